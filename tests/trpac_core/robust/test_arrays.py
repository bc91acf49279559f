"""The array functions give the C library's bits."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from trpac_core.robust.arrays import exp, log, total

VALUES = arrays(float, array_shapes(max_dims=2, max_side=9), elements=st.floats(1e-3, 30.0))


@given(VALUES)
def test_exp_and_log_are_the_c_librarys(values):
    for index in np.ndindex(values.shape):
        assert exp(values)[index] == math.exp(values[index])
        assert log(values)[index] == math.log(values[index])
    assert exp(values).shape == log(values).shape == values.shape


@given(VALUES)
def test_a_total_is_added_up_from_first_to_last(values):
    found = total(values)
    assert found.shape == (*values.shape[:-1], 1)
    for index in np.ndindex(values.shape[:-1]):
        added = 0.0
        for value in values[index].tolist():
            added += value
        assert found[index][0] == added
