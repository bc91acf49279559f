"""The package as its users have it: frames in, results out, one error for what is wrong."""

import logging
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from road_picture import road_picture

import trpac
from scenarios.files import load_vehicle
from scenarios.library import FOLDERS, located, networks_folder, shipped
from trpac.extras import EXTRA_OF, MissingExtraError, extras
from trpac_core.estimator import EstimatorConfig, TrpacEstimator
from trpac_core.estimator_data import Method
from trpac_core.sensors import Sensors

CAR = trpac.Vehicle.builtin("four_in_wheel_motor_ev")
TIME_S = np.arange(0.0, 4.0, 0.01)
TORQUE = np.column_stack([250.0 * (np.sin(4.0 * TIME_S) > -0.3)] * 4)


@pytest.fixture(scope="module")
def log() -> pd.DataFrame:
    return trpac.simulate(CAR, trpac.Road.uniform(0.4, "wet"), torque=TORQUE, speed=5.0)


# The package


def test_it_is_imported_fast_and_prints_nothing():
    code = "import sys, trpac; heavy = {'numba', 'matplotlib', 'onnxruntime', 'pandas', 'cv2', 'asammdf', 'dask'}; "
    code += "assert not heavy & set(sys.modules); from trpac import *; print(*sorted(dir(trpac)))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(trpac.__all__) < set(told.stdout.split())
    assert not told.stderr


def test_every_name_is_there_and_documented():
    for name in set(trpac.__all__) - {"effects"}:
        assert getattr(trpac, name).__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'estimates'"):
        _ = trpac.estimates


def test_a_missing_extra_is_named():
    with (
        pytest.raises(MissingExtraError, match=r"run needs the package 'fmpy'.*trpac-fmu\[fmu\]"),
        extras("run"),
    ):
        raise ModuleNotFoundError("No module named 'fmpy'", name="fmpy.fmi2")
    with pytest.raises(ModuleNotFoundError, match="mine"), extras("run"):
        raise ModuleNotFoundError("mine", name="mine")


def test_every_optional_package_has_its_extra():
    """Each module that EXTRA_OF names is brought by the extra that it is said to be of."""
    import tomllib
    from importlib.metadata import packages_distributions

    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    bring = packages_distributions()
    for module, extra in EXTRA_OF.items():
        listed = " ".join(project["optional-dependencies"][extra]).lower().replace("_", "-")
        assert any(name.lower().replace("_", "-") in listed for name in bring[module]), module


# Cars, roads, names


@pytest.mark.parametrize("kind", FOLDERS)
def test_what_is_shipped_is_found_by_its_name(kind):
    for name, path in shipped(kind).items():
        assert located(kind, name) == path
    with pytest.raises(trpac.TrpacError, match=f"name of a shipped {kind}; .*Known: "):
        located(kind, "nonsense")


def test_a_file_comes_before_a_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("paper_simulation").write_text("schema: 1\n")
    assert located("road", "paper_simulation") == Path("paper_simulation")


def test_a_car_is_the_same_from_python_and_from_its_file(tmp_path):
    values = CAR.model_dump(by_alias=True, exclude={"schema_", "tyre"})
    same = trpac.Vehicle(**values, longitudinal_stiffness_n=CAR.tyre.longitudinal_stiffness_n)
    assert same == CAR
    assert CAR.to_core() == load_vehicle("four_in_wheel_motor_ev").to_core()


def test_all_that_is_wrong_with_a_car_or_a_road_is_said_at_once():
    with pytest.raises(trpac.TrpacError) as told:
        trpac.Vehicle(mass_kg=1e308, wheels=5)
    text = str(told.value)
    assert "mass_kg: is 1e+308" in text
    assert "wheels: unknown key" in text
    assert "track_m: missing" in text
    with pytest.raises(trpac.TrpacError, match=r"segments\[0\]\.mu_left: is 7\.0"):
        trpac.Road.uniform(7.0)


def test_effects_come_as_objects_or_as_in_the_file():
    late = CAR.with_effects([trpac.effects.TorqueLag(time_constant_s=0.05)])
    assert late.effects["torque_lag"] == {"time_constant_s": 0.05}
    assert late.effects["aero_drag"] == CAR.effects["aero_drag"]
    assert CAR.with_effects({"torque_lag": {"time_constant_s": 0.05}}).effects == late.effects
    unlike = CAR.with_effects([trpac.effects.TorqueLagOfRiseAndFall(0.05, apart=0.3)])
    assert type(unlike.make_effects()[0]) is trpac.effects.TorqueLagOfRiseAndFall


