"""Setting and getting of each type of FMI: which values, and that there are any; the client says how."""

from __future__ import annotations

from .cases import Case, Values
from .outcome import NotOfferedError


class TypedValues:
    """The four operations on one type each, by a client's `_set_and_get`."""

    _case: Case

    def _set_and_get(self, values: Values) -> None:
        """Set the values and see that they read back."""
        raise NotImplementedError

    def _typed(self, values: Values, kind: str) -> None:
        if not values:
            raise NotOfferedError(f"the unit has no {kind} input")
        self._set_and_get(values)

    def _real(self) -> None:
        self._typed(self._case.drive, "Real")

    def _integer(self) -> None:
        self._typed(self._case.integers, "Integer")

    def _boolean(self) -> None:
        self._typed(self._case.booleans, "Boolean")

    def _text(self) -> None:
        self._typed(self._case.texts, "String")
