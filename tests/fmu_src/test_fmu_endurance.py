"""Short versions of benchmarks/robustness/endurance_fmu.py and benchmarks/robustness/fuzz, and what they have found."""

from __future__ import annotations

import ctypes
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fmu_unit import DRIVING, Unit
from long import beyond

from benchmarks.robustness.endurance_fmu import (
    MOST_INSTANCE_GROWTH_MB,
    MOST_STEP_GROWTH_MB,
    can_mount,
    in_threads,
    measured,
    small_disk,
)
from benchmarks.robustness.fuzz.files import KINDS
from benchmarks.robustness.fuzz.run import run_kind
from fmu_src.packaging import write_archive
from scenarios.whole_files import written_whole

pytestmark = pytest.mark.e2e

Open = Callable[..., Unit]
ERROR = 3
SEED = 20
DAMAGED = {
    "camera_yaml": 1000,
    "vehicle_yaml": 1000,
    "road_yaml": 1000,
    "manoeuvre_yaml": 1000,
    "scenario_yaml": 1000,
    "mapping_yaml": 1000,
    "sweep_yaml": 500,
    "sweep_part_json": 300,
    "log_csv": 300,
    "log_parquet": 600,
    "log_mf4": 60,
    "log_mat73": 60,
    "bus_dbc": 200,
    "picture_jpeg": 1000,
    "picture_png": 1000,
    "unit_fmu": 400,
    "unit_examined": 200,
    "surface_onnx": 60,
    "state_TrpacEstimator": 60,
}
"""Damaged files of each kind, 11,000 in all: many of those that are read in a millisecond, few of those that a process
reads."""


def test_many_steps_and_instances_leave_nothing_behind(unit_folder: Path) -> None:
    steps = measured("steps", unit_folder, 20_000)
    assert steps["growth_mb"] < MOST_STEP_GROWTH_MB
    instances = measured("instances", unit_folder, 30)
    assert instances["growth_mb"] < MOST_INSTANCE_GROWTH_MB
    assert instances["path_unchanged"]
    assert (instances["more_threads"], instances["more_files"]) == (0, 0)


def test_instances_in_threads_do_what_each_does_alone(unit_folder: Path) -> None:
    assert in_threads(unit_folder, 0)["same_as_alone"]


@pytest.mark.parametrize("unit", beyond(1, ["TrpacEstimator4W", "TrpacEstimator"]))
def test_random_inputs_and_calls(unit: str) -> None:
    result = run_kind(unit, SEED, 300)
    assert result["shown"] == []
    assert result["taken_down"] >= 5, "rubbish has met flags that were up"


@pytest.mark.parametrize("kind", beyond(8, DAMAGED))
def test_damaged_files(kind: str) -> None:
    assert run_kind(kind, SEED, DAMAGED[kind])["shown"] == []


def test_damage_is_damage() -> None:
    """The fuzzing would find what it looks for: a reader that takes anything is found out."""
    import numpy as np

    from benchmarks.robustness.fuzz.files import judge, workplace
    from benchmarks.robustness.fuzz.mutations import damaged

    kind = KINDS["picture_png"]
    with workplace(kind) as (path, good, right):
        assert judge(kind, path, right) is None
        assert judge(kind, path, right + 1) == "read, with another content"
        spoilt = [damaged(kind.ways, good, np.random.default_rng([SEED, i])) for i in range(50)]
        assert sum(one != good for one in spoilt) > 45
        path.unlink()
        path.mkdir()
        assert judge(kind, path, right) is None, "a folder is refused clearly, too"


# Findings


@pytest.mark.parametrize(
    ("name", "value"),
    [("image__middle_to", 8e7), ("image__patches_far", 2**31 - 1), ("image__k2", 1e9), ("image__grid", 1e-3)],
)
def test_parameters_that_would_keep_a_frame_for_ever_are_refused(
    open_unit: Open, name: str, value: float
) -> None:
    unit = open_unit(**{name: value})
    assert [line.status for line in unit.log] == [ERROR]
    assert "cannot be initialised" in unit.log[0].text


