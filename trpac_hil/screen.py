"""The terminal: what came before the first cycle, and what is so while the loop runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from trpac_core.files import quoted
from trpac_core.vehicle import WHEELS
from trpac_hil.figures import Figures
from trpac_hil.readiness import Readiness

STATUS = {0: "starting", 1: "running", 2: "held: inputs", 3: "held: bus", 4: "held: unit"}
CLASSES = {0: "dry", 1: "wet", 2: "snow, ice"}
MOST_WORDS = 8
"""Newest events that are shown; all are in summary.json."""
SHOWN = {
    "wheel speed": ([f"wheel_speed_{w}_rad_s" for w in WHEELS], "rad/s", ".2f"),
    "wheel torque": ([f"wheel_torque_{w}_nm" for w in WHEELS], "N m", ".0f"),
    "vertical load": ([f"vertical_load_{w}_n" for w in WHEELS], "N", ".0f"),
    "vehicle speed": (["vehicle_speed_m_s"], "m/s", ".2f"),
    "accel x, y": (["accel_x_m_s2", "accel_y_m_s2"], "m/s2", ".2f"),
    "yaw rate": (["yaw_rate_rad_s"], "rad/s", ".3f"),
    "steering angle": (["steering_angle_rad"], "rad", ".3f"),
    "true adhesion": ([f"theta_true_{w}" for w in WHEELS], "", ".3f"),
}
"""Lines of the signals: the quantities in each, their unit and form."""
EventTexts = Sequence[tuple[float, str]]
Ages = Mapping[str, Sequence[str]]
"""Columns of the ages of what a quantity is made of, by quantity."""


class EventLines:
    """Events alone, one line each, for logs and pipes."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, soft_wrap=True, highlight=False)

    def __enter__(self) -> EventLines:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def show(self, figures: Figures, texts: EventTexts) -> None:
        """Print the new events."""
        for time_s, text in texts:
            self._console.print(escape(f"{time_s:9.3f} s  {text}"))


class Screen:
    """Tables, redrawn a few times a second, with the newest events below."""

    def __init__(self, title: str, ages: Ages) -> None:
        self._title, self._ages = title, ages
        self._texts: list[tuple[float, str]] = []
        self._live = Live(console=Console(stderr=True), auto_refresh=False, transient=False)

    def __enter__(self) -> Screen:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, figures: Figures, texts: EventTexts) -> None:
        """Redraw the tables."""
        self._texts = [*self._texts, *texts][-MOST_WORDS:]
        events = [Text(f"{time_s:9.3f} s  {text}", style="yellow") for time_s, text in self._texts]
        self._live.update(
            Group(_estimate(figures, self._title), _signals(figures, self._ages), _timing(figures), *events),
            refresh=True,
        )


def readiness_table(readiness: Readiness) -> RenderableType:
    """What was heard before the first cycle, and what is sent."""
    title = f"On the bus, listened for {readiness.listened_s:.1f} s"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for heading in ("quantity", "value", "unit", "from", "id", "1/s", "counter", "state"):
        table.add_column(heading, justify="right" if heading in ("value", "1/s") else "left")
    for line in readiness.lines:
        state = line.problem or "ok"
        style = "" if not line.problem else "red" if line.required else "dim"
        if line.problem and not line.required:
            state = f"{state} (optional)"
        value = "-" if math.isnan(line.value) else f"{line.value:.4g}"
        cells = (line.name, value, line.unit, line.source, line.frame_ids, line.rate, line.counter, state)
        table.add_row(*(Text(quoted(cell)) for cell in cells), style=style)
    notes = [Text(quoted(note)) for note in readiness.notes]
    return Group(*([table] if readiness.lines else []), Text(f"Sent: {', '.join(readiness.sent)}."), *notes)


def _estimate(figures: Figures, title: str) -> Table:
    table = Table(title=escape(title), title_justify="left", show_header=False, box=None, pad_edge=False)
    now = figures.now
    status = now("status")
    interval = f", between {now('TRPAC_low'):.3f} and {now('TRPAC_high'):.3f}"
    worst = f", the worst by {figures.worst_missed_us * 1e-3:.2f} ms" if figures.worst_missed_us else ""
    rows = [
        ("time", f"{now('time_s'):.1f} s, {now('position_m'):.1f} m"),
        ("status", STATUS.get(int(status), "") if not math.isnan(status) else ""),
        (
            "TRPAC",
            f"{now('TRPAC'):.3f} +- {now('TRPAC_std'):.3f}"
            + (interval if not math.isnan(now("TRPAC_low")) else ""),
        ),
        ("flag, K_v", f"{now('flag'):.0f}, {now('K_v'):.2f}"),
        ("road class", _road_class(figures)),
        ("deadlines", f"{now('overruns'):.0f} missed{worst}"),
    ]
    for row in rows:
        table.add_row(*row)
    return table


def _road_class(figures: Figures) -> str:
    parts = []
    for side in ("", "_left", "_right"):
        surface, Q_v = figures.now(f"image_class{side}"), figures.now(f"image_confidence{side}")
        if not math.isnan(surface):
            parts.append(f"{CLASSES.get(int(surface), 'none')} {Q_v:.2f}")
    age_ms = figures.now("age_under_wheel_ms")
    return ", ".join(parts) + ("" if math.isnan(age_ms) else f", picture {age_ms:.0f} ms old")


def _signals(figures: Figures, ages: Ages) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("signal (fl fr rl rr)")
    for heading in ("value", "unit", "age [ms]"):
        table.add_column(escape(heading), justify="left" if heading == "unit" else "right")
    for label, (names, unit, form) in SHOWN.items():
        carried = [name for name in names if name in ages]
        if not carried:
            continue
        values = [figures.now(name) for name in carried]
        shown = "  ".join("no value" if math.isnan(value) else format(value, form) for value in values)
        oldest = max((figures.now(column) for name in carried for column in ages[name]), default=math.nan)
        table.add_row(label, shown, unit, "-" if math.isnan(oldest) else f"{oldest:.1f}")
    return table


def _timing(figures: Figures) -> Table:
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    for heading in ("now", "median", "p99", "max"):
        table.add_column(heading, justify="right")
    shown = {
        "jitter [us]": ("jitter_us", "lateness_us"),
        "cycle [us]": ("cycle_us", "work_us"),
        "unit's step [us]": ("unit_step_us", "unit_us"),
        "age picture [ms]": ("age_picture_ms",) * 2,
    }
    for label, (name, column) in shown.items():
        sketch = figures.sketches[name].summary()
        if sketch is not None:
            numbers = (figures.now(column), sketch["median"], sketch["p99"], sketch["max"])
            table.add_row(escape(label), *("-" if math.isnan(n) else f"{n:.4g}" for n in numbers))
    return table
