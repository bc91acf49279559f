"""The image-based fusion estimator on pictures whose truth is known at every pixel.

Road is painted in one grey per class, and the stand-in classifier reads the middle of a patch: what is tested is
where the estimator looks, and what it makes of what it is told. The trained networks come last.
"""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from ife_scene import (
    ALL_ROAD,
    CAMERA,
    DRY,
    NONE,
    PAINT,
    SNOW,
    WET,
    Masks,
    Middle,
    grained,
    half,
    paint,
    plain,
)
from long import beyond
from numpy.testing import assert_allclose

from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.evidence import EvidenceState, WeightLaw
from trpac_core.vision.ife import PICTURE_SAY, Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError
from trpac_core.vision.networks import RoadMasks, Segmenter, SurfaceClassifier
from trpac_core.vision.roi_sampling import road_shares
from trpac_core.vision.trajectory import Motion
from trpac_core.vision.voting import Voting, VotingConfig

MODELS = Path(__file__).parents[2] / "models"


def run(image, *, config=None, masks=None, classifier=None, motion=None, state=None, **options):
    ife = Ife(config or IfeConfig(), masks or Masks(), classifier or Middle())
    return ife.process(state or IfeState(), image, motion or Motion(10.0), **options)


@pytest.mark.parametrize("surface", list(Surface))
@pytest.mark.parametrize("speed_m_s", [0.0, 3.0, 30.0])
def test_plain_road(surface, speed_m_s):
    state, result = run(plain(surface), motion=Motion(speed_m_s))
    assert result.surface is surface
    assert result.flag
    assert result.p_util == 1.0
    assert result.Q_v == pytest.approx(result.P_fusion)
    assert result.probabilities[surface] == result.P_fusion > 0.99
    assert [group.n_roi for group in result.groups] == [4, 6, 8]
    assert state.frame_count == 1
    assert all(max(group.weights) == group.weights[surface] for group in state.evidence)


def test_patches_keep_off_what_is_no_road_beside_the_wheels_way():
    """A kerb close to the left wheel: of 1.2 m around its track, a third is no road, and a patch lies where less is."""
    road = NONE.copy()
    rows, columns = np.mgrid[0:160, 0:256]
    ground_m = CAMERA.image_to_ground((np.column_stack((columns.ravel(), rows.ravel())) + 0.5) * 7.5)
    road.ravel()[ground_m[:, 1] < 0.95] = 1.0
    _, kept = run(plain(DRY), masks=Masks(road), with_view=True)
    _, free = run(plain(DRY), with_view=True)
    shares = [
        np.concatenate([road_shares(group.boxes_px, road > 0.5, 1920, 1200) for group in result.view.groups])
        for result in (kept, free)
    ]
    assert [len(part) for part in shares] == [18, 18]
    assert shares[0].min() >= 0.7 > shares[1].min()
    assert shares[0].mean() > shares[1].mean() + 0.02


@pytest.mark.parametrize("group", [0, 1, 2])
def test_a_groups_patches_are_evenly_spread_in_width_at_the_same_places(group):
    image = np.random.default_rng(0).integers(0, 255, (CAMERA.height_px, CAMERA.width_px, 3)).astype(np.uint8)
    alike, spread = (
        Ife(IfeConfig(roi_spread=s), Masks(), Middle()).look(
            IfeState(), image, Motion(10.0), CAMERA, Masks().masks, np.ones((160, 256), np.bool_)
        )[group]
        for s in (1.0, 1.5)
    )
    (left, right), (from_left, to_right) = (part.boxes[:, ::2].T for part in (alike, spread))
    assert_allclose(from_left + to_right, left + right, atol=2)
    factors = (to_right - from_left) / (right - left)
    assert_allclose(factors, 1.5 ** np.linspace(-1.0, 1.0, len(factors)), rtol=0.02, err_msg="whole pixels")


def test_patches_cannot_be_spread_by_less_than_nothing():
    with pytest.raises(ValueError, match="roi_spread must be 1"):
        IfeConfig(roi_spread=0.9)


def test_each_group_speaks_of_its_own_stretch_of_road():
    picture = paint(lambda x, y: np.where(x < 4.6, DRY, np.where(x < 7.4, WET, SNOW)))
    _, result = run(picture)
    assert [group.surface for group in result.groups] == [DRY, WET, SNOW]
    assert result.surface is DRY


