"""Longitudinal slip, Eq. (13)."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trpac_core.slip import GREATEST_SLIP, Slip, wheel_slip
from trpac_core.vehicle import GRAVITY_M_S2, Vehicle

FINITE = st.floats(-1e6, 1e6)


@given(FINITE, FINITE)
def test_slip_is_bounded_whatever_comes(wheel, vehicle):
    slip = wheel_slip(wheel, vehicle, 0.29, 1.0)
    assert 0.0 <= slip.size <= GREATEST_SLIP
    assert slip.direction in (-1.0, 0.0, 1.0)


def test_driven_braked_and_free():
    assert wheel_slip(11.0 / 0.29, 10.0, 0.29, 1.0) == Slip(pytest.approx(1.0 / 11.0), 1.0)
    assert wheel_slip(9.0 / 0.29, 10.0, 0.29, 1.0) == Slip(pytest.approx(0.1), -1.0)
    assert wheel_slip(0.0, 10.0, 0.29, 1.0) == Slip(GREATEST_SLIP, -1.0)
    assert wheel_slip(0.9 / 0.29, 1.0, 0.29, 1.0) == Slip(pytest.approx(0.1), -1.0)


@pytest.mark.parametrize(("wheel", "vehicle"), [(0.0, 0.0), (3.0, 0.5), (-2.0, 0.0), (0.0, -0.3)])
def test_standstill_is_no_excitation(wheel, vehicle):
    assert wheel_slip(wheel, vehicle, 0.29, 1.0) == Slip(0.0, 0.0)


def test_wheel_loads_carry_the_car_and_shift_by_the_closed_form():
    car = Vehicle()
    assert 2.0 * (car.wheel_load(True) + car.wheel_load(False)) == pytest.approx(car.mass_kg * GRAVITY_M_S2)
    shifted = car.wheel_load(False, 3.0) - car.wheel_load(False)
    assert shifted == pytest.approx(car.mass_kg * 3.0 * car.cog_height_m / (2.0 * car.wheelbase_m))
    assert car.wheel_load(True, 3.0) == pytest.approx(car.wheel_load(True) - shifted)
