"""Friction estimators of the literature on the same inputs as ours, tuned, with one interface."""

from collections.abc import Callable, Mapping

from scenarios.peers.base import Peer, PeerEstimate, PeerSetup
from scenarios.peers.kalman import EkfPeer, KalmanTuning, UkfPeer
from scenarios.peers.slip_slope import SlipSlopePeer, SlipSlopeTuning
from scenarios.peers.tuning import TUNING_FILE, Tuning, load_tuning

__all__ = [
    "PEERS",
    "PEER_NAMES",
    "TUNING_FILE",
    "EkfPeer",
    "KalmanTuning",
    "Peer",
    "PeerEstimate",
    "PeerSetup",
    "SlipSlopePeer",
    "SlipSlopeTuning",
    "Tuning",
    "UkfPeer",
    "load_tuning",
    "make_peer",
    "make_peers",
]

PEERS: Mapping[str, Callable[[PeerSetup, Tuning], Peer]] = {
    SlipSlopePeer.name: lambda setup, tuning: SlipSlopePeer(setup, tuning.slip_slope),
    EkfPeer.name: lambda setup, tuning: EkfPeer(setup, tuning.ekf),
    UkfPeer.name: lambda setup, tuning: UkfPeer(setup, tuning.ukf),
}
"""Constructor of each peer on one wheel, by name."""
PEER_NAMES = tuple(PEERS)
"""Names of all peers, in the order of `make_peers`."""


def make_peer(name: str, setup: PeerSetup, tuning: Tuning | None = None) -> Peer:
    """The peer of a name on one wheel, with the shipped tuning by default."""
    return PEERS[name](setup, tuning or load_tuning())


def make_peers(setup: PeerSetup, tuning: Tuning | None = None) -> tuple[Peer, ...]:
    """All peers on one wheel, with the shipped tuning by default."""
    tuned = tuning or load_tuning()
    return tuple(make_peer(name, setup, tuned) for name in PEERS)
