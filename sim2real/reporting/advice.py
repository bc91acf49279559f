"""What to try where the verdict names no effect but one or two come near: one sentence of a table per effect."""

from __future__ import annotations

from sim2real.hypotheses.contest import Contest, Entry
from sim2real.hypotheses.selection import Decision
from sim2real.reporting.sentences import closest, number

WORTH_A_TRY = 0.9
"""Share of the misfit from which on an effect that is not named is worth a try [-]."""

TRIES = {
    "torque_gain": "Multiply the wheel torque by about {factor} in the mapping file (scale), or check the torque's "
    "unit, the gear and mass_kg",
    "torque_lag": "Check whether the logged torque is a demand that the actuators follow with a time constant of about "
    "{time_constant_s} s",
    "torque_delay": "Check whether the logged torque is about {delay_s} s ahead of the other signals",
    "aero_drag": "Set aero_drag in the vehicle file to a drag area of about {drag_area_m2} m^2",
    "rolling_resistance": "Set rolling_resistance in the vehicle file to about {coefficient}",
    "brake_drag": "Check whether the brakes drag with about {torque_nm} N m per wheel, or whether brake torque is "
    "missing in the log",
    "road_grade": "Check whether the road has a grade of about {grade}",
    "mass_offset": "Add about {mass_kg} kg to mass_kg in the vehicle file, or check the payload and the torque's scale",
    "wheel_radius_offset": "Set wheel_radius_m in the vehicle file to about {radius_m} m, or check the "
    "unit of the speeds",
    "wheel_inertia_offset": "Set wheel_inertia_kg_m2 in the vehicle file to about {inertia_kg_m2} kg m^2",
    "driveline_compliance": "Check whether the torque is measured at the motor and the driveline twists with about "
    "{stiffness_nm_rad} N m/rad",
    "load_transfer": "Set cog_height_m of load_transfer in the vehicle file to about {cog_height_m} m",
    "tyre_stiffness_offset": "Set tyre.longitudinal_stiffness_n in the vehicle file to about {stiffness_n} N",
    "tyre_load_stiffness": "Set tyre_load_stiffness in the vehicle file to an exponent of about {exponent}",
    "tyre_relaxation": "Set tyre_relaxation in the vehicle file to a length of about {length_m} m",
    "friction_falloff": "Check whether the friction of a sliding tyre falls to about {floor} of its value",
    "friction_offset": "Multiply the friction in the road file by about {factor}",
    "mu_split": "Multiply the friction in the road file by about {left_factor} at the left and {right_factor} at the "
    "right",
    "vehicle_speed_scale": "Divide the vehicle speed by about {factor} in the mapping file (scale), or check its unit",
    "vehicle_speed_delay": "Check whether the vehicle speed is logged about {delay_s} s late",
    "wheel_speed_delay": "Check whether the wheel speeds are logged about {delay_s} s late",
    "wheel_speed_quantisation": "Check whether the wheel speeds are counted from about {teeth} teeth",
    "accelerometer_bias": "Subtract about {bias_m_s2} m/s^2 from the accelerometer in the mapping file (offset), or "
    "check the grade of the road",
}
"""Sentences without their point, with the values of the effect's parameters."""


def advice(decision: Decision, contest: Contest) -> str:
    """What to try by what comes nearest; empty where it is named, or leaves more than a tenth of the misfit."""
    found = closest(decision, contest)
    if found is None or found[1] <= WORTH_A_TRY or not set(found[0].ids) <= set(TRIES):
        return ""
    return f"{'. '.join(_tries(found[0]))}. Then diagnose again."


def _tries(entry: Entry) -> list[str]:
    candidate, x = entry.fitted.candidate, entry.fitted.x
    values: dict[str, dict[str, str]] = {key: {} for key in entry.ids}
    for (key, p), value in zip(candidate.parameters, x, strict=True):
        values[key][p.name] = number(value, digits=2)
    return [TRIES[key].format(**values[key]) for key in entry.ids]
