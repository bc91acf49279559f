"""Settings of a run of the rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from fmu_src.kinds import PYTHON
from trpac_hil.bus import BusSettings
from trpac_hil.codec import DBC_FILE
from trpac_hil.deadlines import SPIN_NS
from trpac_hil.plant_node import PlantJob


@dataclass(frozen=True)
class HilSettings:
    """Settings of a run.

    Attributes
    ----------
    out : Path
        Folder for log.mf4 and summary.json.
    fmu : Path or None
        The unit; None builds TrpacEstimator from the sources.
    kind : str
        Kind of the unit that is built: python or native.
    bus : BusSettings
        Interface and channel.
    dbc, signals : Path, Path or None
        DBC file of the messages, and the file that maps quantities to their signals.
    rate_hz : float
        Cycles per second, 100 to 1000.
    duration_s : float or None
        Length of the run; None runs until a stop is requested [s].
    wheel : str
        Wheel of a unit of one wheel.
    vehicle, camera : Path or None
        vehicle.yaml; camera.yaml of the pictures.
    frames : Path or None
        Folder of pictures; None takes classes from the bus.
    fps : float
        Pictures per second.
    parameters : mapping
        Parameters of the unit by variable name.
    plant : PlantJob or None
        The plant on the same bus; None without it.
    log, counters, live, realtime : bool
        Whether to log; to check message counters; to draw on the terminal; to ask for real-time priority.
    wait_s : float or None
        Longest time to listen for what the unit needs before the first cycle; None begins at once [s].
    record_bus : Path or None
        File for all messages of the bus, in a format of `trpac_hil.bus_file`.
    core : int or None
        Core of the loop; with real-time priority the last one by default.
    camera_threads : int
        Threads of each network.
    spin_ns : int
        Time before a due time at which the sleep ends [ns].
    """

    out: Path
    fmu: Path | None = None
    kind: str = PYTHON
    bus: BusSettings = field(default_factory=BusSettings)
    dbc: Path = DBC_FILE
    signals: Path | None = None
    rate_hz: float = 1000.0
    duration_s: float | None = None
    wheel: str = "fl"
    vehicle: Path | None = None
    camera: Path | None = None
    frames: Path | None = None
    fps: float = 20.0
    parameters: Mapping[str, float] = field(default_factory=dict)
    plant: PlantJob | None = None
    log: bool = True
    counters: bool = True
    live: bool = False
    realtime: bool = False
    wait_s: float | None = None
    record_bus: Path | None = None
    core: int | None = None
    camera_threads: int = 1
    spin_ns: int = SPIN_NS
