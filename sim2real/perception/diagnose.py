"""The camera chain's part of the diagnosis: late, tilted, blurred, ill exposed, or wrong about the classes' friction.

Three independent signals are judged, each by its own module: where the changes of class lie (`perception_shift`), how
sure the camera is (`perception_confidence`), and what a friction reference says of the classes (`perception_friction`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from scenarios.effects import Effect
from scenarios.files import RoadFile, VehicleFile
from sim2real.logs import Log
from sim2real.perception.chain import Account, Chain, Oddity
from sim2real.perception.confidence_chain import NOTICED, confidence_chain, modelled_loss
from sim2real.perception.conflicts import class_conflicts, odd_conflicts, odd_confusion
from sim2real.perception.finding import CameraCandidate, PerceptionFinding
from sim2real.perception.frames import Modelled, of_one_camera, read_results
from sim2real.perception.friction import SIGNAL as REFERENCE
from sim2real.perception.friction import friction_chain
from sim2real.perception.mounting import Mounting
from sim2real.perception.pictures import read_light
from sim2real.perception.shift import shift_chain
from sim2real.perception.stuck import odd_repeats
from sim2real.result import Interval, Measure, Place, Verdict
from trpac_core.vision.camera import Camera

NOISE_FLOOR = 1.0
"""Size of the gap that noise alone leaves, per signal and in total [-]."""
UNEXPLAINED, UNEXPLAINED_REFERENCE = 2.5, 1.5
"""Rest of a signal, in standard deviations, from which on its best account does not explain it; less of the friction
reference, whose deviations hold what all stretches may be off by together [-]."""
AN_EIGHTH, AT_MOST = 0.125, 3.0
"""Share of the gap's square beyond noise that an effect may leave all the same, while the rest is below so many
standard deviations: no form of an effect is exact [-]."""
TYPICAL = 0.75
"""Quantile that is taken for it: a few odd borders or stretches depend on nothing, a whole class of road does."""
MAKE_CLASSES_ERR = {"exposure_shift", "motion_blur"}
"""Effects under which classes may be wrong for whole stretches."""
READINGS = ("image_class", "image_confidence", "mu_reference")
"""What only a camera or a friction sensor can tell: a mapping that computes them tells nothing."""
BOOTSTRAP = 400
QUANTILES = (0.025, 0.975)


def diagnose_perception(
    logs_fit: Sequence[Log],
    log_holdout: Log,
    roads: Sequence[RoadFile],
    vehicle: VehicleFile,
    camera: Camera | None = None,
    exclude: Collection[str] = (),
    seed: int = 0,
    found: Sequence[Effect] = (),
) -> PerceptionFinding | None:
    """Judge the perception columns and the friction reference of some logs.

    Parameters
    ----------
    logs_fit, log_holdout : sequence of Log, Log
        Logs that parameters are fitted to, and the one that the gap is measured on.
    roads : sequence of RoadFile
        The road of each fit log, and last that of the hold-out.
    vehicle : VehicleFile
        The car, with what the simulation models already.
    camera : Camera, optional
        Height and place of the lens. The default is that of scenarios/cameras/paper.yaml, and then intervals of a
        mounting angle hold other heights and places too.
    exclude : collection of str
        Effects that are left out of the library.
    seed : int
        Of the resampling behind the shrink's interval.
    found : sequence of Effect
        What the dynamics were found to need: a friction reference that agrees with it is not the camera's gap.

    Returns
    -------
    PerceptionFinding or None
        None where nothing of the camera chain is measured.
    """
    logs_fit, log_holdout = [_as_read(log) for log in logs_fit], _as_read(log_holdout)
    known, camera = camera is not None, Camera() if camera is None else camera
    further_m = 0.0 if known else vehicle.to_core().cog_to_front_axle_m + camera.x_from_front_axle_m
    read = [
        read_results(log, road, vehicle, camera)
        for log, road in zip((*logs_fit, log_holdout), roads, strict=True)
    ]
    warnings = [text for _, texts in read for text in texts]
    every, odd_distance = of_one_camera([one for one, _ in read if one is not None])
    held_out = every[-1] if read[-1][0] is not None else None
    results = every if held_out is None else every[:-1]
    folders = [log.image_folder for (one, _), log in zip(read[:-1], logs_fit, strict=True) if one is not None]
    modelled = Modelled.of(vehicle)
    light, more = read_light(results, folders)
    light_unseen, yet_more = read_light(
        [] if held_out is None else [held_out], [log_holdout.image_folder][: held_out is not None]
    )
    conflicts = class_conflicts(every)
    warnings += [*odd_distance, *more, *yet_more, *(conflict.sentence for conflict in conflicts)]
    judged = (
        shift_chain(results, held_out, modelled, Mounting(camera.height_m, further_m), exclude),
        confidence_chain(results, held_out, (light, light_unseen), modelled, exclude),
        friction_chain(
            (logs_fit, roads[:-1]),
            (log_holdout, roads[-1]),
            vehicle,
            modelled,
            exclude,
            found,
            camera=bool(results) or held_out is not None,
        ),
    )
    chains = [chain for chain in judged if chain is not None]
    if not chains:
        return None
    lost = modelled_loss(every, modelled)
    unmeasured = np.isnan(lost) and (modelled.exposure_s > 0.0 or modelled.stops != 0.0)
    blurred = unmeasured or lost > NOTICED
    errs = None if blurred else odd_conflicts(conflicts, every)
    if blurred:
        chains = [replace(chain, errs=None) for chain in chains]
    return _conclude(chains, errs, (odd_confusion(every), odd_repeats(every)), tuple(warnings), seed)


def _as_read(log: Log) -> Log:
    """The log without readings that a mapping computed."""
    made = log.derived.intersection(READINGS)
    return replace(log, signals={k: v for k, v in log.signals.items() if k not in made}) if made else log


def camera_shrink(
    log: Log, road: RoadFile, vehicle: VehicleFile, added: Mapping[str, Mapping[str, float]]
) -> float:
    """By how much effects, once they are in vehicle.yaml, shrink the camera's gap of a log [%]; NaN without a camera.

    Parameters
    ----------
    log, road : Log, RoadFile
        The log, and where it was driven.
    vehicle : VehicleFile
        The car as simulated so far.
    added : mapping
        Effects of the camera chain with their parameters, as in vehicle.yaml.
    """
    with_them = vehicle.model_copy(update={"effects": {**vehicle.effects, **added}})
    before, after = (diagnose_perception([log], log, [road, road], v) for v in (vehicle, with_them))
    if before is None or after is None:
        return float("nan")
    return 100.0 * (1.0 - after.before.total / before.before.total)


def _conclude(
    chains: Sequence[Chain],
    conflict: Oddity | None,
    further: Sequence[Oddity | None],
    warnings: tuple[str, ...],
    seed: int,
) -> PerceptionFinding:
    """Each signal's best account, and what they make together.

    `conflict` is what classes say against road.yaml, which bad pictures may cause; `further` is what they may not.
    """
    best = [_standing(chain) for chain in chains]
    rivals = [chain.rivals(account) for chain, account in zip(chains, best, strict=True)]
    nothing = [chain.nothing for chain in chains]
    odd = [one for pair in zip(chains, best, strict=True) if (one := _unexplained(*pair)) is not None]
    causes = tuple(dict.fromkeys(effect for account in best for effect in account.effects))
    errs = conflict or next((chain.errs for chain in chains if chain.errs), None)
    if errs and not set(causes) & MAKE_CLASSES_ERR:
        odd.append(errs)
    odd += [one for one in further if one is not None]
    ambiguous = tuple(
        dict.fromkeys(
            tuple(dict.fromkeys((*account.effects, *(e for r in others for e in r.effects))))
            for account, others in zip(best, rivals, strict=True)
            if others
        )
    )
    unexcited = {
        effect: why for chain in chains for effect, why in chain.unexcited.items() if effect not in causes
    }
    verdict = _verdict(causes, bool(ambiguous), bool(odd))
    return PerceptionFinding(
        verdict=verdict,
        causes=causes,
        candidates=_candidates(chains, best, unexcited, seed),
        before=_measure(chains, nothing),
        after=_measure(chains, nothing if verdict is Verdict.UNKNOWN else best),
        ambiguous_with=ambiguous,
        cannot_rule_out=unexcited,
        places=_places(chains, best),
        next_step=" ".join(chain.next_step for chain, others in zip(chains, rivals, strict=True) if others),
        odd=tuple(odd),
        warnings=warnings,
    )


def _verdict(causes: tuple[str, ...], ambiguous: bool, unexplained: bool) -> Verdict:
    if unexplained:
        return Verdict.UNKNOWN
    if ambiguous:
        return Verdict.AMBIGUOUS
    if len(causes) > 1:
        return Verdict.COMPOUND
    return Verdict.IDENTIFIED if causes else Verdict.NO_GAP


def _standing(chain: Chain) -> Account:
    """The chain's best account; where as simulated leaves too much, one that is worth its price and does not."""
    best = chain.best()
    if best.effects or chain.unexplained or _unexplained(chain, best) is None:
        return best
    able = [a for a in chain.accounts if a.score > 0.0 and _unexplained(chain, a) is None]
    return max(able, key=lambda account: account.score, default=best)


