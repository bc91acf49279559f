"""From the unit's parameters to the estimator's configuration."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from trpac_core.estimator import EstimatorConfig

from .fields import with_fields
from .variables import Kind, Variable


def configuration(variables: Sequence[Variable], values: Mapping[str, Any]) -> EstimatorConfig:
    """The estimator's configuration under these parameters.

    Raises
    ------
    ValueError
        Lists every parameter that is not finite or out of its range; or what the configuration refuses.
    """
    parameters = [v for v in variables if v.causality == "parameter"]
    problems = [problem for v in parameters if (problem := _problem(v, values[v.name]))]
    if problems:
        raise ValueError(f"{len(problems)} parameter(s) cannot be used: {'; '.join(problems)}.")
    settings = {v.source: values[v.name] for v in parameters}
    configured: EstimatorConfig = with_fields(EstimatorConfig(), settings)
    return configured


def _problem(variable: Variable, value: Any) -> str | None:
    if variable.kind not in (Kind.REAL, Kind.INTEGER):
        return None
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    if math.isfinite(value) and low <= value <= high:
        return None
    unit = f" {variable.unit}" if variable.unit not in (None, "1") else ""
    return f"{variable.name} = {value}, expected a number from {low:g} to {high:g}{unit}"
