"""The camera's benchmark: what is true of a frame, what counts as wrong, and how sure the shares are."""

from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from benchmarks.vision.table4 import __main__ as command
from benchmarks.vision.table4 import drives
from benchmarks.vision.table4.clips import ASSUMED, AssumedFile, camera_over
from benchmarks.vision.table4.judge import COLUMNS, Networks, judged, near_corners, within
from benchmarks.vision.table4.report import Measured, tables
from benchmarks.vision.table4.scores import blocks_of, confusion, gate, n_w, share, wilson
from benchmarks.vision.table4.sequences import Sequence, majority
from models.training.rendered import SEED_RANGES
from scenarios.camera.renderer import Renderer
from scenarios.library import networks_folder
from scenarios.strict import load_strict
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.networks import RoadMasks
from trpac_core.vision.roi_sampling import LEAST_ROI_WIDTH_PX, cut_box, project
from trpac_core.vision.trajectory import Motion

SOURCES = load_strict(ASSUMED, AssumedFile).sources


@pytest.fixture(scope="module")
def networks():
    return Networks.load(networks_folder())


def seen(camera, usable=((0.0, 0.0, 1.0, 1.0),)):
    return Sequence("s", "s", "full", camera, Motion(10.0), (), usable)


def test_drives_repeat_and_share_no_seed_with_training():
    first = [drives.plan(drives.FIRST_SEED + n) for n in range(12)]
    assert first == [drives.plan(drives.FIRST_SEED + n) for n in range(12)]
    assert {tuple(s.surface for s in plan.segments) for plan in first} == set(drives.PAIRS)
    assert sum(plan.likely_weather for plan in first) == 6
    with pytest.raises(ValueError, match="belongs to a training split"):
        drives.plan(SEED_RANGES["test"][-1])


def test_a_drive_through_a_street_is_the_same_drive_in_open_shade():
    for seed in range(drives.FIRST_SEED, drives.FIRST_SEED + 4):
        open_land, street = drives.plan(seed), drives.plan(seed, streets=True)
        assert street.look.open_shade
        assert max(street.look.house_rise) > 0.0
        in_the_open = replace(street.look, open_shade=False, house_rise=(0.0, 0.0))
        assert replace(street, look=in_the_open) == open_land
        assert street == drives.plan(seed, streets=True)


def test_the_truth_of_ground_points_is_what_the_renderer_draws():
    plan = drives.plan(drives.FIRST_SEED + 1)
    frame = int(np.searchsorted(plan.places_m, plan.segments[1].start_m - 5.0))
    drawn = Renderer(plan.camera, plan.segments, plan.look).frame(
        float(plan.places_m[frame]), plan.lateral_m[frame], plan.heading_rad[frame]
    )
    ground = np.stack(np.meshgrid(np.arange(3.0, 9.0, 0.25), np.arange(-0.8, 0.9, 0.2)), -1).reshape(-1, 2)
    pixel = np.round(project(ground, plan.camera)).astype(int)
    inside = ((pixel >= 0) & (pixel < [plan.camera.width_px, plan.camera.height_px])).all(axis=1)
    shown = drawn.surface[pixel[inside, 1], pixel[inside, 0]]
    told = drives.surfaces_at(plan, frame, ground[inside])
    assert set(told) == {int(s.surface) for s in plan.segments}, "the change lies in view"
    # A pixel's corner may lie on the other side of the line: no more than that.
    assert np.mean(shown == told) > 0.97


def test_a_half_drawn_drive_is_drawn_anew_and_a_whole_one_is_not(tmp_path, monkeypatch):
    monkeypatch.setattr(drives, "FRAMES", 2)
    monkeypatch.setattr(drives, "SCALE", 0.1)
    told = []
    sequences, cpu_s = drives.rendered_drives(tmp_path, 1, lambda *counts: told.append(counts))
    files = [frame.path for frame in sequences[0].frames]
    assert told == [(1, 1)]
    assert cpu_s > 0.0
    before = [file.stat().st_mtime_ns for file in files]
    assert drives.rendered_drives(tmp_path, 1, lambda *_: None)[1] == cpu_s
    assert [file.stat().st_mtime_ns for file in files] == before
    (files[0].parent / drives.PLAN).unlink()
    drives.rendered_drives(tmp_path, 1, lambda *_: None)
    assert [file.stat().st_mtime_ns for file in files] != before


