"""The sensors' effects: what they report, and how well `correct` undoes it."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from scenarios.effects import EFFECTS
from scenarios.effects.wheel_speed_quantisation import WheelSpeedQuantisation
from scenarios.files import VehicleFile, load_vehicle
from scenarios.plant.sensors import correct, sense

CAR = load_vehicle(Path(__file__).parents[2] / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml")
STEP_S = 2e-3
TIME = np.arange(2001) * STEP_S
WHEELS = tuple(f"wheel_speed_{w}_rad_s" for w in ("fl", "fr", "rl", "rr"))


def car_with(**effects):
    return VehicleFile.model_validate({**CAR.model_dump(by_alias=True), "effects": effects})


def speed_at(time_s):
    return 12.0 + 3.0 * np.sin(1.3 * time_s) + 0.4 * np.sin(9.0 * time_s)


def signals(time_s=TIME):
    speed = speed_at(time_s)
    wheels = {name: (1.0 + 0.01 * i) * speed / 0.29 for i, name in enumerate(WHEELS)}
    return {
        **wheels,
        "vehicle_speed_m_s": speed,
        "accel_x_m_s2": np.gradient(speed, time_s),
        "position_m": time_s * 12,
    }


def reported(**effects):
    return sense(car_with(**effects), TIME, signals())


def changed(after):
    before = signals()
    return {name for name in before if not np.array_equal(before[name], after[name])}


def test_each_sensor_effect_touches_its_own_signals_only():
    assert changed(reported(vehicle_speed_scale={"factor": 1.02})) == {"vehicle_speed_m_s"}
    assert changed(reported(vehicle_speed_delay={"delay_s": 0.03})) == {"vehicle_speed_m_s"}
    assert changed(reported(accelerometer_bias={"bias_m_s2": 0.2})) == {"accel_x_m_s2"}
    assert changed(reported(wheel_speed_delay={"delay_s": 0.03})) == set(WHEELS)
    assert changed(reported(wheel_speed_quantisation={"teeth": 48.0, "window_s": 0.02})) == set(WHEELS)


def test_scale_and_bias():
    assert (
        reported(vehicle_speed_scale={"factor": 1.02})["vehicle_speed_m_s"] == 1.02 * speed_at(TIME)
    ).all()
    biased = reported(accelerometer_bias={"bias_m_s2": -0.3})["accel_x_m_s2"]
    assert (biased == signals()["accel_x_m_s2"] - 0.3).all()


@pytest.mark.parametrize("effect_id", ["wheel_speed_delay", "vehicle_speed_delay"])
@pytest.mark.parametrize("delay_s", [0.02, 0.0333])
def test_a_delayed_signal_is_that_of_a_while_ago(effect_id, delay_s):
    name = WHEELS[2] if effect_id == "wheel_speed_delay" else "vehicle_speed_m_s"
    scale = 1.02 / 0.29 if effect_id == "wheel_speed_delay" else 1.0
    late = reported(**{effect_id: {"delay_s": delay_s}})[name]
    after = delay_s + STEP_S <= TIME
    assert late[after] == pytest.approx(scale * speed_at(TIME[after] - delay_s), abs=3e-4 * scale)
    assert (late[delay_s >= TIME] == late[0]).all()
    assert late[0] == signals()[name][0]


class TestQuantisation:
    def test_counts_are_whole_and_conserve_the_revolutions(self):
        teeth, window_s = 48.0, 0.02
        out = reported(wheel_speed_quantisation={"teeth": teeth, "window_s": window_s})[WHEELS[0]]
        counts = out * teeth * window_s / (2.0 * np.pi)
        assert counts == pytest.approx(np.round(counts), abs=1e-9)
        held = counts.reshape(-1)[:-1].reshape(-1, 10)  # ten rows each
        assert (held == held[:, :1]).all()
        # What is reported through window k was counted in window k - 1: together the angle up to the last full one.
        counted = held[1:, 0].sum()
        turned = quad(lambda t: speed_at(t) / 0.29, 0.0, TIME[-1] - window_s, limit=200)[0]
        assert counted == pytest.approx(turned * teeth / (2.0 * np.pi), abs=1.01)
        assert counts.max() - counts.min() > 3

    def test_before_the_first_window_is_full_the_start_counts(self):
        out = reported(wheel_speed_quantisation={"teeth": 1000.0, "window_s": 0.1})[WHEELS[0]]
        assert out[:50] == pytest.approx(np.full(50, speed_at(0.0) / 0.29), abs=2.0 * np.pi / 100.0)

    @settings(deadline=None, max_examples=50)
    @given(
        speed=st.floats(0.0, 150.0),
        teeth=st.integers(1, 2000),
        window_s=st.floats(1e-3, 0.3),
        step_s=st.sampled_from([5e-4, 1e-3, 0.0067, 0.02]),
    )
    def test_a_constant_speed_is_met_within_one_pulse_at_any_rate(self, speed, teeth, window_s, step_s):
        time_s = 3.7 + np.arange(300) * step_s
        out = WheelSpeedQuantisation(float(teeth), window_s).sense(time_s, {WHEELS[1]: np.full(300, speed)})
        assert np.abs(out[WHEELS[1]] - speed).max() <= 2.0 * np.pi / (teeth * window_s) * (1.0 + 1e-6)

    def test_its_mean_delay_is_one_window(self):
        window_s = 0.04
        out = reported(wheel_speed_quantisation={"teeth": 20_000.0, "window_s": window_s})[WHEELS[0]]
        shifts = np.arange(0.0, 0.08, 1e-3)
        errors = [np.std((out - speed_at(TIME - s) / 0.29)[200:]) for s in shifts]
        assert shifts[np.argmin(errors)] == pytest.approx(window_s, abs=1.5e-3)


UNDONE = {
    "vehicle_speed_scale": ({"factor": 0.9}, 1e-12),
    "vehicle_speed_delay": ({"delay_s": 0.033}, 2e-3),
    "wheel_speed_delay": ({"delay_s": 0.033}, 2e-3),
    "wheel_speed_quantisation": ({"teeth": 1000.0, "window_s": 0.01}, 0.9),
    "accelerometer_bias": ({"bias_m_s2": 0.3}, 1e-12),
}


def test_every_sensor_effect_is_undone_below():
    assert set(UNDONE) == {key for key, effect in EFFECTS.items() if effect.stage == "sensors"}


@pytest.mark.parametrize("effect_id", UNDONE)
def test_correct_undoes_sense_but_at_the_end(effect_id):
    values, tolerance = UNDONE[effect_id]
    car = car_with(**{effect_id: values})
    back = correct(car, TIME, sense(car, TIME, signals()))
    lost = values.get("delay_s", values.get("window_s", 0.0))
    # A delayed sensor repeats its first value: between that and the next nothing was told.
    known = (TIME[-1] - lost - 2.0 * STEP_S >= TIME) & (STEP_S <= TIME)
    for name, true in signals().items():
        assert back[name][known] == pytest.approx(true[known], abs=tolerance), name
    late = [name for name in signals() if np.isnan(back[name]).any()]
    assert bool(late) == (lost > 0.0)
    for name in late:
        assert np.isnan(back[name][TIME > TIME[-1] - lost + 1e-9]).all()


def test_all_sensor_effects_are_undone_together():
    car = car_with(**{key: values for key, (values, _) in UNDONE.items()})
    back = correct(car, TIME, sense(car, TIME, signals()))
    inside = (TIME > 0.2) & (TIME < 3.9)
    truth = signals()
    assert back["vehicle_speed_m_s"][inside] == pytest.approx(truth["vehicle_speed_m_s"][inside], abs=2e-3)
    assert back["accel_x_m_s2"][inside] == pytest.approx(truth["accel_x_m_s2"][inside], abs=1e-9)
    for name in WHEELS:
        assert back[name][inside] == pytest.approx(truth[name][inside], abs=1.0)


@pytest.mark.parametrize("effect_id", UNDONE)
def test_a_lost_sample_stays_lost_and_alone(effect_id):
    values, tolerance = UNDONE[effect_id]
    car = car_with(**{effect_id: values})
    log = sense(car, TIME, signals())
    for name in log:
        log[name] = log[name].copy()
        log[name][1000] = np.nan
    back = correct(car, TIME, log)
    inside = (STEP_S <= TIME) & (TIME < 3.9)
    for name, true in signals().items():
        gone = np.isnan(back[name]) & inside
        assert 1 <= gone.sum() <= 2, name
        kept = inside & ~gone
        assert back[name][kept] == pytest.approx(true[kept], abs=tolerance), name
