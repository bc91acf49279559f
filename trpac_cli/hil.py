"""The commands `trpac hil` and `trpac hil-plant`: the FMU on a CAN bus in real time, and a simulated car for it."""

from __future__ import annotations

import logging
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from trpac_cli.console import (
    MethodOption,
    Terminal,
    UnitOption,
    complain,
    kind_to_build,
    refuse,
    require_folder,
)
from trpac_core.files import quoted

if TYPE_CHECKING:
    from trpac_hil.bus import BusSettings
    from trpac_hil.plant_node import PlantJob
    from trpac_hil.readiness import Readiness

COMMAND, PLANT_COMMAND = "trpac hil", "trpac hil-plant"
EXIT_NO_LOG, EXIT_DEAD = 4, 5
"""Exit codes where log or recording could not be written, and where a process beside the loop died."""
WAIT_S = 5.0
"""Default of the longest time to listen before the first cycle [s]."""
TABLE_WIDTH = 160
"""Width of the table of signals where it goes to no terminal [characters]."""
MULTICAST = "239.74.163.2"
"""Default channel of udp_multicast: python-can's group for IPv4."""
CHANNELS = {"virtual": "trpac", "udp_multicast": MULTICAST, "socketcan": "can0"}

Interface = Annotated[
    str, typer.Option(help="Interface of python-can: virtual, udp_multicast, socketcan, pcan, vector ...")
]
Channel = Annotated[
    str | None,
    typer.Option(
        help="Channel of the interface, such as can1; virtual, udp_multicast and socketcan have a default."
    ),
]
Options = Annotated[
    list[str] | None,
    typer.Option(
        "--bus-option", help="Option of the interface: NAME=VALUE, such as bitrate=1000000; may be repeated."
    ),
]
Dbc = Annotated[
    Path | None,
    typer.Option(
        help="DBC file of the bus: any file with --signals, else one with the names of the shipped trpac.dbc."
    ),
]
Signals = Annotated[
    Path | None,
    typer.Option(
        help="Mapping file of the signals, as for a log: vehicle_speed_m_s: {column: Motion.VehSpd} ..."
    ),
]
Rate = Annotated[float, typer.Option(min=100.0, max=1000.0, help="Cycles per second.")]
Duration = Annotated[
    float | None, typer.Option(min=0.01, max=1e6, help="Length of the run \\[s]; without it until Ctrl-C.")
]
ScenarioOption = Annotated[
    Path | None,
    typer.Option(help="Scenario file: car, road and sensor noise of the plant; by default the paper's."),
]