def test_at_a_border_the_larger_part_counts_and_of_two_halves_the_one_ahead():
    assert majority(np.array([0, 0, 1])) == (Surface.DRY, pytest.approx(2 / 3))
    assert majority(np.array([0, 0, 2, 2])) == (Surface.SNOW_ICE, 0.5)
    assert majority(np.array([2, 1, 0, 0, 1])) == (Surface.WET, 0.4)
    with pytest.raises(ValueError, match="outside the picture"):
        majority(np.empty(0, np.int64))


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: next(iter(source.rows)))
def test_assumed_cameras_look_where_the_pictures_may_be_judged(source, networks):
    sequence = seen(source.camera(), source.usable_shares())
    ground = near_corners(IfeConfig(camera=sequence.camera, groups_looked_at=1), networks, sequence)
    pixels = project(ground, sequence.camera) / [sequence.camera.width_px, sequence.camera.height_px]
    allowed = np.zeros(len(pixels), np.bool_)
    for left, top, right, bottom in sequence.usable:
        allowed |= ((pixels >= [left, top]) & (pixels < [right, bottom])).all(axis=1)
    assert np.ptp(ground[:, 0]) > 1.9, "the whole near group is in the picture"
    assert allowed.mean() > 0.95


def test_the_camera_over_a_road_box_puts_the_near_group_into_it(networks):
    box = (0.3, 0.6, 0.7, 0.9)
    camera = camera_over(box, 640, 400)
    ground = near_corners(IfeConfig(camera=camera, groups_looked_at=1), networks, seen(camera))
    columns, rows = (project(ground, camera) / [640, 400]).T
    assert box[0] - 0.02 < columns.min() < 0.36
    assert 0.64 < columns.max() < box[2] + 0.02
    assert box[1] - 0.02 < rows.min() < 0.64
    assert 0.86 < rows.max() < box[3] + 0.05


def test_what_may_not_be_judged_is_no_road():
    masks = RoadMasks(np.ones((160, 256), np.float32), np.zeros((160, 256), np.float32))
    kept = within(masks, seen(Camera(), ((0.25, 0.5, 0.5, 1.0),))).drivable
    assert kept[80:, 64:128].min() == 1.0
    assert kept.sum() == 80 * 64


def made_up(sequence, truth, found, flag=True, part="", method="IFE"):
    count = len(truth)
    rows = zip(range(count), truth, found, np.broadcast_to(flag, count), strict=True)
    return pd.DataFrame(
        [(sequence, "s", part, n, "normal", method, t, 1.0, f, bool(up), 0.9, 0.8) for n, t, f, up in rows],
        columns=list(COLUMNS),
    )