@pytest.mark.parametrize(
    "make", [trpac.list_effects, trpac.list_scenarios, trpac.list_vehicles, trpac.list_roads]
)
def test_lists_are_tables(make):
    table = make()
    assert len(table)
    assert not table.columns.duplicated().any()


# Methods

METHODS = ("as_printed", "dife", "robust")


def stepped(estimator, log):
    """The estimates of a wheel over the rows of a log."""
    return [
        estimator.step(
            t=row.time_s,
            wheel_speed=row.wheel_speed_fl_rad_s,
            wheel_torque=row.wheel_torque_fl_nm,
            vehicle_speed=row.vehicle_speed_m_s,
            longitudinal_acceleration=row.accel_x_m_s2,
        )
        for row in log.itertuples()
    ]


@pytest.mark.parametrize("method", METHODS)
def test_a_wheels_estimate_is_the_cores_by_each_method(log, method):
    config = EstimatorConfig(CAR.to_core(), method=Method.of(method))
    core, before_s = TrpacEstimator(config), 0.0
    for row, shown in zip(log.itertuples(), stepped(trpac.Estimator(CAR, method=method), log), strict=True):
        sensors = Sensors(
            row.wheel_speed_fl_rad_s,
            row.wheel_torque_fl_nm,
            row.vehicle_speed_m_s,
            longitudinal_acceleration_m_s2=row.accel_x_m_s2,
        )
        estimate, before_s = core.step(row.time_s - before_s, sensors), row.time_s
        assert (shown.theta, shown.std, shown.low, shown.high, shown.expected, shown.expected_std) == (
            estimate.TRPAC,
            estimate.TRPAC_std,
            estimate.TRPAC_low,
            estimate.TRPAC_high,
            estimate.TRPAC_expected,
            estimate.TRPAC_expected_std,
        )
        assert shown.source == estimate.source.label


@pytest.mark.parametrize("method", METHODS)
def test_estimates_of_each_method_have_the_interval_of_the_car_and_its_wheels(log, method):
    done = trpac.estimate(log, CAR, method=method)
    frame = done.frame
    assert done.summary["method"] == method
    for end in ("", "_fl", "_fr", "_rl", "_rr"):
        assert (frame[f"TRPAC_low{end}"] <= frame[f"TRPAC{end}"]).all()
        assert (frame[f"TRPAC{end}"] <= frame[f"TRPAC_high{end}"]).all()
        assert set(frame[f"TRPAC_source{end}"]) <= {"none", "tyre"}
    assert (frame["TRPAC_expected"].std() < 1e-12) == (method == "as_printed")
    assert np.isfinite(frame[["TRPAC_expected", "TRPAC_expected_std"]]).all(axis=None)
    assert done.plot().png[:4] == b"\x89PNG"


@pytest.mark.parametrize(
    "use",
    [
        lambda log, method: trpac.Estimator(CAR, method=method),
        lambda log, method: trpac.estimate(log, CAR, method=method),
        lambda log, method: trpac.run("paper_simulation", method=method),
    ],
)
def test_a_wrong_method_is_named_with_those_there_are(log, use):
    with pytest.raises(trpac.TrpacError, match=r"'DIFE'; expected one of as_printed, dife, robust\.$"):
        use(log, "DIFE")


def test_a_wrong_radius_is_a_warning_of_the_drive():
    wrong = CAR.model_copy(update={"wheel_radius_m": 1.02 * CAR.wheel_radius_m})
    pedal = 250.0 * np.sin(3.0 * np.arange(0.0, 6.0, 0.01))
    drive = trpac.simulate(
        CAR, trpac.Road.uniform(0.4, "wet"), torque=np.column_stack([pedal] * 4), speed=15.0
    )
    warnings = [text for text in trpac.estimate(drive, wrong, method="robust").warnings if "radius" in text]
    assert [text.split()[0] for text in warnings] == ["Front", "Rear"]
    assert all("Adjust wheel_radius_m in vehicle.yaml." in text for text in warnings)
    wheel = trpac.Estimator(wrong, method="robust")
    stepped(wheel, drive)
    assert [text for text in wheel.warnings if "radius" in text]
    assert trpac.estimate(drive, CAR, method="robust").warnings == []


# Simulate


def test_a_frame_of_torques_is_the_array_of_them(log):
    frame = log[["time_s", *(f"wheel_torque_{w}_nm" for w in ("fl", "fr", "rl", "rr"))]]
    pd.testing.assert_frame_equal(
        trpac.simulate(CAR, trpac.Road.uniform(0.4, "wet"), torque=frame, speed=5.0), log, rtol=1e-9
    )


