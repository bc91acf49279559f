"""The rig: unit, bus, camera, recorder and plant of one run."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from fmu_src.kinds import build
from scenarios.camera.files import load_camera
from scenarios.camera_computer import unit_settings
from scenarios.files import load_scenario, load_vehicle
from scenarios.fmu_client.estimator import UNIT, car_parameters
from scenarios.whole_files import write_whole
from trpac_core.vehicle import Vehicle
from trpac_core.vision.camera import Camera
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.preview import PreviewConfig
from trpac_hil.bus import BusSettings, Link, no_fd
from trpac_hil.bus_file import scratch
from trpac_hil.bus_relay import RECORDED, BusRelay, packed, relay_ring
from trpac_hil.camera import MOTION, RESULTS_KEPT, CameraJob, PictureFolder, result_columns, run_camera
from trpac_hil.camera_input import CameraInput
from trpac_hil.codec import CLASS_MESSAGE, Codec, load_codec
from trpac_hil.deadlines import Deadlines, SystemClock
from trpac_hil.delays import Delays, ThreadAccounts
from trpac_hil.errors import HilError
from trpac_hil.events import Events
from trpac_hil.helper import CONTEXT, Body, Control, begin
from trpac_hil.inputs import Inputs
from trpac_hil.loop import Loop
from trpac_hil.mdf import SCRATCH_PREFIX
from trpac_hil.plant_node import play
from trpac_hil.preview_stamps import UNIT_PREVIEW, PreviewStamps
from trpac_hil.readiness import Readiness, listen, sent
from trpac_hil.realtime import as_before, loop_core, memory_mb, pin, raise_priority, undisturbed
from trpac_hil.recorder import BUS_FILE_FAILED, LOG_FAILED, ROWS_KEPT, RecorderJob, record
from trpac_hil.records import age_column, columns
from trpac_hil.settings import HilSettings
from trpac_hil.shared import Numbers, Ring
from trpac_hil.summary import summarise
from trpac_hil.unit import Unit
from trpac_hil.verdict import verdict

LOG, SUMMARY = "log.mf4", "summary.json"
PATIENCE_S, RECORDERS_PATIENCE_S = 60.0, 3600.0
"""Longest time from the request to stop until a process is killed, and until the recorder, which has a log, is [s]."""
RUN_UP_NS = 200_000_000
"""Time from the start message until slot 0, for all processes to receive it [ns]."""
CLASS_SIGNAL, CLASS_STALE_NS = "RoadClass_Number", 1_000_000_000
"""Signal whose age limit is that of the camera, and that limit where the bus has no such message [ns]."""


class Stopper:
    """A request to stop, by Ctrl-C, SIGTERM or `ask`."""

    def __init__(self) -> None:
        self.asked = False

    def __call__(self) -> bool:
        """Whether a stop was requested."""
        return self.asked

    def ask(self, *_: object) -> None:
        """Request a stop at the end of the cycle."""
        self.asked = True

    @contextmanager
    def by_signal(self) -> Iterator[None]:
        """Context in which Ctrl-C and SIGTERM end the loop, not the program; without effect outside the main thread."""
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        before = {number: signal.signal(number, self.ask) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)


class Rig:
    """The processes of a run, which start before the loop and end after it."""

    def __init__(self) -> None:
        self._helpers: list[tuple[Control, Any]] = []
        self.dead: list[str] = []

    def add(self, name: str, body: Callable[..., None], *arguments: Any) -> Control:
        """Start a process, with its control for the argument `...`. Only the recorder may outlive this process."""
        control = Control(name)
        passed = [control if argument is ... else argument for argument in arguments]
        process = CONTEXT.Process(
            target=begin, args=(Body(body, passed), name != "recorder"), name=f"trpac-hil-{name}"
        )
        process.start()
        self._helpers.append((control, process))
        return control

    def wait_until_ready(self) -> None:
        """Wait until all processes are ready; raises HilError."""
        for control, process in self._helpers:
            control.wait_until_ready(process)

    def start(self, start_ns: int) -> None:
        """Send all processes the time at which slot 0 begins."""
        for control, _ in self._helpers:
            control.start(start_ns)

    def check(self, events: Events) -> bool:
        """Report the messages of the processes, and those that have died; returns whether any has."""
        for control, process in self._helpers:
            for kind, text in control.heard() if control.name != "recorder" else ():
                events.report(kind, text)
            if control.name not in self.dead and not process.is_alive():
                self.dead.append(control.name)
                events.report(
                    f"dead {control.name}",
                    f"The process of the {control.name} ended unexpectedly: the run ends.",
                )
        return bool(self.dead)

    def end(self, control: Control | None = None, patience_s: float = PATIENCE_S) -> dict[str, Any]:
        """Stop all processes and wait for them; returns the last messages of the one of `control`, by kind.

        A process that still runs after `patience_s` is killed; the recorder after `RECORDERS_PATIENCE_S`.
        """
        for each, _ in self._helpers:
            each.stop()
        messages: dict[str, Any] = {}
        for each, process in self._helpers:
            patient_s = RECORDERS_PATIENCE_S if each.name == "recorder" else patience_s
            until_s = time.monotonic() + patient_s
            while process.is_alive():
                heard = each.heard()
                messages |= dict(heard) if each is control else {}
                process.join(0.1)
                if time.monotonic() > until_s:
                    process.kill()
            if each is control:
                messages |= dict(each.heard())
        self._helpers.clear()
        return messages


def run_hil(
    settings: HilSettings,
    stopper: Stopper | None = None,
    show: Callable[[Readiness], None] = lambda readiness: None,
    report_wait: Callable[[str], None] = lambda text: None,
) -> dict[str, Any]:
    """Run the loop to its end and write log.mf4 and summary.json; returns the content of summary.json.

    `show` is called with what was heard before the first cycle, where `settings.wait_s` asks for it, and with what is
    sent; `report_wait` with what is waited for.

    Raises
    ------
    HilError, ScenarioError
        Before the loop begins, where a setting cannot be used, or what the unit needs does not come; the folder is then
        unchanged.
    """
    stopper = stopper or Stopper()
    with ExitStack() as stack:
        return _run(settings, stopper, show, report_wait, stack)


def _run(
    settings: HilSettings,
    stopper: Stopper,
    show: Callable[[Readiness], None],
    report_wait: Callable[[str], None],
    stack: ExitStack,
) -> dict[str, Any]:
    settings = replace(settings, core=loop_core(settings.core, settings.realtime))
    settings.bus.check()
    codec = load_codec(settings.dbc, settings.signals)
    preview = _preview(settings)
    unit = stack.enter_context(Unit(_archive(settings, stack), _parameters(settings), settings.wheel))
    codec.require(unit.wiring.required.values())
    sides = len(unit.wiring.sides)
    clock, rig = SystemClock(), Rig()
    start_ns = clock.now_ns()
    event_queue = CONTEXT.SimpleQueue()
    events = Events(
        lambda time_s, text: event_queue.put((time_s, text)), lambda: (clock.now_ns() - start_ns) * 1e-9
    )
    seen = None if settings.frames is None else _camera_job(settings, unit)
    link = _link(settings, codec, events, stack)
    # All settings are checked by now: the processes take seconds to start.
    stack.callback(rig.end)
    settings.out.mkdir(parents=True, exist_ok=True)
    ring = Ring(len(columns(unit.wiring, codec.supplies)), ROWS_KEPT)
    messages = None if settings.record_bus is None else relay_ring(RECORDED)
    recorder = rig.add(
        "recorder", record, _recorder_job(settings, unit, codec), ring, ..., event_queue, messages
    )
    stale_ns = (
        codec[CLASS_MESSAGE].stale_ns[CLASS_SIGNAL] if CLASS_MESSAGE in codec.messages else CLASS_STALE_NS
    )
    stamps = PreviewStamps(preview, 1.0 / settings.fps, sides)
    camera_input = CameraInput(stamps, stale_ns, unit.wiring.side_names)
    if seen is not None:
        results, motion = Ring(result_columns(sides), RESULTS_KEPT), Numbers(len(MOTION))
        camera_input = CameraInput(stamps, stale_ns, unit.wiring.side_names, results, motion)
        rig.add("camera", run_camera, seen, motion, results, ...)
    over = threading.Event()
    start_plant = _plant(settings, rig, events, over, stack)
    rig.wait_until_ready()
    stack.enter_context(as_before())
    system = _system(settings)
    inputs = Inputs(codec, events.report, settings.counters)
    period_ns = round(1e9 / settings.rate_hz)
    slots = None if settings.duration_s is None else max(1, round(settings.duration_s * settings.rate_hz))
    with undisturbed(), stopper.by_signal():
        if settings.wait_s is None:
            show(Readiness((), sent(codec, unit.wiring), codec.notes, 0.0))
        else:
            start_plant(clock.now_ns())
            readiness = listen(
                link,
                codec,
                unit.wiring,
                settings.wait_s,
                settings.counters,
                clock,
                stopper,
                seen is None,
                report_wait,
            )
            show(readiness)
            if readiness.missing and not stopper.asked:
                raise HilError(_not_ready(readiness, settings.bus))
        if messages is not None:
            link.tap = lambda message: messages.write(packed(message))
        link.drain()
        start_ns = clock.now_ns() + RUN_UP_NS
        deadlines = Deadlines(start_ns, period_ns)

        def check() -> None:
            if rig.check(events):
                stopper.ask()

        loop = Loop(
            clock,
            deadlines,
            link,
            unit,
            codec,
            inputs,
            camera_input,
            ring,
            events,
            Delays(stack.enter_context(ThreadAccounts())),
            check,
            settings.spin_ns,
        )
        rig.start(start_ns)
        if settings.wait_s is None:
            start_plant(start_ns)
        before_mb = memory_mb()
        counts = loop.run(stopper, slots)
        over.set()
        after_mb = memory_mb()
        ended = "a stop was requested" if stopper.asked else "the set duration is over"
        if rig.dead:
            ended = f"the process of the {' and of the '.join(rig.dead)} died"
        answers = rig.end(recorder)
    summary = summarise(
        settings, unit, counts, events, codec, inputs, link, camera_input, answers, system, ended
    )
    summary["died"] = list(rig.dead)
    if before_mb is not None and after_mb is not None:
        # The garbage collector is off, so that growth here would not end.
        summary["system"]["memory_mb"] = {"before": round(before_mb, 1), "after": round(after_mb, 1)}
    summary["log"] = _outcome(LOG if settings.log else None, answers, ("log_rows", "rows_lost"), LOG_FAILED)
    if settings.record_bus is not None:
        keys = ("messages", "messages_lost")
        summary["bus_recording"] = _outcome(str(settings.record_bus), answers, keys, BUS_FILE_FAILED)
    if "done" not in answers:
        _clear(settings)
    summary["verdict"] = verdict(summary)
    write_whole(settings.out / SUMMARY, json.dumps(summary, indent=2).encode() + b"\n")
    return summary


def _link(settings: HilSettings, codec: Codec, events: Events, stack: ExitStack) -> Link:
    """The open bus; raises HilError, also where a message is too long for it."""
    link = Link(settings.bus.open, events.report, name=settings.bus.name)
    stack.callback(link.close)
    if codec.beyond_classic and not link.fd:
        raise HilError(no_fd(codec.beyond_classic))
    return link


def _not_ready(readiness: Readiness, bus: BusSettings) -> str:
    """What to say where something that is required has no value."""
    missing = "; ".join(readiness.missing)
    return (
        f"{bus.name}: within {readiness.listened_s:.1f} s these had no value: {missing}. Start "
        "their senders, wait longer for them with --wait-s, or begin without them with --no-wait."
    )


def _archive(settings: HilSettings, stack: ExitStack) -> Path:
    if settings.fmu is not None:
        return settings.fmu
    scratch = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="trpac_")))
    return build(UNIT, scratch, kind=settings.kind, everywhere=False)


def _vehicle(settings: HilSettings) -> Vehicle:
    if settings.vehicle is not None:
        return load_vehicle(settings.vehicle).to_core()
    if settings.plant is not None:
        return load_scenario(settings.plant.scenario).vehicle.to_core()
    return Vehicle()


def _parameters(settings: HilSettings) -> dict[str, Any]:
    """Parameters of the unit; its own preview is off, because the rig stamps the results."""
    return car_parameters(_vehicle(settings), settings.wheel) | dict(settings.parameters) | UNIT_PREVIEW


def _preview(settings: HilSettings) -> PreviewConfig:
    """Settings of the rig's stamps; raises HilError."""
    names = {"preview.P_0": "P_0_m", "preview.hold": "hold_m", "preview.resolution": "resolution_m"}
    chosen = {names[key]: float(value) for key, value in settings.parameters.items() if key in names}
    try:
        return PreviewConfig(**chosen)
    except ValueError as error:
        raise HilError(str(error)) from error


