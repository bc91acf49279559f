"""The estimator's functions that the native unit is made of."""

from __future__ import annotations

from trpac_core import car_friction, dife, local_speed, paper, sensors, tyre, wheel_step
from trpac_core.robust import messages, wheel
from trpac_core.vision import preview

from .translator.body import translated
from .translator.program import Program

ROOTS = (
    tyre.peak_friction,
    wheel_step.wheel_setup,
    wheel_step.first_state,
    wheel_step.first_estimate,
    wheel_step.unusable_input,
    wheel_step.rates_of,
    wheel_step.outcome_of,
    wheel_step.stepped,
    wheel_step.held,
    dife.fusion_step,
    dife.settled,
    dife.visual_gain,
    sensors.unusable,
    sensors.motion_plausible,
    messages.learnt_stiffness_n,
    messages.learnt_offset,
    preview.add_frame,
    preview.prune,
    preview.covering,
    paper.begun,
    paper.printed_step,
    wheel.setup,
    wheel.begun,
    wheel.stepped,
    wheel.point,
    wheel.claim,
    local_speed.local_speeds,
    car_friction.car_friction,
)
"""What the unit calls; all that these need is translated with them."""


def estimator_program() -> Program:
    """The estimator in C."""
    program = Program(translated)
    for function in ROOTS:
        program.require(function)
    return program
