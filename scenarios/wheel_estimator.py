"""The estimator of one wheel, step by step."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenarios.camera.files import load_camera
from scenarios.car_and_road import as_vehicle
from scenarios.files import VehicleFile
from scenarios.library import PAPER_VEHICLE, networks_folder
from trpac_core.errors import TrpacError
from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors
from trpac_core.vehicle import WHEELS
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife

_HELD = "The tyre does not slip enough: the estimate holds what it had."
_UNSEEN = {
    Method.AS_PRINTED: _HELD,
    Method.DIFE: _HELD,
    Method.ROBUST: "The tyre does not slip enough: the interval widens with the way driven.",
}
"""Reason where neither tyre nor camera shows the road."""


@dataclass(frozen=True)
class Estimate:
    """The estimate of one wheel at a time.

    Attributes
    ----------
    theta, std : float
        TRPAC and its standard deviation [-].
    low, high : float
        Bounds of the interval that holds the road's TRPAC with 95 % [-].
    expected, expected_std : float
        Mean and standard deviation of what the road's TRPAC may be [-].
    source : str
        What TRPAC rests on: none, tyre, camera or both.
    peak : float
        Maximum of the tyre's curve at theta, which a brake test measures [-].
    flag : bool
        Whether the camera's class of the road under the wheel is used.
    K_v : float
        Visual gain [1/s].
    excited : bool
        Whether slip is large enough to estimate theta.
    slip, tyre_force_n : float
        Longitudinal slip [-] and observed force [N].
    why : str
        Basis of the estimate, in a sentence.
    """

    theta: float
    std: float
    low: float
    high: float
    expected: float
    expected_std: float
    source: str
    peak: float
    flag: bool
    K_v: float
    excited: bool
    slip: float
    tyre_force_n: float
    why: str


class Estimator:
    """The estimator of one wheel, step by step.

    Parameters
    ----------
    vehicle : Vehicle, path or name, optional
        The car; the paper's (Table 3) where none is given.
    wheel : str
        fl, fr, rl or rr.
    camera : path or name, optional
        The camera of the pictures for `step`.
    method : str
        as_printed, dife or robust (docs/theory/methods.md).

    Raises
    ------
    TrpacError
        A car, wheel, camera or method that is wrong.
    """

    def __init__(
        self,
        vehicle: VehicleFile | str | Path | None = None,
        *,
        wheel: str = "fl",
        camera: str | Path | None = None,
        method: str = "robust",
    ) -> None:
        if wheel not in WHEELS:
            raise TrpacError(f"wheel is {wheel!r}; expected one of {', '.join(WHEELS)}.")
        car = as_vehicle(PAPER_VEHICLE if vehicle is None else vehicle).to_core()
        config = EstimatorConfig(
            vehicle=car,
            front_axle=wheel.startswith("f"),
            left_side=wheel.endswith("l"),
            method=Method.of(method),
        )
        ife = None
        if camera is not None:
            settings = replace(config.image_settings, camera=load_camera(camera))
            ife = Ife.load(settings, networks_folder())
        self._estimator = TrpacEstimator(config, ife)
        self._time_s: float | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about a car that differs from its description, with the method robust."""
        return tuple(self._estimator.messages().values())

    def step(
        self,
        *,
        t: float,
        wheel_speed: float,
        wheel_torque: float,
        vehicle_speed: float,
        longitudinal_acceleration: float | None = None,
        yaw_rate: float | None = None,
        steering_angle: float = 0.0,
        vertical_load: float | None = None,
        road_class: str | None = None,
        road_class_confidence: float = 1.0,
        image: NDArray[np.uint8] | None = None,
    ) -> Estimate:
        """The estimate after the readings at a time.

        Parameters
        ----------
        t : float
            Time, ascending [s].
        wheel_speed, wheel_torque, vehicle_speed : float
            [rad/s], [N m] with brakes included and positive where it drives, [m/s].
        longitudinal_acceleration, yaw_rate, steering_angle, vertical_load : float, optional
            [m/s^2], [rad/s] and [rad] positive to the left, [N]; None: not measured.
        road_class, road_class_confidence : str and float, optional
            A new result of a camera: dry, wet or snow_ice, and its confidence Q_v [-].
        image : array of uint8, shape (height, width, 3), optional
            A new picture, BGR, instead of a result.

        Raises
        ------
        TrpacError
            Times that do not ascend, an unknown class, a picture without camera.
        """
        before_s = t if self._time_s is None else self._time_s
        if not t >= before_s:
            raise TrpacError(f"t is {t} after {before_s}; expected ascending times.")
        frame: NDArray[np.uint8] | RoadClass | None = image
        if road_class is not None:
            known = [surface.label for surface in Surface]
            if road_class not in known:
                raise TrpacError(f"road_class is {road_class!r}; expected one of {', '.join(known)}.")
            frame = RoadClass(Surface(known.index(road_class)), road_class_confidence)
        elif image is not None and not self._estimator.sees:
            raise TrpacError("image is given and no camera: Estimator(vehicle, camera=...) has one.")
        estimate = self._estimator.step(
            t - before_s,
            Sensors(
                wheel_speed,
                wheel_torque,
                vehicle_speed,
                vertical_load,
                steering_angle,
                longitudinal_acceleration,
                yaw_rate,
            ),
            frame,
        )
        self._time_s = t
        if estimate.problem:
            why = estimate.problem
        elif estimate.excitation_flag:
            why = "The tyre slips enough to show the road."
        elif estimate.flag:
            why = "The tyre does not slip enough; the camera's class of the road is used."
        else:
            why = _UNSEEN[self._estimator.config.method]
        return Estimate(
            theta=estimate.TRPAC,
            std=estimate.TRPAC_std,
            low=estimate.TRPAC_low,
            high=estimate.TRPAC_high,
            expected=estimate.TRPAC_expected,
            expected_std=estimate.TRPAC_expected_std,
            source=estimate.source.label,
            peak=estimate.TRPAC_peak,
            flag=bool(estimate.flag),
            K_v=estimate.K_v,
            excited=bool(estimate.excitation_flag),
            slip=estimate.slip,
            tyre_force_n=estimate.tyre_force_n,
            why=why,
        )
