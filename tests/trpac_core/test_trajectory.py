"""Reckoned wheel tracks and their uncertainty against closed forms, an ODE solver and Monte Carlo."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from trpac_core.vision.trajectory import (
    CHI_SQUARE_95_2DOF,
    FLOOR_SPEED_M_S,
    Motion,
    path_curvature,
    position_covariance,
    reckon,
    speed_along,
    way_beside,
    wheel_track,
)

WHEELBASE_M, HALF_TRACK_M = 2.305, 0.678
SETTINGS = {
    "wheelbase_m": WHEELBASE_M,
    "lateral_m": HALF_TRACK_M,
    "horizon_m": 12.0,
    "step_m": 0.25,
    "k1": 5e-5,
    "k2": 2e-4,
    "start_deviation_m": 0.08,
}


@pytest.mark.parametrize("steering_rad", [-0.4, -0.05, 0.02, 0.3])
@pytest.mark.parametrize("lateral_m", [HALF_TRACK_M, -HALF_TRACK_M])
def test_held_steering_keeps_a_front_wheel_on_its_circle(steering_rad, lateral_m):
    curvature = np.tan(steering_rad) / WHEELBASE_M
    track = wheel_track(np.linspace(0.0, 15.0, 40), curvature, WHEELBASE_M, lateral_m)
    centre = np.array([-WHEELBASE_M, 1.0 / curvature])
    radius = np.hypot(WHEELBASE_M, 1.0 / curvature - lateral_m)
    assert np.hypot(*(track - centre).T) == pytest.approx(np.full(40, radius))
    assert track[0] == pytest.approx([0.0, lateral_m])


@pytest.mark.parametrize("radius_m", [-8.0, -30.0, 10.0, 1e9])
def test_the_way_to_a_place_is_the_way_at_which_the_wheel_is_beside_it(radius_m):
    motion = Motion(4.0, steering_angle_rad=float(np.arctan(WHEELBASE_M / radius_m)))
    tracks = [reckon(motion, **{**SETTINGS, "lateral_m": y}) for y in (HALF_TRACK_M, -HALF_TRACK_M)]
    way = np.linspace(2.6, 11.4, 37)
    for side_m in (HALF_TRACK_M, -HALF_TRACK_M):
        track = wheel_track(way, 1.0 / radius_m, WHEELBASE_M, side_m)
        across = np.gradient(track, axis=0)[:, ::-1] * [-1.0, 1.0]
        beside = track + 0.1 * across / np.hypot(*across.T)[:, None]
        assert way_beside(tracks, track) == pytest.approx(way, abs=1e-2)
        assert way_beside(tracks, beside) == pytest.approx(way, abs=2e-2)
    assert way_beside(tracks, np.empty((0, 2))).shape == (0,)


def test_track_agrees_with_the_bicycle_model_about_the_centre_of_gravity():
    """Eq. (1) as printed, from the centre of gravity with its side slip, integrated by a library."""
    l_f, l_r, delta, v, a = 1.112, 1.193, 0.12, 8.0, 1.5
    beta = np.arctan(l_r / (l_f + l_r) * np.tan(delta))

    def rates(_, state):
        _, _, psi, speed = state
        slope = speed / np.cos(beta)
        return [slope * np.cos(psi + beta), slope * np.sin(psi + beta), slope * np.sin(beta) / l_r, a]

    run = solve_ivp(rates, (0.0, 1.2), [-l_f, 0.0, 0.0, v], rtol=1e-10, atol=1e-12)
    x, y, psi, _ = run.y[:, -1]
    left = (
        x + l_f * np.cos(psi) - HALF_TRACK_M * np.sin(psi),
        y + HALF_TRACK_M * np.cos(psi) + l_f * np.sin(psi),
    )
    driven_m = v * 1.2 + 0.5 * a * 1.2**2
    track = wheel_track(np.array([driven_m]), np.tan(delta) / (l_f + l_r), l_f + l_r, HALF_TRACK_M)
    assert track[0] == pytest.approx(left, abs=1e-7)


@given(st.floats(0.0, 60.0), st.floats(-9.0, 5.0), st.floats(-0.5, 0.5))
def test_path_depends_on_steering_alone_and_mirrors(speed, acceleration, steering):
    motion = Motion(speed, acceleration, steering)
    path = reckon(motion, **SETTINGS)
    mirrored = reckon(
        replace(motion, steering_angle_rad=-steering), **{**SETTINGS, "lateral_m": -HALF_TRACK_M}
    )
    standing = reckon(Motion(0.0, 0.0, steering), **SETTINGS)
    assert path.centre_m == pytest.approx(mirrored.centre_m * [1.0, -1.0], abs=1e-12)
    assert path.centre_m == pytest.approx(standing.centre_m)
    assert np.isfinite(path.covariance_m2).all()
    assert path.distance_m[-1] == pytest.approx(12.0)


def test_yaw_rate_takes_the_place_of_steering_above_the_floor_speed_only():
    fast = Motion(10.0, steering_angle_rad=0.3, yaw_rate_rad_s=-0.5)
    assert path_curvature(fast, WHEELBASE_M) == pytest.approx(-0.05)
    crawling = replace(fast, speed_m_s=0.5 * FLOOR_SPEED_M_S)
    assert path_curvature(crawling, WHEELBASE_M) == pytest.approx(np.tan(0.3) / WHEELBASE_M)


def test_speed_follows_the_acceleration_down_to_the_floor():
    speeds = speed_along(np.array([0.0, 10.0, 30.0]), Motion(12.0, -3.0))
    assert speeds == pytest.approx([12.0, np.sqrt(144.0 - 60.0), FLOOR_SPEED_M_S])


def test_covariance_recursion_equals_powers_of_the_transition_matrix():
    v, step, k1, k2, n = 9.0, 0.25, 5e-5, 2e-4, 30
    F = np.eye(4)
    F[0, 2] = F[1, 3] = step / v
    Q = np.diag([0.0, 0.0, k1 * v, k2 * v])
    start = np.diag([0.08**2, 0.08**2, 0.0, 0.0])
    power = np.linalg.matrix_power
    expected = power(F, n) @ start @ power(F, n).T
    expected += sum(power(F, j) @ Q @ power(F, j).T for j in range(n))
    found = position_covariance(np.full(n + 1, v), step, k1, k2, 0.08)
    assert found[n] == pytest.approx(expected[:2, :2])
    assert found[0] == pytest.approx(np.diag([0.08**2, 0.08**2]))


def test_uncertainty_grows_with_the_way_and_more_across_than_along():
    covariance = reckon(Motion(10.0), **SETTINGS).covariance_m2
    assert (np.diff(covariance[:, 0, 0]) >= 0.0).all()
    assert (np.diff(covariance[2:, 1, 1]) > 0.0).all()
    assert (covariance[2:, 1, 1] > covariance[2:, 0, 0]).all()


def test_outline_holds_95_percent_of_random_positions():
    ellipses = reckon(Motion(10.0, steering_angle_rad=0.1), **SETTINGS)
    mean, covariance = ellipses.centre_m[-1], ellipses.covariance_m2[-1]
    points = np.random.default_rng(0).multivariate_normal(mean, covariance, 20_000) - mean
    inside = np.einsum("ni,ij,nj->n", points, np.linalg.inv(covariance), points) <= CHI_SQUARE_95_2DOF
    assert inside.mean() == pytest.approx(0.95, abs=0.005)
    outline = ellipses.outlines_m()[-1] - mean
    on_it = np.einsum("ni,ij,nj->n", outline, np.linalg.inv(covariance), outline)
    assert on_it == pytest.approx(np.full(len(outline), CHI_SQUARE_95_2DOF))


def test_within_takes_each_ellipse_into_one_range():
    track = reckon(Motion(10.0), **SETTINGS)
    ranges = [(2.5, 4.5), (4.5, 7.5), (7.5, 12.0)]
    assert [len(track.within(*limits).distance_m) for limits in ranges] == [8, 12, 18]


@pytest.mark.parametrize(
    "bad", [{"speed_m_s": np.nan}, {"yaw_rate_rad_s": np.inf}, {"steering_angle_rad": 35.0}]
)
def test_motion_that_no_car_does_is_refused(bad):
    with pytest.raises(ValueError, match=r"expected|must be finite"):
        Motion(**{"speed_m_s": 5.0, **bad})
