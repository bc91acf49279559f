"""Friction estimators of the literature on the same inputs as ours, tuned, in one shape."""

from scenarios.peers.base import Peer, PeerEstimate, PeerSetup
from scenarios.peers.kalman import EkfPeer, KalmanTuning, UkfPeer
from scenarios.peers.slip_slope import SlipSlopePeer, SlipSlopeTuning
from scenarios.peers.tuning import TUNING_FILE, Tuning, load_tuning

__all__ = [
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
    "make_peers",
]

PEER_NAMES = (SlipSlopePeer.name, EkfPeer.name, UkfPeer.name)
"""All peers by name, in the order of `make_peers`."""


def make_peers(setup: PeerSetup, tuning: Tuning | None = None) -> tuple[Peer, ...]:
    """All peers on one wheel, with their tuning as delivered unless another is given."""
    tuned = tuning or load_tuning()
    return (
        SlipSlopePeer(setup, tuned.slip_slope),
        EkfPeer(setup, tuned.ekf),
        UkfPeer(setup, tuned.ukf),
    )
