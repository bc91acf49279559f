"""The confidence's account: blur, exposure or both against the simulation as it is, with what speaks for them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sim2real.perception_blocks import BLOCK_S, Blocks, make_blocks
from sim2real.perception_chain import Account, Chain, price
from sim2real.perception_confidence import (
    NORMAL_CONFIDENCE,
    NORMAL_SPREAD,
    ConfidenceFit,
    ConfidenceModel,
    fit_confidence,
    read_model,
)
from sim2real.perception_conflicts import class_error
from sim2real.perception_frames import Modelled, Results
from sim2real.perception_pictures import NORMAL_LIGHT_EV, Light
from sim2real.result import Place

Array = NDArray[np.float64]

SIGNAL = "image_confidence"
CHOICES = (("motion_blur",), ("exposure_shift",), ("motion_blur", "exposure_shift"))
NEXT_STEP = "Drive the same surface slowly and fast, with the pictures recorded."
LEAST_SPEED_SPREAD_M_S = 1.5
"""Standard deviation of speed below which blur cannot show as a fall with speed [m/s]."""
MOST_PLACES = 4
NORMAL_RANGE = 2.0
"""Standard deviations of a normal level that are no gap [-]."""
FEWEST_BLOCKS = 8
"""With fewer blocks nothing is said of confidence."""


@dataclass(frozen=True)
class Seen:
    """Confidence and pictures of the fit logs, and of the hold-out."""

    known: Blocks
    unseen: Blocks
    light: Light | None
    light_unseen: Light | None
    class_error: float
    """Share of the fit logs' results that name another class than road.yaml, away from borders [-]."""

    @property
    def together(self) -> Blocks:
        """All blocks."""
        pairs = ((getattr(self.known, f.name), getattr(self.unseen, f.name)) for f in fields(Blocks))
        return Blocks(*(np.concatenate(p) for p in pairs))

    def log_likelihood(self, fit: ConfidenceFit, model: ConfidenceModel) -> float:
        """Of all there is, at what was fitted [nats]."""
        lights = [light for light in (self.light, self.light_unseen) if light is not None]
        pictures = sum(float(light.log_likelihood(np.array(fit.stops.value))) for light in lights)
        return model.log_likelihood(self.together, fit.loss(self.together)) + pictures


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
    known = make_blocks(fitted).less(modelled.exposure_s, modelled.stops)
    unseen = make_blocks([] if held_out is None else [held_out]).less(modelled.exposure_s, modelled.stops)
    choices = [c for c in CHOICES if not set(c) & set(exclude)]
    pictures = sum(
        int(np.isfinite(one.confidence).sum()) for one in (*fitted, *([held_out] if held_out else []))
    )
    if len(known) < FEWEST_BLOCKS:
        why = f"Only {len(known)} s of image_confidence on the fit logs; {FEWEST_BLOCKS} s are needed."
        return Chain.silent(SIGNAL, pictures, {effect for choice in choices for effect in choice}, why)
    model, seen = read_model(known), Seen(known, unseen, *lights, class_error(fitted))

    def fit(effects: tuple[str, ...]) -> ConfidenceFit:
        return fit_confidence(known, lights[0], model, effects, modelled.exposure_s, modelled.stops)

    plain, fits = fit(()), [fit(choice) for choice in choices]
    accounts = [_account(f, plain, seen, model) for f in (plain, *fits)]
    return Chain(
        SIGNAL,
        pictures,
        (len(known) + len(unseen)) / model.memory,
        accounts[0],
        tuple(accounts[1:]),
        places=_places(unseen, model),
        unexcited=_unexcited(seen, choices),
        next_step=NEXT_STEP,
    )


def _account(f: ConfidenceFit, nothing: ConfidenceFit, seen: Seen, model: ConfidenceModel) -> Account:
    parameters = {"exposure_s": f.exposure_s} if "motion_blur" in f.effects else {}
    if "exposure_shift" in f.effects:
        parameters["stops"] = f.stops
    gain_fit = f.log_likelihood - nothing.log_likelihood
    # a level is one observation, however long it holds: other chains' normal levels are what it is held against
    seconds = len(seen.together) / model.memory
    z, level = rest_of(seen.unseen, seen.known, f, model)
    return Account(
        f.effects,
        f.size,
        price(*(1.0 if effect == "exposure_shift" else seconds for effect in f.effects)),
        gain_fit,
        seen.log_likelihood(f, model) - seen.log_likelihood(nothing, model) - gain_fit,
        parameters,
        z,
        max(level**2 - NORMAL_RANGE**2, 0.0),
        evidence_for=_evidence(f, seen),
        evidence_against=_doubts(f, seen),
    )


