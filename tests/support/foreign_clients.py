"""Other people's FMI clients, and what they need of the machine."""

from __future__ import annotations

import ctypes.util
from importlib.util import find_spec

import pytest


def need_client(package: str) -> None:
    """Skip the test, aloud, where a client cannot run here."""
    if find_spec(package) is None:
        pytest.skip(f"needs {package}: pip install -e .[conformance]")
    if package == "ecospy" and ctypes.util.find_library("tbb") is None:
        pytest.skip("ecospy needs the system library libtbb.so.12 (Debian: apt-get install libtbb12)")
