from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import scenarios.effects as effects_module
from scenarios.effects import EFFECTS, FORMS, ORDER, Effect, catalogue, make_effect
from scenarios.effects.base import Stage, Subsystem, parameter
from scenarios.errors import ScenarioError
from scenarios.files import RoadFile, VehicleFile, load_vehicle
from scenarios.plant.pipeline import initial_state, simulate
from scenarios.plant.sensors import make_log

SCENARIOS = Path(__file__).parents[2] / "scenarios"
CAR = load_vehicle(SCENARIOS / "vehicles" / "four_in_wheel_motor_ev.yaml")
ROAD = RoadFile.model_validate(
    {
        "schema": 1,
        "segments": [
            {"start_m": 0.0, "mu_left": 0.9, "mu_right": 0.9, "surface": "dry"},
            {"start_m": 4.0, "mu_left": 0.3, "mu_right": 0.4, "surface": "snow_ice"},
        ],
    }
)
ROLLING_MASS_KG = CAR.mass_kg + 4.0 * CAR.wheel_inertia_kg_m2 / CAR.wheel_radius_m**2
"""What coasting decelerates: the car and its turning wheels [kg]."""

CONTRACT_IDS = {
    "aero_drag", "rolling_resistance", "road_grade", "mass_offset", "wheel_radius_offset", "wheel_inertia_offset",
    "load_transfer", "tyre_relaxation", "tyre_stiffness_offset", "friction_falloff", "friction_offset", "torque_lag",
    "torque_delay", "torque_gain", "brake_drag", "driveline_compliance", "wheel_speed_delay",
    "wheel_speed_quantisation", "vehicle_speed_delay", "vehicle_speed_scale", "accelerometer_bias", "mu_split",
    "camera_latency", "camera_pitch", "exposure_shift", "motion_blur", "class_friction_offset", "tyre_load_stiffness",
}  # fmt: skip
IN_THE_LOG = [key for key, effect in EFFECTS.items() if effect.stage != "perception"]
"""Effects that act on the plant and its sensors; the camera chain's act on pictures."""
NOMINAL = CAR.to_core()


