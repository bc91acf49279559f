"""`trpac fmu build`: units by name and kind, and what is refused."""

from __future__ import annotations

import pytest
from command_line import run, words

from fmu_src.kinds import known_units


def test_a_unit_is_built_where_asked_and_its_path_is_printed(tmp_path):
    done = run("fmu", "build", "--unit", "TorquePulses", "--flat", "--out", tmp_path / "new" / "dist")
    assert done.exit_code == 0, done.output
    assert done.stdout == f"{tmp_path / 'new' / 'dist' / 'TorquePulses_flat.fmu'}\n"
    assert [path.name for path in (tmp_path / "new" / "dist").iterdir()] == ["TorquePulses_flat.fmu"]


def test_kind_and_version_are_handed_on(tmp_path, monkeypatch):
    given = {}

    def build_fmu(folder, **options):
        given.update(options, folder=folder)
        return folder / "TrpacEstimator_native_fmi3.fmu"

    monkeypatch.setattr("trpac.build_fmu", build_fmu)
    done = run("fmu", "build", "--kind", "native", "--fmi", "3", "--out", tmp_path)
    assert done.exit_code == 0, done.output
    assert given == {"folder": tmp_path, "unit": "TrpacEstimator", "kind": "native", "fmi": 3, "flat": False}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["--unit", "TrpacEstimater"], "did you mean 'TrpacEstimator'"),
        (["--kind", "rust"], "kind is 'rust'; expected one of python, native."),
        (["--unit", "ReferencePlant", "--kind", "native"], "'ReferencePlant' is not a native unit"),
        (["--fmi", "3"], "fmi is 3; expected 2, or of a native unit also 3."),
    ],
)
def test_another_unit_kind_or_version_is_refused(given, said, tmp_path):
    done = run("fmu", "build", *given, "--out", tmp_path / "dist")
    assert done.exit_code == 2
    assert done.stderr.startswith("trpac fmu build: ")
    assert said in done.stderr
    assert not (tmp_path / "dist").exists()


def test_without_a_compiler_a_native_unit_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setattr("fmu_src.native.build.find_spec", lambda _: None)
    done = run("fmu", "build", "--kind", "native", "--out", tmp_path)
    assert done.exit_code == 2
    assert "compiler" in done.stderr
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_a_file_is_refused(tmp_path):
    (tmp_path / "dist").write_text("")
    done = run("fmu", "build", "--unit", "TorquePulses", "--out", tmp_path / "dist")
    assert done.exit_code == 2
    assert "a file. Expected a folder" in done.stderr


def test_help_names_every_unit():
    text = words(run("fmu", "build", "--help").output)
    assert all(name in text for name in known_units("python"))
