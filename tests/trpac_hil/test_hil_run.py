"""The whole rig over the virtual bus: real unit, real processes, pictures, log."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import can
import cv2
import numpy as np
import pytest
import schemas
from asammdf import MDF
from fmu_unit import Unit as Client
from long import beyond, long
from typer.testing import CliRunner

from fmu_src.kinds import KINDS, PYTHON
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_cli.main import app
from trpac_core.estimator import EstimatorConfig
from trpac_hil.bus import BusSettings
from trpac_hil.codec import load_codec
from trpac_hil.errors import HilError
from trpac_hil.plant_node import PlantJob
from trpac_hil.preview_stamps import UNIT_PREVIEW
from trpac_hil.rig import Rig, run_hil
from trpac_hil.settings import HilSettings

pytestmark = pytest.mark.e2e

CODEC = load_codec()
CAMERA = Path("scenarios/cameras/paper.yaml")
INPUTS = {
    "wheel_speed": "wheel_speed_fl_rad_s",
    "wheel_torque": "wheel_torque_fl_nm",
    "vehicle_speed": "vehicle_speed_m_s",
    "longitudinal_acceleration": "accel_x_m_s2",
}
OUTPUTS = ("TRPAC", "TRPAC_std", "K_v", "flag", "excitation_flag", "TRPAC_dynamics")


def pictures(folder: Path) -> Path:
    """Two pictures of noise, and one that is none."""
    folder.mkdir()
    random = np.random.default_rng(1)
    for number in range(2):
        noise = random.integers(0, 255, (300, 480, 3), dtype=np.uint8)
        cv2.imwrite(str(folder / f"{number}.png"), noise)
    (folder / "2.png").write_bytes(b"no picture")
    return folder


class Listener:
    """Keeps all estimates on the bus."""

    def __init__(self, bus: BusSettings) -> None:
        self.estimates: list[dict[str, float]] = []
        self._bus, self._over = bus.open(), threading.Event()
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _listen(self) -> None:
        coded = CODEC["Estimate"]
        while not self._over.is_set():
            message = self._bus.recv(0.1)
            if message is not None and message.arbitration_id == coded.message.frame_id:
                self.estimates.append(coded.decode(bytes(message.data))[0])

    def end(self) -> list[dict[str, float]]:
        self._over.set()
        self._thread.join()
        self._bus.shutdown()
        return self.estimates


def columns(path: Path) -> dict[str, np.ndarray]:
    with MDF(path) as mdf:
        names = [c.name for c in mdf.groups[0].channels]
        return {name: mdf.get(name).samples for name in names}


def replayed(archive: Path, parameters: dict[str, object], log: dict[str, np.ndarray]) -> np.ndarray:
    """The unit through fmpy alone, given the log's inputs; its outputs, shape (rows, 6)."""
    client = Client(unpack_unit(archive))
    client.set(parameters)
    client.initialise()
    connected: set[str] = set()
    results, frame = [], 0
    for row in range(len(log["time_s"])):
        if log["frame_id"][row] != frame:
            frame = int(log["frame_id"][row])
            confidence = float(log["image_confidence"][row])
            client.set({"road_class": int(log["image_class"][row]), "road_class_confidence": confidence})
            client.set({"frame_id": frame})
        values = {name: float(log[column][row]) for name, column in INPUTS.items()}
        connected |= {name for name, value in values.items() if value == value} | set(list(INPUTS)[:3])
        client.step({name: value for name, value in values.items() if name in connected}, log["step_s"][row])
        results.append([float(client.get(name)) for name in OUTPUTS])
    client.free()
    return np.array(results)


