"""`trpac sweep` among strangers: who can reach it, and what of a folder, a file or an address it takes."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from io import StringIO
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import dask
import numpy as np
import pandas as pd
import psutil
import pytest
import yaml
from long import beyond, long
from report_page import Page, require_report
from typer.testing import CliRunner

from scenarios.errors import ScenarioError
from scenarios.plots import png
from scenarios.sweep import figures
from scenarios.sweep.cluster import connected, security_of
from scenarios.sweep.draw import plan_run, run_keys
from scenarios.sweep.execute import Failure, execute, run_one
from scenarios.sweep.files import RANGES, Sweep, load_sweep
from scenarios.sweep.outcome import outcome
from scenarios.sweep.report import write_report
from scenarios.sweep.run import run_plan
from scenarios.sweep.store import COLUMNS, Parts, as_table, identity
from scenarios.sweep.summary import summarise
from scenarios.sweep.trackers import problem_of_address, problem_of_tracker
from trpac_cli import sweep as command
from trpac_cli.console import Terminal
from trpac_cli.main import app

ROOT = Path(__file__).parents[2]
SCENARIO = ROOT / "scenarios" / "paper_simulation.yaml"
SHORT = {
    "schema": 1,
    "name": "short",
    "scenario": str(SCENARIO),
    "runs": 2,
    "seed": 5,
    "road": {"stretch_m": 3.0, "friction": {"dry": [0.7, 1.0], "snow_ice": [0.2, 0.35]}},
    "pedal": {},
}


@pytest.fixture
def sweep_of(tmp_path: Path) -> Callable[..., Sweep]:
    """Writes a sweep file with these changes and reads it."""

    def make(**changes: Any) -> Sweep:
        path = tmp_path / "sweep.yaml"
        path.write_text(yaml.safe_dump(SHORT | changes))
        return load_sweep(path)

    return make


def plugged_in(sweep_of: Callable[..., Sweep], **changes: Any) -> Sweep:
    """The sweep of these changes with code that its file names."""
    with pytest.raises(ScenarioError, match="--allow-code") as refused:
        sweep_of(**changes)
    return load_sweep(str(refused.value).partition(": ")[0], allow_code=True)


def one_sentence(error: BaseException) -> str:
    """The text of a refusal, which is one line that ends once."""
    text = str(error)
    assert "\n" not in text
    assert len(text) < 600
    assert text.endswith(".")
    return text


def sentences(error: BaseException) -> None:
    """Every problem of a file is one line that ends once."""
    for line in str(error).splitlines():
        assert len(line) < 2000
        assert line.endswith(".")


# Who can reach it


def test_nothing_of_a_local_cluster_listens_beyond_this_machine() -> None:
    with connected(None, 1) as client:
        client.submit(int, 1).result()
        me = psutil.Process()
        sockets = [s for p in (me, *me.children(recursive=True)) for s in p.net_connections("inet")]
        listening = [s.laddr.ip for s in sockets if s.status == psutil.CONN_LISTEN]
        datagrams = [s.laddr.ip for s in sockets if s.type == socket.SOCK_DGRAM]
    assert len(listening) >= 3, "the scheduler, its nanny and a worker"
    assert [ip for ip in listening + datagrams if not ip_address(ip).is_loopback] == []


OPEN_TO_OTHERS = (
    "tcp://10.0.0.1:8786",
    "10.0.0.1:8786",
    "ws://192.0.2.1:8786",
    "wss://192.0.2.1:8786",
    "ucx://192.0.2.1:8786",
    "TLS://192.0.2.1:8786",
    "tls://x://192.0.2.1:8786",
    "tcp://0.0.0.0:8786",
    "tcp://[::]:8786",
    "tcp://[2001:db8::1]:8786",
    "tcp://both.example:8786",
)


@pytest.fixture
def names(monkeypatch: pytest.MonkeyPatch) -> None:
    """Names and addresses as a resolver would give them, without asking one."""
    known = {"both.example": ["127.0.0.1", "192.0.2.1"], "localhost": ["127.0.0.1", "::1"]}

    def resolved(host: str, port: object, *_: object, **__: object) -> list[Any]:
        if host not in known and not host.replace(".", "").replace(":", "").isalnum():
            raise socket.gaierror(-2, "Name or service not known")
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (ip, port)) for ip in known.get(host, [host])]

    monkeypatch.setattr(socket, "getaddrinfo", resolved)


@pytest.mark.usefixtures("names")
@pytest.mark.parametrize("address", OPEN_TO_OTHERS)
def test_a_scheduler_elsewhere_is_reached_by_tls_alone(
    sweep_of: Callable[..., Sweep], tmp_path: Path, address: str
) -> None:
    with pytest.raises(ScenarioError, match="expected tls://HOST:PORT") as refused:
        execute(sweep_of(), tmp_path / "out", scheduler=address)
    assert address in one_sentence(refused.value)
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("names")
@pytest.mark.parametrize(
    "address",
    [
        *(
            "",
            "tcp://",
            "tcp://127.0.0.1",
            "tcp://no name:1",
            "tcp://127.0.0.1:99999999",
            "tcp://127.0.0.1:0",
        ),
        *(
            "tcp://[::1:8786",
            "inproc://127.0.0.1/1/1",
            "tcp://" + "9" * 5000,
            "tcp://a\x1b[31m:\x00",
            "tls://x",
        ),
        *("tcp://x@127.0.0.1:8786", "tcp://127.0.0.1:" + "9" * 5000),
    ],
)
def test_what_is_no_address_is_said(sweep_of: Callable[..., Sweep], tmp_path: Path, address: str) -> None:
    with pytest.raises(ScenarioError, match="--scheduler ") as refused:
        execute(sweep_of(), tmp_path / "out", scheduler=address)
    assert one_sentence(refused.value).isprintable()
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("names")
@pytest.mark.parametrize("place", ["127.0.0.1:1", "tcp://127.9.9.9:1", "tcp://[::1]:1", "tcp://localhost:1"])
def test_a_scheduler_of_this_machine_needs_no_tls(place: str) -> None:
    security_of(place)


@pytest.mark.parametrize(
    "given",
    [{}, {"ca-file": "/nowhere/ca.pem"}, {"ca-file": "/nowhere/ca.pem", "client.cert": "/nowhere/c.pem"}],
)
def test_tls_without_certificates_is_refused(given: dict[str, str]) -> None:
    with (
        dask.config.set({f"distributed.comm.tls.{key}": value for key, value in given.items()}),
        pytest.raises(
            ScenarioError, match=r"distributed\.comm\.tls\.ca-file, client\.cert and client\.key"
        ) as no,
    ):
        security_of("tls://192.0.2.1:8786")
    assert "tls://192.0.2.1:8786" in one_sentence(no.value)


@dataclass(frozen=True)
class Certificates:
    """Files of a certificate authority and of one who has its signature."""

    ca: Path
    cert: Path
    key: Path

    def settings(self) -> dict[str, str]:
        """Dask's configuration of a client."""
        names = {"ca-file": self.ca, "client.cert": self.cert, "client.key": self.key}
        return {f"distributed.comm.tls.{name}": str(path) for name, path in names.items()}

    def options(self) -> list[str]:
        """The same for Dask's own commands."""
        return ["--tls-ca-file", str(self.ca), "--tls-cert", str(self.cert), "--tls-key", str(self.key)]


