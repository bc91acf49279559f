"""Away from borders: how often the camera's class is not road.yaml's, and where it keeps being another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import pdtrc

from scenarios.files import RoadSegment
from sim2real.perception.chain import Oddity
from sim2real.perception.crossings import rough_shift
from sim2real.perception.frames import Results
from trpac_core.vision.classes import Surface

Array = NDArray[np.float64]

SIGNAL = "image_place"

MARGIN_M = 5.0
"""Way after and before a border that is left out: there a shift shows, not a conflict [m]."""
FEWEST = 5
MANY, SEVERAL_LOGS = 3, 2
"""Conflicts, and logs that have them, from which on they are a gap, and no slip of road.yaml's."""
CHANCE = 0.01
"""How often mistakes, as the camera makes them elsewhere, may by chance look like a gap that is found [-]."""
MOSTLY = 0.7
"""Share of a segment's results that name one other class, from which on they are no chance mistakes."""
CONFUSED, FEWEST_OF_SURFACE = 0.3, 30
"""Share of a surface's results that name others from which on these are no chance mistakes, and how many results of it
have to be there."""
HARDLY_READ = 0.3
"""Share of wrong classes away from borders from which on a change of class may be any of them [-]."""
SURE, AS_SURE = 0.8, 0.1
"""Confidence from which on pictures are good [-], and by how much less sure mistakes may be all the same, in its
logarithm [-]: with bad pictures the one is lower, or the other more."""


