"""The estimator's functions that the native unit is made of."""

from __future__ import annotations

from trpac_core import wheel_step
from trpac_core.estimator_data import Estimate
from trpac_core.robust import messages

from .translator.body import translated
from .translator.program import Program

ROOTS = (
    wheel_step.wheel_setup,
    wheel_step.first_state,
    wheel_step.first_estimate,
    wheel_step.unusable_input,
    wheel_step.rates_of,
    wheel_step.outcome_of,
    wheel_step.stepped,
    wheel_step.held,
    messages.learnt_stiffness_n,
    messages.learnt_offset,
    messages.is_implausible,
    vars(Estimate)["TRPAC_peak"].fget,
)
"""What the units call of one wheel; all that these need is translated with them."""


def estimator_program() -> Program:
    """The estimator in C."""
    program = Program(translated)
    for function in ROOTS:
        program.require(function)
    return program
