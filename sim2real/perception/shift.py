"""Late results or a wrong mounting angle: by how much the classes' changes lie beyond the road's borders.

A crossing is one observation, however many pictures show it: neighbouring pictures err together. How likely one is
under a candidate's shift says `likelihood`; each candidate takes the share of the stamp and the scale of the errors
that suit it best, at a price.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from sim2real.perception.chain import DECISIVE, Account, Chain, Oddity, price
from sim2real.perception.conflicts import streak_m
from sim2real.perception.crossings import Crossings, find_crossings
from sim2real.perception.drifting import find_drift
from sim2real.perception.frames import Modelled, Results
from sim2real.perception.hanging import odd_hanging
from sim2real.perception.likelihood import (
    ERROR_M,
    SCALES,
    SHARES,
    likeliest,
    over_scales,
    profiles,
    share_price,
)
from sim2real.perception.mounting import Mounting
from sim2real.perception.scatter import odd_scatter
from sim2real.result import Interval, Place

Array = NDArray[np.float64]

DELAYS_S, PITCHES_RAD = (0.0, 1.0), (-0.4, 0.4)
USUAL_PITCH_RAD = 0.15
"""Standard deviation of what mountings are off: an angle of twice that explains little that a delay does not [rad]."""
GRID, GRID_OF_TWO, ZOOMS = 41, 25, 3
"""Points per axis of the search over one parameter, and over two; how often it is drawn closer about what matters."""
SIGNAL = "image_place"
CHOICES = (("camera_latency",), ("camera_pitch",), ("camera_latency", "camera_pitch"))
NEXT_STEP = "Pass the same borders at low and at high speed, five times each at about 10 and 25 m/s."
SAME_SPEED_M_S = 2.0
"""Crossings within this range of speeds count as one speed [m/s]."""
NOTABLE = 3.0
MOST_PLACES = 4
FEWEST_UNSEEN, BEYOND_DOUBT = 4, 6.0
"""Borders passed on the hold-out that can say that there is no shift, unless all logs together speak by so much [nats]
for one that no stamp is long enough for."""
GOES_WITH_SPEED = 20.0
"""Or by so much more for a delay than for any distance: within its stretch a class is right anywhere, but not the
farther on the faster the car is [nats]."""
MOSTLY = 0.25
"""An account that leaves no more than this share of the gap's square beyond noise explains it, though the rest shows a
pattern [-]."""
AROUND_S = 0.2
"""Time about a crossing that is shown [s]."""


@dataclass(frozen=True)
class ShiftFit:
    """A candidate's shift fitted to crossings.

    Attributes
    ----------
    effects : tuple of str
        Its effects; empty for the simulation as it is.
    log_likelihood : float
        Of the crossings it was fitted to [nats].
    delay_s, pitch_rad : Interval
        Estimates; without width where the candidate does not move them.
    share, scale : float
        Share of the stamp that a class is for, and the scale of the errors, at the best [-].
    """

    effects: tuple[str, ...]
    log_likelihood: float
    delay_s: Interval
    pitch_rad: Interval
    share: float
    scale: float

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.effects)

    def shift(self, crossings: Crossings, height_m: float) -> Array:
        """By how much it puts the classes' changes beyond the borders, shape (k,) [m]."""
        age, pitch = np.array([self.delay_s.value]), np.array([self.pitch_rad.value])
        return (crossings.shift_by_age(age) + crossings.shift_by_pitch(pitch, height_m))[0]

    def log_likelihood_of(self, crossings: Crossings, height_m: float) -> float:
        """Of any crossings at its delay and pitch, share and scale at their best [nats]."""
        shift = self.shift(crossings, height_m)
        return float(likeliest(crossings, shift, shifted=bool(self.effects)))

    def scale_of(self, crossings: Crossings, height_m: float) -> float:
        """Scale of any crossings' errors at its delay, pitch and share; the least where there are none [-]."""
        shift = self.shift(crossings, height_m)
        table = over_scales(shift[None, :], *crossings.bracket(self.share), SCALES)
        return float(SCALES[np.argmax(table[:, 0])])

    def rest_m(self, crossings: Crossings, height_m: float) -> Array:
        """Brackets' middles beyond the candidate's, shape (k,) [m]."""
        low, high = crossings.bracket(self.share)
        return 0.5 * (low + high) - self.shift(crossings, height_m)

    def z(self, crossings: Crossings, height_m: float, scale: float) -> Array:
        """Brackets' middles beyond the candidate's, in standard deviations, shape (k,); noise alone gives about 1."""
        low, high = crossings.bracket(self.share)
        width, length = high - low, 0.5 * (crossings.low_length_m + crossings.high_length_m)
        deviation = np.sqrt((scale * ERROR_M) ** 2 + (width**2 + length**2) / 12.0)
        return self.rest_m(crossings, height_m) / deviation


