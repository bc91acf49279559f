"""The confidence's account: blur, exposure or both against the simulation as it is, with the evidence."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from sim2real.perception.blocks import BLOCK_S, Blocks, make_blocks
from sim2real.perception.chain import DECISIVE, Account, Chain, Oddity, price
from sim2real.perception.clear import taken_by_borders
from sim2real.perception.confidence import (
    NORMAL_CONFIDENCE,
    NORMAL_SPREAD,
    USUAL_SPREAD,
    ConfidenceFit,
    ConfidenceModel,
    Signs,
    fit_confidence,
    read_model,
)
from sim2real.perception.conflicts import by_road, class_error, odd_confusion
from sim2real.perception.frames import Modelled, Results
from sim2real.perception.patterns import FEWEST_OF_CLASS, odd_pattern
from sim2real.perception.pictures import NORMAL_LIGHT_EV, Light
from sim2real.result import Interval, Place

Array = NDArray[np.float64]

SIGNAL = "image_confidence"
CHOICES = (("motion_blur",), ("exposure_shift",), ("motion_blur", "exposure_shift"))
NEXT_STEP = "Drive the same surface at low and at high speed and record the pictures."
RECORD = (
    "Record the pictures (image_path): without them a wrong exposure cannot be separated from a camera whose "
    "normal confidence is as low."
)
LEAST_SPEED_SPREAD_M_S = 1.5
"""Standard deviation of speed below which blur cannot show as a fall with speed [m/s]."""
NOTABLE, MOST_PLACES = 2.0, 4
NORMAL_RANGE = 2.0
"""Standard deviations of a normal level, of usual mistakes and of usual light together that are no gap [-]."""
FEWEST_BLOCKS = 8
"""With fewer blocks nothing is said of confidence."""
NOTICED = 0.1
"""Change of the confidence's logarithm below which it is no gap, however steady the camera is otherwise [-]."""
SMALLER, BEYOND_DOUBT, AGAINST = 0.97, 6.0, -1.0
"""Share of the hold-out's gap that an effect has to get below, else it is none [-], unless all logs together speak for
it by so much, and the hold-out not by more than a nat against it [nats]."""
SLIGHT = 0.035
"""Fall of the confidence's logarithm between low and high speed below which blur is none: a normal camera is as unsure
[-]."""


@dataclass(frozen=True)
class Seen:
    """Confidence, and what else shows bad pictures, of the fit logs and of the hold-out."""

    known: Blocks
    unseen: Blocks
    signs: Signs
    light_unseen: Light | None

    @property
    def light(self) -> Light | None:
        """What tells over- from underexposure: the pictures of the fit logs, else the hold-out's."""
        return self.signs.light if self.signs.light is not None else self.light_unseen

    def signed(self, fit: ConfidenceFit) -> ConfidenceFit:
        """A fit with the sign that the hold-out's pictures have where the fit logs name none."""
        stops = fit.stops
        if "exposure_shift" not in fit.effects or self.signs.light is not None or self.light_unseen is None:
            return fit
        size = np.array([stops.value, -stops.value])
        if np.diff(self.light_unseen.log_likelihood(size))[0] <= 0.0:
            return fit
        return replace(fit, stops=Interval(-stops.value, -stops.high, -stops.low, stops.unit))

    @property
    def together(self) -> Blocks:
        """All blocks."""
        pairs = ((getattr(self.known, f.name), getattr(self.unseen, f.name)) for f in fields(Blocks))
        return Blocks(*(np.concatenate(p) for p in pairs))

    def deviance(self, fit: ConfidenceFit) -> float:
        """Squares by which classes and pictures of the fit logs are beyond what a fit explains [-]."""
        loss = fit.loss(self.known)
        mean, stops = np.array(loss.mean() if len(loss) else 0.0), np.array(fit.stops.value)
        return -2.0 * float(self.signs.log_likelihood(mean, stops))

    def log_likelihood(self, fit: ConfidenceFit, model: ConfidenceModel) -> float:
        """Of all there is, at what was fitted [nats]."""
        total = model.log_likelihood(self.together, fit.loss(self.together)) - 0.5 * self.deviance(fit)
        if self.light_unseen is None:
            return total
        return total + float(self.light_unseen.log_likelihood(np.array(fit.stops.value)))


