"""The user's own plant as a unit in the nominal model's place: a foreign car in C, and our ReferencePlant."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from foreign_unit import SIGNALS, command, foreign_unit, recorded
from gap_drives import DRY, clean, noisy, pulses
from gap_files import write_log, write_road
from long import long

import sim2real.own_model.runs as own_runs
import trpac
from benchmarks.gap.own_model import signals as plant_signals
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.effects import EFFECTS
from scenarios.errors import ScenarioError
from scenarios.files import VehicleFile, load_vehicle
from scenarios.yaml_text import to_yaml
from sim2real.demo import VEHICLE
from sim2real.diagnose import diagnose_files
from sim2real.hypotheses.contest import silent
from sim2real.logs import log_of_frame
from sim2real.observing.observer import Simulation
from sim2real.own_model.runs import OwnModel, Run
from sim2real.own_model.signals import load_signals
from sim2real.own_model.study import before_fits
from sim2real.own_model.unit import opened_unit
from sim2real.own_sources import studied
from sim2real.result import Verdict
from sim2real.sources import Sources, make_source

FEW = ("mass_offset", "torque_gain", "torque_lag", "brake_drag", "accelerometer_bias", "road_grade")
EXCLUDE = set(EFFECTS) - set(FEW)


def changed(**parts):
    """The signals file with other parts; None takes one out."""
    return {k: v for k, v in (SIGNALS | parts).items() if v is not None}


def written(folder: Path, content) -> Path:
    path = folder / "signals.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    return foreign_unit(tmp_path_factory.mktemp("foreign"))


@pytest.fixture(scope="module")
def car(unit, tmp_path_factory):
    """The foreign car, to record logs of: it begins as a run says, and runs on to the end."""
    signals = load_signals(written(tmp_path_factory.mktemp("recorder"), changed(initial=None)))
    with opened_unit(unit, signals) as opened:
        yield OwnModel(opened, signals)


@pytest.fixture(scope="module")
def own(unit, tmp_path_factory):
    """The foreign car, opened."""
    signals = load_signals(written(tmp_path_factory.mktemp("signals"), SIGNALS))
    with opened_unit(unit, signals) as opened:
        yield OwnModel(opened, signals)


def log(seconds=6.0, speed_m_s=13.0, scale=1.0):
    return log_of_frame(command(seconds, speed_m_s, scale))


# --- the signals file


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"inputs": None}, "inputs: missing"),
        ({"inputs": {"T_fl": {"signal": "wheel_torque_f_nm"}}}, "is no torque of a log; did you mean"),
        ({"inputs": {"T_fl": {"signal": "wheel_torque_fl_nm", "unit": "km"}}}, "unit 'km' cannot become"),
        ({"inputs": {"T_fl": {}}}, "expected `signal: wheel_torque_fl_nm`"),
        ({"outputs": {"vehicle_sped_m_s": "v_kmh"}}, "vehicle_sped_m_s"),
        ({"outputs": {"vehicle_speed_m_s": {"column": "v_kmh", "unit": "kg"}}}, "cannot become"),
        ({"initial": {"v0_kmh": {"signal": "accel_x_m_s2"}}}, "is not among these"),
        ({"parameters": {"m": {"low": 3.0, "high": 2.0}}}, "low 3 is not below high 2"),
        ({"parameters": {"m": {"low": 1.0, "high": 2.0, "effect": "mass_offset.kg"}}}, "mass_offset.mass_kg"),
        ({"parameter": {}}, "unknown key; did you mean 'parameters'"),
    ],
)
def test_a_signals_file_is_read_strictly(tmp_path, parts, message):
    with pytest.raises(ScenarioError, match=message):
        load_signals(written(tmp_path, changed(**parts)))


def test_the_file_in_the_docs_is_one(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "guide" / "gap_own_model.md").read_text(encoding="utf-8")
    path = tmp_path / "signals.yaml"
    path.write_text(page.partition("```yaml\n")[2].partition("```")[0], encoding="utf-8")
    assert set(load_signals(path).parameters) == {"car.m", "body.h"}


def test_a_text_that_names_a_file_beside_it_is_its_path(tmp_path):
    (tmp_path / "car.yaml").touch()
    signals = load_signals(written(tmp_path, changed(start={"a": "car.yaml", "b": "other", "c": 2.0})))
    assert signals.start == {"a": str(tmp_path / "car.yaml"), "b": "other", "c": 2.0}


def test_an_input_may_be_the_braking_part_of_several_wheels(tmp_path):
    content = {
        "brake": {
            "sum": ["wheel_torque_fl_nm", "wheel_torque_fr_nm"],
            "part": "negative",
            "sign": -1,
            "unit": "kNm",
        }
    }
    given = load_signals(written(tmp_path, changed(inputs=content))).inputs["brake"]
    torque = np.array([[100.0, 100.0, 0.0, 0.0], [-500.0, -700.0, -900.0, -900.0]])
    np.testing.assert_allclose(given.of(torque), [0.0, 1.2])


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"outputs": SIGNALS["outputs"] | {"position_m": "x"}}, "no variable 'x'; did you mean"),
        ({"inputs": {"m": {"signal": "wheel_torque_fl_nm"}}}, "'m' is parameter; expected input"),
        ({"parameters": {"m": {"low": 2000.0, "high": 3000.0}}}, "starts at 1343.8"),
        ({"start": {"mas": 1.0}}, "no variable 'mas'"),
    ],
)
def test_what_the_unit_lacks_is_told(unit, tmp_path, parts, message):
    signals = load_signals(written(tmp_path, changed(**parts)))
    with pytest.raises(ScenarioError, match=message), opened_unit(unit, signals):
        pass


# --- runs


def test_a_run_begins_as_the_log_and_is_not_taken_twice(own):
    before = own.runs
    wanted = [Run(log()), Run(log(), {"m": 1500.0})]
    (first, heavy) = (run[0].log for run in own.simulate(wanted))
    again = own.simulate(wanted)
    assert own.runs == before + 2
    np.testing.assert_array_equal(first.signals["position_m"], again[0][0].log.signals["position_m"])
    assert first.signals["vehicle_speed_m_s"][0] == pytest.approx(13.0, abs=0.01)
    assert first.signals["wheel_speed_fl_rad_s"][0] == pytest.approx(13.0 / 0.29, rel=1e-3)
    assert np.ptp(heavy.signals["vehicle_speed_m_s"]) < 0.95 * np.ptp(first.signals["vehicle_speed_m_s"])


def test_effects_stand_around_the_unit(own):
    effects = (None, EFFECTS["torque_delay"](0.1), EFFECTS["accelerometer_bias"](0.3))
    plain, late, off = (run[0].log for run in own.simulate([Run(log(), effect=e) for e in effects]))
    k = round(0.1 / np.diff(plain.time_s)[0])
    a, b = plain.signals["accel_x_m_s2"], late.signals["accel_x_m_s2"]
    np.testing.assert_allclose(b[200:600], a[200 - k : 600 - k], atol=0.1)
    np.testing.assert_allclose(off.signals["accel_x_m_s2"], a + 0.3)


def test_it_begins_anew_before_it_drifts_away(own):
    at = log(20.0)
    ((first, *others),) = own.simulate([Run(at, {"m": 1000.0})])
    assert [part.from_s for part in others] == [7.0, 11.0, 15.0]
    for part in others:
        assert part.log.time_s[0] == pytest.approx(part.from_s - 3.0, abs=0.01)
        assert part.log.signals["vehicle_speed_m_s"][0] == pytest.approx(13.0, abs=0.01)
    assert first.log.time_s[-1] == pytest.approx(7.0, abs=0.01)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"fail_at": 2.0}, "fails after 2 s"),
        ({"nan_at": 3.0}, "v_kmh is no number from 3(.00[0-9])? s on"),
        ({"hang_at": 1.0}, "takes more than 5 s"),
    ],
)
def test_a_run_that_fails_is_one_clear_error(own, monkeypatch, parameters, message):
    monkeypatch.setattr(own_runs, "LIMIT_S", 5.0)
    with pytest.raises(ScenarioError, match=message) as caught:
        own.simulate([Run(log(), parameters)])
    assert "ForeignCar.fmu over frame" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_too_many_runs_are_refused_before_any(own):
    with pytest.raises(ScenarioError, match=r"61 runs .* expected at most 60"):
        own.require(61)


# --- diagnoses


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("case")
    shutil.copy(VEHICLE, path / "vehicle.yaml")
    write_road(DRY, path / "road.yaml")
    return path


def ask(folder, car, unit, run, **more):
    """The diagnosis of logs of the foreign car in a run's condition, with the sound one as the user's model."""
    for number, name in enumerate(("fit", "hold")):
        at = log(14.0, 13.0 + number, 1.0 + 0.15 * number)
        begin = {"v0_kmh": 3.6 * (13.0 + number)}
        recorded(car, Run(at, begin | run.changed, run.effect), number).to_csv(
            folder / f"{name}.csv", index=False
        )
    return diagnose_files(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        [str(folder / "fit.csv")],
        str(folder / "hold.csv"),
        model=unit,
        signals=written(folder, SIGNALS),
        exclude=EXCLUDE,
        **more,
    )


@long
def test_a_sound_foreign_car_has_no_gap_to_its_own_model(folder, car, unit):
    said = ask(folder, car, unit, Run(log()))
    assert said.verdict is Verdict.NO_GAP


def test_a_late_torque_is_named_and_run_through_the_unit(folder, car, unit):
    said = ask(folder, car, unit, Run(log(), effect=EFFECTS["torque_lag"](0.08)))
    assert said.causes[0].effect == "torque_lag"
    assert said.verdict in (Verdict.IDENTIFIED, Verdict.PARTIAL, Verdict.AMBIGUOUS)
    found = said.own_model
    assert found.effect == "torque_lag"
    assert found.gap_after <= 1.2 * said.gap.noise_floor
    assert found.runs <= 60


@pytest.mark.long
def test_a_payload_is_found_by_the_units_own_mass(folder, car, unit):
    said = ask(folder, car, unit, Run(log(), {"m": 1500.0}))
    best = said.own_model.parameters[0]
    assert best.name == "m"
    assert best.effect == "mass_offset.mass_kg"
    assert best.estimate.value == pytest.approx(1500.0, abs=15.0)
    assert best.gap_after <= 1.2 * said.gap.noise_floor
    assert "m explains most" in said.sentence
    named = {said.causes[0].effect, *(e for group in said.ambiguous_with for e in group)}
    assert "mass_offset" in named
    assert said.to_json()["own_model"]["parameters"][0]["name"] == "m"


@long
def test_what_cannot_be_told_of_the_parameters_is_said_before_anything_is_fitted(car, unit, tmp_path):
    """With a stiffness that goes with the load, a heavier car and a weaker motor differ by the air's drag alone."""
    spans = {"m": (1000.0, 1900.0), "gain": (0.7, 1.3), "h": (0.1, 1.2), "fail_at": (1e8, 1e10)}
    parameters = {name: {"low": low, "high": high} for name, (low, high) in spans.items()}
    signals = written(tmp_path, changed(parameters=parameters))
    frames = [recorded(car, Run(log(14.0), {"v0_kmh": 46.8}), seed) for seed in range(2)]
    fitted, held = (make_source(log_of_frame(frame), DRY) for frame in frames)
    nominal = load_vehicle(VEHICLE)
    with studied(Sources(nominal, None, (fitted,), held), unit, signals, 1, silent) as (sources, study):
        told = before_fits(study, Simulation(nominal), [sources.fit[0].drive])
    assert len(told) == 2
    assert "fail_at of your model changes these logs by less than their noise" in told[0]
    assert "gain and m of your model act alike on these logs (correlation -0.99" in told[1]


