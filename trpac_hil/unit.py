"""The estimator's unit through fmpy, with the bus's quantities as its inputs."""

from __future__ import annotations

import math
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave

from fmu_src.interface_4w import WHICH_WHEEL
from scenarios.fmu_client.archives import UnitFileError
from scenarios.fmu_client.opening import Instance, opened_unit
from scenarios.fmu_client.unpacking import unpack_unit
from trpac_core.vehicle import WHEELS
from trpac_hil.errors import HilError

NO_CLASS = -1
NAN = math.nan
INTERVAL = ("TRPAC_low", "TRPAC_high")
"""Outputs of the interval, which units of older versions do not have."""
WARM_UP_STEPS = 300
"""Steps before the run: the first ones load code and are slow."""
WARM_UP_INPUTS = {"wheel_speed": 52.0, "wheel_torque": 150.0, "vehicle_speed": 15.0}


class Estimates(NamedTuple):
    """Estimates of the car or of the one wheel; theta_hat and flag of each wheel of four; the interval's ends."""

    TRPAC: float
    TRPAC_std: float
    K_v: float
    flag: bool
    excitation: bool
    TRPAC_dynamics: float
    wheels: tuple[float, ...]
    wheel_flags: tuple[bool, ...]
    low: float = NAN
    high: float = NAN

    def held(self) -> Estimates:
        """The same estimate with flags and K_v at 0: it is not updated."""
        return self._replace(
            flag=False, excitation=False, K_v=0.0, wheel_flags=(False,) * len(self.wheel_flags)
        )


@dataclass(frozen=True)
class Wiring:
    """Quantities of the bus by the unit's variables.

    Attributes
    ----------
    wheels : tuple of str
        Wheels that the unit estimates.
    required, optional : mapping
        Quantity (a column of the log) by variable; optional ones are set from their first value on.
    sides : tuple of pairs
        Variables of class and confidence, for each side of the unit.
    side_names : tuple of str
        'left', 'right'.
    """

    wheels: tuple[str, ...]
    required: Mapping[str, str]
    optional: Mapping[str, str]
    sides: tuple[tuple[str, str], ...]
    side_names: tuple[str, ...]

    @classmethod
    def of_one(cls, wheel: str) -> Wiring:
        """The wiring of the unit of one wheel."""
        required = {
            "wheel_speed": f"wheel_speed_{wheel}_rad_s",
            "wheel_torque": f"wheel_torque_{wheel}_nm",
            "vehicle_speed": "vehicle_speed_m_s",
        }
        optional = {"vertical_load": f"vertical_load_{wheel}_n", **_OF_THE_CAR}
        side = "left" if wheel.endswith("l") else "right"
        return cls((wheel,), required, optional, (("road_class", "road_class_confidence"),), (side,))

    @classmethod
    def of_four(cls) -> Wiring:
        """The wiring of the unit of four wheels."""
        required = {f"wheel_speed.{w}": f"wheel_speed_{w}_rad_s" for w in WHEELS}
        required |= {f"wheel_torque.{w}": f"wheel_torque_{w}_nm" for w in WHEELS}
        optional = {f"vertical_load.{w}": f"vertical_load_{w}_n" for w in WHEELS}
        names = ("left", "right")
        sides = tuple((f"road_class.{s}", f"road_class_confidence.{s}") for s in names)
        return cls(
            WHEELS,
            {**required, "vehicle_speed": "vehicle_speed_m_s"},
            {**optional, **_OF_THE_CAR, "lateral_acceleration": "accel_y_m_s2"},
            sides,
            names,
        )


_OF_THE_CAR = {
    "longitudinal_acceleration": "accel_x_m_s2",
    "yaw_rate": "yaw_rate_rad_s",
    "steering_angle": "steering_angle_rad",
}

WIRINGS = ("TrpacEstimator", "TrpacEstimator4W")