def test_each_side_speaks_of_its_own_track():
    picture = paint(lambda x, y: np.where(y > 0.0, SNOW, DRY))
    for side, surface in {"left": SNOW, "right": DRY}.items():
        _, result = run(picture, config=IfeConfig(side=side))
        assert result.near.surface is surface
        assert result.groups[1].surface is surface


def test_patches_follow_the_steered_path():
    picture = paint(lambda x, y: np.where(y > 1.9, SNOW, DRY))
    config = IfeConfig(side="left")
    far = {
        name: run(picture, config=config, motion=motion)[1].groups[2].surface
        for name, motion in {
            "straight": Motion(10.0),
            "left": Motion(10.0, steering_angle_rad=0.14),
            "left by yaw rate": Motion(10.0, yaw_rate_rad_s=0.6),
            "right": Motion(10.0, steering_angle_rad=-0.14),
        }.items()
    }
    assert far == {"straight": DRY, "left": SNOW, "left by yaw rate": SNOW, "right": DRY}


def test_shadow_lowers_the_confidence_of_the_shadowed_side_only():
    masks = Masks(shadow=half(left=True))
    _, left = run(plain(DRY), config=IfeConfig(side="left"), masks=masks)
    _, right = run(plain(DRY), config=IfeConfig(side="right"), masks=masks)
    _, both = run(plain(DRY), masks=masks)
    assert (left.p_util, left.flag, left.near.n_roi) == (0.0, False, 0)
    assert (right.p_util, right.flag, right.near.n_roi) == (1.0, True, 4)
    assert both.p_util == pytest.approx(0.5, abs=0.03)
    assert both.Q_v == pytest.approx(both.p_util * both.P_fusion)


def test_no_patch_lies_in_the_shadow():
    # Painted wet where the shadow lies: a single patch there would show in the classes.
    picture = plain(DRY)
    picture[:, :960] = PAINT[WET]
    _, result = run(picture, masks=Masks(shadow=half(left=True)), with_view=True)
    for group in result.view.groups:
        assert len(group.probabilities) >= 4
        assert (group.probabilities.argmax(axis=1) == DRY).all()


def test_road_that_is_not_drivable_is_of_no_use_either():
    _, result = run(plain(DRY), masks=Masks(drivable=half(left=False)))
    assert result.p_util == pytest.approx(0.5, abs=0.03)


def test_without_usable_road_history_answers_and_the_flag_is_down():
    snowy = EvidenceState((0.3, 0.3, 0.4))
    state = IfeState((snowy,) * 3, frame_count=7)
    after, result = run(plain(DRY), masks=Masks(shadow=ALL_ROAD), state=state)
    assert result.surface is SNOW
    assert result.probabilities == snowy.weights
    assert (result.flag, result.Q_v, result.near.n_roi) == (False, 0.0, 0)
    assert after.evidence == state.evidence
    assert after.frame_count == 8


class HalfBlind(Middle):
    """Reads the left half of its patches only."""

    def __init__(self, share):
        super().__init__()
        self.share = share

    def readable(self, grey):
        return (np.arange(len(grey)) < self.share * len(grey)).astype(float)


@pytest.mark.parametrize("share", [1.0, 0.5, 0.25, 0.0])
def test_patches_that_cannot_be_read_are_left_out_and_lower_p_util(share):
    result = run(
        paint(lambda x, y: np.zeros(len(x))),
        classifier=HalfBlind(share),
        config=IfeConfig(groups_looked_at=1),
    )[1]
    assert result.near.n_roi == round(4 * share)
    assert result.near.p_util == pytest.approx(share, abs=0.02)
    assert result.flag == (share == 1.0)


def test_one_usable_corner_is_no_evidence_however_sure_history_is():
    snowy = IfeState((EvidenceState((0.01, 0.01, 0.98)),) * 3)
    one_corner = IfeConfig(side="right", a_m=0.7, ranges_m=((3.4, 3.6), (4.5, 7.5), (7.5, 12.0)))
    _, result = run(plain(DRY), config=one_corner, state=snowy)
    assert (result.near.n_ell, result.near.n_rs, result.near.n_roi) == (1, 0, 0)
    assert result.Q_v > 0.5
    assert result.surface is SNOW
    assert not result.flag


