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
    networks: str | Path | None = None,
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
    networks : path, optional
        Folder with segmenter.onnx and surface.onnx for an estimator of kind python; by default those of the package.

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

        own = None if networks is None else _checked_networks(Path(networks))
        path = build(unit, Path(folder), kind=kind, fmi=fmi, flat=flat, networks=own)
        if problems := validate_fmu(str(path)):
            raise TrpacError("\n".join(f"{path}: {problem}" for problem in problems))
    return path


def build_ssp(folder: str | Path, *, system: str = "four_wheels", kind: str = "python") -> Path:
    """Build a package (SSP 1.0) of driver, plant and estimator and validate it; returns its path.

    Parameters
    ----------
    folder : path
        Folder of the package, which is made where it is missing.
    system : str
        four_wheels, with TrpacEstimator4W, or one_wheel, with TrpacEstimator at the front left wheel.
    kind : str
        Kind of the estimator, as of `build_fmu`. Driver and plant are of kind python.

    Raises
    ------
    TrpacError
        There is no such system or kind, or it cannot be built.
    MissingExtraError
        Without the extra 'fmu'.
    """
    with extras("build_ssp", "fmu"):
        from fmu_src.ssp import build_system
        from fmu_src.ssp_client import problems

        path = build_system(system, folder, kind)
        if found := problems(path):
            raise TrpacError("\n".join(f"{path}: {problem}" for problem in found))
    return path


def _checked_networks(folder: Path) -> Path:
    """A folder of networks that can be loaded; raises TrpacError."""
    from scenarios.stills import StillNetworks

    StillNetworks.load(folder)
    return folder


def require_unit(path: str | Path) -> Path:
    """The path of a unit after a check of its archive; raises TrpacError."""
    with extras("a unit", "fmu"):
        from scenarios.fmu_client.unpacking import require_whole

        require_whole(Path(path))
    return Path(path)