def _recorder_job(settings: HilSettings, unit: Unit, codec: Codec) -> RecorderJob:
    title = f"{unit.name} at {settings.rate_hz:g} Hz on {settings.bus.name}"
    log = settings.out / LOG if settings.log else None
    ages = {
        name: tuple(age_column(s) for s in codec.supplies_of([role]) if s in codec.supplies)
        for name, role in codec.roles.items()
    }
    return RecorderJob(
        columns(unit.wiring, codec.supplies),
        log,
        f"trpac hil, {title}",
        settings.live,
        title,
        settings.core,
        ages,
        settings.record_bus,
    )


def _camera_job(settings: HilSettings, unit: Unit) -> CameraJob:
    if settings.camera is None or settings.frames is None:
        raise HilError("Pictures need a camera file: --camera, such as scenarios/cameras/paper.yaml.")
    if not settings.frames.is_dir():
        raise HilError(f"{settings.frames}: no such folder. Expected a folder of JPEG or PNG pictures.")
    from scenarios.stills import pictures_in  # here: a run without pictures loads no networks

    files = tuple(pictures_in(settings.frames))
    if not files:
        raise HilError(f"{settings.frames}: no pictures in this folder. Expected JPEG or PNG files.")
    return CameraJob(
        PictureFolder(files),
        _vision(settings, load_camera(settings.camera)),
        settings.fps,
        unit.wiring.side_names,
        settings.camera_threads,
        settings.core,
    )


