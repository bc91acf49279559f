"""The estimators that a sweep compares: ours, the peers of `scenarios.peers`, and plug-ins.

A plug-in is the object that `package.module:function` returns for a `PeerSetup`; it has a name, `reset()` and
`step(step_s, Sensors)`, see `scenarios.peers.base.Peer`.
"""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable

from scenarios import peers
from scenarios.errors import suggestion
from scenarios.metrics import ESTIMATORS
from scenarios.peers import Peer, PeerSetup
from trpac_core.files import quoted

ADDRESS = re.compile(r"\w+(\.\w+)*:\w+")
"""Pattern of package.module:function."""


def problem_of_tracker(name: str) -> str | None:
    """The problem of an estimator's name in a sweep file as a sentence; None for a known name or an address."""
    if name in ESTIMATORS or name in peers.PEERS or ADDRESS.fullmatch(name):
        return None
    problem = f"estimators names {quoted(repr(name))}"
    if ":" in name:
        return f"{problem}; expected package.module:function."
    return f"{problem}; {suggestion(name, [*ESTIMATORS, *peers.PEERS])}"


def problem_of_address(name: str) -> str | None:
    """The problem of an address as a sentence, None where its function can be called; imports its module."""
    problem = f"estimators names {quoted(repr(name))}"
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, SyntaxError, ValueError) as error:
        return f"{problem}: {quoted(error)}; expected package.module:function."
    return None if callable(found) else f"{problem}, which cannot be called."


def make_peer(name: str, setup: PeerSetup) -> Peer:
    """A new peer or plug-in; raises TypeError where the plug-in's object is no estimator."""
    if name in peers.PEERS:
        return peers.make_peer(name, setup)
    module, _, function = name.partition(":")
    factory: Callable[[PeerSetup], Peer] = getattr(importlib.import_module(module), function)
    peer = factory(setup)
    if not isinstance(peer, Peer):
        raise TypeError(f"{name} gives {type(peer).__name__}; expected an object with name, reset and step.")
    peer.reset()
    return peer