def test_confidence_threshold():
    masks = Masks(shadow=half(left=True))
    low = IfeConfig(flag_threshold=0.4)
    assert run(plain(DRY), masks=masks, config=low)[1].flag
    assert not run(plain(DRY), masks=masks, config=replace(low, flag_threshold=0.6))[1].flag


def test_each_switch_leaves_out_its_part():
    shadowed = Masks(shadow=half(left=True))
    assert run(plain(DRY), masks=shadowed, config=IfeConfig(remove_shadow=False))[1].p_util == 1.0

    unsure = Middle(temperature=10.0)
    calibrated = run(plain(WET), classifier=unsure)[1].P_fusion
    raw = run(plain(WET), classifier=unsure, config=IfeConfig(calibrate=False))[1].P_fusion
    assert calibrated < 0.8 < 0.99 < raw

    split = paint(lambda x, y: np.where(y > 0.0, SNOW, DRY))
    history = IfeState((EvidenceState((0.01, 0.01, 0.98)),) * 3)
    law = WeightLaw(sigma=0.0, sigmoid_centre=0.5, sigmoid_slope=10.0)
    faint = Middle(certainty=0.3)
    by_history, without = (
        run(split, state=history, classifier=faint, config=IfeConfig(weight_law=law, weight_evidence=w))[1]
        for w in (True, False)
    )
    assert by_history.groups[2].probabilities[SNOW] > without.groups[2].probabilities[SNOW]

    # Snow everywhere but in the tracks: only without a trajectory does the verge of the lane have a say.
    tracks = paint(lambda x, y: np.where(np.abs(np.abs(y) - 0.678) < 0.6, DRY, SNOW))
    assert run(tracks)[1].surface is DRY
    everywhere = [
        run(tracks, config=IfeConfig(use_trajectory=False, seed=seed), with_view=True)[1].view.groups[2]
        for seed in range(5)
    ]
    assert any((group.probabilities.argmax(axis=1) == SNOW).any() for group in everywhere)


def test_without_trajectory_the_verge_is_no_loss_of_usable_area():
    config = IfeConfig(use_trajectory=False)
    assert run(plain(DRY), config=config, masks=Masks(drivable=half(left=False)))[1].p_util == 1.0
    assert run(plain(DRY), config=config, masks=Masks(shadow=half(left=True)))[1].p_util == pytest.approx(
        0.5, abs=0.03
    )


def test_a_run_repeats_and_continues_from_json():
    rng = np.random.default_rng(3)
    picture = rng.integers(0, 256, (1200, 1920, 3), dtype=np.uint8)
    ife = Ife(IfeConfig(), Masks(), Middle())
    state = IfeState()
    for _ in range(3):
        state, _ = ife.process(state, picture, Motion(8.0))
    restored = IfeState.from_json(json.loads(json.dumps(state.to_json())))
    assert restored == state
    on, result = ife.process(state, picture, Motion(8.0))
    assert Ife(IfeConfig(), Masks(), Middle()).process(restored, picture, Motion(8.0)) == (on, result)
    assert on != state


def test_seed_and_frame_change_the_patches():
    def boxes(seed, frame):
        state = IfeState(frame_count=frame)
        _, result = run(plain(DRY), config=IfeConfig(seed=seed), state=state, with_view=True)
        return result.view.groups[1].boxes_px.tolist()

    assert boxes(0, 0) == boxes(0, 0)
    assert boxes(0, 0) != boxes(0, 1) != boxes(1, 1)


def test_picture_at_another_scale_and_pictures_that_do_not_fit():
    picture = paint(lambda x, y: np.where(x < 4.6, DRY, np.where(x < 7.4, WET, SNOW)))
    small = cv2.resize(picture, (960, 600), interpolation=cv2.INTER_AREA)
    _, result = run(small)
    assert [group.surface for group in result.groups] == [DRY, WET, SNOW]
    with pytest.raises(ImageError, match=r"1920 x 1080 .*camera file says 1920 x 1200"):
        run(picture[:1080])
    with pytest.raises(ImageError, match=r"shape \(1200, 1920\)"):
        run(picture[..., 0])
    with pytest.raises(ImageError, match="float64"):
        run(picture.astype(float))