def hil(
    out: Annotated[Path, typer.Option(help="Folder for log.mf4 and summary.json.")],
    fmu: Annotated[
        Path | None,
        typer.Option(help="FMU: TrpacEstimator or TrpacEstimator4W; without it TrpacEstimator is built."),
    ] = None,
    unit: UnitOption = None,
    interface: Interface = "virtual",
    channel: Channel = None,
    bus_option: Options = None,
    dbc: Dbc = None,
    signals: Signals = None,
    rate_hz: Rate = 1000.0,
    duration_s: Duration = None,
    wheel: Annotated[str, typer.Option(help="Wheel of a one-wheel FMU: fl, fr, rl or rr.")] = "fl",
    vehicle: Annotated[Path | None, typer.Option(help="Car file; by default the paper's car.")] = None,
    parameter: Annotated[
        list[str] | None,
        typer.Option(help="Parameter of the FMU: NAME=VALUE, such as estimator.gamma=10; may be repeated."),
    ] = None,
    method: MethodOption = "robust",
    frames: Annotated[
        Path | None,
        typer.Option(help="Folder of pictures to play; without it the classes come from the bus."),
    ] = None,
    camera: Annotated[Path | None, typer.Option(help="Camera file of the pictures.")] = None,
    fps: Annotated[float, typer.Option(min=0.1, max=200.0, help="Pictures per second.")] = 20.0,
    with_plant: Annotated[
        bool,
        typer.Option("--with-plant", help="Also simulate the car on the same bus; no hardware is needed."),
    ] = False,
    scenario: ScenarioOption = None,
    wait_s: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=1e6,
            help="Longest time to wait for the required signals before the first cycle \\[s].",
        ),
    ] = WAIT_S,
    no_wait: Annotated[
        bool,
        typer.Option("--no-wait", help="Start at once; the estimate starts when the required signals come."),
    ] = False,
    record_bus: Annotated[
        Path | None,
        typer.Option(help="Record all messages of the bus: .blf, .asc, .log (candump) or .mf4."),
    ] = None,
    no_log: Annotated[bool, typer.Option("--no-log", help="Write no log.mf4.")] = False,
    no_counters: Annotated[
        bool, typer.Option("--no-counters", help="Do not check message counters: the senders do not count.")
    ] = False,
    realtime: Annotated[bool, typer.Option("--realtime", help="Ask for real-time priority.")] = False,
    core: Annotated[
        int | None,
        typer.Option(min=0, help="Core for the loop alone; with --realtime by default the last one."),
    ] = None,
    camera_threads: Annotated[int, typer.Option(min=1, max=16, help="Threads of each network.")] = 1,
    events_only: Annotated[
        bool, typer.Option("--quiet", help="Print events only, no table during the run.")
    ] = False,
) -> None:
    """Run the FMU in real time against a CAN bus; Ctrl-C ends the run.

    It receives wheel speeds and torques, vehicle speed and the class of the
    road. It sends TRPAC, flag and K_v. Messages: docs/reference/bus_messages.md.

    Example without hardware: trpac hil --with-plant --duration-s 30 --out out/hil

    On a bus of your own: trpac hil --dbc car.dbc --signals signals.yaml
    --interface socketcan --channel can0 --out out/rig

    Before the first cycle it waits for the required signals and shows them. If
    one is missing after --wait-s, it is named and nothing is written.

    Guide: docs/guide/bus.md.

    Exit codes: 0 done or ended by Ctrl-C, even with missed deadlines; 2 unusable input, no bus, or missing signals; 4
    log or recording could not be written; 5 the process of camera, recorder or plant ended, which ended the run.
    """
    from trpac_core.errors import TrpacError
    from trpac_hil.codec import DBC_FILE
    from trpac_hil.deadlines import SPIN_NS
    from trpac_hil.rig import run_hil
    from trpac_hil.settings import HilSettings
    from trpac_hil.unit import WHEELS

    _silence_libraries()
    require_folder(COMMAND, out)
    if wheel not in WHEELS:
        refuse(COMMAND, f"--wheel {wheel}: expected {', '.join(WHEELS)}.")
    try:
        bus = _bus(interface, channel, bus_option)
        settings = HilSettings(
            out=out,
            fmu=fmu,
            kind=kind_to_build(COMMAND, fmu, unit),
            bus=bus,
            dbc=dbc or DBC_FILE,
            signals=signals,
            rate_hz=rate_hz,
            duration_s=duration_s,
            wheel=wheel,
            vehicle=vehicle,
            camera=camera,
            frames=frames,
            fps=fps,
            parameters=_method(method) | _parameters(parameter),
            plant=_plant_job(bus, dbc, signals, scenario, rate_hz, frames is None) if with_plant else None,
            wait_s=None if no_wait else wait_s,
            record_bus=_recording(record_bus),
            log=not no_log,
            counters=not no_counters,
            live=sys.stderr.isatty() and not events_only,
            realtime=realtime,
            core=core,
            camera_threads=camera_threads,
            spin_ns=SPIN_NS,
        )
        summary = run_hil(settings, show=_show_readiness, report_wait=lambda text: complain(COMMAND, text))
    except (TrpacError, OSError) as error:
        refuse(COMMAND, error)
    _show(summary, out)
    if summary["died"]:
        complain(COMMAND, f"{summary['ended']}, which ended the run.")
        raise typer.Exit(EXIT_DEAD)
    for what, key in (("log", "log"), ("recording", "bus_recording")):
        problem = summary.get(key, {}).get("problem")
        if problem:
            complain(COMMAND, f"no {what}: {problem}")
            raise typer.Exit(EXIT_NO_LOG)


