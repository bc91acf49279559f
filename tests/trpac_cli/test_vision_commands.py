"""`trpac vision`: single pictures and drives through the command line, on the shipped networks."""

import json
import os
import struct
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
import schemas
import yaml
from hypothesis import given
from hypothesis import strategies as st
from long import long
from scipy.special import log_softmax, softmax
from typer.testing import CliRunner

from scenarios import overlay_video, stills
from scenarios.camera.renderer import Renderer
from scenarios.camera.scene import Scene, SurfaceSegment
from scenarios.library import networks_folder
from scenarios.stills import CLASSIFY_COLUMNS, StillNetworks, patch_logs
from scenarios.vision_runs import FRAME_COLUMNS, Frames, run_frames
from trpac_cli.main import app
from trpac_core.vision.camera import Camera
from trpac_core.vision.classes import Surface
from trpac_core.vision.ife import Ife, IfeState
from trpac_core.vision.ife_config import IfeConfig
from trpac_core.vision.images import ImageError, decode_image
from trpac_core.vision.networks import (
    PatchVerdicts,
    RoadMasks,
    Segmenter,
    SurfaceClassifier,
    calibrated_probabilities,
)
from trpac_core.vision.trajectory import Motion

SMALL = Camera().scaled(0.25)
POSITIONS_M = (0.0, 7.0, 14.0, 21.0, 28.0, 35.0)
"""Three places with dry road under the whole near group, and three with snow."""
SPEED_M_S, FPS = 14.0, 2.0
"""At which a car comes from each to the next."""

BROKEN = b"\xff\xd8\xff\xe0 not a picture"


def road(*segments):
    return Renderer(SMALL, [SurfaceSegment(at, surface) for at, surface in segments], Scene(seed=4))


@pytest.fixture(scope="module")
def pictures():
    drive = road((-5.0, Surface.DRY), (21.0, Surface.SNOW_ICE))
    return [drive.frame(position).image for position in POSITIONS_M]


@pytest.fixture
def folder(tmp_path, pictures):
    """Frames whose names sort wrongly by letters: f_8, f_9, f_10 ..."""
    path = tmp_path / "frames"
    path.mkdir()
    for number, image in enumerate(pictures, start=8):
        assert cv2.imwrite(str(path / f"f_{number}.png"), image)
    return path


@pytest.fixture
def camera_file(tmp_path):
    values = {"schema": 1, "distortion": [0.0] * 5}
    for key in ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "height_m", "fps"):
        values[key] = getattr(SMALL, key)
    for key in ("x_from_front_axle_m", "y_m", "pitch_rad", "yaw_rad", "roll_rad"):
        values[key] = getattr(SMALL, key)
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(values))
    return path


def trpac(*arguments):
    return CliRunner().invoke(app, ["vision", *map(str, arguments)])


def drive(frames, camera_file, out, speed_m_s=SPEED_M_S, fps=FPS):
    return trpac("run", frames, "--camera", camera_file, "--speed-m-s", speed_m_s, "--fps", fps, "--out", out)


class ByColour:
    """Logits are the mean blue, green and red of a patch, over 100."""

    temperature = 2.0

    def verdicts(self, patches):
        return PatchVerdicts(patches.astype(np.float64).mean(axis=(1, 2)) / 100.0, np.ones(len(patches)))


class Certain:
    """Every patch has the same logits."""

    temperature = 1.5

    def verdicts(self, patches):
        return PatchVerdicts(np.tile([2.0, 0.5, -1.0], (len(patches), 1)), np.ones(len(patches)))


def noisy(colour, height, width):
    """A colour with just enough grain to count as a picture."""
    grain = np.random.default_rng(0).integers(-4, 5, (height, width, 1))
    return np.clip(np.array(colour) + grain, 0, 255).astype(np.uint8)


def patch_probabilities(*arguments):
    return calibrated_probabilities(patch_logs(*arguments)[None], 1.0)[0]


def masks(drivable, shadow=None):
    none = np.zeros((160, 256), np.float32)
    return RoadMasks(drivable.astype(np.float32), none if shadow is None else shadow.astype(np.float32))


# --- classify ---