def test_shared_masks_are_not_computed_again():
    masks = Masks(shadow=ALL_ROAD)
    run(plain(DRY), masks=masks)
    assert masks.calls == 1
    ife = Ife(IfeConfig(), masks, Middle())
    _, result = ife.process(IfeState(), plain(DRY), Motion(5.0), masks=RoadMasks(ALL_ROAD, NONE))
    assert masks.calls == 1
    assert result.p_util == 1.0


def test_view_is_where_the_patches_were_cut():
    classifier = Middle()
    picture = np.random.default_rng(5).integers(0, 256, (1200, 1920, 3), dtype=np.uint8)
    _, result = run(picture, classifier=classifier, with_view=True)
    boxes = np.concatenate([group.boxes_px for group in result.view.groups])
    for (left, top, right, bottom), patch in zip(boxes, classifier.patches, strict=True):
        region = picture[top:bottom, left:right]
        assert (cv2.resize(region, (96, 64), interpolation=cv2.INTER_AREA) == patch).all()
    near, far = result.view.groups[0].outlines_px, result.view.groups[2].outlines_px
    assert near[..., 1].mean() > far[..., 1].mean(), "the near group is lower in the picture"
    assert run(picture)[1].view is None


def test_distorted_lens():
    camera = Camera(distortion=(-0.3, 0.1, 0.001, -0.001, 0.0))
    picture = paint(lambda x, y: np.where(x < 4.6, DRY, np.where(x < 7.4, WET, SNOW)), camera)
    _, result = run(picture, config=IfeConfig(camera=camera))
    assert [group.surface for group in result.groups] == [DRY, WET, SNOW]


def test_wrong_settings_are_reported_together():
    with pytest.raises(ValueError, match=r"side must be.*0 < k1 < k2.*sigma"):
        IfeConfig(side="middle", k1=1.0, weight_law=WeightLaw(sigma=2.0))
    for law in (
        WeightLaw(0.5, 1.0, 2000.0),
        WeightLaw(sigmoid_slope=-1.0),
        WeightLaw(sigmoid_centre=float("nan")),
    ):
        with pytest.raises(ValueError, match="sigmoid"):
            IfeConfig(weight_law=law)


def test_the_picture_as_a_whole_has_its_say_in_every_patch_unless_left_out():
    """A unit of the picture's logits is as good as PICTURE_SAY of a patch's."""
    picture = plain(WET)
    for certainty, found in ((PICTURE_SAY + 0.01, WET), (PICTURE_SAY - 0.01, SNOW)):
        seen = Masks(surface=(0.0, 0.0, 1.0)), Middle(certainty=certainty)
        _, result = Ife(IfeConfig(), *seen).process(IfeState(), picture, Motion(5.0))
        assert result.surface == found
        assert Voting(VotingConfig(), *seen).process(0, picture).surface == found
        _, alone = Ife(IfeConfig(use_scene=False), *seen).process(IfeState(), picture, Motion(5.0))
        assert alone.surface == WET


def test_vote_counts_the_whole_drivable_area_with_its_shadow():
    picture = paint(lambda x, y: np.where(np.abs(y) < 1.3, DRY, SNOW))
    road = NONE.copy()
    road[90:] = 1.0
    voting = Voting(VotingConfig(), Masks(road, ALL_ROAD), Middle())
    shares = [voting.process(frame, plain(WET)) for frame in range(3)]
    assert all((vote.surface, vote.share, vote.n_roi) == (WET, 1.0, 18) for vote in shares)
    assert {voting.process(frame, picture).share for frame in range(20)} != {1.0}
    assert voting.process(3, picture) == voting.process(3, picture)
    assert Voting(VotingConfig(), Masks(NONE), Middle()).process(0, picture).surface is None
    sides = paint(lambda x, y: np.where(y > 0.0, SNOW, DRY))
    left = Voting(VotingConfig(), Masks(half(left=True)), Middle()).process(0, sides)
    assert (left.surface, left.share) == (SNOW, 1.0)


def rendered(segments, look, position_m=0.0):
    return Renderer(CAMERA, segments, look).frame(position_m)


