"""The way that a log's car has driven, where its position was not measured."""

from __future__ import annotations

from dataclasses import replace

from sim2real.logs.contract import POSITION
from sim2real.logs.log import Log
from sim2real.logs.translate import integrate


def with_way(log: Log) -> Log:
    """The log with a position; where none was measured it is the integral of the speed, from 0 at the first row."""
    if POSITION in log.signals:
        return log
    way_m, _ = integrate(log.time_s, log.signals["vehicle_speed_m_s"])
    return replace(log, signals={**log.signals, POSITION: way_m}, derived=log.derived | {POSITION})
