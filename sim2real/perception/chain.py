"""What the camera's three kinds of evidence have in common: accounts of it, and how they are scored.

Stamps, confidence and friction reference are independent signals; each makes a chain of accounts from "as simulated" to
one or two effects. Gains are quasi-log-likelihoods in nats over "as simulated", counted in observations that err
independently: a border passed, a second of confidence, a stretch of road.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sim2real.result import Interval, Place

Array = NDArray[np.float64]

DECISIVE = 3.0
"""Score from which on an account beats another: odds of twenty to one [nats]."""
FEWEST_EFFECTIVE = 2.0
"""A parameter costs as if at least so many observations stood behind it."""


def price(*effective: float) -> float:
    """What parameters cost, given how many independent observations stand behind each [nats]."""
    return float(0.5 * np.log(np.maximum(effective, FEWEST_EFFECTIVE)).sum())


@dataclass(frozen=True)
class Oddity:
    """A gap that no effect of the library makes.

    Attributes
    ----------
    signal : str
        What shows it.
    sentence : str
        All of it, for a person to act on.
    depends_on, sign, shape : str
        What it goes with, to which side, and how, in words.
    """

    signal: str
    sentence: str
    depends_on: str
    sign: str
    shape: str


@dataclass(frozen=True)
class Account:
    """One way to account for a signal.

    Attributes
    ----------
    effects : tuple of str
        Its effects; empty for the simulation as it is.
    size : int
        Number of parameters.
    price : float
        Half the logarithm of the independent observations behind each parameter, summed, after Schwarz, and what values
        cost that are hardly ever met [nats].
    gain_fit, gain_holdout : float
        Over the simulation as it is, on the logs fitted to and on the hold-out at the same parameters [nats].
    parameters : dict
        Estimates.
    z : array, shape (n,)
        What it leaves of the hold-out's observations, in standard deviations.
    excess : float
        Square by which a level common to all observations lies beyond its spread [-].
    evidence_for, evidence_against : tuple of str
        Sentences.
    """

    effects: tuple[str, ...]
    size: int
    price: float
    gain_fit: float
    gain_holdout: float
    parameters: dict[str, Interval]
    z: Array
    excess: float = 0.0
    evidence_for: tuple[str, ...] = ()
    evidence_against: tuple[str, ...] = ()

    @property
    def score(self) -> float:
        """Both gains less the price [nats]."""
        return self.gain_fit + self.gain_holdout - self.price

    def left(self) -> float:
        """Root mean square of what is left, in noise floors: not below 1; no observations give 0 [-]."""
        return float(np.sqrt(max(float(np.mean(self.z**2)) + self.excess, 1.0))) if len(self.z) else 0.0


@dataclass(frozen=True)
class Chain:
    """One signal of the camera chain with all its accounts.

    Attributes
    ----------
    signal : str
        Its name in the gap's measure.
    observations : int
        Pictures or rows behind it, on all logs.
    effective : float
        Observations that err independently, on all logs.
    nothing : Account
        The simulation as it is.
    accounts : tuple of Account
        Single effects, then pairs.
    places : tuple of Place
        Where the hold-out shows it most; shares of this signal's gap.
    unexcited : dict
        Effect to the reason why these logs could not show it.
    next_step : str
        A manoeuvre that separates confounders.
    unexplained : Oddity or None
        What no account explains.
    errs : Oddity or None
        What it shows that is a gap unless bad pictures make the classes err.
    noticed : float
        Rest in standard deviations up to which it is too small to matter, however little the signal scatters [-].
    no_gap : bool
        Whether the hold-out shows no gap; no effect is then named for the fit logs either.
    asked : tuple of str
        Effects that would account for a signal that is not as usual as a whole, which no more of it would settle:
        where nothing is decisive they stand, as a question, with "as simulated" as their rival.
    """

    signal: str
    observations: int
    effective: float
    nothing: Account
    accounts: tuple[Account, ...]
    places: tuple[Place, ...] = ()
    unexcited: dict[str, str] = field(default_factory=dict)
    next_step: str = ""
    unexplained: Oddity | None = None
    errs: Oddity | None = None
    noticed: float = 0.0
    no_gap: bool = False
    asked: tuple[str, ...] = ()

    @classmethod
    def silent(cls, signal: str, observations: int, effects: Collection[str], why: str) -> Chain:
        """A chain that has too little to say anything."""
        nothing = Account((), 0, 0.0, 0.0, 0.0, {}, np.empty(0))
        return cls(signal, observations, 0.0, nothing, (), unexcited=dict.fromkeys(effects, why))

    def best(self) -> Account:
        """The account that stands: with more effects only where that is decisive or asked, none if `no_gap`."""
        best = self.nothing
        if self.no_gap:
            return best
        for account in sorted(self.accounts, key=lambda a: (len(a.effects), -a.score)):
            margin = DECISIVE if len(account.effects) > len(best.effects) else 0.0
            if account.score > best.score + margin:
                best = account
        if best.effects or not self.asked:
            return best
        return max((best, *(a for a in self.accounts if a.effects == self.asked)), key=lambda a: a.score)

    def rivals(self, best: Account) -> tuple[Account, ...]:
        """Other accounts that this one does not beat decisively: of as many effects, and "as simulated"."""
        return tuple(
            a
            for a in (self.nothing, *self.accounts)
            if a is not best
            and best.effects
            and len(a.effects) in (0, len(best.effects))
            and best.score - a.score < DECISIVE
            and a.score >= self.nothing.score
        )