@pytest.mark.parametrize("position_m", [0.0, 3.0, 6.0])
def test_where_the_renderer_puts_a_change_of_surface_the_estimator_finds_it(position_m):
    """Two independent geometries: the renderer's labels, painted, through the estimator's projection."""
    frame = rendered([SurfaceSegment(0.0, DRY), SurfaceSegment(10.6, SNOW)], Scene(seed=4), position_m)
    picture = grained(np.repeat(PAINT[np.maximum(frame.surface, 0)][..., None], 3, axis=2))
    drivable = cv2.resize(frame.drivable.astype(np.float32), (256, 160), interpolation=cv2.INTER_AREA)
    _, result = run(picture, masks=Masks(drivable), with_view=True)
    change_m = 10.6 - position_m
    for group, view in zip(result.groups, result.view.groups, strict=True):
        low, high = group.range_m
        if high < change_m - 0.5:
            assert group.surface is DRY
            assert (view.probabilities.argmax(axis=1) == DRY).all()
        if low > change_m + 0.5:
            assert group.surface is SNOW
            assert (view.probabilities.argmax(axis=1) == SNOW).all()


@pytest.mark.parametrize("surface", beyond(1, [Surface.WET, Surface.DRY, Surface.SNOW_ICE]))
@pytest.mark.parametrize("sky", beyond(1, ["overcast", "clear"]))
def test_trained_networks_on_rendered_road(surface, sky):
    """Plainly dry, plainly wet, plainly snowy: most frames carry the flag, and all that do are right."""
    files = MODELS / "segmenter.onnx", MODELS / "surface.onnx"
    if missing := [file.name for file in files if not file.is_file()]:
        pytest.skip(f"needs the trained networks: {missing} not in models/")
    ife = Ife(IfeConfig(), Segmenter(files[0]), SurfaceClassifier(files[1]))
    light = {"sky": sky, "sun_share": 0.0 if sky == "overcast" else 0.8}
    look = Scene(seed=11, water_film=0.95, puddles=0.8, **light)
    renderer = Renderer(CAMERA, [SurfaceSegment(0.0, surface)], look)
    state, results = IfeState(), []
    for position_m in (0.0, 6.0, 12.0, 18.0, 24.0):
        state, result = ife.process(state, renderer.frame(position_m).image, Motion(10.0))
        results.append(result)
    verdicts = [
        (result.surface.label, round(result.p_util, 2), round(result.near.m_0, 2)) for result in results
    ]
    believed = [result.surface for result in results if result.flag]
    assert set(believed) == {surface}, verdicts
    assert len(believed) >= 3, verdicts


@pytest.mark.parametrize("grey", [0, 90, 255])
def test_a_camera_that_sees_nothing_keeps_the_flag_down(grey):
    state, _ = run(plain(WET))
    _, result = run(np.full((1200, 1920, 3), grey, np.uint8), state=state)
    assert result.near.n_roi == 0
    assert not result.flag
    assert result.surface is WET  # what history says


def test_the_near_group_alone_gives_the_same_verdicts_bit_by_bit():
    """The trained networks, over frames whose history matters: what the units leave out is not missed."""
    networks = Segmenter(MODELS / "segmenter.onnx"), SurfaceClassifier(MODELS / "surface.onnx")
    camera = CAMERA.scaled(0.5)
    renderer = Renderer(camera, [SurfaceSegment(0.0, WET), SurfaceSegment(8.0, DRY)], Scene(seed=3))
    whole = Ife(IfeConfig(camera=camera), *networks)
    near = Ife(IfeConfig(camera=camera, groups_looked_at=1), *networks)
    states = IfeState(), IfeState()
    for place_m in (0.0, 3.0, 6.0):
        image, motion = renderer.frame(place_m).image, Motion(12.0, 0.5, 0.01)
        (left, seen), (right, alone) = (
            ife.process(state, image, motion) for ife, state in zip((whole, near), states, strict=True)
        )
        states = left, right
        assert len(alone.groups) == 1
        assert alone.near == seen.near
        assert right.evidence[0] == left.evidence[0]
    with pytest.raises(ValueError, match="groups_looked_at must be 1, 2 or 3"):
        IfeConfig(groups_looked_at=0)
