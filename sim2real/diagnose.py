"""The diagnosis as a whole: from files, or from drives, to what it says."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from scenarios.effects import EFFECTS, form_of
from scenarios.files import load_vehicle
from sim2real.adequacy import require_adequate
from sim2real.auxiliary import camera_verdict, counter_verdict
from sim2real.discrepancy.verdict import beside_another_build
from sim2real.how_far.gap import measure
from sim2real.how_far.trpac_error import trpac_error
from sim2real.hypotheses.contest import COUNTER, Progress, first_round, hold_contest, silent
from sim2real.hypotheses.pairs import add_pairs
from sim2real.hypotheses.selection import decide
from sim2real.merge import merge
from sim2real.observing.drive import WHEEL, Drive
from sim2real.observing.evidence import drift_of, gather, residuals
from sim2real.observing.lattice import common_lattice
from sim2real.observing.noise import RESOLUTION
from sim2real.observing.observer import Simulation
from sim2real.observing.orders import Order, counts, read_order, without_swing
from sim2real.observing.reference import By
from sim2real.own_model.study import Study, before_fits
from sim2real.own_sources import require_alone, studied
from sim2real.perception.diagnose import camera_shrink, diagnose_perception
from sim2real.reporting.findings import Findings, describe
from sim2real.result import Diagnosis, Measure, RmsError, Verdict, added
from sim2real.sources import Source, Sources, pairing_of, read_source, read_sources
from trpac_core.files import file_sha256

AS_LITTLE = 1.05
"""A parameter of the user's model that leaves this many times what the first effect leaves on the hold-out, or less, is
not told apart from it: an interval of that gap is as wide [-]."""
PACKAGES = ("trpac-fmu", "numpy", "numba", "scipy", "pandas")


def diagnose_files(
    vehicle: Path,
    road: Path | None,
    fit: Sequence[str],
    holdout: str,
    *,
    mapping: Path | None = None,
    dbc: Sequence[Path] = (),
    paired: Sequence[str] = (),
    simulated: Sequence[str] = (),
    by: By = "time",
    baseline: Sequence[str] = (),
    model: Path | None = None,
    signals: Path | None = None,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose recorded logs against the simulation of a vehicle.

    Parameters
    ----------
    vehicle, road : Path
        vehicle.yaml, and the road of the logs that name none.
    fit, holdout : sequence of str, str
        Logs that parameters are fitted to, and the one that the gap is measured on; `log.csv`,
        `log.csv@road.yaml`, or with a window in seconds, `log.csv@3:5.2`.
    mapping : Path, optional
        How the logs' columns become the contract's.
    dbc : sequence of Path
        DBC files that say what the frames of a bus mean.
    paired : sequence of str
        Reference logs: the same manoeuvres without the fault, one for each fit log and, last, the hold-out's. What the
        simulation leaves of them is no gap.
    simulated : sequence of str
        The same of the user's own simulation over each log's inputs, in place of `paired`.
    by : "time" or "position"
        What says that rows of a log and of its reference are the same point of the manoeuvre.
    baseline : sequence of str
        Logs of the same car without the fault, of any manoeuvre: how it is built otherwise than simulated is
        learnt from them, too.
    model, signals : Path, optional
        The user's own plant as a co-simulation unit, and the file that says which of its variables is which signal: its
        runs over the logs' torques are their references.
    seed : int
        Of the resampling behind the intervals; the same seed gives the same diagnosis.
    exclude : collection of str
        Effects that are left out of the library.
    jobs : int
        Threads.
    progress : callable
        Told the stage, and how much of how much is done.

    Raises
    ------
    ScenarioError
        Unusable input, with everything that is wrong with it.
    """
    progress("reading", 0, 1)
    pairing = pairing_of(paired, simulated, by)
    require_alone(model, signals, pairing)
    sources = read_sources(vehicle, road, fit, holdout, mapping, pairing, baseline, dbc)
    progress("reading", 1, 1)
    if model is None or signals is None:
        return diagnose_sources(sources, seed=seed, exclude=exclude, jobs=jobs, progress=progress)
    with studied(sources, model, signals, jobs, progress) as (held, own):
        return diagnose_sources(held, own=own, seed=seed, exclude=exclude, jobs=jobs, progress=progress)


