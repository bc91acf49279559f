"""What the parameters of a user's unit do to the gap: seen before anything is fitted, fitted, and run once more."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenarios.effects import Effect
from sim2real.how_far.gap import measure
from sim2real.hypotheses.contest import Entry
from sim2real.hypotheses.goodness import inflation
from sim2real.logs import Log
from sim2real.observing.drive import Drive
from sim2real.observing.evidence import Evidence, gather
from sim2real.observing.observer import Simulation
from sim2real.observing.robust import loss, robust_weight
from sim2real.own_model.runs import OwnModel, Run, Stretch
from sim2real.result import NORMAL_95, Interval, OwnFinding, OwnParameter

Array = NDArray[np.float64]
Follow = Callable[[int, Sequence[Stretch]], Array]
"""What the nominal model leaves of a run, on the rows of the log of this number, shape (n, 7)."""

STEP_SHARE = 0.05
"""Step of the finite differences over a parameter's range [-]."""
ALIKE = 0.98
"""Correlation of two parameters' responses from which on these logs do not tell them apart [-]."""
WEAK = 0.1
"""Singular value of the responses, each of unit length, below which a combination of several is not seen [-]."""
MEMBER = 0.3
"""Share of a parameter in a combination from which on it is named [-]."""
LEAST_SIGMA = 4.0
"""Change by a parameter's whole range that counts as seen at least [standard deviations of the noise]."""
ROUNDS = 12
"""Reweightings of a robust linear fit."""
CONFIRMED = 2
"""Most runs over each log to confirm an estimate: the response is linear near the nominal value only."""


@dataclass(frozen=True)
class Response:
    """What a parameter does to what is left of each log, per its unit; shape (n, 7) each."""

    name: str
    low: float
    high: float
    nominal: float
    change: tuple[Array, ...]


