"""A plausible log for the tests of log reading, without a plant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

RADIUS_M = 0.29
WHEELS = ("fl", "fr", "rl", "rr")


def make_frame(rate_hz=100.0, duration_s=3.0, seed=0, camera=False) -> pd.DataFrame:
    """A drive with sensor noise that accelerates and brakes; with camera, ten results a second."""
    rng = np.random.default_rng(seed)
    n = round(rate_hz * duration_s) + 1
    time_s = np.arange(n) / rate_hz
    speed = 15.0 + 2.0 * np.sin(2.0 * time_s)
    columns = {
        "time_s": time_s,
        **{f"wheel_torque_{w}_nm": 400.0 * np.cos(2.0 * time_s) + rng.normal(size=n) for w in WHEELS},
        **{f"wheel_speed_{w}_rad_s": speed / RADIUS_M + 0.05 * rng.normal(size=n) for w in WHEELS},
        "vehicle_speed_m_s": speed + 0.02 * rng.normal(size=n),
        "accel_x_m_s2": 4.0 * np.cos(2.0 * time_s) + 0.05 * rng.normal(size=n),
        "position_m": 15.0 * time_s + 1.0 - np.cos(2.0 * time_s),
    }
    if camera:
        frame = np.floor(time_s * 10.0 + 1e-9)
        columns |= {
            "frame_id": frame,
            "image_class": np.where(frame % 3 == 2, -1.0, frame % 3),
            "image_confidence": rng.uniform(0.5, 1.0, n),
            "image_from_m": columns["position_m"] + 5.0,
            "image_to_m": columns["position_m"] + 12.0,
            "image_path": [f"frames/straße_{int(k):04d}.png" for k in frame],
        }
    return pd.DataFrame(columns)


def save(frame: pd.DataFrame, path: Path) -> Path:
    """The frame as CSV."""
    frame.to_csv(path, index=False)
    return path


def lines_of(frame: pd.DataFrame) -> list[str]:
    """The lines of its CSV form; the first is the header."""
    return frame.to_csv(index=False).splitlines()