def rest_of(
    blocks: Blocks, learnt: Blocks, fit: ConfidenceFit, model: ConfidenceModel
) -> tuple[Array, float]:
    """What a fit leaves of blocks, about the level of each class on the blocks that it learnt from.

    Returns
    -------
    array, shape (n,), and float
        Per block in its standard deviations, and the learnt level in standard deviations of the normal one [-].
    """
    rest, known = blocks.loss - fit.loss(blocks), learnt.loss - fit.loss(learnt)
    level = np.full(len(blocks), known.mean())
    for c in np.unique(learnt.classes):
        level[blocks.classes == c] = known[learnt.classes == c].mean()
    off = (known.mean() + np.log(NORMAL_CONFIDENCE)) / NORMAL_SPREAD
    return (rest - level) / model.deviation, float(off)


def _evidence(f: ConfidenceFit, seen: Seen) -> tuple[str, ...]:
    blocks, sentences = seen.known, []
    if "motion_blur" in f.effects:
        slow, fast = np.quantile(blocks.speed_m_s, (0.1, 0.9))
        low, high = (
            np.exp(-blocks.loss.mean() - f.per_speed * (v - blocks.speed_m_s.mean())) for v in (slow, fast)
        )
        sentences.append(
            f"Confidence goes from {low:.2f} at {slow:.0f} m/s to {high:.2f} at {fast:.0f} m/s, classes held apart."
        )
    if "exposure_shift" in f.effects:
        sentences.append(
            f"Confidence is {np.exp(-blocks.loss.mean()):.2f}; normal is taken as {NORMAL_CONFIDENCE:g} "
            f"({np.exp(np.log(NORMAL_CONFIDENCE) - 2.0 * NORMAL_SPREAD):.2f} to 1)."
        )
        if np.isfinite(seen.class_error):
            sentences.append(
                f"The class is not road.yaml's in {100.0 * seen.class_error:.0f} % of the results."
            )
        if seen.light is not None:
            light = seen.light
            sentences.append(
                f"{light.count} pictures: road {light.level_ev - NORMAL_LIGHT_EV:+.1f} stops from usual, "
                f"{100.0 * light.white_share:.1f} % white, {100.0 * light.black_share:.1f} % black."
            )
    return tuple(sentences)


def _doubts(f: ConfidenceFit, seen: Seen) -> tuple[str, ...]:
    doubts = []
    if f.effects:
        doubts.append(
            "How strongly confidence answers is measured on the shipped networks; another chain's may differ by a "
            "factor of two, which the interval holds."
        )
    if "exposure_shift" in f.effects and seen.light is None:
        doubts.append("The log names no pictures: over- and underexposure cannot be told apart.")
    return tuple(doubts)


def _places(unseen: Blocks, model: ConfidenceModel) -> tuple[Place, ...]:
    """The seconds of the hold-out that are least sure, against a normal confidence."""
    z = (unseen.loss + np.log(NORMAL_CONFIDENCE)) / np.hypot(model.deviation, NORMAL_SPREAD)
    share = z**2 / max(float((z**2).sum()), 1e-12)
    worst = [k for k in np.argsort(-z) if z[k] > NORMAL_RANGE][:MOST_PLACES]
    return tuple(
        Place(
            SIGNAL,
            "camera",
            f"at {unseen.speed_m_s[k]:.0f} m/s",
            float(unseen.time_s[k]),
            float(unseen.time_s[k] + BLOCK_S),
            float(share[k]),
            str(unseen.log[k]),
        )
        for k in worst
    )


def _unexcited(seen: Seen, choices: Sequence[tuple[str, ...]]) -> dict[str, str]:
    """Effects that these logs could hardly show, and why."""
    why = {}
    spread = float(seen.known.speed_m_s.std())
    if spread < LEAST_SPEED_SPREAD_M_S:
        why["motion_blur"] = (
            f"Speed varies by {spread:.1f} m/s only: confidence cannot show a fall with speed."
        )
    if seen.light is None:
        why["exposure_shift"] = (
            "Without pictures a moderate exposure error looks like another camera's normal confidence."
        )
    candidates = {effect for choice in choices for effect in choice}
    return {effect: text for effect, text in why.items() if effect in candidates}
