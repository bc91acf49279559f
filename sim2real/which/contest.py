"""The contest of the candidates: every effect alone, fitted to the fit logs and held to the hold-out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from scenarios.effects import EFFECTS, FORMS
from sim2real.observing.drive import CHANNELS, WHEEL
from sim2real.observing.evidence import Evidence
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import loss
from sim2real.which.fitting import FULL_STEPS, Candidate, Fit, fit

Array = NDArray[np.float64]
Progress = Callable[[str, int, int], None]
T = TypeVar("T")


def silent(stage: str, done: int, total: int) -> None:
    """No progress shown."""


COUNTER = "wheel_speed_quantisation"
"""Judged by the mark that it leaves, see `sim2real.observing.lattice`, not by residuals."""
FINALISTS = 6
"""Effects that are fitted to all fit logs with full care, after a first round on one log."""
PRICE = 0.003
"""Share of the loss that a form of an effect has to take off for each parameter that it has more [-]."""
FURTHER_FORMS = 8
"""Effects, the best ones in their plain forms, whose forms with further parameters are fitted, too."""
NEAR = 0.2
"""Share of the way from an effect's absence to its nearest start that a fit begins at, too [-]."""
WHEELS_APART, WHEEL_VALUES = 3.0, 11
"""A wheel's own value is sought up to this many noticeable changes from the mean, among so many values."""
FIRST_ROUND_STEPS = 4
"""Steps of the first round's fits."""
TELLS_MORE = 3.0
"""The first round is held on the longest log, unless the model as it is leaves so many times its loss on another: the
gap then lies there, and what the longest does not excite would never be fitted [-]."""


@dataclass(frozen=True)
class Entry:
    """A candidate with its fit and what it leaves on the hold-out.

    Attributes
    ----------
    ids : tuple of str
        Its effects; empty for the model as it is.
    fit : Fit or None
        None for the model as it is.
    z_fit, z_hold : array
        Whitened residuals on the fit logs and on the hold-out.
    loss_fit, loss_hold : float
        Their losses.
    """

    ids: tuple[str, ...]
    fit: Fit | None
    z_fit: Array
    z_hold: Array

    @property
    def name(self) -> str:
        """Its effects in a word."""
        return "+".join(self.blamed)

    @property
    def blamed(self) -> tuple[str, ...]:
        """Its effects but structural ones, which are not blamed."""
        return tuple(key for key in self.ids if not EFFECTS[key].structural)

    @property
    def loss_fit(self) -> float:
        """Loss on the fit logs."""
        return loss(self.z_fit)

    @property
    def loss_hold(self) -> float:
        """Loss on the hold-out."""
        return loss(self.z_hold)

    @property
    def loss(self) -> float:
        """Loss on all logs."""
        return self.loss_fit + self.loss_hold

    @property
    def fitted(self) -> Fit:
        """The fit, of an entry that has one."""
        assert self.fit is not None, "the model as it is has no fit"
        return self.fit

    @property
    def size(self) -> int:
        """Number of parameters that logs can tell."""
        return 0 if self.fit is None else sum(np.isfinite(self.fit.candidate.open_share))


@dataclass(frozen=True)
class Varied:
    """An entry whose effects' parameters vary, those of a structural one excepted, see `sim2real.which.varying`.

    Attributes
    ----------
    entry : Entry
        With the constant's fit and the residuals that the varying effect leaves.
    over : str
        What they vary over, "time" or "position".
    spread : dict
        Effect id and parameter to its standard deviation along the drives, in its unit.
    price : float
        What the prior asks for the variation, in units of the loss.
    seconds : float
        Length of all drives [s].
    """

    entry: Entry
    over: str
    spread: dict[tuple[str, str], float]
    price: float
    seconds: float

    @property
    def cost(self) -> float:
        """Loss and price."""
        return self.entry.loss + self.price