def test_classify_tells_dry_from_snow_and_writes_the_agreed_columns(folder, tmp_path):
    out = tmp_path / "deep" / "classes.csv"
    result = trpac("classify", folder, "--out", out)
    assert result.exit_code == 0, result.stderr
    table = pd.read_csv(out)
    assert tuple(table.columns) == CLASSIFY_COLUMNS
    assert list(table["file"]) == [str(folder / f"f_{number}.png") for number in range(8, 14)]
    assert list(table["class"]) == ["dry"] * 3 + ["snow_ice"] * 3
    shares = table[["p_dry", "p_wet", "p_snow_ice"]].to_numpy()
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=2e-6)
    np.testing.assert_allclose(table["confidence"], shares.max(axis=1))
    assert "3 dry, 0 wet, 3 snow_ice" in result.stdout
    assert [path.name for path in out.parent.iterdir()] == ["classes.csv"]


def test_what_cannot_be_used_is_named_and_the_rest_is_classified(folder, tmp_path, pictures):
    cv2.imwrite(str(folder / "one.png"), np.zeros((1, 1, 3), np.uint8))
    cv2.imwrite(str(folder / "lens_cap.png"), np.zeros((300, 480, 3), np.uint8))
    cv2.imwrite(str(folder / "scan.tif"), pictures[0])
    (folder / "broken.jpg").write_bytes(BROKEN)
    (folder / "notes.txt").write_text("no picture, and none expected")
    (folder / "._f_8.png").write_bytes(b"what file browsers leave")
    missing = tmp_path / "not_there.jpg"
    out = tmp_path / "classes.csv"
    result = trpac("classify", missing, folder, folder / "f_8.png", "--out", out)
    assert result.exit_code == 1
    assert len(pd.read_csv(out)) == 6, "each good picture once"
    lines = result.stderr.strip().splitlines()
    assert lines[0] == "trpac vision classify: 5 of the inputs could not be used:"
    assert [line.split(":")[0].rsplit("/")[-1] for line in lines[1:]] == [
        "not_there.jpg",
        "broken.jpg",
        "lens_cap.png",
        "one.png",
        "scan.tif",
    ]


def test_nothing_is_written_where_nothing_can_be_classified(tmp_path):
    empty = tmp_path / "empty"
    empty.mkdir()
    (tmp_path / "broken.jpg").write_bytes(BROKEN)
    out = tmp_path / "out" / "classes.csv"
    result = trpac("classify", empty, tmp_path / "broken.jpg", "--out", out)
    assert result.exit_code == 2
    assert "no pictures in this folder" in result.stderr
    assert "broken.jpg" in result.stderr
    assert not out.parent.exists()
    assert trpac("classify", empty, "--out", tmp_path).exit_code == 2


def turned_jpeg(image):
    """A JPEG stored on its side, with the note that a telephone makes of it (EXIF orientation 6)."""
    on_its_side = cv2.rotate(image, cv2.ROTATE_90_COUNTERCLOCKWISE)
    jpeg = cv2.imencode(".jpg", on_its_side, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    tag = struct.pack("<HHHIII", 1, 0x112, 3, 1, 6, 0)
    exif = b"Exif\0\0II*\0" + struct.pack("<I", 8) + tag
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:]


def test_pictures_of_every_depth_and_turn_give_the_class_of_the_plain_one(tmp_path, pictures):
    plain = pictures[4]
    grey = cv2.cvtColor(plain, cv2.COLOR_BGR2GRAY)
    variants = {
        "a_plain": plain,
        "b_deep": plain.astype(np.uint16) * 257,
        "c_alpha": np.dstack([plain, np.full(plain.shape[:2], 7, np.uint8)]),
        "d_large": cv2.resize(plain, (4000, 2500)),
        "e_grey": grey,
        "f_deep_grey": grey.astype(np.uint16) * 257,
    }
    for name, image in variants.items():
        cv2.imwrite(str(tmp_path / f"{name}.png"), image)
    (tmp_path / "g_turned.jpg").write_bytes(turned_jpeg(plain))
    out = tmp_path / "classes.csv"
    assert trpac("classify", tmp_path, "--out", out).exit_code == 0
    table = pd.read_csv(out)
    assert list(table["class"]) == ["snow_ice"] * 7
    probabilities = table[["p_dry", "p_wet", "p_snow_ice"]].to_numpy()
    np.testing.assert_array_equal(probabilities[1], probabilities[0])
    np.testing.assert_array_equal(probabilities[2], probabilities[0])
    np.testing.assert_allclose(probabilities[6], probabilities[0], atol=0.05)


