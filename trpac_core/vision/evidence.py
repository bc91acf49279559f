"""The improved Dempster-Shafer fusion of patches, Eqs. (7) to (10)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .classes import Surface

N_CLASSES = len(Surface)
_LEAST_MASS = 1e-12


@dataclass(frozen=True)
class EvidenceState:
    """Normalised evidence weights of the classes dry, wet, snow and ice after the last frame [-]."""

    weights: tuple[float, float, float] = (1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0)


@dataclass(frozen=True)
class WeightLaw:
    """Parameters of the weight update, Eq. (9); the defaults of the sigmoid are the printed form.

    Printed, the sigmoid of a number in [0, 1] lies in [0.5, 0.73], so that the weights stay within [0.29,
    0.42]: history decides close votes only. A steeper slope around a centre of 1/3 gives history more
    weight.
    """

    sigma: float = 0.5
    sigmoid_centre: float = 0.0
    sigmoid_slope: float = 1.0


def update_weights(state: EvidenceState, classes: NDArray[np.intp], law: WeightLaw) -> EvidenceState:
    """Evidence weights after a frame, Eq. (9).

    Parameters
    ----------
    state : EvidenceState
        Weights after the frame before.
    classes : array of int, shape (n_act,)
        Class of each patch; n_act must be at least 1.
    law : WeightLaw
        Relaxation factor sigma and the sigmoid's centre and slope.
    """
    if not len(classes):
        raise ValueError(
            "Evidence weights: a frame without patches has no shares n_rd / n_act. Keep the old weights."
        )
    before = np.array(state.weights)
    share = np.bincount(classes, minlength=N_CLASSES) / len(classes)
    relaxed = before + law.sigma * (share - before)
    raised = 1.0 / (1.0 + np.exp(-law.sigmoid_slope * (relaxed - law.sigmoid_centre)))
    dry, wet, snow_ice = (raised / raised.sum()).tolist()
    return EvidenceState((dry, wet, snow_ice))


def basic_probability(
    probabilities: NDArray[np.float64],
    weights: tuple[float, float, float],
    say: NDArray[np.float64] | float = 1.0,
) -> NDArray[np.float64]:
    """Mean evidence of the patches, each weighted by the weight of its own class, normalised: Eq. (8).

    Parameters
    ----------
    probabilities : array, shape (n, 3)
        Calibrated probabilities of each patch [-].
    weights : tuple of 3 floats
        Evidence weights [-].
    say : array, shape (n,), optional
        Weight of each patch; as printed all are equal [-].

    Returns
    -------
    array, shape (3,)
        Basic probability assignment m_0, of sum 1 [-].
    """
    patch_weights = np.array(weights)[probabilities.argmax(axis=1)] * say
    mean = patch_weights @ probabilities / patch_weights.sum()
    return mean / mean.sum()


def combine(mass: NDArray[np.float64], n: int) -> NDArray[np.float64]:
    """Dempster's combination of n equal bodies of evidence on the single classes, Eq. (7).

    With masses on singletons alone the combination is mass^n, normalised by K, here in logarithms.

    Parameters
    ----------
    mass : array, shape (3,)
        Basic probability assignment of each body [-].
    n : int
        Number of bodies.

    Returns
    -------
    array, shape (3,)
        P_fusion of each class, of sum 1 [-].
    """
    log_mass = n * np.log(np.maximum(mass, _LEAST_MASS))
    raised = np.exp(log_mass - log_mass.max())
    return raised / raised.sum()


def visual_confidence(p_util: float, P_fusion: float) -> float:
    """Q_v = p_util P_fusion, Eq. (10) [-]."""
    return p_util * P_fusion
