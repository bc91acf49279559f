"""`trpac fmu doctor`: a unit that is fine, and each way in which one, or its Python, is not."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from doctored_units import RECORD, changed, command, crashing, findings

from fmu_src import doctor
from fmu_src.contents import read_contents, sha256_of
from fmu_src.doctor import Python, State, UnusableError, examine
from fmu_src.host_needs import host_needs
from scenarios.fmu_client import archives

pytestmark = pytest.mark.e2e

NETWORKS = ("resources/segmenter.onnx", "resources/surface.onnx")


@pytest.fixture
def no_probe(monkeypatch: pytest.MonkeyPatch) -> None:
    """Interpreter and description are not looked at, which take longest."""
    monkeypatch.setattr(doctor, "_description", lambda _: doctor.Finding("description", State.OK, ""))
    python = Python(sys.executable, (3, 11, 0), sys.prefix, "", {"numpy": (True, "2")})
    monkeypatch.setattr(doctor, "_probe", lambda *_: python)


def test_a_unit_that_is_fine(unit_file: Path) -> None:
    done = command(unit_file, "--json")
    assert done.exit_code == 0, done.output
    assert {finding["state"] for finding in findings(done).values()} == {"ok"}
    assert "onnxruntime" in findings(done)["packages"]["text"]


@pytest.mark.usefixtures("no_probe")
def test_the_tables_say_the_same(unit_file: Path) -> None:
    shown = command(unit_file)
    assert shown.exit_code == 0
    assert "TrpacEstimator: fine." in shown.stdout
    assert "LD_PRELOAD" in shown.stdout


def test_every_file_of_the_unit_is_recorded(unit_file: Path) -> None:
    with zipfile.ZipFile(unit_file) as archive:
        recorded = read_contents(archive.read(RECORD)).files
        assert {*recorded, RECORD} == set(archive.namelist())
        assert all(sha256_of(archive.read(name)) == digest for name, digest in recorded.items())


@pytest.mark.usefixtures("no_probe")
@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({NETWORKS[1]: b"not a network"}, "resources/surface.onnx is damaged or has been exchanged"),
        ({NETWORKS[0]: None}, "resources/segmenter.onnx is missing"),
        ({"resources/extra.py": b"x = 1\n"}, "resources/extra.py is not of this build"),
        ({RECORD: b"{}"}, "damaged"),
        ({RECORD: b'{"schema": 1}'}, "damaged"),
        ({RECORD: b"\xff\x00"}, "damaged"),
    ],
)
def test_what_is_not_of_the_build_is_named_and_the_unit_not_tried(
    unit_file: Path, tmp_path: Path, changes: dict[str, bytes | None], said: str
) -> None:
    done = command(changed(unit_file, tmp_path / "TrpacEstimator.fmu", changes), "--json")
    assert done.exit_code == 1
    assert findings(done)["contents"]["state"] == "problem"
    assert said in findings(done)["contents"]["text"]
    assert findings(done)["trial"]["state"] == "note"


@pytest.mark.usefixtures("no_probe")
def test_networks_that_have_changed_places_are_both_named(unit_file: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(unit_file) as archive:
        swapped = {NETWORKS[0]: archive.read(NETWORKS[1]), NETWORKS[1]: archive.read(NETWORKS[0])}
    text = findings(command(changed(unit_file, tmp_path / "TrpacEstimator.fmu", swapped), "--json"))[
        "contents"
    ]["text"]
    assert all(f"{name} is damaged or has been exchanged" in text for name in NETWORKS)


@pytest.mark.usefixtures("no_probe")
def test_each_flipped_byte_of_a_file_is_noticed(unit_file: Path, tmp_path: Path) -> None:
    whole, draw = unit_file.read_bytes(), random.Random(7)
    with zipfile.ZipFile(unit_file) as archive:
        entries = [entry for entry in archive.infolist() if entry.file_size]
    for _ in range(25):
        entry = draw.choice(entries)
        at = whole.index(entry.filename.encode(), entry.header_offset) + len(entry.filename)
        at += draw.randrange(entry.file_size)
        target = tmp_path / "TrpacEstimator.fmu"
        target.write_bytes(whole[:at] + bytes([whole[at] ^ (1 << draw.randrange(8))]) + whole[at + 1 :])
        states = {finding.what: finding.state for finding in examine(target).findings}
        assert states["archive"] is State.PROBLEM, entry.filename


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (lambda whole: whole[:-5000], "zip archive"),
        (lambda whole: b"", "zip archive"),
        (lambda whole: b"text", "zip archive"),
    ],
)
def test_what_is_no_archive_is_refused(
    unit_file: Path, tmp_path: Path, content: Callable[[bytes], bytes], said: str
) -> None:
    (tmp_path / "x.fmu").write_bytes(content(unit_file.read_bytes()))
    done = command(tmp_path / "x.fmu")
    assert done.exit_code == 2
    assert said in done.stderr
    assert done.stdout == ""


def test_other_files_and_interpreters_are_refused(unit_file: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("a.txt", "x")
    for arguments, said in (
        ([tmp_path / "nowhere.fmu"], "o such file"),
        ([tmp_path], "zip archive"),
        ([tmp_path / "other.zip"], "holds no modelDescription.xml"),
        ([unit_file, "--python", tmp_path / "nowhere"], "cannot be run as a Python interpreter"),
        ([unit_file, "--python", "/bin/true"], "cannot be run as a Python interpreter"),
    ):
        done = command(*arguments)
        assert (done.exit_code, said in done.stderr) == (2, True), done.output


def test_an_interpreter_without_the_packages_is_told_which_and_how(unit_file: Path, tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "bare"], check=True)
    python = tmp_path / "bare" / "bin" / "python"
    done = command(unit_file, "--json", "--python", python)
    assert done.exit_code == 1
    found = findings(done)["packages"]
    assert found["state"] == "problem"
    assert found["mend"].startswith(f"{python} -m pip install ")
    assert set(found["mend"].split()[-3:]) == {"numpy", "onnxruntime", "opencv-python-headless"}
    assert findings(done)["trial"]["state"] == "problem"


@pytest.mark.usefixtures("no_probe")
@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import ctypes; ctypes.string_at(16)", "died of SIGSEGV"),
        ("import os; os._exit(7)", "ended with 7"),
        ("raise RuntimeError('on purpose')", "no instance"),
    ],
)
def test_a_unit_that_dies_is_a_line_in_the_table(
    unit_file: Path, tmp_path: Path, code: str, said: str
) -> None:
    done = command(crashing(unit_file, tmp_path / "TrpacEstimator.fmu", code), "--json")
    assert done.exit_code == 1
    assert findings(done)["contents"]["state"] == "ok"
    assert findings(done)["trial"]["state"] == "problem"
    assert said in findings(done)["trial"]["text"]


@pytest.mark.usefixtures("no_probe")
def test_a_unit_that_hangs_is_given_up(
    unit_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "TRIAL_LIMIT_S", 1.0)
    done = command(
        crashing(unit_file, tmp_path / "TrpacEstimator.fmu", "import time; time.sleep(60)"), "--json"
    )
    assert "no answer within 1 s" in findings(done)["trial"]["text"]


def test_a_description_that_does_not_validate_is_a_problem(
    unit_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "_trial", lambda *_: doctor.Finding("trial", State.OK, ""))
    monkeypatch.setattr(doctor, "_probe", lambda *_: Python(sys.executable, (3, 11, 0)))
    with zipfile.ZipFile(unit_file) as archive:
        text = archive.read("modelDescription.xml")
    for spoilt in (
        text.replace(b'causality="output"', b'causality="exit"', 1),
        text[:5000],
        b"",
        b"\xff" * 50,
    ):
        target = changed(
            unit_file, tmp_path / "TrpacEstimator.fmu", {"modelDescription.xml": spoilt}, recorded=True
        )
        states = {finding.what: finding.state for finding in examine(target).findings}
        assert (states["description"], states["trial"]) == (State.PROBLEM, State.OK)


@pytest.mark.usefixtures("no_probe")
def test_another_tools_unit_is_examined_as_far_as_can_be(unit_file: Path, tmp_path: Path) -> None:
    done = command(changed(unit_file, tmp_path / "TrpacEstimator.fmu", {RECORD: None}), "--json")
    assert findings(done)["contents"]["state"] == "note"
    assert "contents.json" in findings(done)["trial"]["text"], "this unit itself asks for its record"


@pytest.mark.usefixtures("no_probe")
def test_a_temporary_folder_that_crashes_the_wrapper_is_told(
    unit_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "a+b"))
    found = findings(command(unit_file, "--json"))["trial"]
    assert found["state"] == "problem"
    assert "TMPDIR" in found["mend"]


@pytest.mark.usefixtures("no_probe")
def test_archives_that_unpack_to_too_much_are_not_opened(
    unit_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(archives, "MOST_BYTES", unit_file.stat().st_size - 10_000)
    with pytest.raises(UnusableError, match=r"MB; expected a unit|unpacks to"):
        examine(unit_file)


def test_hosts_are_told_the_interpreters_own_paths(tmp_path: Path) -> None:
    library = tmp_path / "libpython3.11.so.1.0"
    library.write_bytes(b"")
    needs = {
        need.host: " ".join(need.needs)
        for need in host_needs(Python("/x/bin/python3", libpython=str(library)))
    }
    (in_c,) = (text for host, text in needs.items() if host.startswith("C or C++"))
    assert f"LD_PRELOAD={library}" in in_c
    assert "PATH=/x/bin:" in in_c
    without = host_needs(Python("/x/bin/python3", libpython=str(tmp_path / "libpython3.11.a")))
    assert any("--enable-shared" in text for need in without for text in need.needs)


def test_a_python_that_is_too_old_is_refused_by_the_unit_itself(unit_folder: Path) -> None:
    guid = (unit_folder / "resources" / "slavemodule.txt").read_text().rpartition("_")[2]
    code = (
        f"import sys; sys.path.insert(0, {str(unit_folder / 'resources')!r})\n"
        "sys.version_info = (3, 9, 2)\n"
        f"from fmu_src_{guid}.host import require_packages\n"
        "require_packages('TrpacEstimator', {})"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    first_line = done.stderr.splitlines()[0]
    assert "needs Python 3.11 or newer" in first_line
    assert f"{sys.executable} (Python 3.9.2" in first_line


def test_within_another_program_the_command_names_a_python(monkeypatch: pytest.MonkeyPatch) -> None:
    from fmu_src.host import interpreter

    monkeypatch.setattr(sys, "executable", "/opt/matlab/bin/glnxa64/MATLAB")
    assert Path(interpreter()).name.startswith("python")


def test_a_native_unit_needs_nothing_and_is_tried(native_file: Path) -> None:
    done = command(native_file, "--json")
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["ran_its_code"]
    assert [host["host"] for host in answer["hosts"]] == ["every host"]
    assert "needs none" in findings(done)["python"]["text"]
    assert findings(done)["trial"]["state"] == "ok"