def test_only_usable_road_of_the_lower_centre_counts():
    image = noisy((20, 20, 220), 320, 512)
    image[:, :256] = noisy((220, 20, 20), 320, 256)
    image[:180] = noisy((20, 220, 20), 180, 512)
    left = np.zeros((160, 256), bool)
    left[:, :128] = True
    everywhere = np.ones((160, 256), bool)

    def verdict(shown):
        return Surface(int(patch_probabilities(image, shown, ByColour()).argmax()))

    assert verdict(masks(left)) is Surface.DRY
    assert verdict(masks(everywhere, shadow=left)) is Surface.SNOW_ICE
    assert verdict(masks(everywhere, shadow=~left)) is Surface.DRY
    both = [
        patch_probabilities(image, shown, ByColour())
        for shown in (masks(everywhere), masks(~everywhere), masks(everywhere, shadow=everywhere))
    ]
    np.testing.assert_array_equal(both[0], both[1])
    np.testing.assert_array_equal(both[0], both[2])
    assert both[0][0] == pytest.approx(both[0][2], rel=0.05), "without usable road both halves count"
    assert both[0][1] < 0.3, "what lies above the lower centre does not"


def test_agreeing_patches_do_not_grow_more_certain_than_one():
    image = noisy((100, 100, 100), 400, 640)
    fused = patch_probabilities(image, masks(np.ones((160, 256), bool)), Certain())
    np.testing.assert_allclose(fused, calibrated_probabilities(np.array([[2.0, 0.5, -1.0]]), 1.5)[0])


class Road:
    """All is road out of the shadow, and every picture as a whole has the same logits."""

    def segment(self, image):
        return replace(masks(np.ones((160, 256), bool)), surface=np.array([-1.0, 3.0, 0.5]))


def test_the_picture_as_a_whole_counts_beside_its_patches():
    """Exponents add up, each by its say."""
    networks = StillNetworks(Road(), Certain())
    patch_logs = log_softmax(np.array([2.0, 0.5, -1.0]) / 1.5)
    expected = softmax(
        stills.PATCHES_WEIGHT * patch_logs + stills.PICTURE_WEIGHT * np.array([-1.0, 3.0, 0.5])
    )
    found = networks.probabilities(noisy((100, 100, 100), 400, 640))
    np.testing.assert_allclose(found, expected)


def test_one_even_colour_is_refused():
    with pytest.raises(ImageError, match=r"dark\.png: one even colour"):
        patch_probabilities(
            np.full((300, 400, 3), 90, np.uint8), masks(np.ones((160, 256), bool)), Certain(), "dark.png"
        )


@given(st.integers(64, 8000), st.integers(64, 8000))
def test_crops_lie_in_pictures_of_any_shape(width, height):
    crops = stills._crops(width, height)
    assert len(crops) == 6
    for left, top, right, bottom in crops:
        assert 0 <= left < right <= width
        assert height // 2 <= top < bottom <= height
    assert crops[0][0] <= 0.1 * width
    assert crops[0][2] >= 0.9 * width


class Blind(Certain):
    """Reads patches whose mean grey is above a limit."""

    def __init__(self, limit):
        self.limit = limit

    def verdicts(self, patches):
        grey = patches.mean(axis=(1, 2, 3))
        return PatchVerdicts(
            np.where(grey[:, None] > 150, [0.0, 0.0, 3.0], [3.0, 0.0, 0.0]), (grey > self.limit) * 1.0
        )


def test_what_cannot_be_read_does_not_count_and_alone_is_refused():
    image = noisy((60, 60, 60), 320, 512)
    image[:, 260:] = noisy((200, 200, 200), 320, 252)
    everywhere = masks(np.ones((160, 256), bool))
    assert patch_probabilities(image, everywhere, Blind(0)).argmax() == Surface.DRY
    assert patch_probabilities(image, everywhere, Blind(150)).argmax() == Surface.SNOW_ICE
    with pytest.raises(ImageError, match=r"wall\.png: no road that could be read"):
        patch_probabilities(image, everywhere, Blind(255), "wall.png")