def class_error(results: Sequence[Results], later: bool = False) -> float:
    """Share of the results away from borders that name another class than road.yaml; NaN where there are none [-].

    Results are laid over the road as they fit best, so that a late camera's are not wrong ones. Segments that mostly
    show one other class are left out: there the road differs, not the picture. `later`: in the second half of each
    segment alone, where a picture of the one before hardly reaches.
    """
    wrong = [np.empty(0, dtype=np.bool_)]
    for one, segment, inside in _laid_over(results):
        if _other_class(one, segment, inside) is None:
            told = one.classes[inside]
            wrong.append(told[len(told) // 2 if later else 0 :] != segment.surface_class)
    every = np.concatenate(wrong)
    return float(every.mean()) if len(every) else float("nan")


def odd_confusion(results: Sequence[Results]) -> Oddity | None:
    """The gap that one surface is taken for another with good pictures; None where none is."""
    seen: dict[Surface, list[tuple[NDArray[np.int64], Array]]] = {}
    for one, segment, inside in _laid_over(results):
        known = inside & (one.confidence > 0.0)
        seen.setdefault(segment.surface_class, []).append((one.classes[known], np.log(one.confidence[known])))
    of = {
        true: (np.concatenate([c for c, _ in parts]), np.concatenate([s for _, s in parts]))
        for true, parts in seen.items()
    }
    every = np.concatenate([sure for _, sure in of.values()]) if of else np.empty(0)
    if not len(every) or np.exp(every.mean()) < SURE:
        return None
    for true, (classes, sure) in sorted(of.items()):
        wrong = classes != true
        if len(classes) < FEWEST_OF_SURFACE or wrong.mean() < CONFUSED:
            continue
        if wrong.all() or sure[wrong].mean() > sure[~wrong].mean() - AS_SURE:
            other = Surface(int(np.bincount(classes[wrong]).argmax()))
            told = (
                f"The camera reports another class with its usual confidence in {100.0 * wrong.mean():.0f} % of "
                f"its results where road.yaml has {true.label}, mostly {other.label}. Check whether it confuses "
                "the surfaces, or whether road.yaml is out of date."
            )
            return Oddity(SIGNAL, told, "surface", f"{other.label} for {true.label}", "whatever the picture")
    return None


def streak_m(results: Sequence[Results], conflicts: bool = True) -> float:
    """Way over which a camera that errs goes on doing so, the mean away from borders; 0 where it never errs [m].

    Infinite where it errs so often that borders cannot be told from mistakes. `conflicts`: also on segments that mostly
    show one other class.
    """
    if class_error(results) > HARDLY_READ:
        return float("inf")
    wrong_m, runs = 0.0, 0
    for one, place_m in places_of(results):
        wrong = np.zeros(len(one), dtype=np.bool_)
        for segment, inside in _inside(one, place_m):
            if conflicts or _other_class(one, segment, inside) is None:
                wrong |= inside & (one.classes != segment.surface_class)
        wrong_m += float(np.abs(np.gradient(place_m))[wrong].sum()) if len(one) > 1 else 0.0
        runs += int(wrong[0]) + int((wrong[1:] & ~wrong[:-1]).sum())
    return wrong_m / runs if runs else 0.0


@dataclass(frozen=True)
class Conflict:
    """A segment of a log on which most results name one other class than road.yaml, in a sentence."""

    log: str
    sentence: str


def class_conflicts(results: Sequence[Results]) -> tuple[Conflict, ...]:
    """All of them, results laid over the road as they fit best."""
    found = []
    for one, segment, inside in _laid_over(results):
        other = _other_class(one, segment, inside)
        if other is not None and inside.sum() >= FEWEST:
            share = (one.classes[inside] == other).mean()
            sentence = (
                f"{one.log}: from {segment.start_m:g} m on the camera reports {other.label} in {100.0 * share:.0f} % "
                f"of its results where road.yaml has {segment.surface}."
            )
            found.append(Conflict(one.log, sentence))
    return tuple(found)


def odd_conflicts(conflicts: Sequence[Conflict], results: Sequence[Results]) -> Oddity | None:
    """The gap that conflicts of some results are; None where they may be chance, or road.yaml's own slip."""
    logs = {conflict.log for conflict in conflicts}
    if len(conflicts) < MANY or len(logs) < SEVERAL_LOGS:
        return None
    if pdtrc(len(conflicts) - 1, _expected(results)) > CHANCE:
        return None
    told = (
        f"The camera reports another class than road.yaml throughout {len(conflicts)} stretches in {len(logs)} "
        f"logs. Check whether it repeats old results or confuses surfaces. {conflicts[0].sentence}"
    )
    return Oddity(SIGNAL, told, "place", "another class", "for whole stretches")


def _expected(results: Sequence[Results]) -> float:
    """Conflicts that streaks of mistakes make by chance, one each, their lengths as waiting times are [-].

    Such a streak covers `MOSTLY` of a segment if it is there at its begin, or comes soon after, and lasts for so long.
    """
    error, mean_m = class_error(results), streak_m(results, conflicts=False)
    if not error * mean_m > 0.0:
        return 0.0
    seen = (place_m[inside] for one, place_m in places_of(results) for _, inside in _inside(one, place_m))
    way_m = np.array([np.ptp(places) for places in seen if len(places) >= FEWEST])
    spans = way_m / mean_m
    return float((error * (1.0 + (1.0 - MOSTLY) * spans) * np.exp(-MOSTLY * spans)).sum())


def _other_class(one: Results, segment: RoadSegment, inside: NDArray[np.bool_]) -> Surface | None:
    """The other class that results inside a segment mostly name; None where they do not."""
    seen = np.bincount(one.classes[inside], minlength=len(Surface))
    most = Surface(int(seen.argmax()))
    return most if most != segment.surface_class and seen[most] >= MOSTLY * seen.sum() else None


def _laid_over(results: Sequence[Results]) -> Iterator[tuple[Results, RoadSegment, NDArray[np.bool_]]]:
    """Results over the road as they fit best: each log, each segment, and which of its results lie well within."""
    for one, place_m in places_of(results):
        for segment, inside in _inside(one, place_m):
            yield one, segment, inside


def by_road(results: Sequence[Results]) -> tuple[Results, ...]:
    """The results, laid over the road as they fit best, with road.yaml's class; near borders without a confidence."""
    out = []
    for one, place_m in places_of(results):
        classes, confidence = one.classes.copy(), np.full(len(one), np.nan)
        for segment, inside in _inside(one, place_m):
            classes[inside], confidence[inside] = segment.surface_class, one.confidence[inside]
        out.append(replace(one, classes=classes, confidence=confidence))
    return tuple(out)


def places_of(results: Sequence[Results]) -> Iterator[tuple[Results, Array]]:
    """Each log, and where its results lie on the road as they fit best together [m]."""
    if not results:
        return
    age_s, way_m = rough_shift(results)
    for one in results:
        late_m = one.driven_m(one.time_s, np.array([age_s]))[:, 0] + way_m
        yield one, 0.5 * (one.from_m + one.to_m) - late_m


def _inside(one: Results, place_m: Array) -> Iterator[tuple[RoadSegment, NDArray[np.bool_]]]:
    """Each segment of the road, and which results' places lie well within it."""
    starts = [-np.inf, *(s.start_m for s in one.road.segments[1:]), np.inf]
    for segment, begin, end in zip(one.road.segments, starts[:-1], starts[1:], strict=True):
        yield segment, (place_m > begin + MARGIN_M) & (place_m < end - MARGIN_M)
