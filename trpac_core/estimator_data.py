"""Settings, output and state of the estimator of one wheel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum, IntEnum
from typing import Any, NamedTuple

from .dife import FusionState, Gains
from .errors import TrpacError
from .observer import seen_at
from .paper import Printed
from .robust.wheel import RobustState
from .sensors import (
    GREATEST_ACCELERATION_M_S2,
    JUMP_M_S,
    RIM_ACCELERATION_M_S2,
    RIM_JUMP_M_S,
    FilteredReadings,
    filter_share,
)
from .stationary_mean import StationaryMean
from .tyre import peak_friction
from .vehicle import CarTolerance, Vehicle
from .vision.classes import CLASS_THETA, Surface
from .vision.ife import IfeState
from .vision.ife_config import IfeConfig
from .vision.preview import PreviewConfig, PreviewState


@dataclass(frozen=True)
class RoadClass:
    """A surface class that another classifier found, in place of a picture; confidence is its Q_v."""

    surface: Surface
    confidence: float


class Method(Enum):
    """The estimator that computes TRPAC."""

    AS_PRINTED = 0
    """Eqs. (12) to (19) of the paper as they are printed."""
    DIFE = 1
    """The paper's fusion, run only where the tyre slides with statistical significance."""
    ROBUST = 2
    """The observer without camera, within the bounds of the belief; the belief's mean until it has read this road."""

    @property
    def label(self) -> str:
        """Its name in files and on the command line."""
        return self.name.lower()

    @property
    def title(self) -> str:
        """Its name in reports."""
        return "DIFE" if self is Method.DIFE else self.label.replace("_", " ")

    @classmethod
    def of(cls, label: str) -> Method:
        """The method of a name; TrpacError with the names there are."""
        known = {method.label: method for method in cls}
        if label not in known:
            raise TrpacError(f"estimator method is {label!r}; expected one of {', '.join(known)}.")
        return known[label]


class Source(IntEnum):
    """What an estimate rests on; a bit for the tyre, a bit for the camera."""

    NONE = 0
    TYRE = 1
    """The tyre has shown this road."""
    CAMERA = 2
    """A flagged class of the road under the wheel counts."""
    BOTH = 3

    @property
    def label(self) -> str:
        """Its name in files."""
        return self.name.lower()


@dataclass(frozen=True)
class EstimatorConfig:
    """Settings of one wheel's estimator.

    Parameters
    ----------
    vehicle : Vehicle
        What is known of the car.
    front_axle : bool
        Whether the wheel is a front wheel: its load and when it reaches the road seen ahead.
    left_side : bool
        Whether it is on the left: which wheel's track the camera follows.
    vision : IfeConfig
        Settings of the image estimator except those that follow from the vehicle and the wheel, see `image_settings`.
    gains, preview
        Settings of the parts.
    tolerance : CarTolerance
        Tolerances of the car; `vehicle.EXACT_CAR` where it agrees with its description.
    class_theta : tuple of 3 floats
        Adhesion of dry, wet, snow and ice [-].
    theta_initial : float
        The observer's estimate before anything is known: a dry road [-].
    floor_m_s : float
        Speed below which slip is not used. At 1 m/s a speed error of 0.014 m/s is a slip of 0.014, as
        large as the excitation threshold [m/s].
    sensor_filter_s : float
        Time constant of the filter on wheel speed, torque, vehicle speed and measured acceleration. The tyre's curve
        is bent: noise that reached it unfiltered would lower its mean force, and theta_hat would rise to make up for
        it. One filter for all keeps Eq. (12) true between the filtered signals [s].
    sliding_speed_noise_m_s : float
        Standard deviation of the sliding speed omega R - v per sample: that of the car's sensors [m/s].
    torque_noise_nm : float
        Standard deviation of the wheel torque per sample [N m].
    acceleration_filter_s : float
        Time constant for the acceleration that the load follows where it is differentiated from speed [s].
    method : Method
        The estimator that computes TRPAC.
    """

    vehicle: Vehicle = field(default_factory=Vehicle)
    front_axle: bool = True
    left_side: bool = True
    vision: IfeConfig = field(default_factory=IfeConfig)
    gains: Gains = field(default_factory=Gains)
    preview: PreviewConfig = field(default_factory=PreviewConfig)
    tolerance: CarTolerance = field(default_factory=CarTolerance)
    class_theta: tuple[float, float, float] = (
        CLASS_THETA[Surface.DRY],
        CLASS_THETA[Surface.WET],
        CLASS_THETA[Surface.SNOW_ICE],
    )
    theta_initial: float = 0.8
    floor_m_s: float = 1.0
    sensor_filter_s: float = 0.010
    sliding_speed_noise_m_s: float = 0.0042
    torque_noise_nm: float = 3.2
    acceleration_filter_s: float = 0.05
    method: Method = Method.ROBUST

    @property
    def image_settings(self) -> IfeConfig:
        """Settings of the image estimator for this vehicle and wheel: only the near group's verdict reaches it."""
        return replace(
            self.vision,
            groups_looked_at=1,
            track_m=self.vehicle.track_m,
            wheelbase_m=self.vehicle.wheelbase_m,
            side="left" if self.left_side else "right",
        )