def fit_shift(
    crossings: Crossings, effects: tuple[str, ...], height_m: float, delay_s: float, pitch_rad: float
) -> ShiftFit:
    """The best delay, pitch, or both.

    Parameters
    ----------
    crossings : Crossings
        At least one.
    effects : tuple of str
        Out of camera_latency and camera_pitch: what may move.
    height_m : float
        Of the lens above the road [m].
    delay_s, pitch_rad : float
        What the simulation models already; effects that do not move stay there [s], [rad].
    """
    grid = GRID_OF_TWO if len(effects) == 2 else GRID
    delays = np.linspace(*DELAYS_S, grid) if "camera_latency" in effects else np.array([delay_s])
    pitches = np.linspace(*PITCHES_RAD, grid) if "camera_pitch" in effects else np.array([pitch_rad])
    allowance = 0.5 * stdtrit(max(len(crossings) - 1, 1), 0.975) ** 2
    for _ in range(ZOOMS):
        profile = profiles(crossings, _shifts(crossings, delays, pitches, height_m)).max(axis=(0, 1))
        delays = _about(delays, profile.max(axis=1), allowance)
        pitches = _about(pitches, profile.max(axis=0), allowance)
    table = profiles(crossings, _shifts(crossings, delays, pitches, height_m))
    priced = table - share_price(shifted=bool(effects))[:, None, None, None]
    share, scale, _, _ = np.unravel_index(int(np.argmax(priced)), table.shape)
    # the estimate is the plain reading's, the interval holds the others' too
    at_share, profile = table[share].max(axis=0), table.max(axis=(0, 1))
    return ShiftFit(
        effects,
        float(priced.max()),
        _interval(delays, at_share.max(axis=1), profile.max(axis=1), allowance, "s"),
        _interval(pitches, at_share.max(axis=0), profile.max(axis=0), allowance, "rad"),
        float(SHARES[share]),
        float(SCALES[scale]),
    )


def _shifts(crossings: Crossings, delays: Array, pitches: Array, height_m: float) -> Array:
    """Of every delay with every pitch, shape (delays, pitches, k) [m]."""
    return crossings.shift_by_age(delays)[:, None] + crossings.shift_by_pitch(pitches, height_m)[None]


def _about(grid: Array, profile: Array, allowance: float) -> Array:
    """A finer grid over the part of a grid that the interval may take, one step wider."""
    if len(grid) == 1:
        return grid
    matters = np.flatnonzero(profile >= profile.max() - allowance)
    first, last = max(int(matters[0]) - 1, 0), min(int(matters[-1]) + 1, len(grid) - 1)
    return np.linspace(grid[first], grid[last], len(grid))


def _interval(grid: Array, likely: Array, profile: Array, allowance: float, unit: str) -> Interval:
    """Mean where the shares are at their best, and where the profile lies within the allowance of its best."""
    if len(grid) == 1:
        return Interval(float(grid[0]), float(grid[0]), float(grid[0]), unit)
    value = float(np.average(grid, weights=np.exp(likely - likely.max())))
    inside = grid[profile >= profile.max() - allowance]
    return Interval(value, float(min(inside[0], value)), float(max(inside[-1], value)), unit)