def confidence_chain(
    fitted: Sequence[Results],
    held_out: Results | None,
    lights: tuple[Light | None, Light | None],
    modelled: Modelled,
    exclude: Collection[str],
) -> Chain | None:
    """The confidence's account; None where no log has camera results."""
    if not fitted and held_out is None:
        return None
    every_log = [*fitted, *([held_out] if held_out else [])]
    known = make_blocks(fitted).less(modelled.exposure_s, modelled.stops)
    unseen = make_blocks([] if held_out is None else [held_out]).less(modelled.exposure_s, modelled.stops)
    # of what is normal a level tells on clear road
    borders = taken_by_borders(every_log)
    known, unseen = known.raised(borders), unseen.raised(borders)
    choices = [c for c in CHOICES if not set(c) & set(exclude)]
    pictures = sum(int(np.isfinite(one.confidence).sum()) for one in every_log)
    if len(known) < FEWEST_BLOCKS:
        why = f"Only {len(known)} s of image_confidence on the fit logs; {FEWEST_BLOCKS} s are needed."
        if lights[0] is None:
            return Chain.silent(SIGNAL, pictures, [effect for choice in choices for effect in choice], why)
        # the pictures alone still tell their exposure
        known, unseen = make_blocks([]), make_blocks([])
        choices = [c for c in choices if c == ("exposure_shift",)]
    # mistakes that are made with good pictures say nothing of bad ones
    errors = float("nan") if odd_confusion(fitted) else class_error(fitted)
    model, signs = (
        read_model(known),
        Signs(errors, lights[0], float(np.nan_to_num(modelled_loss(fitted, modelled)))),
    )
    seen = Seen(known, unseen, signs, lights[1])

    def fit(effects: tuple[str, ...]) -> ConfidenceFit:
        found = fit_confidence(known, signs, model, effects, modelled.exposure_s, modelled.stops)
        return seen.signed(found)

    plain, fits = fit(()), [fit(choice) for choice in choices]
    accounts = [_account(f, plain, seen, model) for f in (plain, *fits)]
    left_out = [c for c in CHOICES if set(c) & set(exclude)] if len(known) else []
    outside = [_account(fit(choice), plain, seen, model) for choice in left_out]
    chain = Chain(
        SIGNAL,
        pictures,
        (len(known) + len(unseen)) / model.memory,
        accounts[0],
        tuple(accounts[1:]),
        places=_places(accounts[0], unseen),
        unexcited=_unexcited(seen, choices),
        next_step=NEXT_STEP,
        noticed=NOTICED / model.deviation,
        asked=("exposure_shift",) if _is_unusual(seen, plain) else (),
    )
    every = (*chain.accounts, *outside)
    if len(unseen) >= FEWEST_BLOCKS and _shows_no_gap(chain.nothing, every):
        chain = replace(chain, no_gap=True)
    if any(rival is chain.nothing for rival in chain.rivals(chain.best())):
        chain = replace(chain, next_step=RECORD)
    stands = next(f for f in (plain, *fits) if f.effects == chain.best().effects)
    if stands.effects == ("motion_blur",) and np.subtract(*_slow_and_fast(stands, known)[1]) > -SLIGHT:
        chain, stands = replace(chain, no_gap=True), plain
    pattern = odd_pattern(seen.together.raised(-borders), stands, _restlessness(every_log, model, modelled))
    needed = [a for a in outside if a.score > chain.best().score + DECISIVE and not chain.no_gap]
    if needed and not pattern:
        pattern = _of_no_effect(max(needed, key=lambda account: account.score))
    return replace(chain, unexplained=pattern)


def modelled_loss(results: Sequence[Results], modelled: Modelled) -> float:
    """What blur and exposure that are modelled take of the confidence's logarithm, the mean over some results [-].

    NaN where no confidence is measured.
    """
    blocks = make_blocks(results)
    if not len(blocks):
        return float("nan")
    return float((blocks.loss - blocks.less(modelled.exposure_s, modelled.stops).loss).mean())


