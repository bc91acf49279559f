"""The peers: their wheel model and their convergence against an independent solution, and their manners."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
import plant_oracle
import pytest
from scipy.integrate import solve_ivp

from scenarios.errors import ScenarioError
from scenarios.peers import (
    PEER_NAMES,
    EkfPeer,
    KalmanTuning,
    PeerSetup,
    SlipSlopePeer,
    SlipSlopeTuning,
    Tuning,
    UkfPeer,
    load_tuning,
    make_peers,
)
from scenarios.peers.base import UNKNOWN, SensorFront
from scenarios.peers.tuning import write_tuning
from scenarios.peers.wheel_model import WheelState, advanced
from trpac_core.sensors import Sensors
from trpac_core.vehicle import Vehicle

CAR = Vehicle(cog_height_m=0.0, rolling_resistance=0.0)
LOAD_N = CAR.wheel_load(front=True)
SETUP = PeerSetup(CAR)


@lru_cache
def spinning(theta, torque_nm=330.0, noisy=True, step_s=0.002, duration_s=1.2, speed_m_s=8.0):
    """Readings of a wheel that is driven into sliding, from the tests' own tyre and a general integrator."""

    def rates(t, y):
        omega, v = y
        rim = omega * CAR.wheel_radius_m
        slip = (rim - v) / max(rim, v)
        force = math.copysign(
            plant_oracle.friction_force(theta, abs(slip), LOAD_N, CAR.longitudinal_stiffness_n), slip
        )
        torque = torque_nm * min(t / 0.1, 1.0)
        return [(torque - CAR.wheel_radius_m * force) / CAR.wheel_inertia_kg_m2, 4.0 * force / CAR.mass_kg]

    time_s = np.arange(0.0, duration_s, step_s)
    start = [speed_m_s / CAR.wheel_radius_m, speed_m_s]
    omega, v = solve_ivp(rates, (0.0, duration_s), start, "Radau", t_eval=time_s, rtol=1e-8, atol=1e-9).y
    accel = np.array([4.0 * CAR.mass_kg**-1.0 * f for f in _forces(theta, omega, v)])
    torque = torque_nm * np.minimum(time_s / 0.1, 1.0)
    rng = np.random.default_rng(11)
    sigma = (0.01, 3.2, 0.003, 0.05) if noisy else (0.0,) * 4
    columns = [
        a + s * rng.standard_normal(len(a)) for a, s in zip((omega, torque, v, accel), sigma, strict=True)
    ]
    return [
        Sensors(w, t, u, longitudinal_acceleration_m_s2=a) for w, t, u, a in np.column_stack(columns).tolist()
    ]


def _forces(theta, omega, v):
    for w, u in zip(omega, v, strict=True):
        rim = w * CAR.wheel_radius_m
        slip = (rim - u) / max(rim, u)
        size = plant_oracle.friction_force(theta, abs(slip), LOAD_N, CAR.longitudinal_stiffness_n)
        yield math.copysign(size, slip)


def last(peer, readings, step_s=0.002):
    for sensors in readings:
        said = peer.step(step_s, sensors)
    return said


@pytest.mark.parametrize("kind", [EkfPeer, UkfPeer])
@pytest.mark.parametrize("theta", [0.2, 0.3])
def test_filters_find_the_friction_of_a_sliding_tyre(kind, theta):
    """From the start value 0.8, on a tyre and an integrator that are not the filter's."""
    said = last(kind(SETUP, KalmanTuning(theta_walk=0.05)), spinning(theta))
    assert said.TRPAC == pytest.approx(theta, abs=0.01)
    assert said.excited
    assert said.TRPAC_std < 0.02


def test_filters_agree_where_the_tyre_is_seen():
    """Two linearisations of one model: no more apart than their own deviation."""
    ekf, ukf = (last(kind(SETUP, KalmanTuning()), spinning(0.3)) for kind in (EkfPeer, UkfPeer))
    assert abs(ekf.TRPAC - ukf.TRPAC) < 2.0 * max(ekf.TRPAC_std, ukf.TRPAC_std)


@pytest.mark.parametrize(("step_s", "share"), [(0.001, 0.1), (0.01, 0.4)])
@pytest.mark.parametrize(("rim_m_s", "theta"), [(5.02, 0.9), (5.05, 0.5), (5.3, 0.3), (4.7, 0.3)])
def test_a_step_of_the_wheel_follows_a_general_integrator(step_s, share, rim_m_s, theta):
    """Also where the equation is so stiff that an explicit step of 10 ms would blow up; 10 ms are rough."""
    state = WheelState(rim_m_s / CAR.wheel_radius_m, 5.0, theta)
    torque, accel = 200.0, 1.5

    def rates(t, y):
        rim, v = y[0] * CAR.wheel_radius_m, 5.0 + accel * t
        slip = (rim - v) / max(rim, v)
        force = math.copysign(
            plant_oracle.friction_force(theta, abs(slip), LOAD_N, CAR.longitudinal_stiffness_n), slip
        )
        return [(torque - CAR.wheel_radius_m * force) / CAR.wheel_inertia_kg_m2]

    true = solve_ivp(rates, (0.0, step_s), state[:1], "Radau", rtol=1e-9, atol=1e-10).y[0, -1]
    moved = advanced(state, torque, accel, LOAD_N, CAR, step_s, 1.0)
    change = abs(true - state.wheel_speed_rad_s)
    assert moved.state.wheel_speed_rad_s == pytest.approx(true, abs=share * change + 1e-4)
    assert moved.state.speed_m_s == pytest.approx(5.0 + accel * step_s)