def shift_chain(
    fitted: Sequence[Results],
    held_out: Results | None,
    modelled: Modelled,
    mounting: Mounting,
    exclude: Collection[str],
) -> Chain | None:
    """The stamps' account; None where no log has camera results."""
    height_m = mounting.height_m
    if not fitted and held_out is None:
        return None
    known, unseen = find_crossings(fitted), find_crossings([] if held_out is None else [held_out])
    seen = [*fitted, *([] if held_out is None else [held_out])]
    pictures = sum(map(len, seen))
    choices = [c for c in CHOICES if not set(c) & set(exclude)]
    outside = [c for c in CHOICES if set(c) & set(exclude)]
    if not len(known):
        why = "The camera's classes show no border between two surfaces on the fit logs."
        return Chain.silent(SIGNAL, pictures, [effect for choice in choices for effect in choice], why)

    def fit(effects: tuple[str, ...]) -> ShiftFit:
        return fit_shift(known, effects, height_m, modelled.delay_s, modelled.pitch_rad)

    tried = [fit(choice) for choice in ((), *choices, *outside)]
    plain, library = tried[0], 1 + len(choices)
    every = known.joined(unseen)
    # What a shift takes is no scatter, whether or not the library has an effect for it.
    closest = min(tried, key=lambda f: f.scale)
    # A chain that errs in streaks may do so on the hold-out alone: scatter is no shift there either.
    scale = max(closest.scale, closest.scale_of(unseen, height_m))
    told = [_account(f, plain, unseen, mounting, scale, known) for f in tried]
    accounts, others = told[:library], told[library:]
    foremost = int(np.argmax([account.score for account in told]))
    best = told[foremost].score
    unhurried = max(account.score for account in told if "camera_latency" not in account.effects)
    sure = best > BEYOND_DOUBT and _leaves_its_stamp(tried[foremost], every, height_m)
    sure |= best - unhurried > GOES_WITH_SPEED
    chain = Chain(
        SIGNAL,
        pictures,
        float(len(known) + len(unseen)),
        accounts[0],
        tuple(accounts[1:]),
        places=_places(accounts[0], unseen),
        next_step=NEXT_STEP,
        errs=odd_hanging(closest.rest_m(every, height_m), every, seen),
        no_gap=len(unseen) >= FEWEST_UNSEEN and accounts[0].left() <= 1.0 and not sure,
    )
    drift = find_drift(known, unseen, plain.log_likelihood_of(every, height_m), best)
    if drift:
        nothing, *rest = (_account(f, plain, unseen, mounting, drift.scale, known) for f in tried[:library])
        return replace(
            chain,
            nothing=nothing,
            accounts=tuple(rest),
            places=_places(nothing, unseen),
            unexplained=drift.odd,
            no_gap=False,
        )
    for choice, other in zip(outside, others, strict=True):
        if other.score > chain.best().score + DECISIVE and not chain.no_gap:
            return replace(chain, unexplained=_another_law(chain.best(), choice))
    stands = chain.best()
    if stands.effects and stands.left() ** 2 - 1.0 <= MOSTLY * (accounts[0].left() ** 2 - 1.0):
        return chain
    scatter = odd_scatter(scale * ERROR_M, closest.rest_m(every, height_m), every, streak_m(seen))
    return replace(chain, unexplained=scatter)


def _leaves_its_stamp(f: ShiftFit, crossings: Crossings, height_m: float) -> bool:
    """Whether a shift takes the classes beyond the stretches that the simulation has them right in."""
    half_m = 0.25 * (crossings.low_length_m + crossings.high_length_m)
    return bool(np.median(np.abs(f.shift(crossings, height_m)) - half_m) > 0.0)


