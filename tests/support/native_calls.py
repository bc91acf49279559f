"""Random arguments for translated functions, and results down to the bit."""

import dataclasses
import math
import struct

import numpy as np
import pytest

from fmu_src.native.library import CompilerError, Library

RANGES = {
    "theta": (0.02, 1.2),
    "theta_img": (0.1, 1.0),
    "theta_hat": (0.02, 1.2),
    "slip": (0.0, 0.99),
    "friction": (0.0, 1.1),
    "load_n": (300.0, 9000.0),
    "longitudinal_stiffness_n": (1e4, 2e5),
    "stiffness_n": (1e4, 2e5),
    "mean_load_n": (2000.0, 5000.0),
    "radius_m": (0.2, 0.4),
    "inertia_kg_m2": (0.5, 5.0),
    "vehicle_speed_m_s": (-1.0, 60.0),
    "wheel_speed_rad_s": (-5.0, 200.0),
    "speed_m_s": (0.0, 60.0),
    "wheel_torque_nm": (-3000.0, 1000.0),
    "step_s": (0.0, 0.05),
    "duration_s": (0.005, 0.05),
    "K": (1.0, 100.0),
    "gamma": (0.1, 50.0),
    "wheel_noise": (1e-6, 1e-2),
    "speed_noise": (1e-6, 1e-2),
    "peak": (0.5, 4.0),
    "fall": (0.0, 1.0),
    "wheelbase_m": (2.0, 4.0),
    "cog_to_rear_axle_m": (0.5, 1.9),
    "first": (0, 511),
    "count": (0, 512),
    "surface": (0, 2),
    "k": (0, 511),
    "place": (0, 511),
    "X_lb_m": (0.0, 20.0),
    "X_ub_m": (0.0, 20.0),
    "position_m": (0.0, 20.0),
    "samples": (1, 10),
    "given": (-1, 2),
    "stood": (-1, 2),
    "last": (-1, 2),
    "values": (0, 3),
}
"""Where the arguments of these names lie; others are of any size."""
ODD = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e300, math.inf, -math.inf, math.nan)


def build(program, folder):
    """The library of a program; skips the test where there is no C compiler."""
    try:
        return Library(program, folder)
    except CompilerError as error:
        if "There is no C compiler" in str(error):
            pytest.skip(str(error))
        raise


def drawn(kind, rng, name="", odd=0.0):
    """A random value of a translated type; a share `odd` of the numbers is infinite, not a number or of no sense."""
    if kind.kind == "double":
        if rng.random() < odd:
            return ODD[rng.integers(len(ODD))]
        if name in RANGES:
            low, high = RANGES[name]
            return float(rng.uniform(low, high))
        return float(rng.normal() * 10.0 ** rng.integers(-3, 3))
    if kind.kind == "int":
        low, high = RANGES.get(name, (0, 3))
        return int(rng.integers(low, high + 1))
    if kind.kind == "bool":
        return bool(rng.random() < 0.5)
    if kind.kind == "enum":
        members = list(kind.python)
        return members[rng.integers(len(members))]
    if kind.kind == "optional":
        return None if rng.random() < 0.3 else drawn(kind.item, rng, name, odd)
    if kind.kind == "tuple":
        return tuple(drawn(kind.item, rng, name, odd) for _ in range(kind.size))
    if kind.kind == "array":
        return np.array([drawn(kind.item, rng, name, odd) for _ in range(kind.size)]).reshape(kind.shape)
    while True:
        parts = [drawn(field.type, rng, field.name, odd) for field in kind.fields]
        try:
            return tuple(parts) if kind.python is tuple else kind.python(*parts)
        except ValueError:  # fuzzy sets that do not ascend, and the like
            continue


def bits(value):
    """All numbers in a value, each as its bytes; every NaN is the same."""
    if isinstance(value, np.ndarray):
        return [bits(item) for item in value.ravel().tolist()]
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("d", value)
    if isinstance(value, tuple | list):
        return [bits(item) for item in value]
    if dataclasses.is_dataclass(value):
        return [bits(getattr(value, field.name)) for field in dataclasses.fields(value)]
    return value
