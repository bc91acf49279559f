"""The effects of the plant as classes, by their names: `TorqueLag(time_constant_s=0.05)`."""

from __future__ import annotations

from scenarios.effects import FORMS, Effect

_CLASSES: dict[str, type[Effect]] = {kind.__name__: kind for forms in FORMS.values() for kind in forms}
globals().update(_CLASSES)

__all__ = sorted(_CLASSES)


def __getattr__(name: str) -> type[Effect]:
    """Raise AttributeError with the names of all effects."""
    raise AttributeError(f"no effect {name!r}; there are {', '.join(__all__)}")
