"""Packages that are installed only where they are asked for, and what to say where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

EXTRA_OF = {
    "albumentations": "fmu",
    "asammdf": "logs",
    "bayesian_filters": "peers",
    "can": "hil",
    "cantools": "hil",
    "control": "design",
    "dask": "sweep",
    "distributed": "sweep",
    "dtwalign": "gap",
    "fmpy": "fmu",
    "joblib": "gap",
    "lxml": "fmu",
    "msgpack": "hil",
    "objective_rating_metrics": "gap",
    "padasip": "peers",
    "pyarrow": "logs",
    "pythonfmu": "fmu",
    "sympy": "design",
}
"""Module to the extra of this package that brings it."""


class MissingExtraError(ImportError):
    """A package is not installed that this function needs; the text says which extra brings it."""


def missing(error: ModuleNotFoundError, extra: str = "") -> str | None:
    """One sentence on the extra that brings a missing module, `extra` or any; None where no extra does."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return f"needs the package '{module}', which is not installed: pip install 'trpac-fmu[{extra or EXTRA_OF[module]}]'"


@contextmanager
def extras(what: str, extra: str = "") -> Iterator[None]:
    """Within it a missing package of an extra is a MissingExtraError that names `extra`, or one that brings it."""
    try:
        yield
    except ModuleNotFoundError as error:
        text = missing(error, extra)
        if text is None:
            raise
        raise MissingExtraError(f"{what} {text}", name=error.name) from error