def hil_plant(
    interface: Interface = "udp_multicast",
    channel: Channel = None,
    bus_option: Options = None,
    dbc: Dbc = None,
    signals: Signals = None,
    rate_hz: Rate = 1000.0,
    duration_s: Duration = None,
    scenario: ScenarioOption = None,
    camera_fps: Annotated[
        float,
        typer.Option(
            min=0.0, max=200.0, help="Results per second of a simulated camera on the bus; 0: no camera."
        ),
    ] = 20.0,
    camera_delay_s: Annotated[
        float, typer.Option(min=0.0, max=2.0, help="Delay from a picture to its result on the bus \\[s].")
    ] = 0.06,
) -> None:
    """Simulate the car on a CAN bus in real time, for trpac hil in another process; Ctrl-C ends it.

    The reference plant drives over the road of the scenario again and again,
    between 4 and 14 m/s.

    Example, in two terminals: trpac hil-plant, and
    trpac hil --interface udp_multicast --out out/hil

    Guide: docs/guide/bus.md.

    Exit codes: 0 done or ended by Ctrl-C, 2 unusable input or no bus.
    """
    from scenarios.errors import ScenarioError
    from trpac_hil.deadlines import SystemClock
    from trpac_hil.plant_node import open_plant_node
    from trpac_hil.rig import RUN_UP_NS, Stopper

    _silence_libraries()
    try:
        job = _plant_job(_bus(interface, channel, bus_option), dbc, signals, scenario, rate_hz, True)
        job = replace(job, camera_fps=camera_fps, camera_delay_s=camera_delay_s)
        node = open_plant_node(job, lambda kind, text: complain(PLANT_COMMAND, text))
    except (ScenarioError, OSError) as error:
        refuse(PLANT_COMMAND, error)
    stopper = Stopper()
    print(
        f"{PLANT_COMMAND}: driving on {job.bus.name}; sends {', '.join(node.sends)}. Ctrl-C ends.",
        file=sys.stderr,
    )
    with stopper.by_signal():
        slots = None if duration_s is None else round(duration_s * rate_hz)
        node.run(SystemClock().now_ns() + RUN_UP_NS, stopper, slots)
    node.close()
    print(f"{PLANT_COMMAND}: {node.left_out} cycles were left out because they were late.", file=sys.stderr)


def _silence_libraries() -> None:
    """Keep warnings of the libraries off the terminal: what is wrong is said by this command, once."""
    for library in ("can", "cantools"):
        logging.getLogger(library).setLevel(logging.ERROR)


def _bus(interface: str, channel: str | None, options: list[str] | None) -> BusSettings:
    from trpac_hil.bus import BusSettings, bus_options
    from trpac_hil.errors import HilError

    BusSettings(interface).check()
    chosen = channel or CHANNELS.get(interface)
    if chosen is None:
        raise HilError(f"--channel: missing; interface {interface} has no default here.")
    return BusSettings(interface, chosen, bus_options(options or ()))


def _method(label: str) -> dict[str, float]:
    """Parameters of the unit for a method."""
    from trpac_core.estimator_data import Method

    method = Method.of(label)
    return {"estimator.method": method.value}


def _parameters(pairs: list[str] | None) -> dict[str, float]:
    from trpac_hil.errors import HilError

    values = {}
    for pair in pairs or ():
        name, _, text = pair.partition("=")
        try:
            values[name] = float(text)
        except ValueError:
            values[name] = math.nan
        if not math.isfinite(values[name]):
            raise HilError(f"--parameter {pair}: expected NAME=NUMBER, such as estimator.gamma=10.")
    return values


def _plant_job(
    bus: BusSettings,
    dbc: Path | None,
    signals: Path | None,
    scenario: Path | None,
    rate_hz: float,
    sees: bool,
) -> PlantJob:
    from trpac_hil.codec import DBC_FILE
    from trpac_hil.plant_node import PLAIN_SCENARIO, PlantJob

    return PlantJob(
        scenario or PLAIN_SCENARIO, bus, dbc or DBC_FILE, signals, rate_hz, camera_fps=20.0 if sees else 0.0
    )


def _recording(path: Path | None) -> Path | None:
    """A recording's file; raises HilError for a format that cannot be written."""
    from trpac_hil.bus_file import FORMATS
    from trpac_hil.errors import HilError

    if path is not None and path.suffix not in FORMATS:
        raise HilError(f"--record-bus {quoted(path)}: expected a name that ends in {', '.join(FORMATS)}.")
    return path


def _show_readiness(readiness: Readiness) -> None:
    """Print what was heard before the first cycle, on standard error."""
    from trpac_hil.screen import readiness_table

    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        console.width = TABLE_WIDTH
    console.print(readiness_table(readiness))


def _show(summary: dict[str, Any], out: Path) -> None:
    """Print the outcome."""
    console = Terminal()
    if summary["timing"]:
        table = Table()
        for heading in ("", "median", "p99", "max"):
            table.add_column(heading, justify="right" if heading else "left")
        for name, figures in summary["timing"].items():
            if figures:
                table.add_row(name, *(f"{figures[key]:g}" for key in ("median", "p99", "max")))
        console.print(table)
    for text in (summary["system"].get("priority"), summary["system"].get("core")):
        if text:
            console.print(text)
    for line in summary["verdict"]:
        console.print(line, soft_wrap=True)
    log = f"{out / summary['log']['file']}  " if summary["log"]["file"] else ""
    console.print(f"{log}{out / 'summary.json'}", soft_wrap=True)
