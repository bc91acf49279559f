"""From a unit's parameters to the configuration of what it wraps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from trpac_core.parameters.fields import with_fields
from trpac_core.parameters.variables import Kind, Variable

Config = TypeVar("Config")


def configuration(variables: Sequence[Variable], values: Mapping[str, Any], default: Config) -> Config:
    """A unit's configuration: its default with these parameters at their sources.

    Raises
    ------
    ValueError
        Lists every parameter that is not finite or out of its range; or what the configuration refuses.
    """
    check_parameters(variables, values)
    settings = {v.source: values[v.name] for v in variables if v.source}
    configured: Config = with_fields(default, settings)
    return configured


def check_parameters(variables: Sequence[Variable], values: Mapping[str, Any]) -> None:
    """Raise one ValueError that lists every parameter that is not finite or out of its range."""
    parameters = [v for v in variables if v.causality == "parameter"]
    problems = [problem for v in parameters if (problem := _problem(v, values[v.name]))]
    if problems:
        raise ValueError(f"{len(problems)} parameter(s) cannot be used: {'; '.join(problems)}.")


def _problem(variable: Variable, value: Any) -> str | None:
    if variable.kind not in (Kind.REAL, Kind.INTEGER):
        return None
    low = -math.inf if variable.minimum is None else variable.minimum
    high = math.inf if variable.maximum is None else variable.maximum
    if math.isfinite(value) and low <= value <= high:
        return None
    unit = f" {variable.unit}" if variable.unit not in (None, "1") else ""
    return f"{variable.name} = {value}, expected a number from {low:g} to {high:g}{unit}"