# --- run ---


def as_the_estimator_says(folder, table):
    """Hold rows to the estimator's own verdicts; the car drives on half a metre from row to row."""
    networks = (
        Segmenter(networks_folder() / "segmenter.onnx"),
        SurfaceClassifier(networks_folder() / "surface.onnx"),
    )
    ife, state = Ife(IfeConfig(camera=SMALL), *networks), IfeState()
    for number, row in table.iterrows():
        motion = Motion(SPEED_M_S, way_m=SPEED_M_S / FPS * number)
        state, expected = ife.process(state, decode_image(folder / row["frame"]), motion)
        found = (row["P_fusion"], row["p_util"], row["Q_v"], row["flag"])
        assert [float(x) for x in found] == pytest.approx(
            [expected.P_fusion, expected.p_util, expected.Q_v, int(expected.flag)], 1e-5
        )
    assert state.looks


def test_a_folder_of_frames_gives_what_the_estimator_gives_frame_by_frame(folder, camera_file, tmp_path):
    out = tmp_path / "out"
    result = drive(folder, camera_file, out)
    assert result.exit_code == 0, result.stderr
    table = pd.read_csv(out / "frames.csv", keep_default_na=False)
    assert tuple(table.columns) == FRAME_COLUMNS
    assert list(table["frame"]) == [f"f_{number}.png" for number in range(8, 14)]
    assert list(table["class"]) == list(table["voting_class"]) == ["dry"] * 3 + ["snow_ice"] * 3
    as_the_estimator_says(folder, table)
    assert table["ms"].between(0.0, 5000.0, inclusive="neither").all()
    summary = json.loads((out / "summary.json").read_text())
    schemas.validate("vision_summary", summary)
    assert summary["frames"] == 6
    assert summary["unreadable"] == []
    assert summary["class_share"] == {"dry": 0.5, "wet": 0.0, "snow_ice": 0.5}
    assert summary["flag_share"] == pytest.approx(table["flag"].mean())
    assert table["ms"].min() <= summary["ms_median"] <= summary["ms_p99"] <= table["ms"].max() * 1.00001
    assert set(summary["model_sha256"]) == {"segmenter.onnx", "surface.onnx"}
    assert sorted(path.name for path in out.iterdir()) == [
        "annotated.mp4",
        "frames.csv",
        "strip.jpg",
        "summary.json",
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.yaml", "frames", "out"]
    film = cv2.VideoCapture(str(out / "annotated.mp4"))
    assert (film.get(cv2.CAP_PROP_FRAME_COUNT), film.get(cv2.CAP_PROP_FPS)) == (6, FPS)
    assert film.read()[1].shape == (600, 960, 3)
    assert decode_image(out / "strip.jpg").shape == (600, 1440, 3)


def test_an_unusable_frame_is_listed_and_leaves_the_memory_alone(folder, camera_file, tmp_path, pictures):
    (folder / "f_1.jpg").write_bytes(BROKEN)
    cv2.imwrite(str(folder / "f_11_cropped.png"), pictures[0][:200])
    result = drive(folder, camera_file, tmp_path / "holed")
    assert result.exit_code == 1
    assert "2 of 8 frames could not be used" in result.stderr
    assert "480 x 200" in result.stderr
    holed = pd.read_csv(tmp_path / "holed" / "frames.csv", keep_default_na=False)
    bad = holed["frame"].isin(["f_1.jpg", "f_11_cropped.png"])
    assert list(holed[bad].index) == [0, 5]
    for column, empty in zip(FRAME_COLUMNS[1:], ("", "", "", "", 0, "", ""), strict=True):
        assert list(holed[bad][column]) == [empty] * 2, column
    as_the_estimator_says(folder, holed[~bad])
    summary = json.loads((tmp_path / "holed" / "summary.json").read_text())
    assert [entry["frame"] for entry in summary["unreadable"]] == ["f_1.jpg", "f_11_cropped.png"]
    assert summary["class_share"]["dry"] == 0.5
    film = cv2.VideoCapture(str(tmp_path / "holed" / "annotated.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == 8


def test_a_video_is_read_frame_by_frame(camera_file, tmp_path, pictures):
    video = tmp_path / "drive.mp4"
    write_film(video, pictures)
    # 10 m from frame to frame: no frame shows road that one before has shown.
    result = drive(video, camera_file, tmp_path / "out", fps=1.0)
    assert result.exit_code == 0, result.stderr
    table = pd.read_csv(tmp_path / "out" / "frames.csv", dtype={"frame": str})
    assert list(table["frame"]) == [f"{number:06d}" for number in range(6)]
    # Snow after dry road: one look at it is believed, since the network is sure.
    assert list(table["class"]) == ["dry"] * 3 + ["snow_ice"] * 3


def write_film(video, pictures):
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"mp4v"), 20.0, (480, 300))
    for image in pictures:
        writer.write(image)
    writer.release()


def test_a_turn_noted_in_a_video_is_not_applied(tmp_path, pictures):
    """The camera file is of the pixels as stored, as with pictures."""
    plain, noted = tmp_path / "plain.mp4", tmp_path / "noted.mp4"
    write_film(plain, pictures[:2])
    data = plain.read_bytes()
    at = data.index(bytes.fromhex("00010000" + "00" * 12 + "00010000"), data.index(b"tkhd"))
    half_turn = struct.pack(">9i", -65536, 0, 0, 0, -65536, 0, 480 << 16, 300 << 16, 1 << 30)
    noted.write_bytes(data[:at] + half_turn + data[at + 36 :])
    capture = cv2.VideoCapture(str(noted), cv2.CAP_FFMPEG)
    assert capture.get(cv2.CAP_PROP_ORIENTATION_META) == 180.0
    for (_, stored), (_, read) in zip(Frames.find(plain), Frames.find(noted), strict=True):
        np.testing.assert_array_equal(stored, read)


def test_a_film_is_not_written_over_itself(folder, camera_file, tmp_path):
    out = tmp_path / "out"
    assert drive(folder, camera_file, out).exit_code == 0
    before = (out / "annotated.mp4").read_bytes()
    result = drive(out / "annotated.mp4", camera_file, out)
    assert result.exit_code == 2
    assert "holds the frames" in result.stderr
    assert (out / "annotated.mp4").read_bytes() == before


def test_a_name_that_is_no_text_is_written_with_a_mark(camera_file, tmp_path, pictures):
    folder = tmp_path / "odd"
    folder.mkdir()
    cv2.imwrite(str(folder / "a.png"), pictures[0])
    (folder / "a.png").rename(os.fsdecode(os.fsencode(folder) + b"/b\xff.png"))
    result = trpac("classify", folder, "--out", tmp_path / "classes.csv")
    assert result.exit_code == 0, result.stderr
    assert pd.read_csv(tmp_path / "classes.csv")["file"].tolist() == [
        f"{folder}/b\N{REPLACEMENT CHARACTER}.png"
    ]
    result = drive(folder, camera_file, tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert pd.read_csv(tmp_path / "out" / "frames.csv")["frame"].tolist() == [
        "b\N{REPLACEMENT CHARACTER}.png"
    ]


def test_a_link_that_leads_nowhere_is_named_and_counts_as_a_frame(camera_file, tmp_path, pictures):
    folder = tmp_path / "annexed"
    folder.mkdir()
    for number in (1, 3):
        cv2.imwrite(str(folder / f"{number}.png"), pictures[0])
    (folder / "2.png").symlink_to("nowhere")
    result = trpac("classify", folder, "--out", tmp_path / "classes.csv")
    assert result.exit_code == 1
    assert "2.png" in result.stderr
    assert drive(folder, camera_file, tmp_path / "out").exit_code == 1
    frames = pd.read_csv(tmp_path / "out" / "frames.csv", dtype=str, keep_default_na=False)
    assert frames["frame"].tolist() == ["1.png", "2.png", "3.png"]


@pytest.mark.parametrize("out", ["frames/f_8.png", "pipe", "x" * 300])
def test_classify_does_not_write_over_what_is_no_table(folder, tmp_path, out):
    os.mkfifo(tmp_path / "pipe")
    before = (folder / "f_8.png").read_bytes()
    result = trpac("classify", folder, "--out", tmp_path / out)
    assert result.exit_code == 2
    assert result.stderr.startswith("trpac vision classify: ")
    assert (folder / "f_8.png").read_bytes() == before
    assert not (tmp_path / "pipe").is_file()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"frames": "nowhere"}, "expected a folder of frames or a video"),
        ({"frames": "empty"}, "no pictures in this folder"),
        ({"frames": "frames/f_8.png"}, "a single picture"),
        ({"frames": "camera.yaml"}, "not a video that can be decoded"),
        ({"camera_file": "missing.yaml"}, "missing.yaml"),
        ({"camera_file": "wrong.yaml"}, "height_m"),
        ({"camera_file": "square.yaml"}, "none of 6 frames could be used"),
        ({"speed_m_s": "nan", "fps": 0}, "expected 0 to 150; 0 frames per second; expected 0.01 to 1000"),
        ({"speed_m_s": 1e200, "fps": 1e-6}, "1e+200 m/s; expected 0 to 150; 1e-06 frames"),
        ({"camera_file": "far.yaml"}, "distortion"),
        ({"out": "x" * 300}, "File name too long"),
        ({"out": "occupied"}, "summary.json: a folder"),
        ({"out": "camera.yaml"}, "a file. Expected a folder"),
        ({"out": "frames"}, "holds the frames"),
        ({"out": "camera.yaml/below/it"}, "camera.yaml"),
        ({"camera_file": "square.yaml", "out": "new/folders/out"}, "none of 6 frames"),
    ],
)
def test_unusable_input_is_one_message_and_leaves_no_trace(folder, camera_file, tmp_path, changes, expected):
    (tmp_path / "empty").mkdir()
    values = yaml.safe_load(camera_file.read_text())
    (tmp_path / "square.yaml").write_text(yaml.safe_dump(values | {"height_px": 480}))
    (tmp_path / "wrong.yaml").write_text(yaml.safe_dump(values | {"height_m": -1.0}))
    (tmp_path / "far.yaml").write_text(yaml.safe_dump(values | {"distortion": [1e308, 0.0, 0.0, 0.0, 1e308]}))
    (tmp_path / "occupied" / "summary.json").mkdir(parents=True)
    arguments = {"frames": folder, "camera_file": camera_file, "out": tmp_path / "out"}
    arguments |= {
        key: tmp_path / value if isinstance(value, str) else value for key, value in changes.items()
    }
    if "speed_m_s" in changes:
        arguments["speed_m_s"] = changes["speed_m_s"]
    before = sorted(tmp_path.rglob("*"))
    result = drive(**arguments)
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("trpac vision run: ")
    assert expected in result.stderr
    assert sorted(tmp_path.rglob("*")) == before