def test_wrong_frames_and_votes_without_road_count():
    table = made_up("a", [0, 0, 1, 2], [0, 1, 1, -1])
    assert n_w(table).value == 50.0
    assert confusion(table).tolist() == [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


def test_the_flag_is_worth_the_wrong_frames_that_it_holds_back():
    found = gate(made_up("a", [0] * 10, [1, 1, 1, 1] + [0] * 6, [0, 0, 0, 1, 0, 1, 1, 1, 1, 1]))
    assert {name: round(value.value, 2) for name, value in found.items()} == {
        "n_w, all frames": 40.0,
        "n_w, flag 1": 16.67,
        "wrong frames with flag 0": 75.0,
        "right frames with flag 0": 16.67,
    }


def test_blocks_are_whole_rendered_drives_and_pieces_of_real_ones():
    rendered = pd.concat([made_up("a", [0] * 60, [0] * 60), made_up("b", [0] * 60, [0] * 60)])
    assert len(np.unique(blocks_of(rendered))) == 2
    assert len(np.unique(blocks_of(made_up("a", [0] * 60, [0] * 60, part="val")))) == 3


def test_frames_that_are_wrong_together_make_the_interval_wide():
    hit = np.repeat([True, False, False, False], 50)
    alone, together = share(hit, np.arange(200)), share(hit, np.repeat(np.arange(8), 25))
    assert alone.value == together.value == 25.0
    # Binomial standard deviation 3.06 of 200 single frames, 15.3 of 8 blocks that are wholly right or wrong.
    assert alone.high - alone.low == pytest.approx(2 * 1.96 * 3.06, rel=0.1)
    assert together.high - together.low > 4 * (alone.high - alone.low)


def test_wilson_and_what_never_went_wrong():
    low, high = wilson(0.0, 10)
    assert (low, high) == (0.0, pytest.approx(0.2775, abs=1e-4))  # z^2 / (n + z^2)
    one_block = share(np.array([True, False]), np.zeros(2, np.int64))
    assert one_block.high - one_block.low > 80.0, "a single block says next to nothing"
    none_wrong = share(np.zeros(100, np.bool_), np.repeat(np.arange(10), 10))
    assert (none_wrong.value, none_wrong.high) == (0.0, pytest.approx(27.75, abs=0.01))
    assert str(share(np.empty(0, np.bool_), np.empty(0, np.int64))) == "-"


def test_the_command_judges_keeps_and_says_what_it_leaves_out(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(drives, "FRAMES", 2)
    monkeypatch.setattr(drives, "CHANGE_M", (4.0, 5.0))
    data = tmp_path / "data"
    clip = data / "seq_dry_yolop" / "input1"
    clip.mkdir(parents=True)
    rows = ["file,split,task,label,mask,sequence_id,licence,width,height"]
    for n in range(2):
        cv2.imwrite(
            str(clip / f"{n:03d}.jpg"),
            np.random.default_rng(n).integers(60, 140, (240, 320, 3)).astype(np.uint8),
        )
        rows.append(f"seq_dry_yolop/input1/{n:03d}.jpg,train,cls,dry,,yolop_input1,made,320,240")
    (data / "manifest.csv").write_text("\n".join(rows) + "\n")
    asked = [
        "--models",
        networks_folder(),
        "--data",
        data,
        "--frames-cache",
        tmp_path / "frames",
        "--out",
        tmp_path / "out",
    ]
    asked = [*map(str, asked), "--drives", "2", "--no-time"]

    command.main(asked)
    told = capsys.readouterr()
    assert "LEFT OUT of the tables: yolop: no networks in 'without_yolop'" in told.err
    assert "| rendered, likely weather |" in told.out
    assert "| yolop |" not in told.out
    kept = {f: f.stat().st_mtime_ns for f in (tmp_path / "out" / "verdicts").iterdir()}
    assert len(kept) == 4  # two drives, two scenarios

    command.main(asked)
    assert {f: f.stat().st_mtime_ns for f in kept} == kept, "verdicts of the first run are used again"


def test_a_folder_without_networks_is_refused(tmp_path):
    with pytest.raises(SystemExit, match="in its folder 'full'"):
        command.network_folders(tmp_path)


def test_kept_verdicts_are_read_as_they_were_written(tmp_path, monkeypatch, networks):
    monkeypatch.setattr(drives, "FRAMES", 2)
    monkeypatch.setattr(drives, "SCALE", 0.25)
    (sequence,), _ = drives.rendered_drives(tmp_path, 1, lambda *_: None)
    fresh = command._kept(sequence, networks_folder(), "w/ interference", tmp_path, lambda: networks)
    again = command._kept(
        sequence, networks_folder(), "w/ interference", tmp_path, lambda: pytest.fail("judged twice")
    )
    assert (fresh["found"] == judged(sequence, networks, "w/ interference")["found"]).all(), "a run repeats"
    pd.testing.assert_frame_equal(again, fresh)
    measured = Measured(
        again.assign(networks="full", consecutive=True), (), None, 0.0, 0.0, {"full": {"a": "b"}}
    )
    assert "| w/ interference | IFE | 12.8 | " in tables(measured)


def test_wider_patches_are_cut_wider(tmp_path, monkeypatch, networks):
    monkeypatch.setattr(drives, "FRAMES", 1)
    monkeypatch.setattr(drives, "SCALE", 0.25)
    (sequence,), _ = drives.rendered_drives(tmp_path, 1, lambda *_: None, first_seed=6_000_100)
    assert sequence.name == "6000100"
    cut = []
    monkeypatch.setattr(
        "trpac_core.vision.region.cut_box",
        lambda image, box: cut.append(box[2] - box[0]) or cut_box(image, box),
    )
    # The first corner of each patch, whatever it shows: a wider one might need another.
    monkeypatch.setattr("trpac_core.vision.region.with_most_road", lambda shares, count: np.arange(count))
    widths = {
        text: {"roi_width_m": width, "roi_spread": 1.7} for text, width in (("narrow", 1.0), ("wide", 2.0))
    }
    judged(replace(sequence, roi_scale=1.5), networks, "normal", widths)
    narrow, wide = np.array(cut[IfeConfig().b[0] :]).reshape(2, -1)  # the first for the near group's corners
    whole = wide < 0.75 * sequence.camera.width_px  # wider ones end with the picture
    assert_allclose(wide[whole], 2.0 * narrow[whole], atol=1)
    assert narrow.max() > LEAST_ROI_WIDTH_PX
