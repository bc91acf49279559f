"""How much the builds of cars differ, learnt from drawn ones.

`prior.json` holds the covariance of the changes that `columns.of_build` knows, over cars that are built otherwise than
their simulation says; `python -m benchmarks.gap.builds.learn` writes it.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PRIOR = Path(__file__).with_name("prior.json")


@cache
def _learnt() -> tuple[tuple[str, ...], Array]:
    """Names of the changes and their covariance, each in its unit."""
    content = json.loads(PRIOR.read_text(encoding="utf-8"))
    return tuple(content["names"]), np.array(content["covariance"])


def prior_root(names: Sequence[str]) -> Array:
    """A root of the covariance of some changes: root @ unit normals is a draw of them, shape (k, k)."""
    known, covariance = _learnt()
    at = [known.index(name) for name in names]
    return np.asarray(np.linalg.cholesky(covariance[np.ix_(at, at)]))
