"""The recorder: rows into the log, figures and words onto the terminal, and what it says where the log fails."""

from __future__ import annotations

import queue
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asammdf import MDF

from trpac_hil import recorder
from trpac_hil.figures import Figures
from trpac_hil.mdf import MdfLog
from trpac_hil.recorder import LOG_FAILED, RecorderJob, record
from trpac_hil.records import columns
from trpac_hil.screen import Screen
from trpac_hil.shared import Ring
from trpac_hil.unit import Wiring

COLUMNS = columns(Wiring.of_one("fl"))
PLACES = {column.name: place for place, column in enumerate(COLUMNS)}


def rows(number: int) -> np.ndarray:
    made = np.random.default_rng(3).uniform(1.0, 9.0, (number, len(COLUMNS)))
    made[:, 0] = np.arange(number) * 1e-3
    return made


class Told:
    """Control of a recorder in this process; the loop writes three rows in each of three looks, and stops."""

    def __init__(self, ring: Ring, started: bool = True, written: int = 9) -> None:
        self.ring, self.started, self.left = ring, started, rows(written)
        self.said: list[tuple[str, Any]] = []
        self.refused: list[str] = []

    def ready(self) -> None:
        self.said.append(("ready", ""))

    def refuse(self, text: str) -> None:
        self.refused.append(text)

    def send(self, kind: str, content: Any) -> None:
        self.said.append((kind, content))

    def wait_for_start(self) -> bool:
        return self.started

    @property
    def stopped(self) -> bool:
        for row in self.left[:3]:
            self.ring.write(row)
        self.left = self.left[3:]
        return not len(self.left)


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    @contextmanager
    def as_it_is(core: int | None) -> Any:
        yield

    monkeypatch.setattr(recorder, "helper", as_it_is)
    monkeypatch.setattr(recorder, "EVERY_S", 0.0)


def recorded(log: Path | None, live: bool = False, **told: Any) -> Told:
    ring = Ring(len(COLUMNS), 100)
    control = Told(ring, **told)
    words: queue.SimpleQueue[tuple[float, str]] = queue.SimpleQueue()
    for said in ((0.25, "lost [WheelSpeeds]"), (0.5, "back")):
        words.put(said)
    record(RecorderJob(COLUMNS, log, "a test", live, "unit at 1000 Hz"), ring, control, words)  # type: ignore[arg-type]
    return control


def test_all_rows_are_in_the_log_and_the_figures_and_what_was_said_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    control = recorded(tmp_path / "log.mf4")
    assert [kind for kind, _ in control.said] == ["ready", "done"]
    done = control.said[-1][1]
    assert (done["log_rows"], done["rows_lost"]) == (9, 0)
    assert done["figures"]["jitter_us"]["max"] == pytest.approx(
        rows(9)[:, PLACES["lateness_us"]].max(), rel=1e-3
    )
    with MDF(tmp_path / "log.mf4") as mdf:
        assert mdf.get("TRPAC").samples.tolist() == rows(9)[:, PLACES["TRPAC"]].tolist()
    told = capsys.readouterr().err
    assert "0.250 s  lost [WheelSpeeds]" in told
    assert told.count("back") == 1


def test_a_run_that_never_starts_leaves_no_log(tmp_path: Path) -> None:
    control = recorded(tmp_path / "log.mf4", started=False)
    assert control.said[-1][1]["log_rows"] == 0
    assert list(tmp_path.iterdir()) == []


def test_without_a_log_the_figures_are_told_all_the_same() -> None:
    done = recorded(None).said[-1][1]
    assert done["log_rows"] == 0
    assert done["figures"]["jitter_us"]["max"] > 0.0


@pytest.mark.parametrize("failing", ["add", "finish"])
def test_a_log_that_fails_is_told_and_the_figures_are_those_of_all_rows(
    failing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(MdfLog, failing, full)
    control = recorded(tmp_path / "log.mf4")
    assert [kind for kind, _ in control.said] == ["ready", LOG_FAILED, "done"]
    assert "disk full" in control.said[1][1]
    done = control.said[-1][1]
    assert done["log_rows"] == 0
    assert done["figures"]["jitter_us"]["max"] == pytest.approx(
        rows(9)[:, PLACES["lateness_us"]].max(), rel=1e-3
    )
    assert not (tmp_path / "log.mf4").exists()


def test_a_log_that_cannot_be_begun_is_refused_before_the_run(tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        recorded(tmp_path / "nowhere" / "log.mf4")


def test_the_screen_shows_the_newest_row_the_spreads_and_the_last_words(
    capsys: pytest.CaptureFixture[str],
) -> None:
    figures, made = Figures(COLUMNS), rows(500)
    made[:, PLACES["lateness_us"]] = np.linspace(1.0, 8.0, 500)
    newest = {
        "time_s": 12.3,
        "TRPAC": 0.456,
        "TRPAC_std": 0.078,
        "status": 2.0,
        "theta_true_fl": 0.5,
        "overruns": 7.0,
    }
    for name, value in newest.items():
        made[-1, PLACES[name]] = value
    figures.add(made)
    with Screen("unit [fl] at 1000 Hz", {"theta_true_fl": (), "vehicle_speed_m_s": ("work_us",)}) as screen:
        screen.show(figures, [(1.0, "lost WheelSpeeds")])
        screen.show(figures, [(2.0, "back")])
    shown = capsys.readouterr().err
    for text in (
        "unit [fl] at 1000 Hz",
        "12.3 s",
        "0.456 +- 0.078",
        "0.500",
        "lost WheelSpeeds",
        "back",
        "jitter [us]",
    ):
        assert text in shown
    (jitter,) = [line.split()[-4:] for line in shown.splitlines() if "jitter" in line][-1:]
    assert [float(number) for number in jitter] == pytest.approx([8.0, 4.5, 7.93, 8.0], rel=0.01)


def test_the_screen_is_drawn_only_where_it_was_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    recorded(None, live=False)
    assert "jitter" not in capsys.readouterr().err
    recorded(None, live=True)
    assert "jitter" in capsys.readouterr().err
