"""Scores of several networks on the same pictures, with an interval over both."""

import cv2
import numpy as np
import pytest

from benchmarks.vision.training_seeds import interval, main, rows
from models.training.data import COLUMNS, MANIFEST, Picture
from models.training.scores import wilson_interval
from trpac_core.vision.classes import Surface


def test_like_networks_count_as_one():
    """An interval over the same hits three times is the pictures' own: the normal one of a share."""
    hits = np.arange(400) % 4 > 0
    low, high = interval(np.tile(hits, (3, 1)))
    half = 1.96 * np.sqrt(0.75 * 0.25 / 400)
    assert (low, high) == pytest.approx((0.75 - half, 0.75 + half), abs=0.006)


def test_networks_that_differ_widen_the_interval():
    alike = np.tile(np.arange(400) % 4 > 0, (3, 1))
    unlike = np.array([np.arange(400) % 100 < share for share in (55, 75, 95)])
    assert unlike.mean() == pytest.approx(alike.mean())
    (low, high), (lower, higher) = interval(alike), interval(unlike)
    assert higher - lower > 2.0 * (high - low)


def test_where_all_is_right_few_pictures_still_say_little():
    assert interval(np.ones((3, 20), np.bool_)) == wilson_interval(20, 20)
    assert interval(np.zeros((3, 20), np.bool_)) == wilson_interval(0, 20)


class Guess:
    """Takes bright patches for snow and all others for dry."""

    temperature = 1.0

    def verdicts(self, patches, scene=None):
        class Said:
            logits = np.zeros((len(patches), 3))

        Said.logits[:, 2] = np.where(patches.mean(axis=(1, 2, 3)) > 128.0, 1.0, -1.0)
        return Said


def picture(folder, brightness, surface):
    path = folder / f"{surface.label}-{brightness}.png"
    cv2.imwrite(str(path), np.full((200, 200, 3), brightness, np.uint8))
    return Picture(path, "test", surface, None, "condition_web", "", "own")


def test_a_set_has_a_line_for_all_and_for_each_class_that_it_holds(tmp_path):
    snow = [picture(tmp_path, brightness, Surface.SNOW_ICE) for brightness in (100, 200, 220, 240)]
    lines = rows("set", [*snow, picture(tmp_path, 60, Surface.DRY)], [Guess(), Guess()])
    cells = [line.strip("| ").split(" | ")[1:5] for line in lines]
    assert cells == [
        ["accuracy", "5", "0.800", "0.800"],
        ["recall dry", "1", "1.000", "1.000"],
        ["recall snow_ice", "4", "0.750", "0.750"],
    ]


def test_a_folder_without_test_pictures_is_refused_by_name(tmp_path):
    (tmp_path / MANIFEST).write_text(",".join(COLUMNS) + "\n", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"no test pictures for 'stills, same search'.*condition_web"):
        main(["--data", str(tmp_path), "any.onnx"])
    (tmp_path / MANIFEST).unlink()
    with pytest.raises(SystemExit, match=r"manifest\.csv: not found"):
        main(["--data", str(tmp_path), "any.onnx"])
