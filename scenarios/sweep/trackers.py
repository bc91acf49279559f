"""The estimators that a sweep compares: ours, and any that is plugged in.

A plug-in is a class with a name, `reset()` and `step(step_s, Sensors)` that returns something with `TRPAC`,
`TRPAC_std` and `excited`. The package `scenarios.peers`, where there is one, lists its classes by name in
`PEERS`, a mapping from name to a function of what the estimators are `Told`; a sweep file may also name such a
function from anywhere as `package.module:function`.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from scenarios.effects import suggestion
from trpac_core.readings import Sensors
from trpac_core.vehicle import Vehicle

OWN = {"IFE": "TRPAC_image", "DE": "TRPAC_dynamics", "DIFE": "TRPAC"}
"""The estimators of this project, and the output of the fused one that holds each."""
PEERS_PACKAGE = "scenarios.peers"


class PeerEstimate(Protocol):
    """What a plugged-in estimator says at a step."""

    @property
    def TRPAC(self) -> float:
        """Estimated adhesion theta [-]."""
        ...

    @property
    def TRPAC_std(self) -> float:
        """Its standard deviation [-]."""
        ...

    @property
    def excited(self) -> bool:
        """Whether the tyre shows it anything."""
        ...


@runtime_checkable
class Peer(Protocol):
    """An estimator of one wheel on the same inputs as ours."""

    name: str

    def reset(self) -> None:
        """Forget everything."""
        ...

    def step(self, step_s: float, sensors: Sensors) -> PeerEstimate:
        """One step [s]."""
        ...


@dataclass(frozen=True)
class Told:
    """What a peer is told of its wheel: what ours is told, right or wrong.

    Attributes
    ----------
    vehicle : Vehicle
        The car as it is believed to be.
    front_axle : bool
        Whether the wheel is a front wheel.
    wheel_speed_noise_rad_s, vehicle_speed_noise_m_s, wheel_torque_noise_nm : float
        Standard deviations of the sensors' white noise per sample, as they are believed to be.
    theta_initial : float
        Estimate before anything is known [-].
    floor_m_s : float
        Speed below which slip says nothing [m/s].
    """

    vehicle: Vehicle
    front_axle: bool
    wheel_speed_noise_rad_s: float
    vehicle_speed_noise_m_s: float
    wheel_torque_noise_nm: float
    theta_initial: float
    floor_m_s: float


Factory = Callable[[Told], Peer]


def known_peers() -> Mapping[str, Factory]:
    """The peers that this checkout brings, by name."""
    if importlib.util.find_spec(PEERS_PACKAGE) is None:
        return {}
    package = importlib.import_module(PEERS_PACKAGE)
    return dict(getattr(package, "PEERS", {}))


def problem_of_tracker(name: str) -> str | None:
    """One sentence on what is wrong with an estimator's name in a sweep file; None where it is good."""
    if name in OWN:
        return None
    if ":" in name:
        return _problem_of_address(name)
    peers = known_peers()
    if name in peers:
        return None
    return f"estimators names {name!r}; {suggestion(name, [*OWN, *peers])}"


def _problem_of_address(name: str) -> str | None:
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        return f"estimators names {name!r}: {error}; expected package.module:function."
    return None if callable(found) else f"estimators names {name!r}, which cannot be called."


def make_peer(name: str, told: Told) -> Peer:
    """A plugged-in estimator, fresh; raises TypeError where what the name gives is none."""
    if ":" in name:
        module, _, function = name.partition(":")
        factory: Factory = getattr(importlib.import_module(module), function)
    else:
        factory = known_peers()[name]
    peer = factory(told)
    if not isinstance(peer, Peer):
        raise TypeError(f"{name} gives {type(peer).__name__}; expected an object with name, reset and step.")
    peer.reset()
    return peer
