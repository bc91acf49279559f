"""A parameter of the estimator as a named variable."""

from __future__ import annotations

from enum import Enum

from trpac_core.estimator import EstimatorConfig
from trpac_core.parameters.fields import field_value
from trpac_core.parameters.variables import Kind, Variable

_DEFAULTS = EstimatorConfig()


def parameter(
    name: str,
    unit: str,
    source: str,
    description: str,
    minimum: float | None = None,
    maximum: float | None = None,
) -> Variable:
    """The variable of a field of the estimator's configuration, whose default is its start.

    Parameters
    ----------
    name, unit, description : str
        Of the variable.
    source : str
        Dotted path of the field; a number is a place in a tuple.
    minimum, maximum : float, optional
        Values that are accepted, both included.
    """
    start = field_value(_DEFAULTS, source)
    if isinstance(start, Enum):
        start = start.value
    if isinstance(start, bool):
        return Variable(name, Kind.BOOLEAN, "parameter", "fixed", description, start=start, source=source)
    if isinstance(start, int):
        return Variable(
            name,
            Kind.INTEGER,
            "parameter",
            "fixed",
            description,
            None,
            start,
            minimum,
            maximum,
            source=source,
        )
    if not isinstance(start, float):
        raise TypeError(f"'{source}' of the configuration is {start!r}: a parameter is a bool, int or float")
    return Variable(
        name, Kind.REAL, "parameter", "fixed", description, unit, start, minimum, maximum, source=source
    )
