"""Tyres of another formula, with the slope and the peak of the simulation's, and the edition that each came with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from numpy.random import Generator

from . import tyre
from .world import Parameters, World, with_foreign, with_magic


@dataclass(frozen=True)
class Foreign:
    """A tyre of another formula: its own parameters, and how a world gets a share of it."""

    draw: Callable[[Generator], Parameters]
    apply: Callable[..., World]


def _curve(code: int, **between: tuple[float, float]) -> Foreign:
    """A curve by its code, whose own parameters are drawn between these limits."""

    def draw(rng: Generator) -> Parameters:
        return {name: float(rng.uniform(*limits)) for name, limits in between.items()}

    def apply(world: World, share: float, **own: float) -> World:
        return with_foreign(world, code, share, *(own[name] for name in between))

    return Foreign(draw, apply)


def _magic(rng: Generator) -> Parameters:
    return {"shape": float(rng.uniform(1.4, 1.6)), "curvature": float(rng.uniform(-1.0, 0.3))}


FOREIGN: dict[str, tuple[int, Foreign]] = {
    "magic_formula": (1, Foreign(_magic, with_magic)),
    "brush": (2, _curve(tyre.BRUSH)),
    "rational": (2, _curve(tyre.RATIONAL, stretch=(2.3, 3.2), sliding=(0.7, 0.9))),
    "decaying": (3, _curve(tyre.DECAYING, loss=(0.05, 0.25))),
    "saturated": (3, _curve(tyre.SATURATED)),
    "brush_uniform": (4, _curve(tyre.BRUSH_UNIFORM)),
    "brush_falling": (4, _curve(tyre.BRUSH_FALLING, kinetic=(0.75, 0.92))),
    "cubed": (5, _curve(tyre.CUBED, curvature=(-0.2, 0.5))),
    "hyperbolic_tangent": (5, _curve(tyre.HYPERBOLIC_TANGENT)),
    "blended": (6, _curve(tyre.BLENDED, order=(1.7, 3.0))),
    "two_lines": (6, _curve(tyre.TWO_LINES, sliding=(0.7, 0.9))),
    "plain_dugoff": (6, _curve(tyre.PLAIN_DUGOFF)),
    "sine_rise": (7, _curve(tyre.SINE_RISE, sliding=(0.72, 0.9))),
    "arctangent": (7, _curve(tyre.ARCTANGENT)),
    "bristles": (8, _curve(tyre.BRISTLES)),
    "composite": (8, _curve(tyre.COMPOSITE, fading=(0.08, 0.25))),
    "brush_elliptic": (9, _curve(tyre.BRUSH_ELLIPTIC)),
    "splined": (9, _curve(tyre.SPLINED, stretch=(1.7, 2.8), sliding=(0.7, 0.9))),
    "humped": (10, _curve(tyre.HUMPED, sliding=(0.7, 0.9))),
}