@pytest.mark.parametrize(("rim_m_s", "theta"), [(5.15, 0.3), (4.8, 0.3), (5.02, 0.9)])
def test_the_jacobian_is_the_derivative_of_the_step(rim_m_s, theta):
    """To first order in the step: how the linearised equation itself changes with the state is left out."""
    state, step_s = WheelState(rim_m_s / CAR.wheel_radius_m, 5.0, theta), 1e-6

    def after(changed):
        return advanced(changed, 200.0, 0.0, LOAD_N, CAR, step_s, 1.0).state.wheel_speed_rad_s

    moved = advanced(state, 200.0, 0.0, LOAD_N, CAR, step_s, 1.0)
    said = (moved.by_wheel_speed, moved.by_speed, moved.by_theta)
    for name, analytic in zip(WheelState._fields, said, strict=True):
        value, h = getattr(state, name), 1e-5
        numeric = (
            after(state._replace(**{name: value + h})) - after(state._replace(**{name: value - h}))
        ) / (2 * h)
        assert analytic == pytest.approx(numeric, rel=0.01, abs=1e-9), name


def test_slip_slope_finds_the_slope_of_an_elastic_tyre():
    """At small slip on a grippy road the slope is 1.27 C_x / F_z, whatever the road."""
    tuning = SlipSlopeTuning(filter_s=0.01, least_slip=0.002, sliding_slip=0.5, intercept=0.0, gain=0.04)
    peer = SlipSlopePeer(SETUP, tuning)
    last(peer, spinning(1.1, torque_nm=150.0, noisy=False))
    elastic = 1.27 * CAR.longitudinal_stiffness_n / LOAD_N
    assert peer.slope == pytest.approx(elastic, rel=0.06)  # the curve bends by some per cent


def test_slip_slope_reads_used_friction_where_the_tyre_slides_as_a_whole():
    readings = spinning(0.25, noisy=False)
    tuning = SlipSlopeTuning(sliding_slip=0.06, intercept=0.0, gain=0.04)
    peer = SlipSlopePeer(SETUP, tuning)
    said = last(peer, readings)
    end = readings[-1]
    slip = 1.0 - end.vehicle_speed_m_s / (end.wheel_speed_rad_s * CAR.wheel_radius_m)
    assert slip > 0.06
    used = plant_oracle.friction_force(0.25, slip, LOAD_N, CAR.longitudinal_stiffness_n) / LOAD_N
    assert said.TRPAC == pytest.approx(used, abs=0.02)
    assert peer.slope is None


@pytest.mark.parametrize("name", PEER_NAMES)
class TestManners:
    def peer(self, name):
        return next(p for p in make_peers(SETUP) if p.name == name)

    def test_lost_samples_hold_the_estimate_and_widen_it(self, name):
        peer = self.peer(name)
        before = last(peer, spinning(0.3))
        lost = Sensors(math.nan, math.nan, 12.0)
        for _ in range(500):
            after = peer.step(0.002, lost)
        assert after.TRPAC == pytest.approx(before.TRPAC)
        assert after.TRPAC_std > before.TRPAC_std
        assert not after.excited

    def test_it_goes_on_after_a_gap(self, name):
        peer, readings = self.peer(name), spinning(0.3)
        last(peer, readings)
        peer.step(0.002, replace(readings[0], wheel_torque_nm=math.nan))
        assert math.isfinite(last(peer, readings[-200:]).TRPAC)

    def test_standing_says_nothing(self, name):
        peer = self.peer(name)
        for _ in range(100):
            said = peer.step(0.01, Sensors(0.0, 200.0, 0.0, longitudinal_acceleration_m_s2=0.0))
        assert (said.TRPAC, said.excited) == (0.8, False)
        assert said.TRPAC_std == pytest.approx(UNKNOWN)

    def test_reset_forgets(self, name):
        peer, readings = self.peer(name), spinning(0.3)
        first = [peer.step(0.002, s) for s in readings[:150]]
        last(peer, readings[150:])
        peer.reset()
        assert [peer.step(0.002, s) for s in readings[:150]] == first

    def test_a_step_of_no_time_changes_nothing_lasting(self, name):
        peer = self.peer(name)
        last(peer, spinning(0.3))
        said = peer.step(0.0, spinning(0.3)[-1])
        assert 0.0 < said.TRPAC < 1.3

    def test_a_log_without_accelerometer_is_differentiated(self, name):
        peer = self.peer(name)
        without = [replace(s, longitudinal_acceleration_m_s2=None) for s in spinning(0.3)]
        said = last(peer, without)
        assert math.isfinite(said.TRPAC)
        assert said.excited


def test_the_load_follows_the_measured_acceleration():
    front = SensorFront(PeerSetup(Vehicle()))
    sensors = Sensors(50.0, 100.0, 14.0, longitudinal_acceleration_m_s2=3.0)
    taken = front.take(0.01, sensors)
    assert taken.load_n == pytest.approx(Vehicle().wheel_load(True, 3.0))


def test_the_delivered_tuning_names_its_seeds_and_every_peer():
    assert [p.name for p in make_peers(SETUP, load_tuning())] == list(PEER_NAMES)


def test_a_tuning_survives_its_file(tmp_path):
    tuning = Tuning(SlipSlopeTuning(gain=0.031), KalmanTuning(theta_walk=0.02), KalmanTuning(spread=0.5))
    write_tuning(tmp_path / "t.yaml", tuning, {"seeds": [1]})
    assert load_tuning(tmp_path / "t.yaml") == tuning


def test_a_tuning_with_a_slip_in_a_name_is_refused(tmp_path):
    write_tuning(tmp_path / "t.yaml", Tuning(), {})
    text = (tmp_path / "t.yaml").read_text().replace("theta_walk", "theta_wlak")
    (tmp_path / "t.yaml").write_text(text)
    with pytest.raises(ScenarioError, match="theta_wlak"):
        load_tuning(tmp_path / "t.yaml")
