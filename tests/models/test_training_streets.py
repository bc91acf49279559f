"""Street pictures: a manifest of their own, sources by name and hour, squares stretched back, roads that are found."""

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest
from training_folder import COLUMNS, LowerHalf, row, write_folder

from models.training import data, patches
from models.training.found_roads import with_found_roads

GREY, WHITE = 90, 250


@pytest.fixture
def streets(tmp_path):
    """Pictures whose lower half is grey; the mask of the wet one says that its upper half is road."""
    image = np.full((200, 200, 3), WHITE, np.uint8)
    image[100:] = GREY
    upper = np.zeros((200, 200), np.uint8)
    upper[:100] = 1
    rows = [row("street_conditions/dry/cws8262_0001.png", "train", "dry", sequence="a")]
    mask = "street_conditions/wet/cws8262_0002_road.png"
    rows.append(row("street_conditions/wet/cws8262_0002.png", "train", "wet", mask=mask, sequence="b"))
    rows.append(row("street_conditions/snow/sidhardha36_1.png", "val", "snow", notes="snow by night"))
    rows.append(row("street_conditions/dry/sidhardha36_2.png", "val", "dry"))
    write_folder(tmp_path, [], {mask: upper} | {each["file"]: image for each in rows})
    write_manifest(tmp_path / "manifest_street.csv", rows)
    return tmp_path


def write_manifest(file: Path, rows):
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, COLUMNS)
        writer.writeheader()
        writer.writerows(rows)


def test_every_manifest_of_the_folder_is_read_and_sources_go_by_name_and_hour(streets):
    pictures = data.read_manifest(streets)
    assert [p.family for p in pictures] == ["cws8262", "cws8262", "bdd_night", "bdd_day"]
    assert [p.night for p in pictures] == [False, False, True, False]


def test_a_problem_is_told_with_its_manifest(streets):
    write_manifest(
        streets / "manifest_more.csv", [row("street_conditions/dry/unknown_1.png", "train", "dry")]
    )
    with pytest.raises(data.DataFolderError, match=r"manifest_more\.csv, line 2: .*expected one of cws8262"):
        data.read_manifest(streets)


def test_streets_need_no_road_box(streets):
    with pytest.raises(data.DataFolderError) as failure:
        data.check_trainable(data.read_manifest(streets))
    assert "no road box" not in str(failure.value)


def test_patches_lie_where_road_is_found_whatever_a_mask_says(streets):
    found = with_found_roads(data.read_manifest(streets), LowerHalf())
    cut = patches.training_patches(found, seed=1)
    assert np.unique(cut.pictures).tolist() == [0, 1, 2, 3]
    for patch in (*cut.patches, *patches.judged_patches(found).patches):
        assert np.mean(patch > GREY + 40) < 0.3, "edges may hold a kerb"


def test_squares_are_stretched_back_and_their_road_with_them(streets):
    square, *_, dash = with_found_roads(data.read_manifest(streets), LowerHalf())
    assert patches.unsquashed(square, square.image(), 1.3).shape == (200, 260, 3)
    assert patches.unsquashed(square, square.road(), 1.3).shape == (200, 260)
    assert patches.unsquashed(dash, dash.image(), 1.3).shape == (200, 200, 3)
    cv2.imwrite(str(square.path), np.zeros((200, 200, 3), np.uint8))
    assert (square.road()[:98] == 0).all()
    assert (square.road()[102:] == 1).all()