@pytest.mark.parametrize("kind", beyond(1, KINDS))
def test_what_is_on_the_bus_is_what_fmpy_gives_for_the_same_inputs(
    kind: str, unit_file: Path, tmp_path: Path
) -> None:
    """Also where the rig builds a native unit: its outputs are those of the unit with Python."""
    from scenarios.fmu_client.estimator import car_parameters
    from trpac_hil.rig import _vehicle

    bus = BusSettings("virtual", f"test-whole-{kind}")
    settings = HilSettings(
        out=tmp_path / "out",
        fmu=unit_file if kind == PYTHON else None,
        kind=kind,
        bus=bus,
        rate_hz=200.0,
        duration_s=4.0,
        frames=pictures(tmp_path / "frames"),
        camera=CAMERA,
        fps=10.0,
        plant=PlantJob(bus=bus, rate_hz=200.0, camera_fps=0.0),
    )
    listener = Listener(bus)
    summary = run_hil(settings)
    estimates = listener.end()
    log = columns(tmp_path / "out" / "log.mf4")

    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["log.mf4", "summary.json"]
    assert summary == json.loads((tmp_path / "out" / "summary.json").read_text())
    schemas.validate("hil_summary", summary)
    assert summary["cycles"] == len(log["time_s"]) == len(estimates) - 1
    assert summary["cycles"] + summary["overruns"]["left_out"] == 800
    assert summary["discarded_steps"] == 0
    assert summary["wheel"] == "fl"
    assert summary["camera"]["failed"] > 0
    assert np.nanmax(log["vehicle_speed_m_s"]) > 4.0
    assert log["frame_id"].max() > 1, "pictures reached the unit"

    parameters = car_parameters(_vehicle(settings), "fl") | UNIT_PREVIEW
    direct = replayed(unit_file, parameters, log)
    running = log["status"] == 1
    assert running.sum() > 50
    for place, name in enumerate(OUTPUTS):
        assert np.array_equal(direct[running, place], log[name][running]), name
    assert np.ptp(direct[:, 0]) > 0.05, "the estimate has moved"

    half = {s.name: 0.5001 * float(s.scale) for s in CODEC["Estimate"].message.signals}
    names = {"TRPAC": "TRPAC", "TRPAC_std": "TRPAC_std", "K_v": "K_v", "TRPAC_dynamics": "TRPAC_dynamics"}
    for signal_name, column in names.items():
        sent = np.array([e[signal_name] for e in estimates[:-1]])
        assert np.abs(sent - log[column]).max() <= half[signal_name], signal_name
    assert [e["Flag"] for e in estimates[:-1]] == log["flag"].tolist()
    assert estimates[-1]["Status"] == 7.0