def car_with(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


def drive_through_everything(car):
    """Standing start, border crossing, spinning wheels, braking to rest."""
    time_s = np.arange(4001) * 1e-3
    torque = np.interp(time_s, [0.0, 0.1, 1.8, 1.9, 2.2, 2.3, 4.0], [0, 310, 310, 0, 0, -200, -200])
    return simulate(car, ROAD, np.repeat(torque[:, None], 4, axis=1), 1e-3)


def coast(car, speed, duration_s):
    return simulate(car, ROAD, np.zeros((round(duration_s * 1000) + 1, 4)), 1e-3, speed, -1e6)


def assert_same(a, b):
    for field in fields(a):
        assert np.array_equal(getattr(a, field.name), getattr(b, field.name)), field.name


@pytest.mark.parametrize("effect_id", EFFECTS)
def test_neutral_values_reproduce_the_base_plant_bit_for_bit(effect_id):
    neutral = {p.name: p.neutral_value(NOMINAL) for p in EFFECTS[effect_id].parameters()}
    base = drive_through_everything(car_with())
    run = drive_through_everything(car_with(**{effect_id: neutral}))
    assert_same(run, base)
    assert make_log(run, car_with(**{effect_id: neutral})).equals(make_log(base, car_with()))
    assert EFFECTS[effect_id].neutral(NOMINAL) == make_effect(effect_id, neutral, NOMINAL)


@pytest.mark.parametrize(
    "form",
    [form for forms in FORMS.values() for form in forms[1:]],
    ids=lambda form: f"{form.id}-{form.form}",
)
def test_every_form_at_its_neutral_values_is_the_base_plant_bit_for_bit(form, monkeypatch):
    plain = car_with()
    base = drive_through_everything(plain)
    monkeypatch.setattr(VehicleFile, "make_effects", lambda self: [form.neutral(NOMINAL)])
    assert_same(drive_through_everything(plain), base)


@pytest.mark.parametrize("effect_id", IN_THE_LOG)
def test_other_values_change_the_log(effect_id):
    bounds = {p.name: p.bounds(NOMINAL) for p in EFFECTS[effect_id].parameters()}
    middle = {name: 0.3 * low + 0.7 * high for name, (low, high) in bounds.items()}
    car = car_with(**{effect_id: middle})
    base = drive_through_everything(car_with())
    assert not make_log(drive_through_everything(car), car).equals(make_log(base, car_with()))


@pytest.mark.parametrize("effect_id", EFFECTS)
def test_each_effect_describes_itself(effect_id):
    effect = EFFECTS[effect_id]
    assert effect_id in CONTRACT_IDS or effect.structural
    assert effect.equation
    assert effect.source
    assert effect.excited_by
    assert effect.stage in get_args(Stage)
    assert effect.subsystem in get_args(Subsystem)
    assert effect.confounders
    assert set(effect.confounders) <= CONTRACT_IDS - {effect_id}
    assert effect.parameters()
    for p in effect.parameters():
        assert p.unit
        assert p.meaning
        low, high = p.bounds(NOMINAL)
        assert low <= p.neutral_value(NOMINAL) <= high


def test_every_file_that_defines_an_effect_is_listed_once_and_has_its_id():
    folder = Path(effects_module.__file__).parent
    defining = {path.stem for path in folder.glob("*.py") if "(Effect):" in path.read_text(encoding="utf-8")}
    assert sorted(ORDER) == sorted(defining)
    for key, forms in FORMS.items():
        assert {form.id for form in forms} == {key}
        assert EFFECTS[key] is forms[0]
        assert len({form.form for form in forms}) == len(forms)


def test_every_id_of_the_contract_is_there():
    assert CONTRACT_IDS <= set(EFFECTS)


@pytest.mark.parametrize("effect_id", EFFECTS)
def test_bounds_are_accepted_and_nothing_beyond_them(effect_id):
    neutral = {p.name: p.neutral_value(NOMINAL) for p in EFFECTS[effect_id].parameters()}
    for p in EFFECTS[effect_id].parameters():
        low, high = p.bounds(NOMINAL)
        for value in (low, high):
            assert getattr(make_effect(effect_id, {**neutral, p.name: value}, NOMINAL), p.name) == value
        for value in (low - 1e-6, high + max(1e-6, 1e-9 * high), float("nan")):
            with pytest.raises(ValueError, match=rf"{effect_id}.{p.name} is .*expected"):
                make_effect(effect_id, {**neutral, p.name: value}, NOMINAL)


@pytest.mark.parametrize("effect_id", IN_THE_LOG)
def test_a_fit_may_start_at_its_start_values(effect_id):
    parameters = EFFECTS[effect_id].parameters()
    for p in parameters:
        low, high = p.bounds(NOMINAL)
        starts, neutral = p.start_values(NOMINAL), p.neutral_value(NOMINAL)
        assert starts
        assert low <= min(starts) <= max(starts) <= high
        if low < neutral < high and effect_id not in ("driveline_compliance", "wheel_speed_quantisation"):
            assert min(starts) < neutral < max(starts)
    for values in product(*(p.start_values(NOMINAL) for p in parameters)):
        car = car_with(**{effect_id: dict(zip((p.name for p in parameters), values, strict=True))})
        run = drive_through_everything(car)
        assert np.isfinite(make_log(run, car).to_numpy()).all()
        assert 3.0 < run.speed_m_s.max() < 9.0


def test_the_page_about_effects_is_up_to_date():
    text = catalogue.PAGE.read_text(encoding="utf-8")
    assert text == catalogue.page(), "run python -m scenarios.effects.catalogue"
    assert all(f"### {key}\n" in text for key in EFFECTS)


def test_order_in_the_file_does_not_matter():
    values = {
        key: {p.name: p.start_values(NOMINAL)[0] for p in EFFECTS[key].parameters()} for key in IN_THE_LOG
    }
    forwards, backwards = car_with(**values), car_with(**dict(reversed(values.items())))
    assert list(forwards.effects) != list(backwards.effects)
    assert [effect.id for effect in backwards.make_effects()] == IN_THE_LOG
    run, other = drive_through_everything(forwards), drive_through_everything(backwards)
    assert_same(run, other)
    assert make_log(run, forwards).equals(make_log(other, backwards))


@pytest.mark.parametrize(
    "off",
    [
        {"friction_falloff": {"falloff_s_m": 0.0, "floor": 0.3}},
        {
            "driveline_compliance": {
                "stiffness_nm_rad": 500.0,
                "damping_nm_s_rad": 7.0,
                "motor_inertia_kg_m2": 0.0,
            }
        },
        {"wheel_speed_quantisation": {"teeth": 7.0, "window_s": 0.0}},
    ],
    ids=lambda off: next(iter(off)),
)
def test_one_neutral_parameter_switches_an_effect_off_whatever_the_others(off):
    run, base = drive_through_everything(car_with(**off)), drive_through_everything(car_with())
    assert_same(run, base)
    assert make_log(run, car_with(**off)).equals(make_log(base, car_with()))


def test_air_drag_coasting_makes_the_inverse_speed_grow_linearly():
    """M v' = -k v^2 gives 1/v = 1/v0 + k t / M."""
    area = 3.0
    run = coast(car_with(aero_drag={"drag_area_m2": area}), 30.0, 20.0)
    expected = 1.0 / 30.0 + 0.5 * 1.225 * area * run.time_s / ROLLING_MASS_KG
    assert 1.0 / run.speed_m_s == pytest.approx(expected, rel=2e-4)
    # The accelerometer feels the drag too.
    drag_n = 0.5 * 1.225 * area * run.speed_m_s**2
    felt = (run.tyre_force_n.sum(1) - drag_n) / CAR.mass_kg
    assert run.accel_x_m_s2 == pytest.approx(felt, abs=1e-9)


def test_rolling_resistance_coasting_slows_linearly_then_rests():
    """M v' = -c m g until rest, and no step backwards after it."""
    c = 0.05
    run = coast(car_with(rolling_resistance={"coefficient": c}), 2.0, 6.0)
    decel = c * CAR.mass_kg * 9.81 / ROLLING_MASS_KG
    stop_s = 2.0 / decel
    moving = run.time_s < stop_s - 0.05
    assert run.speed_m_s[moving] == pytest.approx(2.0 - decel * run.time_s[moving], abs=2e-3)
    resting = run.time_s > stop_s + 0.05
    assert resting.sum() > 1000
    assert not run.speed_m_s[resting].any()
    assert not run.wheel_speed_rad_s[resting].any()
    assert np.ptp(run.position_m[resting]) == 0.0


def test_load_transfer_follows_the_closed_form():
    """Each wheel's load changes by m a h / (2 L), down at the front when accelerating."""
    height, length = 0.54, CAR.wheelbase_m
    run = drive_through_everything(car_with(load_transfer={"cog_height_m": height}))
    shift = CAR.mass_kg * run.accel_x_m_s2 * height / (2.0 * length)
    front = CAR.mass_kg * 9.81 * CAR.cog_to_rear_axle_m / (2.0 * length)
    rear = CAR.mass_kg * 9.81 * (length - CAR.cog_to_rear_axle_m) / (2.0 * length)
    assert run.vertical_load_n.sum(1) == pytest.approx(CAR.mass_kg * 9.81, rel=1e-12)
    assert run.vertical_load_n[:, 0] == pytest.approx(front - shift, abs=0.01)
    assert run.vertical_load_n[:, 3] == pytest.approx(rear + shift, abs=0.01)
    assert shift.max() > 300.0
    assert shift.min() < -200.0
    assert run.accel_x_m_s2 == pytest.approx(run.tyre_force_n.sum(1) / CAR.mass_kg, abs=1e-6)


def test_unknown_effect_suggests_the_known_one():
    with pytest.raises(ValueError, match=r"'aero_darg' is not an effect.*did you mean 'aero_drag'"):
        make_effect("aero_darg", {}, NOMINAL)


def test_all_problems_of_an_effect_come_at_once():
    with pytest.raises(
        ValueError, match=r"'drag_aera_m2'.*did you mean 'drag_area_m2'.*needs drag_area_m2"
    ) as caught:
        make_effect("aero_drag", {"drag_aera_m2": 0.6}, NOMINAL)
    assert "m^2" in str(caught.value)
    with pytest.raises(ValueError, match=r"rolling_resistance.coefficient is 12; expected 0 to 0.3"):
        make_effect("rolling_resistance", {"coefficient": 12.0}, NOMINAL)


def test_actuators_and_sensors_take_one_file_each(monkeypatch):
    """The hooks of the two other stages reach the plant and the log."""

    @dataclass(frozen=True)
    class Gain(Effect):
        id = "torque_gain"
        factor: float = parameter("-", "torque per command", neutral=1.0, low=0.5, high=1.5)

        def actuate(self, time_s, torque_nm):
            return torque_nm * self.factor

        def sense(self, time_s, signals):
            return {**signals, "vehicle_speed_m_s": signals["vehicle_speed_m_s"] * 2.0}

    monkeypatch.setitem(effects_module.EFFECTS, "torque_gain", Gain)
    monkeypatch.setitem(effects_module.FORMS, "torque_gain", (Gain,))
    torque = np.full((500, 4), 100.0)
    half = simulate(car_with(torque_gain={"factor": 0.5}), ROAD, torque, 1e-3)
    assert (half.speed_m_s == simulate(car_with(), ROAD, 0.5 * torque, 1e-3).speed_m_s).all()
    assert (half.wheel_torque_nm == 100.0).all()  # the log holds the command
    log = make_log(half, car_with(torque_gain={"factor": 0.5}))
    assert (log["vehicle_speed_m_s"] == 2.0 * half.speed_m_s).all()
    with pytest.raises(ScenarioError, match="torque_gain acts in the actuators"):
        initial_state(car_with(torque_gain={"factor": 0.5}), ROAD)
