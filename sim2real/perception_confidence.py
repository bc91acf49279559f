"""Motion blur or wrong exposure: confidence that falls with speed, or at all speeds.

Blur lowers the logarithm of Q_v in proportion to speed, whatever the camera's normal confidence. Exposure lowers it
alike at all speeds, which shows only against a normal confidence; that is not known well, so it is a stated prior, and
the pictures themselves say more where the log names them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.stats import t as student

from scenarios.effects.exposure_shift import TOLERATED_STOPS
from scenarios.effects.motion_blur import TOLERATED_SMEAR_M
from sim2real.perception_blocks import Blocks, make_blocks
from sim2real.perception_chain import Account, Chain
from sim2real.perception_frames import Modelled, Results
from sim2real.perception_pictures import NORMAL_LIGHT_EV, Light
from sim2real.result import Interval

Array = NDArray[np.float64]

NORMAL_CONFIDENCE = 0.9
"""Q_v of a camera chain that nothing disturbs: the shipped networks' median is 0.99, other chains say less [-]."""
NORMAL_SPREAD = 0.125
"""Standard deviation of its logarithm among chains: 0.7 is still normal, 0.5 (the flag's threshold) is not [-]."""
CLASS_SPREAD = 0.1
"""Standard deviation of its logarithm among the classes of one chain [-]."""
LEAST_DEVIATION = 0.01
"""Least standard deviation that a block is credited with [-]."""
FEWEST_BLOCKS = 8
"""With fewer blocks nothing is said of confidence."""
LAW_SPREAD = 0.4
"""Standard deviation of the logarithm of how strongly networks' confidence answers, about the shipped ones' [-]."""
SIGNAL = "image_confidence"
CHOICES = (("motion_blur",), ("exposure_shift",), ("motion_blur", "exposure_shift"))
NEXT_STEP = "Drive the same surface slowly and fast, with the pictures recorded."
LEAST_SPEED_SPREAD_M_S = 1.5
"""Standard deviation of speed below which blur cannot show as a fall with speed [m/s]."""
STOPS = np.linspace(-6.0, 6.0, 241)


@dataclass(frozen=True)
class ConfidenceFit:
    """A candidate's loss of confidence.

    Attributes
    ----------
    effects : tuple of str
        Its effects; empty for the simulation as it is.
    log_likelihood : float
        Of the blocks (and pictures) it was fitted to [nats].
    per_speed, level : float
        Loss per speed, and at all speeds [s/m], [-].
    exposure_s, stops : Interval
        Estimates; without width where the candidate does not move them.
    """

    effects: tuple[str, ...]
    log_likelihood: float
    per_speed: float
    level: float
    exposure_s: Interval
    stops: Interval

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.effects)

    def loss(self, blocks: Blocks) -> Array:
        """Loss that it adds to the normal one, shape (n,) [-]."""
        return self.per_speed * blocks.speed_m_s + self.level


@dataclass(frozen=True)
class ConfidenceModel:
    """Blocks as Gaussian about an uncertain level: a block's deviation, and its variance's factor for memory."""

    deviation: float
    memory: float

    def log_likelihood(self, blocks: Blocks, loss: Array) -> float:
        """Of blocks under an added loss, shape (n,) [nats], but for a constant."""
        if not len(blocks):
            return 0.0
        rest = blocks.loss - loss + np.log(NORMAL_CONFIDENCE)
        return float(-0.5 * rest @ cho_solve(cho_factor(self._covariance(blocks)), rest))

    def weigh(self, blocks: Blocks) -> Array:
        """Inner products of loss, speed and one under the blocks' inverse covariance, shape (3, 3)."""
        columns = np.column_stack(
            [blocks.loss + np.log(NORMAL_CONFIDENCE), blocks.speed_m_s, np.ones(len(blocks))]
        )
        return columns.T @ cho_solve(cho_factor(self._covariance(blocks)), columns)

    def _covariance(self, blocks: Blocks) -> Array:
        same = blocks.classes[:, None] == blocks.classes[None, :]
        noise = self.deviation**2 * self.memory
        return NORMAL_SPREAD**2 + CLASS_SPREAD**2 * same + noise * np.eye(len(blocks))


def read_model(blocks: Blocks) -> ConfidenceModel:
    """Deviation and memory of the blocks about a level per class and a slope over speed."""
    design = np.column_stack([blocks.speed_m_s, *(blocks.classes == c for c in np.unique(blocks.classes))])
    solution, *_ = np.linalg.lstsq(design, blocks.loss, rcond=None)
    rest = blocks.loss - design @ solution
    free = max(len(blocks) - int(np.linalg.matrix_rank(design)), 3)
    # few blocks do not tell their own deviation well: the variance of Student's t
    deviation = max(float(np.sqrt(rest @ rest / (free - 2))), LEAST_DEVIATION)
    neighbours = blocks.log[1:] == blocks.log[:-1]
    products = (rest[1:] * rest[:-1])[neighbours]
    echo = float(np.clip(products.mean() / max(rest.var(), 1e-12), 0.0, 0.9)) if len(products) else 0.0
    return ConfidenceModel(deviation, (1.0 + echo) / (1.0 - echo))


