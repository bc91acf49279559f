"""The kinds of a unit, and a unit of a kind built by its name.

What building needs is imported when a unit is built, so that a command line can name the kinds without it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

PYTHON, NATIVE = KINDS = ("python", "native")
"""With the networks, the host needs Python; in C, without pictures, the host needs nothing."""


def known_units(kind: str) -> list[str]:
    """Names of the units of a kind; BuildError for another kind."""
    from .native.build import NATIVE_UNITS
    from .packaging import BuildError
    from .units import UNITS

    if kind not in KINDS:
        raise BuildError(f"kind is {kind!r}; expected one of {', '.join(KINDS)}.")
    return [name for name in UNITS if name in NATIVE_UNITS or kind != NATIVE]


def build(
    name: str,
    folder: Path,
    *,
    kind: str = PYTHON,
    fmi: int = 2,
    flat: bool = False,
    everywhere: bool | None = None,
    networks: Path | None = None,
) -> Path:
    """Build a unit into a folder; returns its path, NAME.fmu with _native, _fmi3 and _flat before the dot.

    Parameters
    ----------
    name, kind : str
        One of `known_units(kind)`.
    folder : Path
        Made where it is missing.
    fmi : int
        Version of FMI: 2 for 2.0; of a native unit also 3 for 3.0.
    flat : bool
        Names without dots, see `model_description`.
    everywhere : bool, optional
        Platforms of a native unit, see `build_native`.
    networks : Path, optional
        Folder with the networks of a unit that holds some, in place of the package's.

    Raises
    ------
    BuildError
        There is no such unit of this kind and version of FMI, or it cannot be built.
    OSError
        The archive cannot be written.
    """
    from scenarios.errors import suggestion

    from .native.build import build_native
    from .packaging import BuildError, build_unit
    from .units import UNITS

    if name not in (known := known_units(kind)):
        raise BuildError(f"{name!r} is not a {kind} unit; {suggestion(name, known)}")
    if fmi not in ((2, 3) if kind == NATIVE else (2,)):
        raise BuildError(f"fmi is {fmi}; expected 2, or of a native unit also 3.")
    ending = (
        f"{'_native' if kind == NATIVE else ''}{'_fmi3' if fmi == 3 else ''}{'_flat' if flat else ''}.fmu"
    )
    target = folder / f"{name}{ending}"
    if kind == NATIVE:
        if networks is not None:
            raise BuildError("A native unit holds no networks; leave them out.")
        return build_native(UNITS[name].info, target, fmi=fmi, flat=flat, everywhere=everywhere)
    slave = UNITS[name]
    if networks is not None:
        if not slave.resources:
            raise BuildError(f"{name} holds no networks; leave them out.")
        slave = replace(slave, resources=tuple(networks / path.name for path in slave.resources))
    return build_unit(slave, target, flat=flat)
