"""A package of a system by its name, with the units that it needs."""

from __future__ import annotations

import tempfile
from pathlib import Path

from scenarios.errors import suggestion

from .kinds import NATIVE, PYTHON, build, known_units
from .packaging import BuildError
from .ssp import SYSTEMS, build_package


def build_system(name: str, folder: Path, *, kind: str = PYTHON) -> Path:
    """Build the units of a system and write its package; returns its path.

    Parameters
    ----------
    name : str
        Key of `SYSTEMS`.
    folder : Path
        Made where it is missing.
    kind : str
        Of the estimator; with native the file is NAME_native.ssp. Driver and plant are of kind python.

    Raises
    ------
    BuildError
        There is no such system or kind, or it cannot be built.
    """
    if name not in SYSTEMS:
        raise BuildError(f"{name!r} is not a system; {suggestion(name, SYSTEMS)}")
    of_kind, wiring = known_units(kind), SYSTEMS[name]
    with tempfile.TemporaryDirectory(prefix="trpac_ssp_") as scratch:
        units = {
            unit: build(unit, Path(scratch), kind=kind if unit in of_kind else PYTHON)
            for unit in wiring.elements.values()
        }
        ending = "_native" if kind == NATIVE else ""
        return build_package(wiring, units, folder / f"{wiring.name}{ending}.ssp")
