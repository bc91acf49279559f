"""The effects that the plant can model, listed in ORDER."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module

from scenarios.effects.base import Effect, Parameter
from scenarios.errors import suggestion
from trpac_core.vehicle import Vehicle

ORDER = (
    # actuators
    "torque_gain",
    "torque_lag",
    "torque_delay",
    # dynamics
    "aero_drag",
    "rolling_resistance",
    "brake_drag",
    "road_grade",
    "mass_offset",
    "wheel_radius_offset",
    "wheel_inertia_offset",
    "driveline_compliance",
    "load_transfer",
    "tyre_stiffness_offset",
    "tyre_load_stiffness",
    "tyre_relaxation",
    "friction_falloff",
    "tyre_shape",
    "tyre_formula",
    # road
    "friction_offset",
    "mu_split",
    # sensors
    "vehicle_speed_scale",
    "vehicle_speed_delay",
    "wheel_speed_delay",
    "wheel_speed_quantisation",
    "accelerometer_bias",
    # perception
    "camera_pitch",
    "camera_latency",
    "motion_blur",
    "exposure_shift",
    "class_friction_offset",
)
"""Files of this folder, each with one effect of the same id, in the order in which the effects act: along the plant,
and within a stage as the signal passes them."""


def _forms_in(file: str) -> tuple[type[Effect], ...]:
    """The effect classes of a file of this folder, in order."""
    module = import_module(f"{__name__}.{file}")
    return tuple(
        kind
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, Effect) and kind.__module__ == module.__name__
    )


FORMS: dict[str, tuple[type[Effect], ...]] = {file: _forms_in(file) for file in ORDER}
"""All forms of each effect by its id, the plant's own first."""

EFFECTS: dict[str, type[Effect]] = {key: forms[0] for key, forms in FORMS.items()}
"""All effects by id, in `ORDER`; each is the first class of its file."""

__all__ = ["EFFECTS", "FORMS", "ORDER", "Effect", "Parameter", "form_of", "make_effect", "problems_of"]


def problems_of(effect_id: str, values: Mapping[str, float], vehicle: Vehicle, form: str = "") -> list[str]:
    """Problems of the values of an effect on this vehicle; empty without any."""
    if effect_id not in EFFECTS:
        return [
            f"{effect_id!r} is not an effect that the plant models; {suggestion(effect_id, list(EFFECTS))}"
        ]
    kind = next((kind for kind in FORMS[effect_id] if kind.form == form), EFFECTS[effect_id])
    known = {p.name: p for p in kind.parameters()}
    problems = [
        f"{name!r} is not a parameter of {effect_id}; {suggestion(name, list(known))}"
        for name in values
        if name not in known
    ]
    for name, p in known.items():
        low, high = p.bounds(vehicle)
        if name not in values:
            problems.append(f"{effect_id} needs {name} [{p.unit}], {p.meaning}.")
        elif not low <= values[name] <= high:
            problems.append(
                f"{effect_id}.{name} is {values[name]:g}; expected {low:g} to {high:g} [{p.unit}], {p.meaning}."
            )
    return problems


def form_of(effect_id: str, form: str) -> type[Effect]:
    """The class of an effect in one of its forms; the plant's own for an empty one."""
    return next(kind for kind in FORMS[effect_id] if form in ("", kind.form))


def make_effect(effect_id: str, values: Mapping[str, float], vehicle: Vehicle, form: str = "") -> Effect:
    """The effect with these parameter values on this vehicle, in a form of it; the plant's own for an empty one.

    Raises
    ------
    ValueError
        Unknown id or parameter, a missing parameter, or a value out of bounds; names them all.
    """
    problems = problems_of(effect_id, values, vehicle, form)
    if problems:
        raise ValueError(" ".join(problems))
    return form_of(effect_id, form)(**values)
