"""Tests that take long: `make test` leaves them to `make test-all`."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

long = pytest.mark.long


def beyond(count: int, items: Iterable[Any]) -> list[Any]:
    """Sets of parameters of one kind, of which all beyond the first few are long; a tuple is a set of several."""
    sets = [item if isinstance(item, tuple) else (item,) for item in items]
    return [pytest.param(*item, marks=() if i < count else long) for i, item in enumerate(sets)]