@pytest.mark.e2e
@long
def test_our_plant_as_their_model(tmp_path):
    """The unit ReferencePlant, whose car has softer tyres than vehicle.yaml, beside logs with a weaker torque."""
    archive = build_unit(UNITS["ReferencePlant"], tmp_path / "ReferencePlant.fmu")
    build = {"tyre_stiffness_offset": {"stiffness_n": 38_000.0}}
    nominal = load_vehicle(VEHICLE)
    theirs = VehicleFile.model_validate(
        {**nominal.model_dump(by_alias=True), "effects": nominal.effects | build}
    )
    for name, car in (("vehicle.yaml", nominal), ("theirs.yaml", theirs)):
        (tmp_path / name).write_text(to_yaml(car.model_dump(by_alias=True)), encoding="utf-8")
    write_road(DRY, tmp_path / "road.yaml")
    written(tmp_path, plant_signals(nominal))
    for number, name in enumerate(("fit", "hold")):
        torque = (1.0 + 0.15 * number) * pulses(9.0)
        drive = clean(torque, 13.0, DRY, dict(theirs.effects) | {"torque_gain": {"factor": 0.88}})
        write_log(noisy(drive, number), tmp_path / f"{name}.csv")
    said = diagnose_files(
        tmp_path / "vehicle.yaml",
        tmp_path / "road.yaml",
        [str(tmp_path / "fit.csv")],
        str(tmp_path / "hold.csv"),
        model=archive,
        signals=tmp_path / "signals.yaml",
        exclude=EXCLUDE,
    )
    assert said.causes[0].effect == "torque_gain"
    assert said.causes[0].parameters["factor"].value == pytest.approx(0.88, abs=0.01)
    assert said.own_model.gap_after <= 1.2 * said.gap.noise_floor
    assert said.own_model.runs <= 60


def test_the_front_door_takes_a_model(folder, car, unit, tmp_path, monkeypatch):
    given = {}
    monkeypatch.setattr(
        "sim2real.diagnose.diagnose_sources", lambda sources, **more: given.update(more, at=sources)
    )
    frames = [recorded(car, Run(log(8.0), {"v0_kmh": 46.8}), seed) for seed in range(2)]
    trpac.diagnose(
        folder / "vehicle.yaml",
        folder / "road.yaml",
        fit=frames[:1],
        holdout=frames[1],
        model=unit,
        signals=written(tmp_path, SIGNALS),
    )
    assert {r.name for r in given["own"].responses} == set(SIGNALS["parameters"])
    assert all(source.drive.reference is not None for source in given["at"].all)


def test_a_model_comes_with_its_signals_and_without_references(folder, unit):
    for more, message in (
        ({"model": unit}, "belong together"),
        ({"model": unit, "signals": Path("s.yaml"), "paired": ["a.csv"]}, "are both given"),
    ):
        with pytest.raises(ScenarioError, match=message):
            diagnose_files(folder / "vehicle.yaml", folder / "road.yaml", ["a.csv"], "b.csv", **more)