def _unexplained(chain: Chain, account: Account) -> Oddity | None:
    """What a signal's best account leaves; None where it leaves noise."""
    if chain.unexplained:
        return chain.unexplained
    if not len(account.z):
        return None
    typical = float(np.hypot(np.quantile(np.abs(account.z), TYPICAL), np.sqrt(account.excess)))
    least = UNEXPLAINED_REFERENCE if chain.signal == REFERENCE else UNEXPLAINED
    most = AN_EIGHTH * (chain.nothing.left() ** 2 - 1.0)
    if account.effects and account.left() ** 2 - 1.0 <= most:
        least = max(least, AT_MOST)
    if typical < max(least, chain.noticed):
        return None
    named = " and ".join(account.effects) or "the simulation as it is"
    told = f"{chain.signal}: with {named} {typical:.1f} times the noise remain on the hold-out."
    return Oddity(chain.signal, told, "none of the checked quantities", "both ways", "no pattern found")


def _measure(chains: Sequence[Chain], accounts: Sequence[Account]) -> Measure:
    """Gap on the hold-out under one account per signal."""
    signals = {c.signal: a.left() for c, a in zip(chains, accounts, strict=True) if len(a.z)}
    return Measure(_total(signals.values()), signals)


def _total(sizes: Collection[float]) -> float:
    return float(np.sqrt(np.mean(np.square(list(sizes))))) if sizes else float("nan")


