"""Drives and roads of the diagnosis' tests as files."""

import pandas as pd
import yaml

from sim2real.observing.drive import CHANNELS
from trpac_core.vehicle import WHEELS


def write_log(drive, path, **changed):
    """The drive as a log of the contract; `changed` puts other columns in, None leaves one out."""
    columns = {
        "time_s": drive.time_s,
        **{f"wheel_torque_{w}_nm": drive.torque_nm[:, i] for i, w in enumerate(WHEELS)},
        **dict(zip(CHANNELS, drive.measured.T, strict=True)),
        **changed,
    }
    pd.DataFrame({k: v for k, v in columns.items() if v is not None}).to_csv(path, index=False)


def write_road(road, path):
    path.write_text(yaml.safe_dump(road.model_dump(by_alias=True)), encoding="utf-8")