class Study:
    """A unit over the logs of a diagnosis: responses to its parameters, and confirmations.

    Parameters
    ----------
    own : OwnModel
        The unit.
    logs : sequence of Log
        The fit logs, and the hold-out last.
    follow : callable
        From a simulated log to a reference, see `Follow`.
    """

    def __init__(self, own: OwnModel, logs: Sequence[Log], follow: Follow) -> None:
        self.own, self.logs, self._follow = own, list(logs), follow
        own.require(len(logs) * (1 + len(own.signals.parameters) + CONFIRMED) + 1)
        self.responses = self._respond()

    def _references(self, runs: Sequence[Run]) -> list[Array]:
        """References of runs over all logs in turn, as often as there are runs for it."""
        made = self.own.simulate(runs)
        return [self._follow(i % len(self.logs), run) for i, run in enumerate(made)]

    def _respond(self) -> tuple[Response, ...]:
        steps, runs = [], [Run(log) for log in self.logs]
        for name, tunable in self.own.signals.parameters.items():
            nominal = self.own.nominal(name)
            upward = tunable.high - nominal >= nominal - tunable.low
            steps.append((name, (1.0 if upward else -1.0) * STEP_SHARE * (tunable.high - tunable.low)))
            runs += [Run(log, {name: nominal + steps[-1][1]}) for log in self.logs]
        found, count = self._references(runs), len(self.logs)
        plain = found[:count]
        return tuple(
            Response(
                name,
                self.own.signals.parameters[name].low,
                self.own.signals.parameters[name].high,
                self.own.nominal(name),
                tuple((b - a) / step for a, b in zip(plain, found[at : at + count], strict=True)),
            )
            for (name, step), at in zip(steps, range(count, len(found), count), strict=True)
        )

    def identifiability(self, evidence: Evidence) -> tuple[str, ...]:
        """Sentences on what the fit logs cannot tell of the parameters, before anything is fitted."""
        told, seen = [], []
        for r in self.responses:
            column = _whitened(evidence, r)
            if (r.high - r.low) * float(np.linalg.norm(column)) < LEAST_SIGMA:
                told.append(
                    f"{r.name} of your model changes these logs by less than their noise from {r.low:g} to {r.high:g}: "
                    "it cannot be identified or ruled out."
                )
            else:
                seen.append((r.name, column / np.linalg.norm(column)))
        if len(seen) < 2:
            return tuple(told)
        names, columns = [n for n, _ in seen], np.column_stack([c for _, c in seen])
        alike = columns.T @ columns
        pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(alike[i, j]) >= ALIKE]
        told += [
            f"{names[j]} and {names[i]} of your model act alike on these logs (correlation {alike[i, j]:.3f}): "
            "only one of them, or a sum of both, is identifiable. Drive a manoeuvre in which they differ."
            for i, j in pairs
        ]
        _, sizes, directions = np.linalg.svd(columns, full_matrices=False)
        for size, direction in zip(sizes, directions, strict=True):
            members = [i for i, share in enumerate(direction) if abs(share) > MEMBER]
            if size < WEAK and len(members) > 2:
                told.append(
                    f"{', '.join(names[i] for i in members)} of your model have a combination that these logs do "
                    f"not excite (singular value {size:.2g}): they are not identifiable together."
                )
        return tuple(told)

    def judge(self, model: Simulation, fit_to: Evidence, held: Evidence, best: Entry | None) -> OwnFinding:
        """What tuning each parameter takes off the gap, and what the first effect leaves when the unit is run with it.

        Parameters
        ----------
        model : Simulation
            The nominal model.
        fit_to, held : Evidence
            Fit logs and hold-out, with the unit's run as reference.
        best : Entry, optional
            The best effect of the library, fitted.
        """
        first = None if best is None else best.fitted.candidate.effects(best.fitted.x)[0]
        z, z_held = (e.whitened(e.residuals(model)) for e in (fit_to, held))
        whole = loss(z)
        beyond = max(whole - float(np.count_nonzero(z)), 1e-9)
        fits = sorted((self._fit(r, fit_to, z) for r in self.responses), key=lambda f: f[1])
        found = []
        for number, (r, left, x, curvature) in enumerate(fits):
            moved = [(x - r.nominal) * _whitened(e, r, last) for e, last in ((fit_to, False), (held, True))]
            rest = Entry((), None, z - moved[0], z_held - moved[1])
            sd = float(np.sqrt(inflation(rest, fit_to, held) / curvature))
            after, at = self._confirmed(model, fit_to, held, r, x) if number == 0 else (None, x)
            tunable = self.own.signals.parameters[r.name]
            found.append(
                OwnParameter(
                    r.name,
                    Interval(
                        at, max(at - NORMAL_95 * sd, r.low), min(at + NORMAL_95 * sd, r.high), tunable.unit
                    ),
                    r.nominal,
                    tunable.effect or "",
                    float(np.clip((whole - left) / beyond, 0.0, 1.0)),
                    after,
                )
            )
        exact = None if first is None else self._exact(model, held, first)
        return OwnFinding(
            self.own.unit.path.name,
            self.own.runs,
            tuple(found),
            "" if exact is None or first is None else first.id,
            exact,
            _sentence(found, first, exact, 0.0 if best is None else (whole - best.loss_fit) / beyond),
        )

    def _fit(self, r: Response, evidence: Evidence, z: Array) -> tuple[Response, float, float, float]:
        """A parameter fitted alone: what it leaves of the loss, its value, and the curvature of half the loss there."""
        column = _whitened(evidence, r)
        change = 0.0
        low, high = r.low - r.nominal, r.high - r.nominal
        curvature = 1e-12
        for _ in range(ROUNDS):
            weight = robust_weight(z - change * column)
            curvature = max(float(weight @ column**2), 1e-12)
            change = float(np.clip((weight * column) @ z / curvature, low, high))
        return r, loss(z - change * column), r.nominal + change, curvature

    def _confirmed(
        self, model: Simulation, fit_to: Evidence, held: Evidence, r: Response, x: float
    ) -> tuple[float, float]:
        """Gap on the hold-out with the unit run at the estimate, and that: moved on once where it is better."""
        best = (np.inf, np.inf, x)
        for _ in range(CONFIRMED):
            references = self._references([Run(log, {r.name: x}) for log in self.logs])
            tried, last = _with(fit_to, references[:-1]), _with(held, references[-1:])
            z = tried.whitened(tried.residuals(model))
            size = measure(last, last.residuals(model)).total
            if loss(z) >= best[0]:
                break
            best = (loss(z), size, x)
            again = replace(r, nominal=x)
            moved = self._fit(again, tried, z)[2]
            if abs(moved - x) < 0.02 * abs(x - r.nominal):
                break
            x = moved
        return best[1], best[2]

    def _exact(self, model: Simulation, held: Evidence, effect: Effect) -> float | None:
        """Gap on the hold-out with the unit run with an effect; None where nothing of the unit stands for it."""
        log = self.logs[-1]
        if effect.stage in ("actuators", "sensors"):
            run = Run(log, effect=effect)
        else:
            changed = self._as_parameters(model, effect)
            if changed is None:
                return None
            run = Run(log, changed)
        reference = self._follow(len(self.logs) - 1, self.own.simulate([run])[0])
        last = _with(held, [reference])
        return measure(last, last.residuals(model)).total

    def _as_parameters(self, model: Simulation, effect: Effect) -> dict[str, float] | None:
        """Values of the unit's parameters for an effect of the library, by how far it is from the nominal car's."""
        car = model.vehicle.to_core()
        own = next((e for e in model.effects if e.id == effect.id), None)
        stands = {p.effect: name for name, p in self.own.signals.parameters.items() if p.effect}
        changed = {}
        for p in effect.parameters():
            name = stands.get(f"{effect.id}.{p.name}")
            base = p.neutral_value(car) if own is None else getattr(own, p.name, p.neutral_value(car))
            if name is None:
                if getattr(effect, p.name) != base:
                    return None
                continue
            changed[name] = self.own.nominal(name) + getattr(effect, p.name) - base
        return changed or None