@dataclass(frozen=True)
class Contest:
    """All entries, best first within each kind.

    Attributes
    ----------
    null : Entry
        The model as it is.
    singles, pairs : tuple of Entry
        See `sim2real.which.pairs` for the latter.
    forms : tuple of Entry
        Single effects in the forms that do worse than the one among `singles`.
    partners : tuple of (float, str)
        What a second effect beside the best single one promises to leave of the fit logs [loss], best first.
    twins : tuple of Entry
        Pairs with the plain form of a best effect whose form has a further parameter, see `sim2real.which.pairs`.
    structured : tuple of Entry
        Single effects with a structural one beside them, see `sim2real.which.structure`.
    varied : tuple of Varied
        Effects that are not the same everywhere: single ones, or beside a structural one, or two, see
        `sim2real.which.varying`.
    motion : float
        Least loss that one of these effects leaves as a constant beside a free term over the car's motion.
    instead : float
        Least loss that such a term leaves in the place of all effects.
    lone : float
        Least loss that a fault outside the library leaves by itself: a free term at one wheel alone or
        between the axles, see `sim2real.which.suspect`, or the impostor.
    impostor : Entry or None
        What passes for the best effect, fitted in its place, see `sim2real.which.sluggish`.
    """

    null: Entry
    singles: tuple[Entry, ...]
    pairs: tuple[Entry, ...] = ()
    forms: tuple[Entry, ...] = ()
    partners: tuple[tuple[float, str], ...] = ()
    twins: tuple[Entry, ...] = ()
    structured: tuple[Entry, ...] = ()
    varied: tuple[Varied, ...] = ()
    motion: float = float("inf")
    instead: float = float("inf")
    lone: float = float("inf")
    impostor: Entry | None = None


def hold_contest(
    model: Simulation,
    fit_to: Evidence,
    holdout: Evidence,
    first: Sequence[Fit],
    jobs: int = 1,
    progress: Progress = silent,
) -> Contest:
    """Every effect alone, fitted to all fit logs from where its first round ended; each in its best form."""
    null = as_it_is(model, fit_to, holdout)
    finalists = list(dict.fromkeys(found.candidate.ids for found in first))[:FINALISTS]
    work = [
        partial(
            enter,
            found.candidate,
            fit_to,
            holdout,
            found.x,
            FULL_STEPS if found.candidate.ids in finalists else 1,
        )
        for found in first
    ]
    best: dict[tuple[str, ...], Entry] = {}
    entries = filter(is_proper, run_all(work, jobs, progress, "effects"))
    ranked = sorted(entries, key=priced)
    for entry in ranked:
        best.setdefault(entry.ids, entry)
    others = (entry for entry in ranked if best[entry.ids] is not entry)
    return Contest(null, tuple(best.values()), forms=tuple(others))


def priced(entry: Entry) -> float:
    """Loss of an entry by which the forms of an effect are ranked: a further parameter has to earn its place."""
    return entry.loss * (1.0 + PRICE * entry.size)


def is_proper(entry: Entry) -> bool:
    """Whether every effect of an entry is itself at its values, see `Effect.is_itself`."""
    found = entry.fitted
    vehicle = found.candidate.base.vehicle.to_core()
    return all(effect.is_itself(vehicle) for effect in found.candidate.effects(found.x))


