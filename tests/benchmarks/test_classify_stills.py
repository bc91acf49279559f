"""Scores of the command that classifies single pictures."""

import csv

import cv2
import numpy as np
import pytest
from road_picture import road_picture

from benchmarks.vision.classify_stills import main
from models.training.data import COLUMNS, LABELS, MANIFEST
from scenarios.stills import classify_pictures


@pytest.fixture
def folder(tmp_path):
    """One road in all sets, called what the command calls it but in one, and a covered lens."""
    road, covered = road_picture(960, 600, colour=True), np.full((600, 960, 3), 70, np.uint8)
    cv2.imwrite(str(tmp_path / "road.png"), road)
    found = classify_pictures([tmp_path / "road.png"])[0]["class"][0]
    name = next(label for label, surface in LABELS.items() if surface.label == found)
    other = next(label for label in LABELS if label != name)
    files = {
        "condition_web/val.png": ("val", name, road),
        "condition_web/test.png": ("test", name, road),
        "condition_web/covered.png": ("test", other, covered),
        "other_cameras/one/test.png": ("test", other, road),
        "street_conditions/dry/sidhardha36_day.png": ("val", name, road),
        "street_conditions/dry/sidhardha36_night.png": ("val", name, road),
    }
    rows = []
    for file, (split, label, picture) in files.items():
        path = tmp_path / file
        path.parent.mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(path), picture)
        rows.append(
            {
                "file": file,
                "split": split,
                "task": "cls",
                "label": label,
                "sequence_id": file,
                "width": 960,
                "height": 600,
                "notes": "night" if "night" in file else "",
            }
        )
    with (tmp_path / MANIFEST).open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, (*COLUMNS, "notes"), restval="", extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    return tmp_path


def test_a_refused_picture_counts_as_wrong(folder, capsys):
    main(["--data", str(folder)])
    lines = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in capsys.readouterr().out.splitlines()
    ]
    shares = {line[0]: [cell.split(" ")[0] for cell in line[1:]] for line in lines if len(line) == 6}
    assert shares["web stills, validation"][:2] == ["1", "1.000"]
    assert shares["web stills, test"][:2] == ["2", "0.500"]
    assert sorted(shares["web stills, test"][2:]) == ["-", "0.000", "1.000"]
    assert shares["other cameras, test"][:2] == ["1", "0.000"]
    for hour in ("day", "night"):
        assert shares[f"dash cameras by {hour}, validation"][:2] == ["1", "1.000"]
    by_confidence = [line for line in lines if line and line[0].startswith("above")]
    assert sum(int(line[1]) for line in by_confidence) == 5


def test_a_folder_without_one_of_the_sets_is_refused_by_name(folder):
    file = folder / MANIFEST
    kept = [line for line in file.read_text(encoding="utf-8").splitlines() if "other_cameras" not in line]
    file.write_text("\n".join(kept) + "\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"no test pictures for 'other cameras, test'"):
        main(["--data", str(folder)])