def make_certificates(folder: Path) -> Certificates:
    """As docs/guide/sweep.md says."""
    folder.mkdir()
    made = Certificates(folder / "ca.pem", folder / "dask.pem", folder / "dask-key.pem")
    page = (ROOT / "docs" / "guide" / "sweep.md").read_text(encoding="utf-8")
    recipe = next(p for p in page.split("```bash\n")[1:] if p.startswith("umask")).split("```")[0]
    subprocess.run(["/bin/sh", "-e", "-c", recipe], cwd=folder, check=True, capture_output=True)
    return made


@pytest.fixture
def tls_cluster(tmp_path: Path) -> Iterator[tuple[str, Certificates]]:
    """Scheduler and one worker of their own processes, which speak TLS alone."""
    if shutil.which("openssl") is None:
        pytest.skip("needs the command openssl")
    made = make_certificates(tmp_path / "certificates")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tls://127.0.0.1:{free.getsockname()[1]}"
    dask_command = [sys.executable, "-m", "dask"]
    about = ["--no-dashboard", *made.options()]
    host, _, port = address.removeprefix("tls://").partition(":")
    scheduler = ["scheduler", "--protocol", "tls", "--host", host, "--port", port, *about]
    worker = ["worker", address, "--host", host, "--nthreads", "1", "--no-nanny", *about]
    worker += ["--local-directory", str(tmp_path)]
    place: dict[str, Any] = {"cwd": ROOT, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    processes = [subprocess.Popen([*dask_command, *words], **place) for words in (scheduler, worker)]
    try:
        yield address, made
    finally:
        for process in processes:  # a worker that is asked to leave would first look for its scheduler
            process.kill()
            process.wait(20)


@long
@pytest.mark.e2e
def test_a_sweep_over_tls_and_nobody_without_the_certificate(
    sweep_of: Callable[..., Sweep],
    tmp_path: Path,
    tls_cluster: tuple[str, Certificates],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (address, certificates), sweep = tls_cluster, sweep_of(runs=1)
    with dask.config.set(certificates.settings()):
        parts, failures = execute(sweep, tmp_path / "out", scheduler=address)
    assert not failures
    expected = as_table(run_one(sweep, run_keys(sweep)[0]).rows)
    pd.testing.assert_frame_equal(parts.table(), expected, check_exact=True)
    monkeypatch.setattr("scenarios.sweep.cluster.CONNECT_S", 5.0)
    with dask.config.set(certificates.settings()), connected(address, 1) as client:
        assert client.submit(int, 1).result() == 1, "the time is enough for who has the certificate"
    with pytest.raises(ScenarioError, match="names no certificates"):
        execute(sweep, tmp_path / "without", scheduler=address)
    stranger = make_certificates(tmp_path / "stranger")
    with dask.config.set(stranger.settings()), pytest.raises(ScenarioError, match="no answer") as refused:
        execute(sweep, tmp_path / "stranger's", scheduler=address)
    one_sentence(refused.value)
    with pytest.raises(ScenarioError, match="no answer"):
        execute(sweep, tmp_path / "plain", scheduler=address.replace("tls", "tcp"))


# What lies in the folder


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Sweep, Path]:
    """A sweep and its folder with both runs done."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "sweep.yaml").write_text(yaml.safe_dump(SHORT))
    sweep = load_sweep(folder / "sweep.yaml")
    parts = Parts(folder / "out", identity(sweep))
    parts.open()
    for key in run_keys(sweep):
        parts.keep(key.index, run_one(sweep, key).rows, 0.1)
    return sweep, folder / "out"


@pytest.fixture
def folder(finished: tuple[Sweep, Path], tmp_path: Path) -> Path:
    """A copy of it to spoil."""
    return Path(shutil.copytree(finished[1], tmp_path / "out"))


def test_a_run_has_the_columns_that_its_part_must_have(finished: tuple[Sweep, Path]) -> None:
    rows = json.loads((finished[1] / "parts" / "0000000.json").read_text())["rows"]
    assert all(row.keys() == COLUMNS for row in rows)
    assert {row["level"] for row in rows} == {None}


def edit(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    """Changes what a part says."""

    def spoil(path: Path) -> None:
        part = json.loads(path.read_text())
        change(part)
        path.write_text(json.dumps(part))

    return spoil


def of_rows(change: Callable[[list[dict[str, Any]]], object]) -> Callable[[Path], object]:
    return edit(lambda part: change(part["rows"]))


def set_in_row(column: str, value: Any) -> Callable[[Path], object]:
    return of_rows(lambda rows: rows[0].update({column: value}))


def huge(path: Path) -> None:
    with path.open("r+b") as file:
        file.truncate(1 << 30)


def swap(make: Callable[[Path], object]) -> Callable[[Path], object]:
    def spoil(path: Path) -> None:
        path.unlink()
        make(path)

    return spoil


STRANGE = {
    "pipe": swap(os.mkfifo),
    "folder": swap(os.mkdir),
    "device": swap(lambda path: path.symlink_to("/dev/zero")),
    "dangling": swap(lambda path: path.symlink_to("/nowhere/at/all")),
    "loop": swap(lambda path: path.symlink_to(path)),
    "huge": huge,
    "empty": swap(Path.touch),
    "deep": lambda path: path.write_text("[" * 100_000),
    "deep_object": lambda path: path.write_text('{"rows":' * 100_000),
    "digits": lambda path: path.write_text("1" * 5_000),
    "not_text": lambda path: path.write_bytes(b"\xff\xfe\x00{"),
    "cut": lambda path: path.write_text(path.read_text()[:-30]),
    "null": lambda path: path.write_text("null"),
}
SPOILT = STRANGE | {
    "no_rows": edit(lambda part: part.update(rows=[])),
    "rows_lost": of_rows(lambda rows: rows.clear()),
    "one_estimator_lost": of_rows(lambda rows: rows.pop(1)),
    "stretch_lost": edit(lambda part: part.update(rows=[r for r in part["rows"] if r["stretch"] == 0])),
    "row_twice": of_rows(lambda rows: rows.append(rows[0])),
    "other_run": lambda path: shutil.copy(path.with_name("0000000.json"), path),
    "not_a_number": set_in_row("error_end", float("nan")),
    "infinite": set_in_row("error_end", float("inf")),
    "too_large": set_in_row("error_end", 1e999),
    "changed": set_in_row("error_end", 0.123),
    "yes": set_in_row("stretch", True),
    "deep_row": of_rows(lambda rows: rows[0].update(error_end=json.loads("[" * 900 + "]" * 900))),
    "digits_in_row": lambda path: path.write_text(
        path.read_text().replace('"seed": ', '"seed": ' + "1" * 5_000, 1)
    ),
    "column_lost": of_rows(lambda rows: [row.pop("theta") for row in rows]),
    "cpu_time": edit(lambda part: part.update(cpu_s=float("nan"))),
}


@pytest.mark.parametrize("spoil", SPOILT.values(), ids=SPOILT.keys())
def test_a_part_that_is_not_what_was_written_is_refused_before_the_work(
    finished: tuple[Sweep, Path], folder: Path, spoil: Callable[[Path], object]
) -> None:
    part = folder / "parts" / "0000001.json"
    spoil(part)
    began = time.monotonic()
    with pytest.raises(
        ScenarioError, match=r"0000001\.json: .*; delete it and run the sweep again\.$"
    ) as refused:
        execute(finished[0], folder, jobs=1)
    assert time.monotonic() - began < 2.0
    one_sentence(refused.value)


def test_a_part_of_another_sweep_of_the_same_runs_is_refused(
    finished: tuple[Sweep, Path], folder: Path, sweep_of: Callable[..., Sweep]
) -> None:
    other = sweep_of(seed=6)
    parts = Parts(folder.parent / "other", identity(other))
    parts.open()
    parts.keep(1, run_one(other, run_keys(other)[1]).rows, 0.1)
    shutil.copy(folder.parent / "other" / "parts" / "0000001.json", folder / "parts")
    with pytest.raises(ScenarioError, match=r"0000001\.json: .*; delete it"):
        Parts(folder, identity(finished[0])).open()


@pytest.mark.parametrize(
    "name", ["0000002.json", "1.json", "00000001.json", "٠٠٠٠٠٠١.json", "-000001.json", "x.json"]
)
def test_a_part_of_no_run_of_the_sweep_is_refused(
    finished: tuple[Sweep, Path], folder: Path, name: str
) -> None:
    shutil.copy(folder / "parts" / "0000001.json", folder / "parts" / name)
    with pytest.raises(ScenarioError, match=rf"{name}: is no run of this sweep; delete it") as refused:
        Parts(folder, identity(finished[0])).open()
    one_sentence(refused.value)


def test_what_the_sweep_did_not_ask_for_is_refused_even_if_it_was_kept_so(
    finished: tuple[Sweep, Path], folder: Path
) -> None:
    sweep = finished[0]
    parts, rows = Parts(folder, identity(sweep)), run_one(sweep, run_keys(sweep)[1]).rows
    spoilt = ([], rows[1:], [*rows, rows[0]], [row for row in rows if row["estimator"] != "DE"])
    wrong_run = [{**row, "run": 0} for row in rows]
    for kept in (*spoilt, wrong_run, [{k: v for k, v in row.items() if k != "theta"} for row in rows]):
        parts.keep(1, kept, 0.1)
        with pytest.raises(ScenarioError, match=r"0000001\.json: .*; delete it"):
            parts.open()
    parts.keep(1, rows, 0.1)
    assert parts.open() == {0, 1}


@pytest.mark.parametrize("spoil", STRANGE.values(), ids=STRANGE.keys())
def test_a_spoilt_identity_is_refused(
    finished: tuple[Sweep, Path], folder: Path, spoil: Callable[[Path], object]
) -> None:
    spoil(folder / "sweep.json")
    with pytest.raises(
        ScenarioError, match=r"sweep\.json: .*; delete it and run the sweep again\.$"
    ) as refused:
        Parts(folder, identity(finished[0])).open()
    one_sentence(refused.value)


def test_parts_that_are_no_folder_are_refused(finished: tuple[Sweep, Path], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "parts").write_text("mine")
    with pytest.raises(ScenarioError, match=r"parts: a file\. Expected a folder"):
        Parts(tmp_path / "out", identity(finished[0])).open()


@pytest.mark.parametrize("kind", ["link", "pipe"])
def test_what_lies_where_a_part_is_first_written_is_not_written_through(
    finished: tuple[Sweep, Path], folder: Path, kind: str
) -> None:
    scratch, mine = folder / "parts" / "0000001.json.part", folder.parent / "mine.txt"
    mine.write_text("mine")
    if kind == "link":
        scratch.symlink_to(mine)
    else:
        os.mkfifo(scratch)
    sweep, parts = finished[0], Parts(folder, identity(finished[0]))
    parts.keep(1, run_one(sweep, run_keys(sweep)[1]).rows, 0.1)
    assert mine.read_text() == "mine"
    assert parts.open() == {0, 1}


class Diverging:
    """A plug-in whose estimate runs away."""

    name = "diverging"
    TRPAC_std, excited = 0.1, True

    def __init__(self, told: object) -> None:
        self.TRPAC = float("nan")

    def reset(self) -> None:
        """Nothing is kept."""

    def step(self, step_s: float, sensors: object) -> Diverging:
        return self


def test_an_estimate_that_is_no_number_is_a_failed_run_by_name(sweep_of: Callable[..., Sweep]) -> None:
    sweep = plugged_in(sweep_of, estimators=["DIFE", f"{__name__}:Diverging"], runs=1)
    with pytest.raises(ValueError, match="Diverging gives an estimate that is no finite number"):
        run_one(sweep, run_keys(sweep)[0])


# What is written


@pytest.mark.e2e
@pytest.mark.parametrize("name", ["runs.parquet", "summary.json", "report.html"])
def test_table_summary_and_report_appear_together_or_not_at_all(
    finished: tuple[Sweep, Path], folder: Path, name: str
) -> None:
    for other in ("runs.parquet", "summary.json", "report.html"):
        (folder / other).write_text("of an earlier run")
    (folder / name).unlink()
    (folder / name).mkdir()
    result = CliRunner().invoke(app, ["sweep", str(finished[0].path), "--out", str(folder)])
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    assert name in result.stderr
    for other in {"runs.parquet", "summary.json", "report.html"} - {name}:
        assert (folder / other).read_text() == "of an earlier run"
    assert len(os.listdir(folder)) == 5


MARKUP = "<i>[/bold] $x_{$ :bug: [red]\x1b[31m \x9b 50% \ud800 $\\frac$"


@pytest.mark.e2e
def test_names_of_the_file_are_text_in_every_result(
    finished: tuple[Sweep, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In table, report and terminal, and in a path that looks like markup."""
    shown = StringIO()
    monkeypatch.setattr(command, "Terminal", lambda: Terminal(file=shown, width=400))
    sweep, _ = finished
    file = sweep.file.model_copy(update={"name": MARKUP, "description": MARKUP * 100})
    strange = Sweep(sweep.path, file, sweep.scenario)
    monkeypatch.setattr("scenarios.sweep.files.load_sweep", lambda path, **options: strange)
    out = tmp_path / "[bold]$a$[" / "[red]\x1b[31m"
    shutil.copytree(finished[1], out)
    (out / "sweep.json").write_text(json.dumps(identity(strange)))
    for path in (out / "parts").iterdir():
        path.unlink()
    parts = Parts(out, identity(strange))
    for key in run_keys(strange):
        parts.keep(key.index, run_one(strange, key).rows, 0.1)
    result = CliRunner().invoke(app, ["sweep", "sweep.yaml", "--out", str(out)])
    assert result.exit_code == 0, result.output
    text = shown.getvalue()
    assert "<i>[/bold] $x_{$ :bug: [red]\\x1b[31m \\x9b 50% \\ud800" in text
    assert f"Report: {tmp_path}/[bold]$a$[/[red]\\x1b[31m/report.html" in text
    assert "\x1b" not in text
    report = Page((out / "report.html").read_text()).source
    assert "&lt;i&gt;[/bold] $x_{$ :bug:" in report
    assert "<i>" not in report
    assert json.loads((out / "summary.json").read_text())["name"] == MARKUP


@pytest.mark.parametrize("name", beyond(1, ["a$\\frac$", "$x_{$", "100 $", "\\$\\bad$ $"]))
def test_dollars_are_no_formula_in_pictures(finished: tuple[Sweep, Path], name: str) -> None:
    table = Parts(finished[1], identity(finished[0])).table()
    table["estimator"] = table["estimator"].replace({"DE": name})
    assert png(figures.distributions(table))
    assert png(figures.errors_by_friction(table))
    table["estimator"] = table["estimator"].replace({"DIFE": name + name})
    assert png(figures.coverage(table))
    table["parameter"], table["level"] = name, 1.0
    assert [png(figure) for _, figure in figures.degradations(table)]


def test_why_a_run_failed_is_one_plain_line_in_the_report(
    finished: tuple[Sweep, Path], tmp_path: Path
) -> None:
    table = Parts(finished[1], identity(finished[0])).table()
    failures = [Failure(1, "<script>alert(1)</script>")]
    became = outcome(table, failures)
    write_report(finished[0], table, summarise(table), became, tmp_path / "report.html")
    page = require_report((tmp_path / "report.html").read_text())
    assert "<script>alert" not in page.source
    assert "1 <script>alert(1)</script>" in page.text
    assert page.verdict == became.sentence
    assert "1 failed with an error" in page.verdict


# What the file asks for

NUMBERS = [
    *((*name.split("."),) for name in RANGES),
    ("road", "stretch_m"),
    ("pedal", "period_s"),
    ("pedal", "light_torque_nm"),
    ("camera", "wrong_length_m"),
    ("unit", "estimator.gamma"),
    ("unit", "estimator.floor_speed"),
    ("unit", "camera.cx"),
]
HOSTILE = (1e308, -1e308, 5e-324, -0.0, 1e-300, 10**400, -(10**400), 2**63, 1e7)


@pytest.mark.parametrize("place", NUMBERS, ids=".".join)
def test_every_number_has_bounds(sweep_of: Callable[..., Sweep], place: tuple[str, str]) -> None:
    """What is far out is refused; what is taken can be run."""
    section, key = place
    for value in HOSTILE:
        given = {**SHORT.get(section, {}), key: value}  # type: ignore[dict-item]
        if abs(value) >= 1e7:
            with pytest.raises(ScenarioError, match=key.replace(".", r"\.")) as refused:
                sweep_of(**{section: given})
            sentences(refused.value)
            continue
        try:
            sweep = sweep_of(**{section: given})
        except ScenarioError as error:
            sentences(error)
            continue
        began = time.monotonic()
        plan = plan_run(sweep, run_keys(sweep)[0])
        assert run_plan(plan, sweep.file.estimators, sweep.file.unit)
        assert time.monotonic() - began < 10.0


@pytest.mark.parametrize("kind", ["uniform", "normal", "choice"])
@pytest.mark.parametrize("value", [1e308, -1e308, 10**400, 2**63], ids=["large", "low", "digits", "seed"])
def test_drawn_numbers_have_bounds_too(sweep_of: Callable[..., Sweep], kind: str, value: float) -> None:
    for pair in ([value, value], [1.0, abs(value)]):
        with pytest.raises(ScenarioError) as refused:
            sweep_of(vehicle={"mass_factor": {kind: pair}})
        sentences(refused.value)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"seed": 2**63}, "seed"),
        ({"seed": 10**400}, "seed"),
        ({"seed": -1}, "seed"),
        ({"runs": 10**400}, "runs"),
        ({"runs": 1001, "vary": [{"parameter": "camera.late_s", "levels": [0.1] * 1000}]}, "runs"),
        ({"vary": [{"parameter": "camera.late_s", "levels": [0.1] * 1001}]}, "levels"),
        ({"vary": [{"parameter": "camera.late_s", "levels": [0.1]}] * 101}, "vary"),
        ({"camera": {"late_s": {"choice": [0.1] * 1001}}}, "choice"),
        ({"camera": {"late_s": {"uniform": [0.1] * 50_000}}}, "uniform"),
        ({"road": {"friction": {"dry": [0.5] * 50_000}}}, "friction"),
        ({"estimators": [f"os:a{i}" for i in range(101)]}, "estimators"),
        ({"estimators": ["x" * 90_000]}, "estimators"),
        ({"name": "x" * 201}, "name"),
        ({"description": "x" * 10_001}, "description"),
        ({"unit": {"estimator.gamma": float("nan")}}, "estimator.gamma"),
    ],
    ids=lambda value: value if isinstance(value, str) else "-".join(value),
)
def test_lists_counts_and_texts_have_bounds(
    sweep_of: Callable[..., Sweep], changes: dict[str, Any], named: str
) -> None:
    began = time.monotonic()
    with pytest.raises(ScenarioError, match=named) as refused:
        sweep_of(**changes)
    sentences(refused.value)
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize(
    "name", [".x:y", "..:y", "$a$:b", "[/red]:x", "a b:c", ":", "a:", ":b", "os:path:join", "a\x00:b"]
)
def test_an_estimator_is_named_as_python_names_things(name: str) -> None:
    assert "expected package.module:function" in str(problem_of_tracker(name))


def test_a_plug_in_that_cannot_be_read_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "half_written.py").write_text("def f(:\n")
    assert "half_written:f" in str(problem_of_address("half_written:f"))


def test_code_that_a_file_names_is_not_even_imported_unless_allowed(
    tmp_path: Path, sweep_of: Callable[..., Sweep], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "named_code.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close()\n")
    with pytest.raises(ScenarioError, match="'named_code:f', which is code that would be run"):
        sweep_of(estimators=["DIFE", "named_code:f"])
    assert not (tmp_path / "ran").exists()


def test_a_stretch_of_no_length_is_not_waited_for(sweep_of: Callable[..., Sweep]) -> None:
    sweep = sweep_of(camera={"wrong_length_m": 0.1, "wrong_share": 0.5}, runs=1)
    assert np.isfinite(run_one(sweep, run_keys(sweep)[0]).cpu_s)
