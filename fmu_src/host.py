"""What the unit asks of the Python that runs it."""

from __future__ import annotations

import importlib
import sys
from typing import Any

PIP_NAMES = {"numpy": "numpy", "cv2": "opencv-python-headless", "onnxruntime": "onnxruntime"}
"""Modules that the carried estimator imports, and the packages that bring them."""


_KEPT: list[dict[str, Any]] = []


def keep(namespace: dict[str, Any]) -> None:
    """Give back the reference to the entry script's namespace that the wrapper drops at each instantiation.

    The wrapper runs the script once per instance and releases its namespace, which it only borrowed. Without
    this the namespace is freed under the module, and a later instance fails or crashes.
    """
    _KEPT.append(namespace)


class MissingPackagesError(ImportError):
    """The host's Python lacks packages of the unit; the text says which, where and how to install them."""


def require_packages(modules: dict[str, str] | None = None) -> None:
    """Import what the unit needs, or say everything that is missing in one error.

    A per cent sign is doubled: the wrapper hands the text to a printf-like logger.

    Parameters
    ----------
    modules : dict, optional
        Module names and the packages that bring them; by default those of the estimator.

    Raises
    ------
    MissingPackagesError
        Names each package, the interpreter and the command that installs them. The same sentence goes to
        standard error, because hosts show no log of a unit that could not be instantiated.
    """
    problems, packages = [], []
    for module, package in (PIP_NAMES if modules is None else modules).items():
        try:
            importlib.import_module(module)
        except ImportError as error:
            problems.append(f"{package} ({error})")
            packages.append(package)
    if problems:
        message = (
            f"TrpacEstimator needs Python packages that {sys.executable or 'the embedded interpreter'} "
            f"(Python {sys.version_info.major}.{sys.version_info.minor}, prefix {sys.prefix}) cannot import: "
            f"{'; '.join(problems)}. Install them with: "
            f"{sys.executable or 'python3'} -m pip install {' '.join(packages)}"
        )
        print(message, file=sys.stderr)
        raise MissingPackagesError(message.replace("%", "%%"))
