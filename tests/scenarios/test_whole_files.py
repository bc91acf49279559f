"""`written_whole`: a result is there whole, or the folder is as it was, whatever goes wrong while it is moved."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from scenarios.whole_files import written_whole

NEW = {"a.txt": "new a", "b.txt": "new b", "c.txt": "new c"}
OLD = {"a.txt": "old a", "c.txt": "old c", "mine.txt": "mine"}
FAULTS = [OSError("disk full"), KeyboardInterrupt(), SystemExit(143)]


def fill(folder: Path, files: dict[str, str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)


def content(folder: Path) -> dict[str, str]:
    return {p.name: p.read_text() for p in folder.iterdir()}


def write(folder: Path) -> None:
    with written_whole(folder) as made:
        fill(made, NEW)


def test_new_files_take_the_place_of_old_ones_and_others_stay(tmp_path: Path) -> None:
    out = tmp_path / "out"
    fill(out, OLD)
    write(out)
    assert content(out) == OLD | NEW
    assert os.listdir(tmp_path) == ["out"]


def test_a_folder_in_the_way_of_one_file_leaves_all_as_it_was(tmp_path: Path) -> None:
    out = tmp_path / "out"
    fill(out, {"a.txt": "old a", "b.txt": "old b"})
    fill(out / "c.txt", {"mine.txt": "mine"})
    with pytest.raises(IsADirectoryError, match=r"c\.txt: a folder\. Expected a place for a file"):
        write(out)
    assert content(out / "c.txt") == {"mine.txt": "mine"}
    assert sorted(os.listdir(out)) == ["a.txt", "b.txt", "c.txt"]
    assert (out / "a.txt").read_text() == "old a"
    assert (out / "b.txt").read_text() == "old b"


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: type(fault).__name__)
@pytest.mark.parametrize("done", [False, True], ids=["before it is done", "after it is done"])
@pytest.mark.parametrize("failing", range(5))
def test_a_fault_at_any_move_leaves_all_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int, done: bool, fault: BaseException
) -> None:
    """Two old files are moved aside and three new ones in: five moves; from the fault on no other goes well."""
    out, moves, move = tmp_path / "out", [], os.replace
    fill(out, OLD)

    def replace(source: Path, target: Path) -> None:
        moves.append(target)
        if len(moves) <= failing or (done and len(moves) == failing + 1):
            move(source, target)
        if len(moves) > failing:
            raise fault

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(type(fault)):
        write(out)
    monkeypatch.undo()
    assert content(out) == OLD
    assert os.listdir(tmp_path) == ["out"]


@pytest.mark.parametrize("failing", range(3))
def test_folders_that_were_not_there_do_not_remain_after_a_fault(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int
) -> None:
    moves, move = [], os.replace

    def replace(source: Path, target: Path) -> None:
        moves.append(target)
        if len(moves) > failing:
            raise OSError("disk full")
        move(source, target)

    monkeypatch.setattr(os, "replace", replace)
    with pytest.raises(OSError, match="disk full"):
        write(tmp_path / "new" / "deeper")
    assert os.listdir(tmp_path) == []


def test_a_link_in_the_way_is_replaced_and_what_it_leads_to_stays(tmp_path: Path) -> None:
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    fill(out, {})
    fill(elsewhere, {"mine.txt": "mine"})
    (out / "a.txt").symlink_to(elsewhere)
    (out / "b.txt").symlink_to(tmp_path / "nowhere")
    write(out)
    assert content(out) == NEW
    assert content(elsewhere) == {"mine.txt": "mine"}