class Estimate(NamedTuple):
    """Output of the estimator at a step."""

    TRPAC: float
    """Estimated adhesion of the road under the wheel [-]."""
    flag: bool
    """Epsilon: whether the camera's verdict on the road under the wheel is used."""
    K_v: float
    """Visual gain [-] or [1/s], after Eq. (17) or (18)."""
    excitation_flag: bool
    """Whether the estimator runs: slip is above the threshold."""
    excitation_threshold: float
    """Slip above which it runs [-]."""
    slip: float
    """Longitudinal slip, unsigned and filtered [-]."""
    tyre_force_n: float
    """Observed longitudinal force F_hat [N]."""
    TRPAC_image: float
    """Adhesion of the class that the camera gave the road under the wheel, whatever its flag [-]."""
    TRPAC_dynamics: float
    """The same estimator without the camera (DE) [-]."""
    image_confidence: float
    """Q_v of the road under the wheel, 0 where there is no verdict [-]."""
    frame_age_s: float
    """Time since the picture of the road under the wheel was taken; -1 where there is none [s]."""
    TRPAC_std: float
    """Standard deviation of TRPAC [-]."""
    load_n: float
    """Vertical load that is used [N]."""
    longitudinal_stiffness_n: float
    """C_x of the vehicle description [N]."""
    TRPAC_low: float
    """Lower bound of the interval that holds the road's TRPAC with 95 % [-]."""
    TRPAC_high: float
    """Its upper bound [-]."""
    TRPAC_expected: float
    """Mean of the belief: friction to expect before the tyre shows it [-]."""
    TRPAC_expected_std: float
    """Its standard deviation [-]."""
    source: Source
    problem: str | None = None
    """One sentence where the input was unusable and the last good estimate is held."""

    @property
    def TRPAC_peak(self) -> float:
        """Maximum of the tyre curve at TRPAC, which a brake test measures; computed on access [-]."""
        return peak_friction(self.TRPAC, self.load_n, self.longitudinal_stiffness_n)


OUTPUTS = (
    "TRPAC",
    "flag",
    "K_v",
    "excitation_flag",
    "excitation_threshold",
    "slip",
    "tyre_force_n",
    "TRPAC_image",
    "TRPAC_dynamics",
    "TRPAC_peak",
    "image_confidence",
    "frame_age_s",
    "TRPAC_std",
    "TRPAC_low",
    "TRPAC_high",
    "TRPAC_expected",
    "TRPAC_expected_std",
    "source",
)
"""Fields of an estimate that tables and buses show."""