def first_round(
    model: Simulation,
    fit_to: Evidence,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> list[Fit]:
    """Every form of every effect that acts on the car's motion or its sensors, fitted roughly to one log.

    A form with more parameters than the effect's first one starts from where that ended, if that was among the best.
    """
    one_log = _telling(model, fit_to)
    candidates = [
        Candidate(model, (key,), (form,))
        for key, kinds in FORMS.items()
        if key not in {*exclude, COUNTER} and kinds[0].stage != "perception" and not kinds[0].structural
        for form in range(len(kinds))
    ]
    plain = [c for c in candidates if len(c.parameters) == len(FORMS[c.ids[0]][0].parameters())]
    near = [partial(fit, c, one_log, _near_and_far(c), FIRST_ROUND_STEPS) for c in plain]
    found = run_all(near, jobs, progress, "effects, first round")
    ranked = list(dict.fromkeys(f.candidate.ids for f in sorted(found, key=lambda fit: fit.loss)))
    of = {f.candidate.ids: f for f in found if f.candidate.forms == (0,)}
    more = [
        partial(_fit_beyond, c, of[c.ids], one_log)
        for c in candidates
        if c not in plain and c.ids in ranked[:FURTHER_FORMS]
    ]
    return sorted([*found, *run_all(more, jobs, progress, "forms, first round")], key=lambda fit: fit.loss)


def _telling(model: Simulation, fit_to: Evidence) -> Evidence:
    """The log that the first round is held on."""
    logs = fit_to.each()
    longest = max(range(len(logs)), key=lambda i: len(logs[i].drives[0]))
    losses = [loss(log.whitened(log.residuals(model))) for log in logs]
    most = int(np.argmax(losses))
    return logs[most if losses[most] > TELLS_MORE * losses[longest] else longest]


def _near_and_far(candidate: Candidate) -> Array:
    """A candidate's coarse grid and, of a single parameter, points nearer to its absence: small gaps need them."""
    far = candidate.starts
    if far.shape[1] > 1:
        return far
    offsets = far[:, 0] - candidate.neutral[0]
    sides = [side for side in (offsets[offsets > 0.0], offsets[offsets < 0.0]) if len(side)]
    near = [candidate.neutral[0] + NEAR * side[np.argmin(np.abs(side))] for side in sides]
    return np.concatenate([np.reshape(near, (-1, 1)), far])


def _fit_beyond(candidate: Candidate, plain: Fit, evidence: Evidence) -> Fit:
    return fit(candidate, evidence, _beyond(candidate, plain, evidence), FIRST_ROUND_STEPS)


def _beyond(candidate: Candidate, plain: Fit, evidence: Evidence) -> Array:
    """Where a form with further parameters starts: the effect as it is without them, and with each value of theirs.

    Where each wheel has its own value, also at what suits each wheel's speed best: wheels that ring at several
    frequencies are found from nowhere else.
    """
    x = plain.x
    rest = candidate.neutral[len(x) :]
    values = np.unique(np.array([rest, *candidate.starts[:, len(x) :]]), axis=0)
    points = [np.concatenate([x, value]) for value in values]
    if candidate.kinds[0].of_wheels:
        points.append(wheel_by_wheel(candidate, x, evidence))
    return np.array(points)


def wheel_by_wheel(candidate: Candidate, plain: Array, evidence: Evidence) -> Array:
    """Where each wheel has the value, about the plain fit's, that suits itself best, as the form writes it."""
    values = plain[0] * (1.0 + WHEELS_APART * candidate.scale[-1] * np.linspace(-1.0, 1.0, WHEEL_VALUES))
    rest = candidate.neutral[len(plain) :]
    losses = np.empty((len(values), 4))
    for row, value in enumerate(values):
        alike = candidate.model(np.array([value, *plain[1:], *rest]))
        z = evidence.whitened(evidence.residuals(alike)).reshape(-1, len(CHANNELS))[:, WHEEL]
        losses[row] = [loss(z[:, wheel]) for wheel in range(4)]
    own = values[np.argmin(losses, axis=0)]
    mean, unlike, sides = own.mean(), 0.25 * (own[:2].sum() - own[2:].sum()), 0.5 * (own[::2] - own[1::2])
    return np.array([mean, *plain[1:], *(np.array([unlike, *sides]) / mean)])


def as_it_is(model: Simulation, fit_to: Evidence, holdout: Evidence) -> Entry:
    """The entry of a model to which nothing is fitted."""
    left_fit, left_hold = (e.whitened(e.residuals(model)) for e in (fit_to, holdout))
    return Entry((), None, left_fit, left_hold)


def enter(candidate: Candidate, fit_to: Evidence, holdout: Evidence, start: Array, steps: int) -> Entry:
    """Fit a candidate from a start, and hold it to the hold-out."""
    found = fit(candidate, fit_to, start, steps)
    return Entry(candidate.ids, found, found.z, holdout.whitened(holdout.residuals(candidate.model(found.x))))


def run_all(work: Sequence[Callable[[], T]], jobs: int, progress: Progress, stage: str) -> list[T]:
    """Results in order; the compiled step releases the interpreter's lock, so threads do."""
    results = []
    for result in Parallel(n_jobs=jobs, prefer="threads", return_as="generator")(
        delayed(job)() for job in work
    ):
        results.append(result)
        progress(stage, len(results), len(work))
    return results
