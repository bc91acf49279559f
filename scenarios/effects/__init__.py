"""The effects that the plant can model; the one list of them is EFFECTS."""

from __future__ import annotations

from collections.abc import Mapping

from scenarios.effects.accelerometer_bias import AccelerometerBias
from scenarios.effects.aero_drag import AeroDrag
from scenarios.effects.base import Effect, Parameter
from scenarios.effects.brake_drag import BrakeDrag, BrakeDragOfAxles
from scenarios.effects.camera_latency import CameraLatency
from scenarios.effects.camera_pitch import CameraPitch
from scenarios.effects.class_friction_offset import ClassFrictionOffset
from scenarios.effects.driveline_compliance import (
    DrivelineCompliance,
    DrivelineComplianceOfAxles,
    DrivelineComplianceOfWheels,
)
from scenarios.effects.exposure_shift import ExposureShift
from scenarios.effects.friction_falloff import FrictionFalloff, FrictionFalloffHyperbolic
from scenarios.effects.friction_offset import FrictionOffset
from scenarios.effects.load_transfer import LoadTransfer
from scenarios.effects.mass_offset import MassOffset, MassOffsetPlaced
from scenarios.effects.motion_blur import MotionBlur
from scenarios.effects.mu_split import MuSplit
from scenarios.effects.road_grade import RoadGrade
from scenarios.effects.rolling_resistance import (
    RollingResistance,
    RollingResistanceForce,
    RollingResistanceOfAxles,
)
from scenarios.effects.torque_delay import TorqueDelay
from scenarios.effects.torque_gain import TorqueGain, TorqueGainOfAxles, TorqueGainOfSigns
from scenarios.effects.torque_lag import TorqueLag, TorqueLagInTwoStages, TorqueLagOfRiseAndFall
from scenarios.effects.tyre_formula import TyreFormula
from scenarios.effects.tyre_relaxation import (
    TyreRelaxation,
    TyreRelaxationOfAxles,
    TyreRelaxationOfSlip,
    TyreRelaxationOfWheels,
    TyreRelaxationWhileItAdheres,
    TyreRelaxationWithLoad,
)
from scenarios.effects.tyre_shape import TyreShape
from scenarios.effects.tyre_stiffness_offset import (
    TyreStiffnessOffset,
    TyreStiffnessOffsetOfAxles,
    TyreStiffnessOffsetOfWheels,
    TyreStiffnessOffsetWithLoad,
)
from scenarios.effects.vehicle_speed_delay import VehicleSpeedDelay
from scenarios.effects.vehicle_speed_scale import VehicleSpeedScale
from scenarios.effects.wheel_inertia_offset import WheelInertiaOffset, WheelInertiaOffsetOfAxles
from scenarios.effects.wheel_radius_offset import (
    WheelRadiusOffset,
    WheelRadiusOffsetOfAxles,
    WheelRadiusOffsetOfWheels,
    WheelRadiusOffsetRolling,
)
from scenarios.effects.wheel_speed_delay import WheelSpeedDelay
from scenarios.effects.wheel_speed_quantisation import WheelSpeedQuantisation
from scenarios.errors import suggestion
from trpac_core.vehicle import Vehicle

EFFECTS: dict[str, type[Effect]] = {
    effect.id: effect
    for effect in (
        # actuators
        TorqueGain,
        TorqueLag,
        TorqueDelay,
        # dynamics
        AeroDrag,
        RollingResistance,
        BrakeDrag,
        RoadGrade,
        MassOffset,
        WheelRadiusOffset,
        WheelInertiaOffset,
        DrivelineCompliance,
        LoadTransfer,
        TyreStiffnessOffset,
        TyreRelaxation,
        FrictionFalloff,
        TyreShape,
        TyreFormula,
        # road
        FrictionOffset,
        MuSplit,
        # sensors
        VehicleSpeedScale,
        VehicleSpeedDelay,
        WheelSpeedDelay,
        WheelSpeedQuantisation,
        AccelerometerBias,
        # perception
        CameraPitch,
        CameraLatency,
        MotionBlur,
        ExposureShift,
        ClassFrictionOffset,
    )
}
"""All effects by id, in the order in which they act: along the plant, and within a stage as the signal passes them."""

OTHER_FORMS = (
    TorqueGainOfAxles,
    TorqueGainOfSigns,
    TorqueLagInTwoStages,
    TorqueLagOfRiseAndFall,
    RollingResistanceForce,
    RollingResistanceOfAxles,
    BrakeDragOfAxles,
    MassOffsetPlaced,
    WheelRadiusOffsetRolling,
    WheelRadiusOffsetOfAxles,
    WheelRadiusOffsetOfWheels,
    WheelInertiaOffsetOfAxles,
    DrivelineComplianceOfAxles,
    DrivelineComplianceOfWheels,
    TyreStiffnessOffsetOfAxles,
    TyreStiffnessOffsetOfWheels,
    TyreStiffnessOffsetWithLoad,
    TyreRelaxationOfSlip,
    TyreRelaxationWithLoad,
    TyreRelaxationWhileItAdheres,
    TyreRelaxationOfAxles,
    TyreRelaxationOfWheels,
    FrictionFalloffHyperbolic,
)
FORMS: dict[str, tuple[type[Effect], ...]] = {
    key: (effect, *(other for other in OTHER_FORMS if other.id == key)) for key, effect in EFFECTS.items()
}
"""Every form of each effect, the plant's own first: what goes by one name in the field may act in more than one way."""

__all__ = ["EFFECTS", "FORMS", "Effect", "Parameter", "form_of", "make_effect", "problems_of"]


def problems_of(effect_id: str, values: Mapping[str, float], vehicle: Vehicle, form: str = "") -> list[str]:
    """Everything that keeps an effect from being made on this vehicle; empty when nothing does."""
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
