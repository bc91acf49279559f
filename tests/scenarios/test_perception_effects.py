from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from scenarios.effects import EFFECTS
from scenarios.effects.camera_pitch import seen_distance_m
from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, VehicleFile, load_vehicle
from scenarios.perception import NORMAL_CONFIDENCE, WRONG_SHARE, perceive, plain_frames, surfaces_at
from scenarios.plant.pipeline import simulate
from trpac_core.vision.camera import Camera

CAR = load_vehicle(Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml")
IDS = tuple(key for key, effect in EFFECTS.items() if effect.stage == "perception")
ROAD = RoadFile.model_validate(
    {
        "schema": 1,
        "segments": [
            {"start_m": 60.0 * k, "mu_left": mu, "mu_right": mu, "surface": surface}
            for k, (mu, surface) in enumerate([(0.9, "dry"), (0.3, "snow_ice"), (0.5, "wet"), (0.9, "dry")])
        ],
    }
)
COLUMNS = ("frame_id", "image_class", "image_confidence", "image_from_m", "image_to_m")


def car_with(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


def roll(speed_m_s=20.0, duration_s=10.0, rate_hz=200.0):
    """Rolling freely: nothing slows the plain car."""
    steps = round(duration_s * rate_hz) + 1
    return simulate(car_with(), ROAD, np.zeros((steps, 4)), 1.0 / rate_hz, speed_m_s)


def look(speed_m_s=20.0, fps=20.0, seed=3, **effects):
    return perceive(roll(speed_m_s), ROAD, car_with(**effects), fps=fps, seed=seed)


def frames_of(columns):
    """First row of each result."""
    there = np.flatnonzero(np.isfinite(columns["frame_id"]))
    new = there[np.unique(columns["frame_id"][there], return_index=True)[1]]
    return {name: values[new] for name, values in columns.items()}


def first_place(columns, surface):
    """Where the classes go over to a surface for good: the least wrong split of the stamps."""
    frames = frames_of(columns)
    middle = 0.5 * (frames["image_from_m"] + frames["image_to_m"])
    near = np.abs(middle - {2: 60.0, 1: 120.0}[surface]) < 20.0
    middle, is_new = middle[near], frames["image_class"][near] == surface
    wrong = [is_new[:k].sum() + (~is_new[k:]).sum() for k in range(len(middle) + 1)]
    return middle[int(np.argmin(wrong))]


def test_all_five_are_in_the_library():
    assert set(IDS) == {
        "camera_latency",
        "camera_pitch",
        "exposure_shift",
        "motion_blur",
        "class_friction_offset",
    }
    assert {EFFECTS[key].subsystem for key in IDS} == {"camera"}


@pytest.mark.parametrize("effect_id", IDS)
def test_neutral_values_leave_every_column_as_it_is(effect_id):
    neutral = {p.name: p.neutral_value(CAR.to_core()) for p in EFFECTS[effect_id].parameters()}
    plain, same = look(), look(**{effect_id: neutral})
    for name, values in plain.items():
        assert np.array_equal(values, same[name], equal_nan=True), name


@pytest.mark.parametrize("effect_id", IDS)
def test_starts_lie_within_the_bounds_and_change_the_columns(effect_id):
    plain = look(20.0, fps=400.0)
    for p in EFFECTS[effect_id].parameters():
        low, high = p.bounds(CAR.to_core())
        for start in p.start_values(CAR.to_core()):
            assert low < start < high
            others = {q.name: q.neutral_value(CAR.to_core()) for q in EFFECTS[effect_id].parameters()}
            changed = look(20.0, fps=400.0, **{effect_id: {**others, p.name: start}})
            assert any(not np.array_equal(x, changed[n], equal_nan=True) for n, x in plain.items())


def test_columns_of_a_plain_drive():
    columns = look(fps=20.0)
    frames = frames_of(columns)
    assert set(columns) == {*COLUMNS, "mu_reference"}
    assert len(frames["frame_id"]) == pytest.approx(10.0 * 20.0, abs=1)
    # the near end lies P_0 ahead of the front axle, the length is the way of a frame interval
    assert frames["image_to_m"] - frames["image_from_m"] == pytest.approx(1.0, rel=1e-3)
    assert frames["image_from_m"][1:] == pytest.approx(frames["image_to_m"][:-1], abs=1e-6)
    begin = roll().position_m[np.isfinite(columns["frame_id"])][0]
    assert frames["image_from_m"][0] - begin == pytest.approx(
        2.5 + CAR.to_core().cog_to_front_axle_m, abs=0.2
    )
    right = surfaces_at(ROAD, 0.5 * (frames["image_from_m"] + frames["image_to_m"])) == frames["image_class"]
    assert 1.0 - right.mean() == pytest.approx(WRONG_SHARE, abs=0.025)
    assert np.median(frames["image_confidence"]) == pytest.approx(NORMAL_CONFIDENCE, abs=0.02)


def test_before_the_first_result_there_is_none():
    columns = look(fps=2.0)
    before = ~np.isfinite(columns["frame_id"])
    assert before.any()
    assert (columns["image_class"][before] == -1).all()
    assert np.isnan(columns["image_from_m"][before]).all()
    assert (columns["image_class"][~before] >= 0).all()


def test_the_same_seed_gives_the_same_columns():
    a, b, other = look(seed=5), look(seed=5), look(seed=6)
    assert all(np.array_equal(a[n], b[n], equal_nan=True) for n in a)
    assert not np.array_equal(a["image_confidence"], other["image_confidence"], equal_nan=True)


def test_a_frame_rate_of_nothing_is_refused():
    with pytest.raises(ScenarioError, match="fps is 0"):
        perceive(roll(), ROAD, CAR, fps=0.0)


@pytest.mark.parametrize("speed", [8.0, 20.0])
def test_latency_moves_the_stamps_by_the_way_driven_meanwhile(speed):
    delay = 0.2
    duration = roll(speed).time_s[-1]
    plain, late = frames_of(look(speed)), frames_of(look(speed, camera_latency={"delay_s": delay}))
    arrived = len(late["frame_id"])
    assert arrived == pytest.approx((duration - delay) * 20.0, abs=1)
    moved = late["image_from_m"] - plain["image_from_m"][:arrived]
    assert moved == pytest.approx(speed * delay, rel=1e-3)
    assert np.array_equal(late["image_class"], plain["image_class"][:arrived])
    assert late["image_confidence"] == pytest.approx(plain["image_confidence"][:arrived])


def test_latency_and_pitch_move_a_change_of_class_and_only_one_with_speed():
    latency, pitch = {"delay_s": 0.3}, {"pitch_rad": 0.15}
    shift = {
        (name, v): first_place(look(v, fps=40.0, **{name: values}), 2) - first_place(look(v, fps=40.0), 2)
        for name, values in {"camera_latency": latency, "camera_pitch": pitch}.items()
        for v in (8.0, 24.0)
    }
    for v in (8.0, 24.0):
        assert shift["camera_latency", v] == pytest.approx(0.3 * v, abs=1.1 * v / 40.0)
        assert shift["camera_pitch", v] == pytest.approx(0.85, abs=1.1 * v / 40.0)


@pytest.mark.parametrize("pitch", [-0.1, -0.02, 0.05, 0.2])
@pytest.mark.parametrize("distance", [1.5, 2.9, 8.0])
def test_pitch_geometry_is_the_projection_through_two_cameras(pitch, distance):
    """What the real camera shows at a pixel is stamped with the distance that the camera file gives that pixel."""
    file = Camera(pitch_rad=0.1)
    real = Camera(pitch_rad=0.1 + pitch)
    stamped = np.array([[distance + file.x_from_front_axle_m, 0.0]])
    truly = real.image_to_ground(file.ground_to_image(stamped))[0, 0] - file.x_from_front_axle_m
    assert seen_distance_m(np.array(distance), file.height_m, pitch) == pytest.approx(truly, rel=1e-6)


@pytest.mark.parametrize("pitch", [-0.06, 0.06])
def test_either_end_of_a_stretch_is_seen_where_the_pitched_camera_looks(pitch):
    frames = plain_frames(roll(25.0), CAR, 20.0, Camera(), np.random.default_rng(0))
    stamped, height_m = frames.stamped_m, frames.camera_height_m
    seen = EFFECTS["camera_pitch"](pitch).perceive(frames).seen_m
    assert np.ptp(stamped, axis=1) == pytest.approx(25.0 / 20.0, rel=1e-3)
    assert seen == pytest.approx(height_m / np.tan(np.arctan(height_m / stamped) + pitch))
    assert (np.sign(stamped - seen) == np.sign(pitch)).all()


def test_pitch_towards_the_sky_stays_finite():
    assert np.isfinite(seen_distance_m(np.array([2.9, 100.0]), 1.4, -0.4)).all()


def test_latency_and_pitch_do_not_mind_each_others_order():
    random = np.random.default_rng(0)
    frames = plain_frames(roll(), CAR, 20.0, Camera(), random)
    late, tilted = EFFECTS["camera_latency"](0.1), EFFECTS["camera_pitch"](0.05)
    one, other = late.perceive(tilted.perceive(frames)), tilted.perceive(late.perceive(frames))
    for field in fields(one):
        assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name


@pytest.mark.parametrize("stops", [-3.0, 2.0])
def test_exposure_lowers_confidence_at_all_speeds_and_classes_err(stops):
    share = np.exp(-((stops / 4.3) ** 2))
    for speed in (8.0, 24.0):
        plain = frames_of(look(speed, fps=40.0))
        wrong = frames_of(look(speed, fps=40.0, exposure_shift={"stops": stops}))
        assert wrong["image_confidence"] == pytest.approx(share * plain["image_confidence"])
        middle = 0.5 * (wrong["image_from_m"] + wrong["image_to_m"])
        error = (surfaces_at(ROAD, middle) != wrong["image_class"]).mean()
        assert error == pytest.approx(1.0 - (1.0 - WRONG_SHARE) * share, abs=0.08)


def test_blur_lowers_confidence_with_speed_times_exposure():
    exposure = 0.05
    for speed in (8.0, 24.0):
        plain = frames_of(look(speed))
        blurred = frames_of(look(speed, motion_blur={"exposure_s": exposure}))
        ratio = blurred["image_confidence"] / plain["image_confidence"]
        assert ratio == pytest.approx(np.exp(-speed * exposure / 4.0), rel=1e-3)


def test_class_friction_offset_changes_the_reference_and_leaves_the_places():
    plain, offset = look(), look(class_friction_offset={"dry": 0.7, "wet": 0.8, "snow_ice": 0.25})
    for name in COLUMNS:
        assert np.array_equal(plain[name], offset[name], equal_nan=True)
    front = surfaces_at(ROAD, roll().position_m + CAR.to_core().cog_to_front_axle_m)
    expected = np.array([0.7, 0.8, 0.25])[front] - np.array([0.8, 0.6, 0.2])[front]
    assert offset["mu_reference"] - plain["mu_reference"] == pytest.approx(expected, abs=1e-12)
    assert plain["mu_reference"] == pytest.approx(np.array([0.8, 0.6, 0.2])[front], abs=0.06)
