"""The real units as the rig opens, steps and reads them."""

from __future__ import annotations

from pathlib import Path

import pytest

from fmu_src.kinds import KINDS, build
from trpac_hil.errors import HilError
from trpac_hil.unit import Unit

GRIP = {"fl": 0.9, "fr": 0.7, "rl": 0.5, "rr": 0.3}
"""What the wheels' torques use of their loads: each shows another friction."""


@pytest.mark.e2e
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["TrpacEstimator", "TrpacEstimator4W"])
def test_what_is_read_of_a_unit_is_what_its_variables_say(name: str, kind: str, tmp_path: Path) -> None:
    unit = Unit(
        build(name, tmp_path, kind=kind, everywhere=False),
        {"estimator.theta_initial": 0.6, "estimator.method": 1},
        "rl",
    )
    assert (unit.last.TRPAC_dynamics, unit.last.flag) == (0.6, False), "what warmed it up is forgotten"
    wheels = unit.wiring.wheels

    def value(variable: str) -> float | bool:
        read = unit._instance.getBoolean if "flag" in variable else unit._instance.getReal
        return read(unit.references([variable]))[0]

    def of_each(variable: str) -> list[float | bool]:
        return [value(variable if len(wheels) == 1 else f"{variable}.{wheel}") for wheel in wheels]

    references, flags, pulled = unit.references(tuple(unit.wiring.required)), set(), 0
    for step in range(400):
        inputs = []
        for variable in unit.wiring.required:
            kind, _, wheel = variable.partition(".")
            grip = GRIP[wheel or "rl"]
            slipping = step >= 100
            speed = 52.0 * (1.05 + 0.1 * grip) if slipping else 52.0
            torque_nm = 3000.0 * grip * 0.29 if slipping else 150.0
            inputs.append({"wheel_speed": speed, "wheel_torque": torque_nm}.get(kind, 15.0))
        classes = [(2, 0.9 if step < 300 else 0.0), (1, 0.8 if 100 <= step < 300 else 0.0)]
        unit.give_class(classes[: len(unit.wiring.sides)], step + 1)
        said = unit.step(0.01 * step, 0.01, references, inputs)
        assert said is not None
        ends = (value("TRPAC"), value("TRPAC_std")) if len(wheels) == 1 else (
            value("TRPAC.vehicle"), value("TRPAC_std.vehicle")
        )  # fmt: skip
        assert (said.TRPAC, said.TRPAC_std) == ends
        assert said.K_v == max(of_each("K_v"))
        assert said.flag == any(of_each("flag"))
        assert said.excitation == any(of_each("excitation_flag"))
        assert said.TRPAC_dynamics == min(of_each("TRPAC_dynamics"))
        if len(wheels) == 4:
            assert (list(said.wheels), list(said.wheel_flags)) == (of_each("TRPAC"), of_each("flag"))
        flags.add(said.flag)
        pulled += of_each("K_v")[0] > 0.0
    assert flags == {False, True}
    assert pulled > 0
    assert len(set(of_each("TRPAC"))) == len(wheels), "each wheel has an estimate of its own"
    folder = unit._folder
    unit.close()
    unit.close()
    assert not folder.exists()
    with pytest.raises(HilError, match="is closed"):
        unit.give_class([(0, 0.9)], 1)
