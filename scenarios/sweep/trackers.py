"""The estimators that a sweep compares: ours, the peers of `scenarios.peers`, and any that is plugged in.

A plug-in is what `package.module:function` gives for what the estimators are told, a `PeerSetup`: an object with a
name, `reset()` and `step(step_s, Sensors)`, see `scenarios.peers.base.Peer`.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable

from scenarios import peers
from scenarios.effects import suggestion
from scenarios.peers import Peer, PeerSetup

OWN = {"IFE": "TRPAC_image", "DE": "TRPAC_dynamics", "DIFE": "TRPAC"}
"""The estimators of this project, and the output of the fused one that holds each."""


def problem_of_tracker(name: str) -> str | None:
    """One sentence on what is wrong with an estimator's name in a sweep file; None where it is good."""
    if name in OWN or name in peers.PEERS:
        return None
    if ":" in name:
        return _problem_of_address(name)
    return f"estimators names {name!r}; {suggestion(name, [*OWN, *peers.PEERS])}"


def _problem_of_address(name: str) -> str | None:
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        return f"estimators names {name!r}: {error}; expected package.module:function."
    return None if callable(found) else f"estimators names {name!r}, which cannot be called."


def make_peer(name: str, setup: PeerSetup) -> Peer:
    """A peer or a plugged-in estimator, fresh; raises TypeError where what the name gives is none."""
    if name in peers.PEERS:
        return peers.make_peer(name, setup)
    module, _, function = name.partition(":")
    factory: Callable[[PeerSetup], Peer] = getattr(importlib.import_module(module), function)
    peer = factory(setup)
    if not isinstance(peer, Peer):
        raise TypeError(f"{name} gives {type(peer).__name__}; expected an object with name, reset and step.")
    peer.reset()
    return peer