def test_an_effect_acts_and_a_neutral_one_does_not(log):
    road = trpac.Road.uniform(0.4, "wet")
    none = trpac.simulate(CAR, road, torque=TORQUE, speed=5.0, effects=[trpac.effects.TorqueLag(0.0)])
    late = trpac.simulate(CAR, road, torque=TORQUE, speed=5.0, effects=[trpac.effects.TorqueLag(0.2)])
    pd.testing.assert_frame_equal(none, log)
    assert (log["vehicle_speed_m_s"] - late["vehicle_speed_m_s"]).abs().max() > 0.01


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: f.drop(columns="time_s"), "lacks time_s"),
        (lambda f: f.assign(time_s=f["time_s"] ** 2), "not equally apart"),
        (lambda f: f.iloc[:1], "not equally apart"),
        (lambda f: f.assign(wheel_torque_fl_nm=np.nan), "not finite at row 0"),
    ],
)
def test_torques_that_cannot_be_driven_are_refused(log, change, said):
    with pytest.raises(trpac.TrpacError, match=said):
        trpac.simulate(CAR, "paper_simulation", torque=change(log))


# Estimate


def test_a_frame_gives_what_its_file_gives(log, tmp_path, caplog):
    log.to_csv(tmp_path / "log.csv", index=False)
    with caplog.at_level(logging.WARNING, "trpac"):
        found = trpac.estimate(log)
    assert "no vehicle file was given" in caplog.text
    summary = trpac.estimate(tmp_path / "log.csv").summary
    assert found.summary["estimate"] == summary["estimate"]
    assert found.summary["warnings"] == summary["warnings"]
    by_path = trpac.estimate(tmp_path / "log.csv", CAR)
    pd.testing.assert_frame_equal(by_path.frame, found.frame)
    assert by_path.summary["vehicle"]["sha256"] is None
    written = found.write(tmp_path / "out")
    assert sorted(path.name for path in written) == ["estimates.csv", "report.html", "summary.json"]
    assert found.plot().save(tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")
    assert "<table" in found._repr_html_()
    assert found.verdict in repr(found)


def test_a_mapping_holds_for_a_frame_too(log, tmp_path):
    (tmp_path / "map.yaml").write_text("schema: 1\nvehicle_speed_m_s: {column: v, unit: km/h}\n")
    theirs = log.rename(columns={"vehicle_speed_m_s": "v"}).assign(v=3.6 * log["vehicle_speed_m_s"])
    found = trpac.estimate(theirs, CAR, mapping=tmp_path / "map.yaml")
    pd.testing.assert_frame_equal(found.frame, trpac.estimate(log, CAR).frame, rtol=1e-6)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda f: f.drop(columns="accel_x_m_s2"), "required column missing: accel_x_m_s2"),
        (lambda f: f.assign(accel_x_m_s2="fast"), "column accel_x_m_s2 holds .*; expected numbers"),
        (lambda f: pd.concat([f, f[["accel_x_m_s2"]]], axis=1), "stands 2 times"),
        (lambda f: f.assign(time_s=f["time_s"][::-1].to_numpy()), "time_s"),
        (lambda f: f.iloc[:0], "has no rows"),
    ],
)
def test_a_frame_that_is_no_log_is_refused(log, change, said):
    with pytest.raises(trpac.TrpacError, match=said):
        trpac.estimate(change(log), CAR)


def test_the_steps_of_one_wheel_come_to_what_the_whole_log_says(log):
    wheel = trpac.Estimator(CAR, wheel="rr")
    said = [
        wheel.step(
            t=row.time_s,
            wheel_speed=row.wheel_speed_rr_rad_s,
            wheel_torque=row.wheel_torque_rr_nm,
            vehicle_speed=row.vehicle_speed_m_s,
            longitudinal_acceleration=row.accel_x_m_s2,
        )
        for row in log.itertuples()
    ]
    whole = trpac.estimate(log, CAR).frame
    excited = [i for i, e in enumerate(said) if e.excited]
    assert excited
    assert said[excited[-1]].theta == pytest.approx(whole["TRPAC_rr"].iloc[excited[-1]], abs=0.05)
    assert said[excited[-1]].why == "The tyre slips enough to show the road."
    assert "interval widens" in wheel.step(t=4.0, wheel_speed=20, wheel_torque=0, vehicle_speed=5.8).why


def test_a_step_that_cannot_be_is_refused_or_told():
    wheel = trpac.Estimator(CAR)
    rolling = {"wheel_speed": 34.5, "wheel_torque": 0.0, "vehicle_speed": 10.0}
    wheel.step(t=1.0, **rolling)
    with pytest.raises(trpac.TrpacError, match="ascending"):
        wheel.step(t=0.5, **rolling)
    with pytest.raises(trpac.TrpacError, match="expected one of dry, wet, snow_ice"):
        wheel.step(t=1.1, **rolling, road_class="ice")
    with pytest.raises(trpac.TrpacError, match="no camera"):
        wheel.step(t=1.1, **rolling, image=np.zeros((300, 480, 3), np.uint8))
    assert "wheel_speed_rad_s is nan" in wheel.step(t=1.1, **rolling | {"wheel_speed": np.nan}).why
    with pytest.raises(trpac.TrpacError, match="expected one of fl, fr, rl, rr"):
        trpac.Estimator(CAR, wheel="front")


