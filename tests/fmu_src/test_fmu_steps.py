"""Steps that a host gets wrong are discarded, told once, and change nothing; every kind of unit, through fmpy."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmpy.fmi1 import FMICallException
from fmu_unit import DRIVING, STEP_S, Unit, Unit3

from fmu_src.native.build import build_native
from fmu_src.packaging import build_unit
from fmu_src.units import UNITS
from scenarios.fmu_client.unpacking import unpack_unit

pytestmark = pytest.mark.e2e

DISCARD, ERROR = 2, 3
Open = Callable[..., Unit]

SIZES_S = (math.nan, math.inf, -math.inf, 0.0, -0.001, 10.1, 1e9, 1e300)
BEGINS_S = (math.nan, math.inf, -math.inf, -1.0, 0.0, 1e9)
"""Times at which no step begins after one that ended at 0.3 s."""
INPUTS = {
    "TrpacEstimator": DRIVING,
    "TrpacEstimator4W": {"vehicle_speed": 15.0, "wheel_speed.fl": 52.0, "wheel_torque.fl": 150.0},
    "ReferencePlant": {"wheel_torque.fl": 200.0, "wheel_torque.fr": 200.0},
    "TorquePulses": {},
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Folders of units by name and kind, each built once."""
    made: dict[tuple[str, str], Path] = {}

    def folder(name: str, kind: str) -> Path:
        if (name, kind) not in made:
            target = tmp_path_factory.mktemp("steps") / f"{name}.fmu"
            if kind == "python":
                build_unit(UNITS[name], target)
            else:
                build_native(UNITS[name].info, target, fmi=int(kind[-1]), everywhere=False)
            made[name, kind] = unpack_unit(target, tmp_path_factory.mktemp("unpacked"))
        return made[name, kind]

    return folder


@pytest.fixture(
    params=[
        *((name, "python") for name in INPUTS),
        *(
            (name, kind)
            for name in ("TrpacEstimator", "TrpacEstimator4W")
            for kind in ("native 2", "native 3")
        ),
    ],
    ids=" ".join,
)
def opened(
    request: pytest.FixtureRequest, folders: Callable[[str, str], Path]
) -> Iterator[Callable[[], Unit]]:
    """Opens driven instances of a unit: 300 steps from 0 s."""
    name, kind = request.param
    if kind != "python":
        request.getfixturevalue("native_file")  # skips where there is no compiler
    folder, units = folders(name, kind), []

    def open_one(begin_s: float = 0.0) -> Unit:
        unit = (Unit3 if kind == "native 3" else Unit)(folder)
        units.append(unit)
        unit.initialise()
        unit.time_s = begin_s
        unit.step(INPUTS[name], count=300)
        return unit

    yield open_one
    for unit in units:
        unit.free()


def refused(unit: Unit, begin_s: float, step_s: float) -> None:
    """The unit discards this step."""
    with pytest.raises(FMICallException) as raised:
        unit.slave.doStep(begin_s, step_s)
    assert raised.value.status == DISCARD


def test_steps_that_cannot_be_taken_change_nothing_and_are_told_once(opened, capfd) -> None:
    other, unit = opened(), opened()  # fmpy gives all messages to the newest
    before, saved = unit.outputs(), unit.saved()
    for step_s in SIZES_S:
        refused(unit, unit.time_s, step_s)
    for begin_s in BEGINS_S:
        refused(unit, begin_s, STEP_S)
    assert unit.outputs() == before
    assert unit.saved() == saved
    for _ in range(100):
        for one in (unit, other):
            one.step()
        assert unit.outputs() == other.outputs()
    assert [line.status for line in unit.log] == [ERROR, ERROR]
    assert (
        "step size is nan s; expected above 0 and up to 10 s. Step again with such a size."
        in unit.log[0].text
    )
    assert "begins at nan s; expected a finite time." in unit.log[1].text
    assert all("discarded and no time has passed." in line.text for line in unit.log)
    assert capfd.readouterr().err.count("discarded and no time") == 2, "hosts that log nothing"
    assert other.log == []


@pytest.mark.parametrize("jump_s", [-1.0, -STEP_S, STEP_S, 0.1, 3600.0])
def test_a_step_that_begins_elsewhere_than_the_last_one_ended_is_discarded(opened, jump_s: float) -> None:
    """A step that is taken twice, or left out, was taken as it came."""
    other, unit = opened(), opened()  # fmpy gives all messages to the newest
    refused(unit, unit.time_s + jump_s, STEP_S)
    for one in (unit, other):
        one.step(count=3)
    assert unit.outputs() == other.outputs()
    (line,) = unit.log
    assert "expected 0.3" in line.text
    assert (
        "where the last one ended. Step again from there, or restore a state or reset the unit" in line.text
    )


def test_the_times_of_real_hosts_are_taken(opened) -> None:
    """They begin anywhere, vary the step, and round their times: to nanoseconds, to single precision, by products."""
    for begin_s in (5.0, -3.0, 86400.0):
        unit = opened(begin_s)
        time_s = unit.time_s
        for index in range(200):
            step_s = STEP_S * (0.1, 1.0, 7.0)[index % 3]
            off_s = (0.0, 1e-9, -1e-9)[index % 3]
            unit.slave.doStep(time_s + off_s, step_s)
            time_s += step_s
        unit.free()
    unit = opened()
    for index in range(300, 600):
        single_s = math.floor(index * STEP_S * 2**20) / 2**20
        unit.slave.doStep(single_s, STEP_S)
    for index in range(600, 900):
        unit.slave.doStep(index * STEP_S, (index + 1) * STEP_S - index * STEP_S)
    assert unit.log == []


def test_after_a_state_was_restored_or_a_reset_a_step_begins_where_the_host_is(opened) -> None:
    unit, other = opened(), opened(100.0)
    saved, back_s = unit.saved(), unit.time_s
    unit.step(count=50)
    expected = unit.outputs()
    for one, begin_s in ((unit, back_s), (other, 100.3), (other, 0.0)):
        one.restore(saved)
        one.time_s = begin_s
        one.step(count=50)
        assert one.outputs() == expected
    refused(other, back_s + 1.0, STEP_S)
    other.reset()
    other.initialise()
    other.time_s = 7.0
    other.step()
    assert len(other.log) == 1


def test_the_native_unit_says_the_same_words(open_unit, open_native, native_folder, folders, capfd) -> None:
    logs = []

    def open_third() -> Unit:
        unit = Unit3(folders("TrpacEstimator", "native 3"))
        unit.initialise()
        return unit

    for open_one in (open_unit, open_native, open_third):
        unit = open_one()
        unit.step(DRIVING, count=3)
        refused(unit, 1e6, STEP_S)
        refused(unit, unit.time_s, 1e9)
        logs.append((unit.log, capfd.readouterr().err))
    unit.free()
    assert logs[0] == logs[1] == logs[2]


def test_hosts_read_how_far_a_native_unit_has_come(open_native, folders) -> None:
    unit = open_native()
    unit.step(DRIVING, count=3)
    refused(unit, 5.0, STEP_S)
    assert unit.slave.getRealStatus(2) == pytest.approx(3 * STEP_S), "fmi2LastSuccessfulTime"
    third = Unit3(folders("TrpacEstimator", "native 3"))
    third.initialise()
    third.step(DRIVING, count=3)
    refused(third, 5.0, STEP_S)
    assert third.get("time") == third.time_s
    third.free()