def diagnose_sources(
    sources: Sources,
    *,
    own: Study | None = None,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose logs that have been read, `own` with the user's model as their reference; see `diagnose_files`."""
    provenance = _provenance(sources)  # now: the files may be others when the fits are done
    inadequate = require_adequate(sources)
    drives = [s.drive for s in sources.all]
    model = Simulation(sources.vehicle)
    warned = before_fits(own, model, drives[:-1]) if own else ()
    findings = find(
        model,
        drives[:-1],
        drives[-1],
        baseline=[s.drive for s in sources.baseline],
        exclude=exclude,
        jobs=jobs,
        progress=progress,
    )
    said = _told(findings, exclude, seed, jobs, progress)
    if own:
        said = replace(_with_own(said, own, findings), warnings=(*warned, *said.warnings))
    camera = diagnose_perception(
        [s.log for s in sources.fit],
        sources.holdout.log,
        [s.road for s in sources.all],
        sources.vehicle,
        exclude=exclude,
        seed=seed,
        found=findings.added(),
    )
    if camera is not None:
        said = merge(said, camera_verdict(camera, sources.vehicle, sources.holdout.road))
    return replace(
        said,
        trpac=_estimate(findings, sources),
        warnings=(
            *inadequate,
            *(f"{s.log.name}: {text}" for s in sources.all for text in s.log.warnings),
            *said.warnings,
        ),
        provenance={**provenance, **said.provenance},
    )


def _with_own(said: Diagnosis, own: Study, findings: Findings) -> Diagnosis:
    """The diagnosis with what the user's own model says of it."""
    first = said.causes[0].effect if said.causes else ""
    entry = next((e for e in findings.contest.singles if e.ids[0] == first), None)
    found = own.judge(findings.model, findings.fit_to, findings.holdout, entry)
    if said.verdict is Verdict.NO_GAP:
        return replace(said, own_model=found)
    said = replace(said, own_model=found, sentence=f"{said.sentence} {found.sentence}".strip())
    return _beside_own(said)


def _beside_own(said: Diagnosis) -> Diagnosis:
    """The diagnosis with the effect that the best own parameter stands for among those that it cannot tell apart.

    It belongs there where the user's model, run with it, leaves as little as with the first effect.
    """
    found = said.own_model
    if (
        found is None
        or not found.parameters
        or said.verdict
        not in (
            Verdict.IDENTIFIED,
            Verdict.PARTIAL,
            Verdict.AMBIGUOUS,
        )
    ):
        return said
    best, first = found.parameters[0], said.causes[0]
    effect = best.effect.partition(".")[0]
    left = first.gap_after if found.gap_after is None else found.gap_after
    groups = [g for g in said.ambiguous_with if first.effect in g]
    known = {first.effect, *(e for g in groups for e in g)}
    if not effect or effect in known or best.gap_after is None or best.gap_after > AS_LITTLE * left:
        return said
    group = tuple(dict.fromkeys((first.effect, effect, *(e for g in groups for e in g))))
    others = tuple(g for g in said.ambiguous_with if g not in groups)
    told = f"So {effect} and {first.effect} are not separated by these logs."
    return replace(
        said,
        verdict=Verdict.AMBIGUOUS,
        ambiguous_with=(group, *others),
        sentence=f"{said.sentence} {told}",
    )


def _estimate(findings: Findings, sources: Sources) -> RmsError | None:
    """What the found effects do to the estimator's own error."""
    held = sources.holdout
    measured = "mu_reference" in held.log.signals and "mu_reference" not in held.log.derived
    reference = held.on_rows("mu_reference") if measured else None
    return trpac_error(sources.vehicle, held.drive, findings.added(), reference)


def diagnose(
    model: Simulation,
    fit: Sequence[Drive],
    holdout: Drive,
    *,
    seed: int = 0,
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Diagnosis:
    """Diagnose drives against a simulation; see `diagnose_files`."""
    findings = find(model, fit, holdout, exclude=exclude, jobs=jobs, progress=progress)
    return _told(findings, exclude, seed, jobs, progress)


def _told(
    findings: Findings, exclude: Collection[str], seed: int, jobs: int, progress: Progress
) -> Diagnosis:
    said = describe(findings, seed=seed, jobs=jobs, progress=progress)
    if findings.lattice is None:
        return said
    return merge(said, counter_verdict(findings.lattice, *counter_gap(findings), COUNTER in exclude))


def find(
    model: Simulation,
    fit: Sequence[Drive],
    holdout: Drive,
    *,
    baseline: Sequence[Drive] = (),
    exclude: Collection[str] = (),
    jobs: int = 1,
    progress: Progress = silent,
) -> Findings:
    """Hold the contest and decide it; `baseline` are drives of the same car without the fault."""
    lattice = None if model.has(COUNTER) else common_lattice([d.lattice for d in (*fit, holdout)])
    base = model.with_effects(lattice.effect()) if lattice else model
    order, (*fit, holdout) = without_order(base, [*fit, holdout])

    fit_to, held = gather(base, fit), gather(base, [holdout])
    first = first_round(base, fit_to, exclude, jobs, progress)
    if first:
        best = first[0].candidate.model(first[0].x)
        fit_to, held = fit_to.sharpened(best), held.sharpened(best)
        drift = drift_of(best, fit_to, held)
        fit_to, held = fit_to.drifting(best, drift), held.drifting(best, drift)
    contest = hold_contest(base, fit_to, held, first, jobs, progress)
    decision = decide(contest, fit_to, held)
    if order is not None and decision.verdict is Verdict.NO_GAP:
        decision = replace(decision, verdict=Verdict.UNKNOWN)
        return Findings(base, fit_to, held, contest, decision, lattice, order, only_order=True)
    if contest.singles and decision.verdict is Verdict.UNKNOWN:
        contest = add_pairs(contest, base, fit_to, held, jobs, progress)
        decision = decide(contest, fit_to, held)
    gap = decision.verdict is not Verdict.NO_GAP
    if contest.singles and gap and (decision.verdict is Verdict.UNKNOWN or baseline):
        faultless = gather(base, baseline) if baseline else None
        contest, decision = beside_another_build(
            decision, contest, base, fit_to, held, faultless, jobs, progress
        )
    return Findings(base, fit_to, held, contest, decision, lattice, order)


def without_order(model: Simulation, drives: Sequence[Drive]) -> tuple[Order | None, list[Drive]]:
    """What repeats with the wheels' angle and is more than noise, and the logs without it."""
    rests = [residuals(model, drive) for drive in drives]
    order = read_order(drives, rests)
    if order is None:
        return None, list(drives)
    calm = [without_swing(drive, rest, order) for drive, rest in zip(drives, rests, strict=True)]
    if not counts(calm, gather(model, calm).noises):
        return None, list(drives)
    return order, calm


def counter_gap(findings: Findings) -> tuple[Measure, Measure]:
    """The hold-out's gap against the noise beside a counter's rounding, and against both."""
    held = findings.holdout
    rests = held.residuals(findings.model)
    assert findings.lattice is not None
    fine = []
    for noise in held.noises:
        sigma = noise.sigma.copy()
        sigma[WHEEL] = np.maximum(findings.lattice.sigma_rad_s, RESOLUTION[WHEEL])
        fine.append(replace(noise, sigma=np.minimum(sigma, noise.sigma)))
    return measure(replace(held, noises=tuple(fine)), rests), measure(held, rests)


def _provenance(sources: Sources) -> dict[str, object]:
    return {
        "vehicle": _file(sources.vehicle_path),
        "fit": [_origin(source) for source in sources.fit],
        "baseline": [_origin(source) for source in sources.baseline],
        "holdout": _origin(sources.holdout),
        "versions": {name: version(name) for name in PACKAGES},
    }


def _origin(source: Source) -> dict[str, object]:
    log = {"path": str(source.log.path), "sha256": source.log.sha256, "read_as": source.log.read_as}
    origin = {**log, "road": _file(source.road_path), "rate_hz": source.log.rate_hz}
    if source.reference is None:
        return origin
    return {**origin, "reference": {"path": str(source.reference.path), "sha256": source.reference.sha256}}


def _file(path: Path | None) -> dict[str, str | None]:
    """A file's path and hash; neither where it was no file."""
    return {
        "path": None if path is None else str(path),
        "sha256": None if path is None else file_sha256(path),
    }


def shrink_on(diagnosis: Diagnosis, log: Path, road: Path) -> float:
    """By how much what a diagnosis found shrinks the gap of a log that it has never seen [%].

    The car's gap, or the camera's where all that it found lies in the camera chain.

    Parameters
    ----------
    diagnosis : Diagnosis
        From `diagnose_files`.
    log, road : Path
        The further log, and where it was driven.
    """
    vehicle = load_vehicle(diagnosis.provenance["vehicle"]["path"])
    named = added(diagnosis) or diagnosis.causes[:1]
    of_car = [c for c in named if EFFECTS[c.effect].stage != "perception"]
    source = read_source(str(log), road)
    if named and not of_car:
        found = {c.effect: {name: v.value for name, v in c.parameters.items()} for c in named}
        return camera_shrink(source.log, source.road, vehicle, found)
    model = Simulation(vehicle)
    effects = [
        form_of(c.effect, c.form)(**{name: v.value for name, v in c.parameters.items()}) for c in of_car
    ]
    with_them = model.with_effects(*effects)
    held = gather(with_them, [source.drive])
    before, after = measure(held, held.residuals(model)), measure(held, held.residuals(with_them))
    return 100.0 * (1.0 - after.total / before.total)