@dataclass(slots=True)
class EstimatorState:
    """State of the estimator; changed in place at the end of a step."""

    fusion: FusionState
    dynamics: FusionState
    readings: FilteredReadings
    robust: RobustState
    printed: Printed
    printed_alone: Printed
    """Of the estimator as printed, with the camera and without."""
    locked_s: float = math.inf
    """Time since the wheel was last locked [s]."""
    time_s: float = 0.0
    position_m: float = 0.0
    speed_m_s: float = 0.0
    acceleration_m_s2: float = 0.0
    lagged_slip: float = 0.0
    """Signed slip through the sensor filter once more [-]."""
    lagged_speed_m_s: float = 0.0
    """Speed behind the filter that differentiates it."""
    load_n: float = 0.0
    """Vertical load, filtered where it is measured."""
    step_s: float = 0.0
    settled: bool = False
    """Whether the force observers follow the wheel; not so at the start and after a gap in the input."""
    frame_failed: bool = False
    ife: IfeState = field(default_factory=IfeState)
    preview: PreviewState = field(default_factory=PreviewState)

    def to_json(self) -> dict[str, Any]:
        """The state as JSON-able values, exact."""
        values = {item.name: getattr(self, item.name) for item in fields(self)}
        for name in _PARTS:
            values[name] = values[name]._asdict()
        for name in ("fusion", "dynamics"):
            values[name]["mean"] = values[name]["mean"]._asdict()
        values["locked_s"] = None if math.isinf(self.locked_s) else self.locked_s
        for name in ("printed", "printed_alone"):
            values[name] = [None if math.isnan(value) else value for value in values[name]]
        values["ife"], values["preview"] = self.ife.to_json(), self.preview.to_json()
        values["robust"] = self.robust.to_json()
        return values

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> EstimatorState:
        """The state that `to_json` wrote."""
        values = dict(data)
        for name, kind in _PARTS.items():
            values[name] = kind(**values[name])
        values["locked_s"] = math.inf if values["locked_s"] is None else values["locked_s"]
        for name in ("printed", "printed_alone"):
            theta, s = values[name]
            values[name] = Printed(theta, math.nan if s is None else s)
        values["ife"] = IfeState.from_json(values["ife"])
        values["preview"] = PreviewState.from_json(values["preview"])
        values["robust"] = RobustState.from_json(values["robust"])
        return cls(**values)


def _fusion_state(**values: Any) -> FusionState:
    """A state of its JSON-able values."""
    return FusionState(**{**values, "mean": StationaryMean(**values["mean"])})


_PARTS: Mapping[str, Any] = {
    "fusion": _fusion_state,
    "dynamics": _fusion_state,
    "readings": FilteredReadings,
}


@dataclass(slots=True)
class Rates:
    """Values that depend on the step size only."""

    step_s: float
    sensor_share: float
    """Of the sensor filter [-]."""
    acceleration_share: float
    """Of the filter that differentiates speed [-]."""
    noise_m_s: float
    """Standard deviation of the filtered sliding speed [m/s]."""
    most_m_s: float
    """How far the speed may be from its filter [m/s]."""
    most_rim_m_s: float
    """How far the rim's speed may be from its filter [m/s]."""
    ahead: float
    """Share of the step at which the force observer samples an input that changes linearly over it [-]."""
    differentiator_1_s: float
    """Acceleration by the speed's distance from the filter that differentiates it [1/s]."""

    @classmethod
    def at(cls, config: EstimatorConfig, step_s: float, before_s: float) -> Rates:
        """Rates of a step; a step of 0 keeps noise and differentiator of the one before it."""
        sensor_share, lag_s = filter_share(step_s, config.sensor_filter_s), step_s or before_s
        # White noise per sample through a discrete first-order filter
        share = filter_share(lag_s, config.sensor_filter_s)
        return cls(
            step_s,
            sensor_share,
            filter_share(step_s, config.acceleration_filter_s),
            noise_m_s=config.sliding_speed_noise_m_s * math.sqrt(share / (2.0 - share)),
            most_m_s=JUMP_M_S + GREATEST_ACCELERATION_M_S2 * step_s,
            most_rim_m_s=RIM_JUMP_M_S + RIM_ACCELERATION_M_S2 * step_s,
            ahead=seen_at(config.gains.K * step_s),
            # On an even rise a discrete filter lags by step over share, not by its time constant.
            differentiator_1_s=filter_share(lag_s, config.acceleration_filter_s) / lag_s
            if lag_s
            else 1.0 / config.acceleration_filter_s,
        )