def test_text_that_is_not_utf_8_is_told_and_taken_as_empty(open_unit: Open) -> None:
    # The wrapper hands over a list with a hole and an error pending, and would free the unit under the host.
    unit = open_unit()
    unit.restore(unit.saved())
    reference = (ctypes.c_uint * 1)(unit.variables["image_path"].valueReference)
    text = (ctypes.c_char_p * 1)("Prüfstand.png".encode("latin-1"))
    for _ in range(2):
        assert unit.slave.fmi2SetString(unit.slave.component, reference, 1, text) == 0
    unit.step(DRIVING, count=5)
    assert [line.status for line in unit.log] == [ERROR]
    assert "not UTF-8" in unit.log[0].text
    unit.step({"image_path": "Prüfstand.png"})
    assert "Prüfstand.png" in unit.log[1].text


def test_a_digit_changed_in_a_state_is_found(open_unit: Open) -> None:
    unit = open_unit()
    unit.step(DRIVING, count=50)
    saved = unit.slave.serializeFMUstate(unit.slave.getFMUstate())
    value = re.search(rb'"TRPAC": (0\.\d+)', saved)
    assert value is not None
    spoilt = saved.replace(value[1], b"0.3", 1)
    assert json.loads(spoilt)
    unit.slave.setFMUstate(unit.slave.deSerializeFMUstate(spoilt))
    assert [(line.status, "damaged" in line.text) for line in unit.log] == [(ERROR, True)]
    assert unit.get("TRPAC") != 0.3


@pytest.mark.parametrize("program", ["build_fmu.py", "build_ssp.py"])
def test_a_full_disk_leaves_no_half_archive(program: str) -> None:
    if not can_mount():
        pytest.skip("this machine mounts no small file system without special rights")
    done = small_disk([sys.executable, program, "--out", "OUT"])
    assert (done["exit_code"], done["lines_of_error"], done["left"]) == (3, 1, [])


def test_an_archive_that_fails_half_way_leaves_the_one_before(tmp_path: Path) -> None:
    target = write_archive(tmp_path / "unit.fmu", {"a": b"first"})
    before = target.read_bytes()
    with pytest.raises(TypeError):
        write_archive(target, {"a": b"second", "b": None})  # type: ignore[dict-item]
    assert target.read_bytes() == before
    assert os.listdir(tmp_path) == ["unit.fmu"]
    assert write_archive(tmp_path / "unit.fmu", {"a": b"first"}).read_bytes() == before


def test_a_result_goes_to_a_folder_that_is_a_disk_of_its_own(tmp_path: Path) -> None:
    """Nothing is made beside a folder that is there: that may be another disk, or not the user's to write to."""
    out = tmp_path / "mounted"
    out.mkdir()
    with written_whole(out) as made:
        assert made.parent == out
        (made / "log.csv").write_text("first")
    assert os.listdir(out) == ["log.csv"]


def _fail_half_way(out: Path) -> None:
    with written_whole(out) as made:
        (made / "log.csv").write_text("second, cut sho")
        (made / "no such folder" / "figure.png").write_text("fails as a full disk does")


def test_a_result_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with written_whole(out) as made:
        (made / "log.csv").write_text("first")
    with pytest.raises(OSError, match="no such folder"):
        _fail_half_way(out)
    assert [p.name for p in tmp_path.iterdir()] == ["out"]
    assert (out / "log.csv").read_text() == "first"


def test_a_killed_writer_leaves_the_folder_as_it_was(tmp_path: Path) -> None:
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom scenarios.whole_files import written_whole\n"
        "with written_whole(Path(sys.argv[1])) as made:\n"
        "    (made / 'log.csv').write_text('half')\n    os.kill(os.getpid(), 9)\n"
    )
    out = tmp_path / "out"
    done = subprocess.run([sys.executable, "-c", code, out], check=False, cwd=Path(__file__).parents[2])
    assert done.returncode == -9
    assert not out.exists()
    assert os.listdir(tmp_path)[0].startswith(".out_")
