"""A folder of example files, to try each command on: logs of simulated drives, car, road, camera and pictures."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from scenarios.car_and_road import Road, Vehicle
from scenarios.files import SensorNoise
from scenarios.library import located
from scenarios.progress import Progress, silent
from scenarios.whole_files import written_whole
from trpac.scenarios import simulate

CAR, ROAD, CAMERA = "four_in_wheel_motor_ev", "paper_simulation", "paper"
LAG_S = 0.08
"""Lag of the torque in the logs for a diagnosis, which car.yaml lacks [s]."""
NOISE = SensorNoise(wheel_speed_noise_rad_s=0.02, vehicle_speed_noise_m_s=0.02, accel_x_noise_m_s2=0.05)
BRAKE_FROM_S, BRAKE_NM = 8.8, (-570.0, -570.0, -310.0, -310.0)
"""The drive ends with a stop on the wet road: its begin, and the torques of the wheels, near the limit [s, N m]."""
FRAMES, FIRST_FRAME_M, FRAME_STEP_M = 20, 8.0, 0.75
"""Number of pictures, and the front axle's position at the first and from one to the next [m]; ice from 20 m on."""
FOREIGN = {
    "time_s": ("t [s]", 1.0),
    **{f"wheel_torque_{w}_nm": (f"M_{w.upper()} [Nm]", 1.0) for w in ("fl", "fr", "rl", "rr")},
    **{f"wheel_speed_{w}_rad_s": (f"n_{w.upper()} [1/min]", 30.0 / np.pi) for w in ("fl", "fr", "rl", "rr")},
    "vehicle_speed_m_s": ("v_ground [km/h]", 3.6),
    "accel_x_m_s2": ("a_long [g]", 1.0 / 9.80665),
}
"""Name in foreign.csv of each column, and its value there per value of the log format."""


def pedal(time_s: NDArray[np.float64], share: float = 1.0) -> NDArray[np.float64]:
    """Torque of the four wheels under a pulsed pedal, shape (n, 4) [N m]."""
    return np.column_stack([share * 310.0 * (np.sin(4.0 * time_s) > -0.3)] * 4)


def example(folder: str | Path, progress: Progress = silent) -> tuple[Path, ...]:
    """Write the example files into a folder; returns their paths.

    ======================  ============================================================================
    car.yaml, road.yaml     the car, and a road with friction 0.9, 0.3 and 0.5, 20 m each
    drive.csv               a drive over it: 10 s at 100 Hz, with sensor noise and the true friction
    foreign.csv             the same drive with other names and units
    mapping.yaml            says how foreign.csv becomes the log format
    fit_a.csv, fit_b.csv    drives of a car whose torque lags by 80 ms, which car.yaml does not say
    holdout.csv             one more of them, to judge the diagnosis on
    camera.yaml             the camera of the pictures
    frames/                 20 pictures of the road ahead, dry at first, then ice
    ======================  ============================================================================

    Parameters
    ----------
    folder : path
        The folder; it is made where it does not exist.
    progress : callable
        Called with how many of how many pictures are drawn.

    Raises
    ------
    OSError
        The folder cannot be written to.
    """
    folder = Path(folder)
    car, road = Vehicle.builtin(CAR), Road.builtin(ROAD)
    time_s = np.arange(0.0, 10.0, 0.01)
    torque = np.where(time_s[:, None] < BRAKE_FROM_S, pedal(time_s), BRAKE_NM)
    drive = simulate(car, road, torque=torque, noise=NOISE, seed=1)
    with written_whole(folder) as made:
        for kind, name, file in (
            ("vehicle", CAR, "car"),
            ("road", ROAD, "road"),
            ("camera", CAMERA, "camera"),
        ):
            shutil.copyfile(located(kind, name), made / f"{file}.yaml")
        drive.to_csv(made / "drive.csv", index=False)
        _foreign(drive).to_csv(made / "foreign.csv", index=False)
        (made / "mapping.yaml").write_text(_mapping(), encoding="utf-8")
        real = car.with_effects({"torque_lag": {"time_constant_s": LAG_S}})
        for seed, (name, share) in enumerate((("fit_a", 0.8), ("fit_b", 0.9), ("holdout", 1.0)), start=2):
            torque = pedal(time_s[:800], share)
            log = simulate(real, road, torque=torque, noise=NOISE, seed=seed)
            log.to_csv(made / f"{name}.csv", index=False)
        files = sorted(path.name for path in made.iterdir())
    with written_whole(folder / "frames") as made:
        _draw(made, progress)
        pictures = sorted(path.name for path in made.iterdir())
    return tuple(folder / name for name in files) + tuple(folder / "frames" / name for name in pictures)


def _foreign(drive: pd.DataFrame) -> pd.DataFrame:
    return pd.DataFrame({name: factor * drive[ours] for ours, (name, factor) in FOREIGN.items()})


def _mapping() -> str:
    """The mapping file of foreign.csv; its units are found in the columns' names."""
    lines = [f'  {ours}: "{name}"' for ours, (name, _) in FOREIGN.items()]
    return "\n".join(
        ["# How the columns of foreign.csv become the log format.", "schema: 1", "columns:", *lines, ""]
    )


def _draw(folder: Path, progress: Progress) -> None:
    import cv2

    from scenarios.camera.files import load_camera
    from scenarios.camera.renderer import Renderer
    from scenarios.camera.scene import Scene, SurfaceSegment

    segments = [SurfaceSegment(s.start_m, s.surface_class) for s in Road.builtin(ROAD).segments]
    scene = Scene.random(np.random.default_rng(1))
    renderer = Renderer(load_camera(located("camera", CAMERA)), segments, scene)
    for number in range(FRAMES):
        image = renderer.frame(FIRST_FRAME_M + number * FRAME_STEP_M).image
        cv2.imwrite(str(folder / f"frame_{number + 1:02d}.jpg"), image, [cv2.IMWRITE_JPEG_QUALITY, 90])
        progress(number + 1, FRAMES)
