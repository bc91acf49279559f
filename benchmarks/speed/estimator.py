"""Time of one estimator step in Python, one wheel, classes in place of pictures, over a recorded drive.

Classes come at 20 Hz, some of them wrong, so that DE and DIFE are apart and both are computed. The reference loop is a
fixed piece of Python: where a busy machine slows it, it slows the step alike.
"""

import time

import numpy as np

from benchmarks.accuracy.random_drives import STEP_S, CarError, make_drive, told
from trpac_core.estimator import Sensors, TrpacEstimator

SEED, BATCH, REPEATS = 1, 500, 5
REFERENCE_LOOPS = 2000


def reference_us() -> float:
    """Time of 100 additions and multiplications of floats in a loop [us]."""
    begin, x = time.process_time(), 0.0
    for _ in range(REFERENCE_LOOPS):
        for i in range(100):
            x = 0.5 * x + i
    return (time.process_time() - begin) / REFERENCE_LOOPS * 1e6


def measure() -> dict[str, float]:
    """CPU time of a step: median and extremes over batches of the drive, each the least of the repeats [us]."""
    drive = make_drive(SEED, CarError(), 1.0)
    readings = [
        Sensors(omega, torque, speed, longitudinal_acceleration_m_s2=acceleration)
        for omega, torque, speed, acceleration in drive.rows.tolist()
    ]
    given = [(sensors, drive.frames.get(row)) for row, sensors in enumerate(readings)]
    batches = [given[k : k + BATCH] for k in range(0, len(given) - BATCH + 1, BATCH)]
    times = np.full((REPEATS, len(batches)), np.inf)
    references = []
    for repeat in range(REPEATS):
        estimator = TrpacEstimator(told())
        for number, batch in enumerate(batches):
            begin = time.process_time()
            for sensors, frame in batch:
                estimator.step(STEP_S, sensors, frame)
            times[repeat, number] = (time.process_time() - begin) / BATCH * 1e6
        references.append(reference_us())
    least = times.min(axis=0)
    return {
        "steps": len(given),
        "step_us_median": round(float(np.median(least)), 2),
        "step_us_slowest_batch": round(float(least.max()), 2),
        "step_us_median_of_all_repeats": round(float(np.median(times)), 2),
        "reference_loop_us": round(min(references), 2),
    }
