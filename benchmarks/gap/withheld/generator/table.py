"""Which cases there are: the one place with the counts."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from .camera_library import CAMERA_LIBRARY
from .camera_outside import CAMERA_OUTSIDE
from .library import LIBRARY
from .outside import OUTSIDE


class Group(StrEnum):
    """What a case asks."""

    RICH = "rich"
    """One effect, driving that excites everything."""
    TYRE = "tyre_mismatch"
    """As rich, and the tyre's curve is partly of another formula."""
    MILD = "mild"
    """One effect, calm driving."""
    NO_GAP = "no_gap"
    PAIR = "pair"
    """Two effects at once."""
    OUTSIDE = "outside"
    """An effect that the library does not hold."""
    REMOVED = "removed"
    """The same logs as a rich case, its effect taken out of the library."""
    TIMING = "timing"
    """A log of 60 s at 1 kHz, by the command, alone on the machine."""


PAIRS = (
    ("aero_drag", "rolling_resistance"),
    ("aero_drag", "mass_offset"),
    ("aero_drag", "torque_delay"),
    ("rolling_resistance", "wheel_radius_offset"),
    ("rolling_resistance", "torque_lag"),
    ("road_grade", "vehicle_speed_scale"),
    ("road_grade", "accelerometer_bias"),
    ("road_grade", "torque_gain"),
    ("mass_offset", "tyre_stiffness_offset"),
    ("mass_offset", "accelerometer_bias"),
    ("mass_offset", "friction_offset"),
    ("wheel_radius_offset", "torque_lag"),
    ("wheel_radius_offset", "wheel_speed_delay"),
    ("load_transfer", "aero_drag"),
    ("load_transfer", "torque_delay"),
    ("tyre_relaxation", "vehicle_speed_delay"),
    ("tyre_relaxation", "brake_drag"),
    ("tyre_stiffness_offset", "friction_offset"),
    ("friction_falloff", "torque_gain"),
    ("mu_split", "vehicle_speed_delay"),
    ("torque_gain", "vehicle_speed_scale"),
    ("torque_delay", "wheel_speed_quantisation"),
    ("driveline_compliance", "vehicle_speed_scale"),
    ("wheel_inertia_offset", "aero_drag"),
    ("wheel_radius_offset", "tyre_stiffness_offset"),
    ("mass_offset", "load_transfer"),
    ("friction_offset", "friction_falloff"),
    ("brake_drag", "torque_gain"),
    ("wheel_speed_delay", "vehicle_speed_delay"),
    ("mass_offset", "rolling_resistance"),
    ("wheel_radius_offset", "wheel_inertia_offset"),
    ("tyre_relaxation", "tyre_stiffness_offset"),
    ("torque_gain", "torque_lag"),
    ("mass_offset", "road_grade"),
    ("wheel_speed_delay", "wheel_speed_quantisation"),
    ("vehicle_speed_scale", "accelerometer_bias"),
    ("torque_delay", "wheel_speed_delay"),
    ("rolling_resistance", "tyre_stiffness_offset"),
    ("mass_offset", "brake_drag"),
    ("rolling_resistance", "friction_offset"),
    ("vehicle_speed_delay", "vehicle_speed_scale"),
    ("aero_drag", "wheel_radius_offset"),
    ("friction_falloff", "tyre_stiffness_offset"),
    ("wheel_inertia_offset", "torque_gain"),
    ("mass_offset", "wheel_radius_offset"),
)
"""Pairs that one car may well have together."""

CAMERA_PAIRS = (
    ("camera_latency", "camera_pitch"),
    ("motion_blur", "exposure_shift"),
    ("camera_latency", "class_friction_offset"),
    ("camera_pitch", "motion_blur"),
    ("exposure_shift", "class_friction_offset"),
    ("camera_latency", "exposure_shift"),
    ("camera_pitch", "class_friction_offset"),
    ("camera_latency", "motion_blur"),
    ("camera_pitch", "exposure_shift"),
    ("motion_blur", "class_friction_offset"),
)
"""The same of one camera: new, in the dark, on a strange road, knocked, slow, behind a tinted windscreen."""