def _places(chains: Sequence[Chain], best: Sequence[Account]) -> tuple[Place, ...]:
    """Places of the signals that have a gap; shares are of the camera's whole gap."""
    size = {
        c.signal: c.nothing.left() ** 2
        for c, a in zip(chains, best, strict=True)
        if a.effects or _unexplained(c, a) is not None
    }
    whole = sum(size.values())
    return tuple(
        Place(p.signal, p.subsystem, p.regime, p.from_s, p.to_s, p.share * size[c.signal] / whole, p.log)
        for c in chains
        if c.signal in size
        for p in c.places
    )


def _candidates(
    chains: Sequence[Chain], best: Sequence[Account], unexcited: dict[str, str], seed: int
) -> tuple[CameraCandidate, ...]:
    """All accounts of all signals, and the compounds of the best ones of several signals."""
    out = []
    for at, chain in enumerate(chains):
        out += [_candidate(chains, {at: account}, unexcited, seed) for account in chain.accounts]
    standing = [at for at, account in enumerate(best) if account.effects]
    for count in range(2, len(standing) + 1):
        for together in combinations(standing, count):
            out.append(_candidate(chains, {at: best[at] for at in together}, unexcited, seed))
    return tuple(sorted(out, key=lambda c: -c.score))


def _candidate(
    chains: Sequence[Chain], changed: dict[int, Account], unexcited: dict[str, str], seed: int
) -> CameraCandidate:
    accounts = [changed.get(at, chain.nothing) for at, chain in enumerate(chains)]
    own = [(chains[at], account) for at, account in changed.items()]
    effects = tuple(effect for _, account in own for effect in account.effects)
    unseen = [chain.signal for chain, account in own if not len(account.z)]
    unknown = (
        f"The hold-out has no data of {' and '.join(unseen)}: the decrease of the gap there is not known."
    )
    nan = float("nan")
    return CameraCandidate(
        effects=effects,
        signal=" and ".join(chain.signal for chain, _ in own),
        gain_fit=sum(account.gain_fit for _, account in own),
        gain_holdout=sum(account.gain_holdout for _, account in own),
        size=sum(account.size for _, account in own),
        observations=sum(chain.observations for chain, _ in own),
        effective=sum(chain.effective for chain, _ in own),
        score=sum(account.score for _, account in own),
        parameters={name: value for _, account in own for name, value in account.parameters.items()},
        after=Measure(nan) if unseen else _measure(chains, accounts),
        shrink_percent=Interval(nan, nan, nan, "%") if unseen else _shrink(chains, accounts, seed),
        evidence_for=tuple(text for _, account in own for text in account.evidence_for),
        evidence_against=tuple(text for _, account in own for text in account.evidence_against)
        + tuple(unexcited[effect] for effect in effects if effect in unexcited)
        + ((unknown,) if unseen else ()),
        excited=not any(effect in unexcited for effect in effects),
    )


def _shrink(chains: Sequence[Chain], accounts: Sequence[Account], seed: int) -> Interval:
    """Shrink of the total with a 95 % interval, by resampling the hold-out's observations [%]."""
    generator = np.random.default_rng(seed)
    seen = [(c.nothing, a) for c, a in zip(chains, accounts, strict=True) if len(a.z)]
    old = np.zeros(BOOTSTRAP + 1)
    new = np.zeros(BOOTSTRAP + 1)
    for nothing, account in seen:
        count = len(account.z)
        rows = np.vstack((np.arange(count), generator.integers(0, count, (BOOTSTRAP, count))))
        old += np.maximum((nothing.z**2)[rows].mean(axis=1) + nothing.excess, NOISE_FLOOR)
        new += np.maximum((account.z**2)[rows].mean(axis=1) + account.excess, NOISE_FLOOR)
    shrink = 100.0 * (1.0 - np.sqrt(new / np.maximum(old, 1e-12)))
    low, high = np.quantile(shrink[1:], QUANTILES)
    value = float(shrink[0])
    return Interval(value, float(min(low, value)), float(max(high, value)), "%")
