"""Motion blur or wrong exposure: confidence that falls with speed, or at all speeds.

Blur lowers the logarithm of Q_v in proportion to speed, whatever the camera's normal confidence. Exposure lowers it
alike at all speeds, which shows only against a normal confidence; that is not known well, so it is a stated prior, and
the pictures themselves say more where the log names them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.special import stdtrit

from scenarios.effects.exposure_shift import TOLERATED_STOPS
from scenarios.effects.motion_blur import TOLERATED_SMEAR_M
from sim2real.perception.blocks import Blocks
from sim2real.perception.chain import DECISIVE
from sim2real.perception.pictures import Light
from sim2real.result import NORMAL_95, Interval

Array = NDArray[np.float64]

NORMAL_CONFIDENCE = 0.92
"""Q_v on clear road of a chain that nothing disturbs: the shipped networks' median is 0.99, others say less. With the
borders that chains have beside it the mean is 0.9 [-]."""
NORMAL_SPREAD = 0.094
"""Standard deviation of its logarithm that a chain may have which nobody has seen: 0.76 does not prove a fault, 0.5
(the flag's threshold) does. It is 0.1 of the mean, less what borders make of that, 0.035 [-]."""
USUAL_SPREAD = 0.07
"""The same of chains that were seen, with room: 79 undisturbed ones had 0.04, the least sure of them 0.84. A level that
is lower by twice as much, below 0.8, is asked about [-]."""
CLASS_SPREAD = 0.1
"""Standard deviation of its logarithm among the classes of one chain [-]."""
USUAL_ERROR, ERROR_SPREAD = 0.04, 0.7
"""Share of wrong classes of an undisturbed chain, and the standard deviation of its logarithm among chains: up to 16 %
are normal [-]."""
LEAST_DEVIATION = 0.01
"""Least standard deviation that a block is credited with [-]."""
LAW_SPREAD, BLUR_LAW_SPREAD = 0.4, 1.0
"""Standard deviation of the logarithm of how strongly networks' confidence answers to exposure and to blur, about the
shipped ones' [-]: another chain was found to give way six times as soon."""
MOST_LOG_FACTOR = 5.0
"""Intervals of an exposure time reach no farther than by this factor's logarithm [-]."""
STOPS = np.linspace(-6.0, 6.0, 241)
POWERS = (1.0, 2.0)
"""Confidence falls with the smear or with its square: chains that live on coarse looks lose little at first."""


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
        Loss per speed to its power, and at all speeds [(s/m)^power], [-].
    exposure_s, stops : Interval
        Estimates; without width where the candidate does not move them.
    power : float
        Out of `POWERS`.
    """

    effects: tuple[str, ...]
    log_likelihood: float
    per_speed: float
    level: float
    exposure_s: Interval
    stops: Interval
    power: float = 1.0

    @property
    def size(self) -> int:
        """Number of parameters."""
        return len(self.effects)

    def loss(self, blocks: Blocks) -> Array:
        """Loss that it adds to the normal one, shape (n,) [-]."""
        return self.per_speed * blocks.speed_m_s**self.power + self.level


@dataclass(frozen=True)
class Signs:
    """What shows bad pictures beside confidence.

    Attributes
    ----------
    class_error : float
        Share of results that name another class than road.yaml; NaN where not known [-].
    light : Light or None
        How the pictures are exposed; None where they are not known.
    modelled : float
        Mean loss of confidence that the simulation has already, which makes classes err as well [-].
    """

    class_error: float
    light: Light | None
    modelled: float = 0.0

    def log_likelihood(self, loss: Array, stops: Array) -> Array:
        """Under further mean losses of confidence and exposure errors, same shape [nats].

        Bad pictures may make classes err up to a share that goes with the loss, and need not: chains differ.
        """
        total = np.zeros(np.shape(loss))
        if self.class_error > 0.0:
            explained = 1.0 - (1.0 - USUAL_ERROR) * np.exp(-np.maximum(loss + self.modelled, 0.0))
            total -= 0.5 * (np.maximum(np.log(self.class_error / explained), 0.0) / ERROR_SPREAD) ** 2
        return total if self.light is None else total + self.light.log_likelihood(stops)


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

    def weigh(self, blocks: Blocks, power: float) -> Array:
        """Inner products of loss, speed to a power and one under the blocks' inverse covariance, shape (3, 3)."""
        if not len(blocks):
            return np.zeros((3, 3))
        columns = np.column_stack(
            [blocks.loss + np.log(NORMAL_CONFIDENCE), blocks.speed_m_s**power, np.ones(len(blocks))]
        )
        return columns.T @ cho_solve(cho_factor(self._covariance(blocks)), columns)

    def _covariance(self, blocks: Blocks) -> Array:
        same = blocks.classes[:, None] == blocks.classes[None, :]
        noise = self.deviation**2 * self.memory
        return NORMAL_SPREAD**2 + CLASS_SPREAD**2 * same + noise * np.eye(len(blocks))


def read_model(blocks: Blocks) -> ConfidenceModel:
    """Deviation and memory of the blocks about a level per class and a slope over speed to the power that suits."""
    if not len(blocks):
        return ConfidenceModel(LEAST_DEVIATION, 1.0)
    rest, free = min(
        (_about_lines(blocks, power) for power in POWERS), key=lambda found: float(found[0] @ found[0])
    )
    # few blocks do not tell their own deviation well: the variance of Student's t
    deviation = max(float(np.sqrt(rest @ rest / (free - 2))), LEAST_DEVIATION)
    neighbours = blocks.log[1:] == blocks.log[:-1]
    products = (rest[1:] * rest[:-1])[neighbours]
    echo = float(np.clip(products.mean() / max(rest.var(), 1e-12), 0.0, 0.9)) if len(products) else 0.0
    return ConfidenceModel(deviation, (1.0 + echo) / (1.0 - echo))


def _about_lines(blocks: Blocks, power: float) -> tuple[Array, int]:
    """What a level per class and a slope over speed to a power leave, and the blocks that are free beside them."""
    levels = [blocks.classes == c for c in np.unique(blocks.classes)]
    design = np.column_stack([blocks.speed_m_s**power, *levels])
    solution, *_ = np.linalg.lstsq(design, blocks.loss, rcond=None)
    return blocks.loss - design @ solution, max(len(blocks) - int(np.linalg.matrix_rank(design)), 3)


def fit_confidence(
    blocks: Blocks,
    signs: Signs,
    model: ConfidenceModel,
    effects: tuple[str, ...],
    exposure_s: float,
    stops: float,
) -> ConfidenceFit:
    """The best blur, exposure, or both, by the law of blur that suits best.

    Parameters
    ----------
    blocks : Blocks
        Less what the simulation models already.
    signs : Signs
        What else shows that pictures are bad.
    model : ConfidenceModel
        Of these blocks.
    effects : tuple of str
        Out of motion_blur and exposure_shift: what may move.
    exposure_s, stops : float
        What the simulation models already [s], [stops].
    """
    powers = POWERS if "motion_blur" in effects else POWERS[:1]
    first, *others = [_fit_by_law(blocks, signs, model, effects, exposure_s, stops, p) for p in powers]
    return next((f for f in others if f.log_likelihood - first.log_likelihood > DECISIVE), first)


def _fit_by_law(
    blocks: Blocks,
    signs: Signs,
    model: ConfidenceModel,
    effects: tuple[str, ...],
    exposure_s: float,
    stops: float,
    power: float,
) -> ConfidenceFit:
    products = model.weigh(blocks, power)
    errors = STOPS if "exposure_shift" in effects else np.array([stops])
    levels = (errors**2 - stops**2) / TOLERATED_STOPS**2
    slopes = np.zeros(len(levels))
    if "motion_blur" in effects:
        least = -exposure_s / TOLERATED_SMEAR_M if power == 1.0 else 0.0
        slopes = np.maximum((products[0, 1] - levels * products[1, 2]) / max(products[1, 1], 1e-12), least)
    ways = np.stack([np.ones(len(levels)), -slopes, -levels])
    profile = -0.5 * np.einsum("ig,ij,jg->g", ways, products, ways)
    speed = float((blocks.speed_m_s**power).mean()) if len(blocks) else 0.0
    profile = profile + signs.log_likelihood(levels + slopes * speed, errors)
    best = int(np.argmax(profile))
    quantile = float(stdtrit(max(len(blocks) / model.memory - 2.0, 1.0), 0.975))
    blur = Interval(exposure_s, exposure_s, exposure_s, "s")
    if "motion_blur" in effects:
        half = quantile / np.sqrt(max(products[1, 1], 1e-12))
        blur = _exposure_time(exposure_s, float(slopes[best]), float(half), power)
    wrong = Interval(stops, stops, stops, "stops")
    if "exposure_shift" in effects:
        wrong = _exposure_error(profile, signed=signs.light is not None)
    return ConfidenceFit(
        effects, float(profile[best]), float(slopes[best]), float(levels[best]), blur, wrong, power
    )


def _exposure_time(modelled_s: float, slope: float, half: float, power: float) -> Interval:
    """Exposure time, with the uncertainty of the slope and of the law together."""
    if slope <= 0.0:
        added = slope * TOLERATED_SMEAR_M
        return Interval(modelled_s + added, 0.0, modelled_s + half ** (1.0 / power) * TOLERATED_SMEAR_M, "s")
    added = slope ** (1.0 / power) * TOLERATED_SMEAR_M
    spread = np.hypot(half / slope / power, NORMAL_95 * BLUR_LAW_SPREAD)
    factor = float(np.exp(min(spread, MOST_LOG_FACTOR)))
    return Interval(modelled_s + added, modelled_s + added / factor, modelled_s + added * factor, "s")


def _exposure_error(profile: Array, *, signed: bool) -> Interval:
    """Exposure error, with the law's uncertainty; without pictures its sign is open, and the interval holds both."""
    law = float(np.exp(0.5 * NORMAL_95 * LAW_SPREAD))
    inside = STOPS[profile >= profile.max() - 0.5 * NORMAL_95**2]
    if signed:
        value = float(np.average(STOPS, weights=np.exp(profile - profile.max())))
        low, high = float(inside[0]), float(inside[-1])
        low, high = low * (law if low < 0.0 else 1.0 / law), high * (law if high > 0.0 else 1.0 / law)
        return Interval(value, max(low, float(STOPS[0])), min(high, float(STOPS[-1])), "stops")
    size = np.abs(STOPS)
    value = float(np.average(size, weights=np.exp(profile - profile.max())))
    most = min(float(np.abs(inside).max()) * law, float(size.max()))
    return Interval(value, -most, most, "stops")
