"""Optional packages, and errors where one is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

EXTRA_OF = {
    "albumentations": "fmu",
    "asammdf": "logs",
    "bayesian_filters": "peers",
    "can": "logs",
    "cantools": "logs",
    "control": "design",
    "dask": "sweep",
    "distributed": "sweep",
    "dtwalign": "gap",
    "fmpy": "fmu",
    "h5py": "logs",
    "joblib": "gap",
    "lxml": "fmu",
    "msgpack": "hil",
    "objective_rating_metrics": "gap",
    "padasip": "peers",
    "pythonfmu": "fmu",
    "sympy": "design",
}
"""Extra of this package by module."""


class MissingExtraError(ImportError):
    """A required package is not installed; the text names its extra."""


def missing(error: ModuleNotFoundError, extra: str = "") -> str | None:
    """The sentence on the extra of a missing module, or on `extra`; None where the module is of no extra."""
    module = (error.name or "").partition(".")[0]
    if module not in EXTRA_OF:
        return None
    return f"needs the package '{module}', which is not installed: pip install 'trpac-fmu[{extra or EXTRA_OF[module]}]'"


@contextmanager
def extras(what: str, extra: str = "") -> Iterator[None]:
    """Context that raises MissingExtraError for a missing package of an extra."""
    try:
        yield
    except ModuleNotFoundError as error:
        text = missing(error, extra)
        if text is None:
            raise
        raise MissingExtraError(f"{what} {text}", name=error.name) from error