def _restlessness(results: Sequence[Results], model: ConfidenceModel, modelled: Modelled) -> float:
    """Standard deviation of the confidence's logarithm from second to second, on one class at one speed [-].

    Where pictures are so bad that classes err in turns, the class that is named is not the one on the road, and a
    picture of which surface it is that is read well or badly.
    """
    blocks = make_blocks(by_road(results)).less(modelled.exposure_s, modelled.stops)
    return (
        min(model.deviation, read_model(blocks).deviation)
        if len(blocks) >= FEWEST_BLOCKS
        else model.deviation
    )


def _is_unusual(seen: Seen, plain: ConfidenceFit) -> bool:
    """Whether the level is lower than that of chains that were seen, and no picture tells why."""
    return seen.light is None and level_of(seen.known, plain) > NORMAL_RANGE * USUAL_SPREAD


def _shows_no_gap(nothing: Account, others: Sequence[Account]) -> bool:
    """Whether no account makes the hold-out's gap smaller, nor has all logs together speak for it beyond doubt."""
    if min((account.left() for account in others), default=0.0) <= SMALLER * nothing.left():
        return False
    best = max(others, key=lambda account: account.score, default=nothing)
    return best.score < BEYOND_DOUBT or best.gain_holdout < AGAINST


def _of_no_effect(needed: Account) -> Oddity:
    """What the confidence does that no effect of the library has it do."""
    blurred = "motion_blur" in needed.effects
    what = "how the confidence depends on speed" if blurred else "how low the confidence is"
    told = f"No effect of the library explains {what}. {needed.evidence_for[0]}"
    if blurred:
        return Oddity(SIGNAL, told, "speed", "less at high speed", "falls with it")
    return Oddity(SIGNAL, told, "nothing that was measured", "less", "equal at all speeds")


def _account(f: ConfidenceFit, nothing: ConfidenceFit, seen: Seen, model: ConfidenceModel) -> Account:
    parameters = {"exposure_s": f.exposure_s} if "motion_blur" in f.effects else {}
    if "exposure_shift" in f.effects:
        parameters["stops"] = f.stops
    gain_fit = f.log_likelihood - nothing.log_likelihood
    # a level is one observation, however long it holds: other chains' normal levels are what it is held against
    seconds = len(seen.together) / model.memory
    level = level_of(seen.known, f) / (
        USUAL_SPREAD if not f.effects and _is_unusual(seen, f) else NORMAL_SPREAD
    )
    return Account(
        f.effects,
        f.size,
        price(*(1.0 if effect == "exposure_shift" else seconds for effect in f.effects)),
        gain_fit,
        seen.log_likelihood(f, model) - seen.log_likelihood(nothing, model) - gain_fit,
        parameters,
        rest_of(seen.unseen, seen.known, f, model),
        max(level**2 + seen.deviance(f) - NORMAL_RANGE**2, 0.0),
        evidence_for=_evidence(f, seen),
        evidence_against=_doubts(f, seen),
    )


def level_of(learnt: Blocks, fit: ConfidenceFit) -> float:
    """By how much a fit leaves the confidence's logarithm below a normal one's [-]."""
    return float((learnt.loss - fit.loss(learnt)).mean() + np.log(NORMAL_CONFIDENCE)) if len(learnt) else 0.0


def rest_of(blocks: Blocks, learnt: Blocks, fit: ConfidenceFit, model: ConfidenceModel) -> Array:
    """What a fit leaves of blocks, about the level of each class on the blocks that it learnt from, shape (n,) [-]."""
    if not len(learnt):
        return np.empty(0)
    rest, known = blocks.loss - fit.loss(blocks), learnt.loss - fit.loss(learnt)
    level = np.zeros(len(blocks))
    for c in np.unique(blocks.classes):
        # what a class's level is where few blocks were learnt from, the blocks themselves have to say
        learnt_of = known[learnt.classes == c]
        level[blocks.classes == c] = (
            learnt_of if len(learnt_of) >= FEWEST_OF_CLASS else rest[blocks.classes == c]
        ).mean()
    return (rest - level) / model.deviation