@long
def test_a_method_is_that_of_the_unit(unit_file: Path, tmp_path: Path) -> None:
    """At the start the robust estimate is the mean of all roads, that of the others `estimator.theta_initial`."""
    command = ["hil", "--with-plant", "--fmu", str(unit_file), "--rate-hz", "100", "--duration-s", "0.2"]
    done = CliRunner().invoke(app, [*command, "--method", "robust", "--out", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert 0.5 < columns(tmp_path / "out" / "log.mf4")["TRPAC"][0] < 0.7 < EstimatorConfig.theta_initial


def test_ctrl_c_ends_cleanly_with_the_log_written(unit_file: Path, tmp_path: Path) -> None:
    code = "from trpac_cli.main import app; app()"
    command = [
        "hil",
        "--with-plant",
        "--fmu",
        str(unit_file),
        "--rate-hz",
        "100",
        "--out",
        str(tmp_path / "out"),
    ]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *command, "--quiet"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(Path.cwd()), "COLUMNS": "200"},
        start_new_session=True,
    )
    try:
        # The log's scratch file grows once the loop runs.
        for _ in range(1200):
            if any(p.stat().st_size > 0 for p in tmp_path.glob("out/.hil_*/*")):
                break
            time.sleep(0.1)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=120.0)
    finally:
        if process.poll() is None:
            process.kill()
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["ended"] == "a stop was requested"
    assert summary["log"]["rows"] == summary["cycles"] > 0
    assert str(summary["cycles"]) in output
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["log.mf4", "summary.json"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--fmu", "README.md"], "cannot be unpacked: File is not a zip file"),
        (["--interface", "no_such", "--channel", "x"], "no_such: unknown to python-can"),
        (["--frames", "requirements", "--camera", str(CAMERA)], "no pictures in this folder"),
        (["--frames", "docs"], "--camera"),
        (["--parameter", "estimator.gama=10"], "has no parameter estimator.gama"),
        (["--parameter", "TRPAC=1"], "has no parameter TRPAC"),
        (["--parameter", "camera.width=nan"], "expected NAME=NUMBER"),
        (["--parameter", "preview.hold=inf"], "expected NAME=NUMBER"),
        (["--parameter", "camera.width=480.5"], "camera.width is 480.5; expected a whole number"),
        (["--parameter", "wheel.front=0.5"], "wheel.front is 0.5; expected 0 or 1"),
        (["--parameter", "estimator.gamma=-1"], "refuses the settings"),
        (["--wheel", "xx"], "expected fl, fr, rl, rr"),
        (["--dbc", "README.md"], "cannot be read as DBC"),
        (["--scenario", "nothing.yaml", "--with-plant"], "nothing.yaml"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    unit_file: Path, tmp_path: Path, arguments: list[str], words: str
) -> None:
    command = ["hil", "--out", str(tmp_path / "out"), "--duration-s", "0.1"]
    if "--fmu" not in arguments:
        command += ["--fmu", str(unit_file)]
    done = CliRunner().invoke(app, command + arguments)
    assert done.exit_code == 2, done.output
    assert words in done.stderr
    assert not list(tmp_path.glob("out/*"))


@pytest.mark.parametrize("name", beyond(1, ["recorder", "camera", "plant"]))
def test_a_process_that_dies_ends_the_run_with_a_summary_and_an_exit_code_of_its_own(
    name: str, unit_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = Rig.start

    def kill() -> None:
        for process in multiprocessing.active_children():
            if process.name == f"trpac-hil-{name}":
                process.kill()

    def begin_and_kill(rig: Rig, start_ns: int) -> None:
        begin(rig, start_ns)
        threading.Timer(1.0, kill).start()

    monkeypatch.setattr(Rig, "start", begin_and_kill)
    command = [
        "hil",
        "--fmu",
        str(unit_file),
        "--channel",
        f"test-dies-{name}",
        "--with-plant",
        "--rate-hz",
        "100",
    ]
    if name == "camera":
        command += ["--frames", str(pictures(tmp_path / "frames")), "--camera", str(CAMERA)]
    done = CliRunner().invoke(app, [*command, "--duration-s", "60", "--out", str(tmp_path / "out")])
    assert done.exit_code == 5, done.output
    assert f"the process of the {name} died, which ended the run" in done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["ended"] == f"the process of the {name} died"
    assert summary["verdict"][0] == f"Ended: the process of the {name} died."
    assert 50 < summary["cycles"] + summary["overruns"]["left_out"] < 1000
    assert f"dead {name}" in {event["kind"] for event in summary["events"]}
    assert (summary["log"]["problem"] is None) == (name != "recorder")
    left = {path.name for path in (tmp_path / "out").iterdir()}
    assert left == ({"summary.json"} if name == "recorder" else {"summary.json", "log.mf4"})


@pytest.mark.long
def test_the_unit_of_four_wheels_runs_on_the_same_bus(tmp_path: Path) -> None:
    from fmu_src.packaging import build_unit
    from fmu_src.units import UNITS

    archive = build_unit(UNITS["TrpacEstimator4W"], tmp_path / "TrpacEstimator4W.fmu")
    bus = BusSettings("virtual", "test-four")
    job = PlantJob(bus=bus, rate_hz=100.0, camera_delay_s=0.03)
    summary = run_hil(
        HilSettings(tmp_path / "out", archive, bus=bus, rate_hz=100.0, duration_s=1.5, plant=job)
    )
    log = columns(tmp_path / "out" / "log.mf4")
    assert (summary["unit"], summary["wheel"]) == ("TrpacEstimator4W", "all")
    assert (log["status"] == 1).sum() > 10
    assert log["image_class_right"].max() >= 0
    assert np.isfinite(log["TRPAC_rr"]).all()


def test_a_full_disk_costs_the_log_and_not_the_run() -> None:
    from trpac_hil.recorder import _kept

    class Full:
        path = Path("log.mf4")
        dropped = False

        def add(self, rows: np.ndarray) -> None:
            raise OSError(28, "No space left on device")

        def drop(self) -> None:
            self.dropped = True

    class Ear:
        def __init__(self) -> None:
            self.said: list[tuple[str, str]] = []

        def send(self, kind: str, text: str) -> None:
            self.said.append((kind, text))

    full, ear = Full(), Ear()
    assert _kept(full, np.zeros((1, 3)), ear) is None  # type: ignore[arg-type]
    assert full.dropped
    assert ear.said[0][0] == "log failed"
    assert "No space left" in ear.said[0][1]


@long
def test_a_helper_that_cannot_begin_is_one_sentence(unit_file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "frames"
    folder.mkdir()
    (folder / "a.png").write_bytes(b"no picture")
    with pytest.raises(HilError, match=r"a\.png: neither JPEG nor PNG"):
        run_hil(HilSettings(tmp_path / "out", unit_file, duration_s=0.1, frames=folder, camera=CAMERA))
    assert not list((tmp_path / "out").iterdir())


def test_the_virtual_bus_carries_messages_both_ways() -> None:
    """What the tests above rest on."""
    one, other = (BusSettings("virtual", "test-ways").open() for _ in range(2))
    one.send(can.Message(arbitration_id=5, data=b"\x01", is_extended_id=False))
    message = other.recv(1.0)
    assert message is not None
    assert message.arbitration_id == 5
    one.shutdown()
    other.shutdown()
