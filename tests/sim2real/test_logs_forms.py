"""One drive in all forms that a log comes in gives one estimate."""

import numpy as np
import pytest
from log_forms import FORMS
from long import beyond

import trpac

CAR = trpac.Vehicle.builtin("four_in_wheel_motor_ev")
TIME_S = np.arange(0.0, 2.6, 0.005)
TORQUE = np.column_stack([250.0 * (np.sin(4.0 * TIME_S) > -0.3)] * 4)
TOLERANCE = 1e-6
"""Files hold as many digits as the numbers have, times to a microsecond; the estimate moves by less than this."""


@pytest.fixture(scope="module")
def drive():
    return trpac.simulate(CAR, trpac.Road.uniform(0.4, "wet"), torque=TORQUE, speed=5.0).drop(
        columns="mu_reference"
    )


@pytest.fixture(scope="module")
def estimate(drive):
    return trpac.estimate(drive, CAR).frame


@pytest.mark.parametrize("form", beyond(7, FORMS))
def test_the_estimate_is_that_of_the_plain_form(drive, estimate, tmp_path, form):
    made = FORMS[form](drive, tmp_path)
    read = trpac.read_log(made.path, mapping=made.mapping, dbc=made.dbc)
    assert read.warnings == ()
    found = trpac.estimate(read, CAR).frame
    assert np.abs(estimate["TRPAC"].max() - estimate["TRPAC"].min()) > 0.05
    for name in ("TRPAC", "TRPAC_std"):
        assert np.nanmax(np.abs(found[name].to_numpy() - estimate[name].to_numpy())) < TOLERANCE
