"""The terminal while the loop runs."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.console import Console, Group
from rich.live import Live
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from trpac_hil.figures import Figures
from trpac_hil.records import AGED

STATUS = {0: "starting", 1: "running", 2: "held: inputs", 3: "held: bus", 4: "held: unit"}
MOST_WORDS = 8
"""Newest events that are shown; all are in summary.json."""
EventTexts = Sequence[tuple[float, str]]


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
    """A table, redrawn a few times a second, with the newest events below."""

    def __init__(self, title: str) -> None:
        self._title = title
        self._texts: list[tuple[float, str]] = []
        self._live = Live(console=Console(stderr=True), auto_refresh=False, transient=False)

    def __enter__(self) -> Screen:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def show(self, figures: Figures, texts: EventTexts) -> None:
        """Redraw the table."""
        self._texts = [*self._texts, *texts][-MOST_WORDS:]
        events = [Text(f"{time_s:9.3f} s  {text}", style="yellow") for time_s, text in self._texts]
        self._live.update(Group(_estimate(figures, self._title), _timing(figures), *events), refresh=True)


def _estimate(figures: Figures, title: str) -> Table:
    table = Table(title=escape(title), title_justify="left", show_header=False, box=None, pad_edge=False)
    status = figures.now("status")
    truth = figures.now("theta_true_fl")
    rows = [
        ("time", f"{figures.now('time_s'):.1f} s, {figures.now('position_m'):.1f} m"),
        ("status", STATUS.get(int(status), "") if not math.isnan(status) else ""),
        ("TRPAC", f"{figures.now('TRPAC'):.3f} +- {figures.now('TRPAC_std'):.3f}"),
        ("true, front left", "not told" if math.isnan(truth) else f"{truth:.3f}"),
        ("flag, K_v", f"{figures.now('flag'):.0f}, {figures.now('K_v'):.2f}"),
        ("speed", f"{figures.now('vehicle_speed_m_s'):.1f} m/s"),
        ("overruns", f"{figures.now('overruns'):.0f}"),
    ]
    for row in rows:
        table.add_row(*row)
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
        **{f"age {m} [ms]": (f"age_{m}_ms",) * 2 for m in AGED},
        "age picture [ms]": ("age_picture_ms",) * 2,
    }
    for label, (name, column) in shown.items():
        sketch = figures.sketches[name].summary()
        if sketch is not None:
            numbers = (figures.now(column), sketch["median"], sketch["p99"], sketch["max"])
            table.add_row(escape(label), *("-" if math.isnan(n) else f"{n:.4g}" for n in numbers))
    return table
