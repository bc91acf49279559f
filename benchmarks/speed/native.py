"""Time of a step of the native unit in a host in C, with its set and get, beside the estimator's in Python [ns].

The host is the tests': each step sets ten inputs and reads all real outputs. `c_block_ns` is the median of the slowest
tenth of the steps: those that end a block of the belief.
"""

import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np

from benchmarks.accuracy.random_drives import STEP_S, CarError, make_drive
from benchmarks.robustness.native_units import HOST, compiled, run
from fmu_src.native.build import build_native
from fmu_src.native.library import compiler
from fmu_src.units import UNITS
from trpac_core.estimator import EstimatorConfig, RoadClass, Sensors, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.vision.classes import Surface

SEED, CONFIDENCE = 1, 0.9


def rows() -> np.ndarray:
    """The host's rows: a random drive on a road whose class is told every 40 steps, shape (n, 11)."""
    drive = make_drive(SEED, CarError(), 1.0)
    made = np.zeros((len(drive.rows), 11))
    made[:, 0], made[:, 1:4], made[:, 4] = STEP_S, drive.rows[:, :3], CONFIDENCE
    made[:, 7] = np.nan_to_num(drive.rows[:, 3])
    made[:, 9], made[:, 10] = Surface.WET, 1 + np.arange(len(made)) // 40
    return made


def python_ns(method: Method, given: np.ndarray) -> float:
    """Mean time of a step in Python."""
    estimator = TrpacEstimator(EstimatorConfig(method=method))
    readings = [
        (Sensors(*row[1:4], longitudinal_acceleration_m_s2=row[7]), row[10]) for row in given.tolist()
    ]
    begun, last = time.perf_counter(), 0.0
    for sensors, frame in readings:
        estimator.step(STEP_S, sensors, RoadClass(Surface.WET, CONFIDENCE) if frame != last else None)
        last = frame
    return 1e9 * (time.perf_counter() - begun) / len(readings)


def measure() -> dict[str, dict[str, float]]:
    """Mean and worst time of a step by method."""
    given = rows()
    found: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        unit = build_native(UNITS["TrpacEstimator"].info, folder / "unit.fmu")
        with zipfile.ZipFile(unit) as archive:
            archive.extractall(folder)
        parts = [folder / "binaries" / "linux64" / "TrpacEstimator.so", folder / "sources" / "tables.c"]
        host = compiled(compiler(), folder / "host", folder / "sources", HOST, *parts)
        given.tofile(folder / "rows.bin")
        for method in Method:
            mean, block = map(float, run(host, "bench", folder / "rows.bin", method.value).split())
            found[method.label] = {
                "c_mean_ns": mean,
                "c_block_ns": block,
                "python_mean_ns": round(python_ns(method, given)),
            }
    return found
