"""The estimators that a sweep compares: ours, the peers of `scenarios.peers`, and any that is plugged in.

A plug-in is what `package.module:function` gives for what the estimators are told, a `PeerSetup`: an object with a
name, `reset()` and `step(step_s, Sensors)`, see `scenarios.peers.base.Peer`.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable

from scenarios import peers
from scenarios.errors import suggestion
from scenarios.peers import Peer, PeerSetup
from trpac_core.estimator_data import Method
from trpac_core.files import quoted

OWN = {"IFE": "TRPAC_image", "DE": "TRPAC_dynamics", "DIFE": "TRPAC"}
"""The estimators of this project, and the output of the fused one that holds each."""
METHODS = tuple(method.label for method in Method if method is not Method.DIFE)
"""The other methods of this project's estimator."""

ADDRESS = re.compile(r"\w+(\.\w+)*:\w+")
"""package.module:function, which no formula, markup or relative import is."""


def problem_of_tracker(name: str) -> str | None:
    """One sentence on what is wrong with an estimator's name in a sweep file; None where it is good, or an address."""
    if name in OWN or name in METHODS or name in peers.PEERS or ADDRESS.fullmatch(name):
        return None
    problem = f"estimators names {quoted(repr(name))}"
    if ":" in name:
        return f"{problem}; expected package.module:function."
    return f"{problem}; {suggestion(name, [*OWN, *METHODS, *peers.PEERS])}"


def problem_of_address(name: str) -> str | None:
    """One sentence on why the function at an address cannot be called; None where it can. Imports its module."""
    problem = f"estimators names {quoted(repr(name))}"
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, SyntaxError, ValueError) as error:
        return f"{problem}: {quoted(error)}; expected package.module:function."
    return None if callable(found) else f"{problem}, which cannot be called."


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
