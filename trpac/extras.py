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


def missing(error: ModuleNotFoundError) -> str | None:
    """One sentence on the extra that brings a missing module; None where no extra does."""
    module = (error.name or "").partition(".")[0]
    extra = EXTRA_OF.get(module)
    if extra is None:
        return None
    return f"needs the package '{module}', which is not installed: pip install 'trpac-fmu[{extra}]'"


@contextmanager
def extras(what: str) -> Iterator[None]:
    """Within it a missing package of an extra is a MissingExtraError that names the extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        text = missing(error)
        if text is None:
            raise
        raise MissingExtraError(f"{what} {text}", name=error.name) from error