# Pictures


def test_rgb_is_asked_for_by_name(tmp_path):
    import cv2

    picture = road_picture(640, 480, colour=True)
    cv2.imwrite(str(tmp_path / "road.png"), picture)
    of_file = trpac.classify(tmp_path / "road.png")
    assert trpac.classify(picture) == of_file
    assert trpac.classify(picture[..., ::-1], order="rgb") == of_file
    assert trpac.classify(picture.astype(np.uint16) << 4) == of_file
    assert trpac.classify(picture / 255.0) == of_file
    assert sum(of_file.probabilities.values()) == pytest.approx(1.0)
    assert of_file.confidence == of_file.probabilities[of_file.surface]


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((480, 640)),
        np.full((480, 640, 3), 2.0),
        np.zeros((480, 640, 4), np.uint8),
        np.zeros((3, 3, 3), np.uint8),
    ],
)
def test_arrays_that_are_no_pictures_are_refused(image):
    with pytest.raises(trpac.TrpacError, match="expected"):
        trpac.classify(image)


def test_frames_of_a_drive_are_remembered():
    eye = trpac.VisionEstimator("paper")
    seen = [eye.step(road_picture(480, 300), t, speed=10.0) for t in (0.0, 0.1)]
    assert seen[0].surface in ("dry", "wet", "snow_ice")
    assert eye._way_m == pytest.approx(1.0)


def test_networks_of_ones_own_judge_pictures_and_go_into_a_unit(tmp_path):
    own = tmp_path / "own"
    own.mkdir()
    for name in ("segmenter.onnx", "surface.onnx"):
        (own / name).write_bytes((networks_folder() / name).read_bytes())
    picture = road_picture(480, 300)
    assert trpac.classify(picture, networks=own) == trpac.classify(picture)
    eye = trpac.VisionEstimator("paper", networks=own)
    assert eye.step(picture, 0.0, speed=10.0).surface in ("dry", "wet", "snow_ice")
    with zipfile.ZipFile(trpac.build_fmu(tmp_path, networks=own)) as unit:
        assert unit.read("resources/surface.onnx") == (own / "surface.onnx").read_bytes()
    for given in ({"kind": "native"}, {"unit": "ReferencePlant"}):
        with pytest.raises(trpac.TrpacError, match="holds no networks"):
            trpac.build_fmu(tmp_path, networks=own, **given)
    (own / "surface.onnx").write_bytes(b"no network")
    with pytest.raises(trpac.TrpacError, match=r"surface\.onnx"):
        trpac.build_fmu(tmp_path, networks=own)


def test_a_package_is_built_and_another_system_is_refused(tmp_path):
    package = trpac.build_ssp(tmp_path, system="one_wheel")
    assert package == tmp_path / "trpac_one_wheel.ssp"
    with zipfile.ZipFile(package) as archive:
        assert "SystemStructure.ssd" in archive.namelist()
    with pytest.raises(trpac.TrpacError, match="four_wheels, one_wheel"):
        trpac.build_ssp(tmp_path, system="five_wheels")


def test_a_unit_is_built_in_each_kind_and_another_is_refused(native_file, tmp_path):
    for fmi, name in ((2, "TrpacEstimator_native_flat.fmu"), (3, "TrpacEstimator_native_fmi3_flat.fmu")):
        path = trpac.build_fmu(tmp_path, kind="native", fmi=fmi, flat=True)
        assert path == tmp_path / name
        with zipfile.ZipFile(path) as archive:
            assert f"sources/fmi{fmi}.c" in archive.namelist()
    assert trpac.build_fmu(tmp_path, unit="TorquePulses").name == "TorquePulses.fmu"
    for given, said in (
        ({"kind": "rust"}, "kind is 'rust'; expected one of python, native"),
        (
            {"unit": "ReferencePlant", "kind": "native"},
            "'ReferencePlant' is not a native unit; Known: TrpacE",
        ),
        ({"fmi": 3}, "fmi is 3; expected 2, or of a native unit also 3"),
        ({"unit": "TrpacEstimater"}, "did you mean 'TrpacEstimator'"),
    ):
        with pytest.raises(trpac.TrpacError, match=said):
            trpac.build_fmu(tmp_path, **given)
