"""Time of one estimator step in Python, one wheel, no picture. Prints JSON."""

import json
import time

import numpy as np

from trpac_core.estimator import EstimatorConfig, RoadClass, TrpacEstimator
from trpac_core.readings import Sensors
from trpac_core.vision.classes import Surface

STEPS, REPEATS = 5000, 9
SITUATIONS = {
    "cruising": Sensors(10.0 / 0.29, 20.0, 10.0),
    "sliding": Sensors(10.0 / 0.29 / 0.97, 270.0, 10.0, longitudinal_acceleration_m_s2=2.5),
}


def microseconds(sensors: Sensors) -> float:
    """Median over repeats of the mean step time, in CPU time of this process [us]."""
    times = []
    for _ in range(REPEATS):
        estimator = TrpacEstimator(EstimatorConfig())
        estimator.step(0.001, sensors, RoadClass(Surface.SNOW_ICE, 0.9))
        started = time.process_time()
        for _ in range(STEPS):
            estimator.step(0.001, sensors)
        times.append((time.process_time() - started) / STEPS * 1e6)
    return float(np.median(times))


if __name__ == "__main__":
    print(json.dumps({f"step_{name}_us": round(microseconds(s), 1) for name, s in SITUATIONS.items()}))
