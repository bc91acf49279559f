"""The delivered gains are the designed ones, and the design's noise figure is what a simulation shows."""

import control
import numpy as np
import pytest

from scenarios.gain_design import SEPARATION, DesignPoint, design_gains, linearised, theta_deviation
from trpac_core.dife import Gains
from trpac_core.vehicle import Vehicle

CAR = Vehicle()


def test_delivered_gains_are_the_designed_ones():
    design = design_gains(DesignPoint(), CAR)
    assert Gains().K == pytest.approx(design.K, rel=0.01)
    assert Gains().gamma == pytest.approx(design.gamma, rel=0.01)
    assert design.theta_deviation <= DesignPoint().theta_deviation


def test_poles_are_the_two_gains():
    """The cascade is exact: linearised, observer and estimator have the poles -K and -gamma."""
    poles = np.sort(control.poles(linearised(DesignPoint(), CAR, 60.0, 10.0)).real)
    assert poles == pytest.approx([-60.0, -10.0], rel=1e-6)


def test_more_noise_lowers_gamma_until_the_deviation_is_kept():
    loud = DesignPoint(vehicle_speed_noise_m_s=0.03, wheel_speed_noise_rad_s=0.1)
    design = design_gains(loud, CAR)
    assert design.gamma < design.K / SEPARATION
    assert design.theta_deviation == pytest.approx(loud.theta_deviation, rel=1e-3)


def test_deviation_from_the_lyapunov_equation_is_that_of_a_simulation():
    point = DesignPoint()
    system = control.c2d(linearised(point, CAR, 63.0, 12.5), point.sample_time_s, "zoh")
    noise = np.random.default_rng(5).standard_normal((3, 400_000)) * np.array(
        [
            [point.wheel_torque_noise_nm],
            [point.wheel_speed_noise_rad_s],
            [point.vehicle_speed_noise_m_s],
        ]
    )
    response = control.forced_response(system, inputs=noise, timepts=np.arange(400_000) * point.sample_time_s)
    # 400 s hold some 5000 independent values of a filter at 12.5 1/s: the deviation is known to 1 to 2 %.
    assert np.std(np.squeeze(response.outputs)[1000:]) == pytest.approx(
        theta_deviation(point, CAR, 63.0, 12.5), rel=0.05
    )