def _vision(settings: HilSettings, camera: Camera) -> IfeConfig:
    """Settings of the image estimator by the unit's parameters, which the unit has accepted before."""
    return replace(unit_settings(_parameters(settings)).image_settings, camera=camera)


def _plant(
    settings: HilSettings, rig: Rig, events: Events, over: threading.Event, stack: ExitStack
) -> Callable[[int], None]:
    """Start the plant's process; returns what lets it drive, and relays its messages to a bus of this process."""
    job = settings.plant
    if job is None:
        return lambda start_ns: None
    job = replace(job, core=settings.core, realtime=settings.realtime)
    if settings.bus.interface != "virtual":
        return rig.add("plant", play, job, None, ...).start
    wire = relay_ring()
    control = rig.add("plant", play, job, wire, ...)
    link = Link(job.bus.open, lambda kind, text: events.report(f"plant: {kind}", f"Plant: {text}"))
    stack.callback(link.close)
    relay = BusRelay(wire, link, SystemClock())

    def start(start_ns: int) -> None:
        control.start(start_ns)
        # Half a period apart, loop and relay do not need the interpreter at the same time.
        period_ns = round(1e9 / job.rate_hz)
        arguments = (start_ns + period_ns // 2, period_ns, over.is_set)
        thread = threading.Thread(target=relay.run, args=arguments, name="relay", daemon=True)
        thread.start()
        stack.callback(thread.join, 2.0)
        stack.callback(over.set)

    return start


def _system(settings: HilSettings) -> dict[str, Any]:
    """Ask for core and priority of the loop; returns the outcomes as in summary.json."""
    granted: dict[str, Any] = {"cpus": os.cpu_count(), "platform": sys.platform}
    if settings.core is not None:
        granted["core"] = pin(settings.core)
    if settings.realtime:
        granted["priority"] = raise_priority()
    return granted


def _outcome(
    file: str | None, answers: Mapping[str, Any], keys: tuple[str, str], failed: str
) -> dict[str, Any]:
    """What became of a file of the recorder, as in summary.json; `keys` are those of its rows and of the lost ones."""
    if file is None:
        return {"file": None, "rows": 0, "rows_lost": 0, "problem": None}
    rows, lost = (answers.get("done", {}).get(key, 0) for key in keys)
    problem = answers.get(failed) or (None if "done" in answers else "the recorder's process died.")
    return {"file": file if rows else None, "rows": rows, "rows_lost": lost, "problem": problem}


def _clear(settings: HilSettings) -> None:
    """Remove what a recorder that died has left half written."""
    for left in settings.out.glob(f"{SCRATCH_PREFIX}*"):
        shutil.rmtree(left, ignore_errors=True)
    if settings.record_bus is not None:
        scratch(settings.record_bus).unlink(missing_ok=True)