TARGETS = (5.5, 10.0, 20.0)
"""Wanted gaps [noise floors]; the first a little above five, so that most of its cases count."""


@dataclass(frozen=True)
class Spec:
    """What a case is to be, before anything is drawn.

    Attributes
    ----------
    name : str
        Unique; the seed and it fix everything that is drawn.
    group : Group
    effects : tuple of str
        What deviates.
    target : float
        Wanted gap of each effect [noise floors].
    data : str
        Name of the case whose logs these are, its own but for `REMOVED`.
    camera : bool
        Whether the logs have a camera, which is then where the deviation lies.
    """

    name: str
    group: Group
    effects: tuple[str, ...]
    target: float
    data: str
    camera: bool = False

    @property
    def rich(self) -> bool:
        """Whether everything is excited."""
        return not (self.group is Group.MILD or (self.group is Group.NO_GAP and self.name.endswith("calm")))

    @property
    def exclude(self) -> tuple[str, ...]:
        """What is taken out of the library."""
        return self.effects if self.group is Group.REMOVED else ()


@dataclass(frozen=True)
class Counts:
    """Cases per item of each group; `every` takes each n-th effect only, `camera` those of the camera."""

    rich: int
    tyre: int
    mild: int
    no_gap: int
    pairs: int
    outside: int
    removed: int
    timing: int
    every: int = 1
    camera: bool = False


SIZES: dict[str, Counts] = {
    "small": Counts(rich=1, tyre=1, mild=1, no_gap=3, pairs=1, outside=1, removed=1, timing=0, every=5),
    "full": Counts(rich=5, tyre=1, mild=2, no_gap=75, pairs=1, outside=3, removed=2, timing=1),
    "camera": Counts(rich=6, tyre=0, mild=3, no_gap=25, pairs=2, outside=2, removed=2, timing=0, camera=True),
}
"""Cases of each size."""


def table(size: str) -> list[Spec]:
    """All cases of a size, in a fixed order."""
    counts = SIZES[size]
    library, beyond, pairs = (
        (CAMERA_LIBRARY, CAMERA_OUTSIDE, CAMERA_PAIRS) if counts.camera else (LIBRARY, OUTSIDE, PAIRS)
    )
    inside, outside = list(library)[:: counts.every], list(beyond)[:: counts.every]
    specs = [_single(Group.RICH, e, i) for e in inside for i in range(counts.rich)]
    specs += [_single(Group.TYRE, e, i + 1) for e in inside for i in range(counts.tyre)]
    specs += [_single(Group.MILD, e, i + 1) for e in inside for i in range(counts.mild)]
    for i in range(counts.no_gap):
        name = f"no_gap-{i}-{'calm' if i % 3 == 2 else 'rich'}"
        specs.append(Spec(name, Group.NO_GAP, (), 1.0, name))
    for pair in pairs[:: counts.every]:
        for i in range(counts.pairs):
            name = f"pair-{pair[0]}-{pair[1]}-{i}"
            specs.append(Spec(name, Group.PAIR, pair, 10.0, name))
    specs += [_single(Group.OUTSIDE, e, i) for e in outside for i in range(counts.outside)]
    for effect in inside:
        for twin in [_single(Group.RICH, effect, i) for i in range(1, 1 + counts.removed)]:
            name = f"removed-{effect}-{twin.name[-1]}"
            specs.append(Spec(name, Group.REMOVED, (effect,), twin.target, twin.name))
    for i in range(counts.timing):
        specs.append(Spec(f"timing-{i}", Group.TIMING, ("torque_lag",), 10.0, f"timing-{i}"))
    return [replace(spec, camera=True) for spec in specs] if counts.camera else specs


def _single(group: Group, effect: str, i: int) -> Spec:
    name = f"{group.value}-{effect}-{i}"
    return Spec(name, group, (effect,), TARGETS[i % len(TARGETS)], name)
