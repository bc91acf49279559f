"""Co-simulation units."""

from __future__ import annotations

from pathlib import Path

from trpac.extras import extras
from trpac_core.errors import TrpacError


def build_fmu(
    folder: str | Path,
    *,
    unit: str = "TrpacEstimator",
    kind: str = "python",
    fmi: int = 2,
    flat: bool = False,
) -> Path:
    """Build a co-simulation unit and validate it; returns its path.

    Parameters
    ----------
    folder : path
        Folder of the archive, which is made where it is missing.
    unit : str
        TrpacEstimator, TrpacEstimator4W, ReferencePlant or TorquePulses.
    kind : str
        python, or native: TrpacEstimator or TrpacEstimator4W in C, whose host needs no Python; building one needs a C
        compiler (docs/guide/unit/native.md).
    fmi : int
        Version of FMI: 2 for 2.0; of a native unit also 3 for 3.0.
    flat : bool
        Whether the names of its variables are without dots.

    Raises
    ------
    TrpacError
        There is no such unit of this kind and version of FMI, or it cannot be built.
    MissingExtraError
        Without the extra 'fmu'.
    """
    with extras("build_fmu", "fmu"):
        from fmpy.validation import validate_fmu

        from fmu_src.kinds import build

        path = build(unit, Path(folder), kind=kind, fmi=fmi, flat=flat)
        if problems := validate_fmu(str(path)):
            raise TrpacError("\n".join(f"{path}: {problem}" for problem in problems))
    return path


def require_unit(path: str | Path) -> Path:
    """The path of a unit after a check of its archive; raises TrpacError."""
    with extras("a unit", "fmu"):
        from scenarios.fmu_client.unpacking import require_whole

        require_whole(Path(path))
    return Path(path)