class Unit:
    """One instance of TrpacEstimator or TrpacEstimator4W; a context that frees it and removes its files."""

    def __init__(self, archive: Path, settings: Mapping[str, Any], wheel: str) -> None:
        """Unpack, instantiate, warm up, initialise; raises HilError where the file or a setting cannot be used."""
        self.archive = archive
        try:
            self._folder = unpack_unit(archive)
        except UnitFileError as error:
            raise HilError(str(error)) from error
        self._slave: FMU2Slave | None = None
        try:
            self._open(settings, wheel)
        except BaseException:
            self.close()
            raise

    def _open(self, settings: Mapping[str, Any], wheel: str) -> None:
        try:
            slave, description = opened_unit(self.archive, self._folder, WIRINGS, "hil")
        except UnitFileError as error:
            raise HilError(str(error)) from error
        self._slave = slave
        name = description.coSimulation.modelIdentifier
        self.name = name
        self.wiring = Wiring.of_four() if name.endswith("4W") else Wiring.of_one(wheel)
        known = self._typed(
            settings, {v.name: v.type for v in description.modelVariables if v.causality == "parameter"}
        )
        self.references = Instance(slave, description, known).references
        reals, flags = _outputs(self.wiring)
        outputs = {v.name for v in description.modelVariables}
        interval = [f"{name}.vehicle" if len(self.wiring.wheels) > 1 else name for name in INTERVAL]
        self._has_interval = outputs.issuperset(interval)
        self._reals = self.references([*reals, *(interval if self._has_interval else ())])
        self._flags = self.references(flags)
        self._classes, self._confidences = map(self.references, zip(*self.wiring.sides, strict=True))
        self._frame_id = self.references(["frame_id"])
        self._warm_up()
        slave.reset()
        Instance(slave, description, known)
        self._last = self._read()

    def _typed(self, settings: Mapping[str, Any], types: Mapping[str, str]) -> dict[str, Any]:
        """Settings converted to the types of their variables; raises HilError for unknown names and wrong values."""
        kinds = {"Integer": int, "Boolean": bool, "Real": float}
        usable = {name for name, kind in types.items() if kind in kinds}
        unknown = sorted(set(settings) - usable - set(WHICH_WHEEL))
        if unknown:
            raise HilError(
                f"{self.archive}: has no parameter {', '.join(unknown)}; see docs/reference/fmu_variables.md."
            )
        known = {name: value for name, value in settings.items() if name in usable}
        typed = {name: kinds[types[name]](value) for name, value in known.items()}
        changed = [name for name, value in known.items() if typed[name] != value]
        if changed:
            raise HilError(
                f"{self.archive}: {changed[0]} is {known[changed[0]]:g}; expected "
                f"{'0 or 1' if isinstance(typed[changed[0]], bool) else 'a whole number'}."
            )
        return typed

    def _warm_up(self) -> None:
        """Take steps whose results are discarded; raises HilError where the unit refuses them with these settings."""
        values = [WARM_UP_INPUTS[name.partition(".")[0]] for name in self.wiring.required]
        references = self.references(tuple(self.wiring.required))
        for number in range(WARM_UP_STEPS):
            self.give_class([(0, 0.9)] * len(self.wiring.sides), number + 1)
            if not self.step(1e-3 * number, 1e-3, references, values):
                raise HilError(f"{self.archive}: refuses the settings; its error message is above.")

    @property
    def _instance(self) -> FMU2Slave:
        if self._slave is None:
            raise HilError(f"{self.archive}: is closed.")
        return self._slave

    def give_class(self, classes: Sequence[tuple[int, float]], number: int) -> None:
        """Set class and confidence of each side, as the result of that number."""
        slave = self._instance
        slave.setInteger([*self._classes, *self._frame_id], [*(surface for surface, _ in classes), number])
        slave.setReal(self._confidences, [confidence for _, confidence in classes])

    def step(
        self, time_s: float, step_s: float, references: Sequence[int], values: Sequence[float]
    ) -> Estimates | None:
        """Set inputs and step; returns the estimates, or None where the unit discards the step."""
        slave = self._instance
        try:
            slave.setReal(references, values)
            slave.doStep(time_s, step_s)
            self._last = self._read()
        except FMICallException:
            return None
        return self._last

    @property
    def last(self) -> Estimates:
        """The estimates of the last step that was not discarded."""
        return self._last

    def _read(self) -> Estimates:
        reals = self._instance.getReal(self._reals)
        flags = [bool(flag) for flag in self._instance.getBoolean(self._flags)]
        low, high = reals[-2:] if self._has_interval else (NAN, NAN)
        if len(self.wiring.wheels) == 1:
            TRPAC, std, K_v, alone = reals[:4]
            return Estimates(TRPAC, std, K_v, flags[0], flags[1], alone, (), (), low, high)
        trpac, gains, alone = reals[2:6], reals[6:10], reals[10:14]
        return Estimates(
            reals[0],
            reals[1],
            max(gains),
            any(flags[:4]),
            any(flags[4:]),
            min(alone),
            tuple(trpac),
            tuple(flags[:4]),
            low,
            high,
        )

    def close(self) -> None:
        """Free the instance and remove its files."""
        if self._slave is not None:
            slave, self._slave = self._slave, None
            slave.terminate()
            slave.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> Unit:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _outputs(wiring: Wiring) -> tuple[list[str], list[str]]:
    """Real and Boolean outputs in the order in which `Unit` reads them."""
    if len(wiring.wheels) == 1:
        return ["TRPAC", "TRPAC_std", "K_v", "TRPAC_dynamics"], ["flag", "excitation_flag"]
    reals = [f"{name}.{w}" for name in ("TRPAC", "K_v", "TRPAC_dynamics") for w in WHEELS]
    flags = [f"{name}.{w}" for name in ("flag", "excitation_flag") for w in WHEELS]
    return ["TRPAC.vehicle", "TRPAC_std.vehicle", *reals], flags