@long
def test_a_run_broken_off_leaves_the_results_of_the_last_one(folder, camera_file, tmp_path):
    out = tmp_path / "out"
    assert drive(folder, camera_file, out).exit_code == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def broken_off(done, total):
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_frames(Frames.find(folder), camera_file, 20.0, 40.0, out, broken_off)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["camera.yaml", "frames", "out"]


@long
def test_without_an_encoder_there_is_the_strip_and_the_run_says_so(
    folder, camera_file, tmp_path, monkeypatch
):
    out = tmp_path / "out"
    assert drive(folder, camera_file, out).exit_code == 0

    class NoEncoder:
        fourcc = staticmethod(cv2.VideoWriter.fourcc)

        def __init__(self, *arguments):
            pass

        def isOpened(self):
            return False

    monkeypatch.setattr(overlay_video.cv2, "VideoWriter", NoEncoder)
    result = drive(folder, camera_file, out)
    assert result.exit_code == 0, result.stderr
    assert "strip.jpg in place of annotated.mp4" in result.stdout
    assert sorted(path.name for path in out.iterdir()) == ["frames.csv", "strip.jpg", "summary.json"]
    assert json.loads((out / "summary.json").read_text())["annotated"] is None


@given(st.integers(1, 400))
def test_the_strip_spreads_evenly_over_a_run_of_any_length(count):
    strip = overlay_video.Strip()
    for number in range(count):
        strip.add(np.full((2, 480, 3), number % 256, np.uint8))
    kept = len(strip._tiles)
    assert min(count, 12) <= kept <= 24
    shown = [int(tile[0, 0, 0]) for tile in strip._tiles]
    assert shown == [number % 256 for number in range(0, count, strip._stride)]