def _another_law(best: Account, choice: tuple[str, ...]) -> Oddity:
    """What a shift is that goes with speed in a way that no effect of the library has."""
    laws = {"camera_latency": "is proportional to speed", "camera_pitch": "does not depend on speed"}
    law = " and partly ".join(laws[effect] for effect in choice)
    named = " and ".join(best.effects) or "no effect of the library"
    told = f"The changes of class are shifted by a distance that {law}, which {named} does not explain."
    late = "camera_latency" in choice
    return Oddity(
        SIGNAL,
        told,
        "speed" if late else "nothing that was measured",
        "along the road",
        "in proportion to it" if late else "a constant distance",
    )


def _account(
    f: ShiftFit, nothing: ShiftFit, unseen: Crossings, mounting: Mounting, scale: float, known: Crossings
) -> Account:
    height_m = mounting.height_m
    parameters = {"delay_s": f.delay_s} if "camera_latency" in f.effects else {}
    if "camera_pitch" in f.effects:
        parameters["pitch_rad"] = mounting.over_places(f.pitch_rad, float(known.ahead_m.mean()))
    every = known.joined(unseen)
    known_gain, gain = (
        f.log_likelihood_of(seen, height_m) - nothing.log_likelihood_of(seen, height_m)
        for seen in (known, every)
    )
    off = f.pitch_rad.value - nothing.pitch_rad.value
    return Account(
        f.effects,
        f.size,
        price(*[len(every)] * f.size) + 0.5 * (off / USUAL_PITCH_RAD) ** 2,
        known_gain,
        gain - known_gain,
        parameters,
        _without_odd(f.z(unseen, height_m, scale)),
        evidence_for=_seen(known) if f.effects else (),
    )


def _without_odd(z: Array) -> Array:
    """Residuals with the largest tenth cut down to the next: one misread border is not the size of the gap."""
    if not len(z):
        return z
    most = max(float(np.quantile(np.abs(z), 0.9, method="lower")), NOTABLE)
    return np.clip(z, -most, most)


def _seen(known: Crossings) -> tuple[str, ...]:
    """How far beyond the borders the changes of class appear, slow and fast."""
    low, high = known.bracket(0.5)
    beyond, speed = 0.5 * (low + high), known.speed_m_s
    if np.ptp(speed) < SAME_SPEED_M_S:
        return (
            f"{len(known)} borders, all passed at about {speed.mean():.0f} m/s, appear {np.median(beyond):+.2f} m "
            "along the road.",
        )
    fast = speed > np.median(speed)
    if not fast.any():  # most were passed at the top speed
        fast = speed == speed.max()
    slow = ~fast
    return (
        f"{len(known)} borders appear {np.median(beyond[slow]):+.2f} m along the road at {speed[slow].mean():.0f} m/s "
        f"and {np.median(beyond[fast]):+.2f} m at {speed[fast].mean():.0f} m/s.",
    )


def _places(nothing: Account, unseen: Crossings) -> tuple[Place, ...]:
    """The crossings of the hold-out that lie beyond noise."""
    share = nothing.z**2 / max(float((nothing.z**2).sum()), 1e-12)
    low, high = unseen.bracket(0.5)
    late_s = 0.5 * (low + high) / np.maximum(unseen.speed_m_s, 0.5)
    begin = unseen.time_s - np.maximum(late_s, 0.0) - AROUND_S
    end = unseen.time_s + np.maximum(-late_s, 0.0) + AROUND_S
    notable = np.flatnonzero(np.abs(nothing.z) > NOTABLE)
    worst = notable[np.argsort(-share[notable])][:MOST_PLACES]
    return tuple(
        Place(
            SIGNAL,
            "camera",
            "surface change",
            float(begin[k]),
            float(end[k]),
            float(share[k]),
            str(unseen.log[k]),
        )
        for k in worst
    )