def _evidence(f: ConfidenceFit, seen: Seen) -> tuple[str, ...]:
    blocks, sentences = seen.known, []
    if "motion_blur" in f.effects:
        (slow, fast), losses = _slow_and_fast(f, blocks)
        low, high = np.exp(-losses)
        sentences.append(
            f"Confidence changes from {low:.2f} at {slow:.0f} m/s to {high:.2f} at {fast:.0f} m/s, for each class "
            "separately."
        )
    if "exposure_shift" in f.effects:
        if len(blocks):
            sentences.append(
                f"Confidence is {np.exp(-blocks.loss.mean()):.2f} on clear road; normal is taken as "
                f"{NORMAL_CONFIDENCE:g} ({np.exp(np.log(NORMAL_CONFIDENCE) - NORMAL_RANGE * USUAL_SPREAD):.2f} to 1)."
            )
        if np.isfinite(seen.signs.class_error):
            sentences.append(
                f"The class differs from road.yaml in {100.0 * seen.signs.class_error:.0f} % of the results."
            )
        if (light := seen.light) is not None:
            sentences.append(
                f"{light.count} pictures: road {light.level_ev - NORMAL_LIGHT_EV:+.1f} stops from usual, "
                f"{100.0 * light.white_share:.1f} % white, {100.0 * light.black_share:.1f} % black."
            )
    return tuple(sentences)


def _slow_and_fast(f: ConfidenceFit, blocks: Blocks) -> tuple[Array, Array]:
    """Low and high speed of some blocks [m/s], and the loss of confidence at them with a fit's blur [-]."""
    ends = np.quantile(blocks.speed_m_s, (0.1, 0.9))
    beyond = ends**f.power - (blocks.speed_m_s**f.power).mean()
    return ends, blocks.loss.mean() + f.per_speed * beyond


def _doubts(f: ConfidenceFit, seen: Seen) -> tuple[str, ...]:
    doubts = []
    if f.effects:
        doubts.append(
            "The dependence of confidence was measured on image networks; that of another chain may differ by a "
            "factor of two, for blur of seven, which the interval includes."
        )
    if "exposure_shift" in f.effects and seen.light is None:
        doubts.append("The log names no pictures: over- and underexposure cannot be separated.")
    return tuple(doubts)


def _places(nothing: Account, unseen: Blocks) -> tuple[Place, ...]:
    """The seconds of the hold-out that are least sure."""
    unsure = np.maximum(nothing.z, 0.0) ** 2 + nothing.excess
    share = unsure / max(float((nothing.z**2 + nothing.excess).sum()), 1e-12)
    worst = [k for k in np.argsort(-unsure) if unsure[k] > NOTABLE**2][:MOST_PLACES]
    return tuple(
        Place(
            SIGNAL,
            "camera",
            f"at {unseen.speed_m_s[k]:.0f} m/s",
            float(unseen.time_s[k] - 0.5 * BLOCK_S),
            float(unseen.time_s[k] + 0.5 * BLOCK_S),
            float(share[k]),
            str(unseen.log[k]),
        )
        for k in worst
    )


def _unexcited(seen: Seen, choices: Sequence[tuple[str, ...]]) -> dict[str, str]:
    """Effects that these logs could hardly show, and why."""
    why = {}
    spread = float(seen.known.speed_m_s.std()) if len(seen.known) else 0.0
    if spread < LEAST_SPEED_SPREAD_M_S:
        why["motion_blur"] = (
            f"Speed varies by {spread:.1f} m/s only: a fall of confidence with speed cannot show."
        )
    if seen.light is None:
        why["exposure_shift"] = (
            "Without pictures a moderate exposure error cannot be separated from the normal confidence of another "
            "camera."
        )
    candidates = [effect for choice in choices for effect in choice]
    return {effect: text for effect, text in why.items() if effect in candidates}
