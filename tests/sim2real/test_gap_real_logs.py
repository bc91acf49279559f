"""Cases of logs that this project did not make: their files, their gap budgets, and one whole diagnosis."""

import sys

import pytest
from long import beyond, long

from scenarios.effects import EFFECTS
from scenarios.errors import ScenarioError
from scenarios.files import load_road
from sim2real.cases.__main__ import main
from sim2real.cases.case import FOLDER, budget, case_names, load_case, stages
from sim2real.diagnose import diagnose
from sim2real.result import Verdict

# Share of the first residuals that the last step may leave: mean of wheel and vehicle speed, each in SI units.
LEFT = {
    "bmw_m8": 0.25,
    "carsim_city": 0.15,
    "carsim_hybrid": 0.35,
    "carsim_sports": 0.4,
    "chrono": 0.35,
    "commonroad": 0.3,
    "m8_model": 0.35,
    "open_car_dynamics": 0.4,
}
SPEEDS = ("wheel_speed [rad/s]", "vehicle_speed [m/s]")


@pytest.fixture(scope="module")
def logs(trpac_data):
    return trpac_data / "vehicle_logs"


def test_every_case_has_its_limit_and_files_that_can_be_read():
    assert set(case_names()) == set(LEFT)
    for name in case_names():
        case = load_case(name)
        for window in (*case.fit, case.holdout):
            assert load_road(FOLDER / name / window.road).segments
        assert len({step.name for step in case.steps}) == len(case.steps)


def test_holdouts_share_no_time_with_what_is_fitted_to():
    for name in case_names():
        case = load_case(name)
        held = case.holdout
        for window in case.fit:
            apart = window.to_s <= held.from_s or window.from_s >= held.to_s
            assert window.log != held.log or apart, name


def test_an_unknown_case_is_refused_with_those_that_there_are():
    with pytest.raises(ScenarioError, match=r"'bmw' is no case\. Known: bmw_m8"):
        load_case("bmw")


@pytest.mark.data
@pytest.mark.parametrize("step", ["-1", "5"])
def test_a_step_that_a_case_has_not_is_refused_with_those_that_it_has(
    logs, step, tmp_path, monkeypatch, capsys
):
    asked = ["cases", str(logs), "chrono", "--step", step, "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", asked)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"chrono has no step {step}; it has 0 (as weighed), 1 (" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.data
@pytest.mark.parametrize("name", beyond(3, LEFT))
def test_diagnosed_steps_shrink_the_gap_of_the_holdout(logs, name):
    found = stages(name, logs)
    first, *_, last = budget(found)
    assert sum(last.si[key] / first.si[key] for key in SPEEDS) / len(SPEEDS) < LEFT[name]
    assert last.total < first.total
    assert first.total > 3.0


@pytest.mark.data
def test_a_radius_per_axle_is_structure_that_no_single_radius_mends(logs):
    steps = stages("m8_model", logs)
    found = {stage.name: gap for stage, gap in zip(steps, budget(steps), strict=True)}
    with_one = found["tyre_stiffness_offset as diagnosed"].si["wheel_speed [rad/s]"]
    with_two = found["radius per axle"].si["wheel_speed [rad/s]"]
    assert with_two < 0.5 * with_one


@pytest.mark.data
def test_the_hybrids_drag_is_the_parameter_files(logs):
    """With the torque's lever arm mended, drag comes out near 0.3 x 1.6 m^2, from a guess of 0.7 m^2."""
    stage = stages("carsim_hybrid", logs)[2]
    others = _all_but("aero_drag", "wheel_speed_delay")
    said = diagnose(stage.model, stage.fit, stage.holdout, exclude=others)
    drag = next(c for c in said.causes if c.effect == "aero_drag").parameters["drag_area_m2"]
    assert drag.value == pytest.approx(0.48, abs=0.1)
    assert said.causes[0].effect == "aero_drag"


@pytest.mark.data
@long
def test_the_city_cars_weight_and_drag_are_found(logs):
    """631 kg are what its file says, the log's wheel loads 748 kg: mass, or the torque that looks like it."""
    stage = stages("carsim_city", logs)[0]
    others = _all_but("aero_drag", "torque_gain", "mass_offset", "rolling_resistance", "tyre_relaxation")
    said = diagnose(stage.model, stage.fit, stage.holdout, exclude=others)
    assert said.verdict is Verdict.COMPOUND
    assert said.gap.after.total < 0.1 * said.gap.before.total
    values = {c.effect: c.parameters for c in said.causes[:2]}
    assert values["aero_drag"]["drag_area_m2"].value == pytest.approx(0.48, abs=0.1)
    inertial = values.get("mass_offset") or values["torque_gain"]
    mass = 631.0 + inertial["mass_kg"].value if "mass_kg" in inertial else 631.0 / inertial["factor"].value
    assert mass == pytest.approx(748.0, rel=0.03)


def _all_but(*kept):
    return set(EFFECTS) - set(kept)
