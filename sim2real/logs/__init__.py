"""Recorded logs of any source in the log format's names and units."""

from sim2real.logs.contract import COLUMNS, REQUIRED, Column
from sim2real.logs.errors import LogError
from sim2real.logs.log import Log
from sim2real.logs.mapping import Mapping, load_mapping
from sim2real.logs.read import log_of_frame, read_log
from sim2real.logs.resampling import resample
from sim2real.logs.way import with_way
from sim2real.logs.write import write_log

__all__ = [
    "COLUMNS",
    "REQUIRED",
    "Column",
    "Log",
    "LogError",
    "Mapping",
    "load_mapping",
    "log_of_frame",
    "read_log",
    "resample",
    "with_way",
    "write_log",
]