def before_fits(study: Study, model: Simulation, drives: Sequence[Drive]) -> tuple[str, ...]:
    """What the fit logs cannot tell of a unit's parameters."""
    return study.identifiability(gather(model, drives)) if study.responses else ()


def _whitened(evidence: Evidence, r: Response, last: bool = False) -> Array:
    """A response in standard deviations of the noise, 0 where nothing counts; of the fit logs, or of the last one."""
    parts = []
    changes = r.change[-1:] if last else r.change[:-1]
    for drive, noise, change in zip(evidence.drives, evidence.noises, changes, strict=True):
        rows = np.where(drive.moving[:, None] & drive.counted[None, :], change, np.nan)
        parts.append(np.nan_to_num(noise.whitened(rows)).ravel())
    return np.concatenate(parts)


def _with(evidence: Evidence, references: Sequence[Array]) -> Evidence:
    """The same logs held against other references."""
    drives = [replace(d, reference=r) for d, r in zip(evidence.drives, references, strict=True)]
    return replace(evidence, drives=tuple(drives))


def _sentence(found: Sequence[OwnParameter], first: Effect | None, exact: float | None, taken: float) -> str:
    """What was found, for a reader; `taken` is the share of the loss beyond noise that the first effect takes."""
    parts = []
    if exact is not None and first is not None:
        parts.append(f"Your model, run with {first.id}, leaves a gap of {exact:.2f} on the hold-out.")
    for best in found[:1]:
        value = best.estimate
        beside = (
            "" if first is None else f" ({first.id} of the library: {100.0 * np.clip(taken, 0.0, 1.0):.0f} %)"
        )
        parts.append(
            f"Of the parameters of your model {best.name} explains most: {100.0 * best.share:.0f} % of the misfit "
            "beyond noise"
            f"{beside}, at {value.value:.4g} {value.unit} in place of {best.nominal:.4g}; a run with it leaves a "
            "gap of "
            f"{best.gap_after:.2f}."
        )
    return " ".join(parts)