def fit_confidence(
    blocks: Blocks,
    light: Light | None,
    model: ConfidenceModel,
    effects: tuple[str, ...],
    exposure_s: float,
    stops: float,
) -> ConfidenceFit:
    """The best blur, exposure, or both.

    Parameters
    ----------
    blocks : Blocks
        Less what the simulation models already.
    light : Light or None
        How the pictures are exposed; None where they are not known.
    model : ConfidenceModel
        Of these blocks.
    effects : tuple of str
        Out of motion_blur and exposure_shift: what may move.
    exposure_s, stops : float
        What the simulation models already [s], [stops].
    """
    products = model.weigh(blocks)
    errors = STOPS if "exposure_shift" in effects else np.array([stops])
    levels = (errors**2 - stops**2) / TOLERATED_STOPS**2
    slopes = np.zeros(len(levels))
    if "motion_blur" in effects:
        least = -exposure_s / TOLERATED_SMEAR_M
        slopes = np.maximum((products[0, 1] - levels * products[1, 2]) / products[1, 1], least)
    ways = np.stack([np.ones(len(levels)), -slopes, -levels])
    profile = -0.5 * np.einsum("ig,ij,jg->g", ways, products, ways)
    if light is not None:
        profile = profile + light.log_likelihood(errors)
    best = int(np.argmax(profile))
    quantile = float(student.ppf(0.975, max(len(blocks) / model.memory - 2.0, 1.0)))
    blur = Interval(exposure_s, exposure_s, exposure_s, "s")
    if "motion_blur" in effects:
        blur = _exposure_time(exposure_s, float(slopes[best]), quantile / np.sqrt(products[1, 1]))
    wrong = Interval(stops, stops, stops, "stops")
    if "exposure_shift" in effects:
        wrong = _exposure_error(profile, 0.5 * quantile**2, signed=light is not None)
    return ConfidenceFit(effects, float(profile[best]), float(slopes[best]), float(levels[best]), blur, wrong)


def _exposure_time(modelled_s: float, slope: float, half: float) -> Interval:
    """Exposure time, with the uncertainty of the slope and of the law together."""
    added = slope * TOLERATED_SMEAR_M
    if slope <= 0.0:
        return Interval(modelled_s + added, 0.0, modelled_s + half * TOLERATED_SMEAR_M, "s")
    factor = np.exp(np.hypot(half / slope, 1.96 * LAW_SPREAD))
    return Interval(modelled_s + added, modelled_s + added / factor, modelled_s + added * factor, "s")


def _exposure_error(profile: Array, allowance: float, *, signed: bool) -> Interval:
    """Exposure error; without pictures its sign is open, and the interval holds both."""
    law = float(np.exp(0.5 * 1.96 * LAW_SPREAD))
    inside = STOPS[profile >= profile.max() - allowance]
    if signed:
        value = float(np.average(STOPS, weights=np.exp(profile - profile.max())))
        low, high = float(inside[0]), float(inside[-1])
        return Interval(
            value, low * (law if low < 0.0 else 1.0 / law), high * (law if high > 0.0 else 1.0 / law), "stops"
        )
    size = np.abs(STOPS)
    value = float(np.average(size, weights=np.exp(profile - profile.max())))
    most = min(float(np.abs(inside).max()) * law, float(size.max()))
    return Interval(value, -most, most, "stops")


@dataclass(frozen=True)
class Seen:
    """Confidence and pictures of the fit logs, and of the hold-out."""

    known: Blocks
    unseen: Blocks
    light: Light | None
    light_unseen: Light | None

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
    model, seen = read_model(known), Seen(known, unseen, *lights)

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
        unexcited=_unexcited(seen, choices),
        next_step=NEXT_STEP,
    )


def _account(f: ConfidenceFit, nothing: ConfidenceFit, seen: Seen, model: ConfidenceModel) -> Account:
    parameters = {"exposure_s": f.exposure_s} if "motion_blur" in f.effects else {}
    if "exposure_shift" in f.effects:
        parameters["stops"] = f.stops
    gain_fit = f.log_likelihood - nothing.log_likelihood
    z, level = rest_of(seen.unseen, seen.known, f, model)
    return Account(
        f.effects,
        f.size,
        gain_fit,
        seen.log_likelihood(f, model) - seen.log_likelihood(nothing, model) - gain_fit,
        parameters,
        z,
        max(level**2 - 1.0, 0.0),
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
