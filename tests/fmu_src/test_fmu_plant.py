"""The plant as a unit: the same numbers as the Python plant, and nothing that takes the host down."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from fmu_unit import STEP_S, Unit

from fmu_src.interface_plant import REFERENCE_PLANT
from fmu_src.packaging import build_unit
from fmu_src.reference_plant import _road, _vehicle
from fmu_src.units import UNITS
from scenarios.files import load_road, load_vehicle
from scenarios.fmu_client.unpacking import unpack_unit
from scenarios.plant.pipeline import PlantState, advance, initial_state, make_setup
from trpac_core.files import file_sha256

Open = Callable[..., Unit]

ROOT = Path(__file__).parents[2]
VEHICLE = ROOT / "scenarios" / "vehicles" / "four_in_wheel_motor_ev.yaml"
ROAD = ROOT / "scenarios" / "roads" / "paper_simulation.yaml"
WHEELS = ("fl", "fr", "rl", "rr")
WARNING, ERROR = 1, 3


def torques(*values: float) -> dict[str, float]:
    return {f"wheel_torque.{wheel}": value for wheel, value in zip(WHEELS, values, strict=True)}


def pulse(index: int) -> tuple[float, float, float, float]:
    drive = 250.0 if index % 400 < 250 else -80.0
    return (drive, 0.9 * drive, 0.8 * drive, 0.7 * drive)


@pytest.mark.e2e
def test_validation_finds_no_problem_and_the_same_sources_give_the_same_bytes(tmp_path: Path) -> None:
    first, second = (build_unit(UNITS["ReferencePlant"], tmp_path / name) for name in ("a.fmu", "b.fmu"))
    assert file_sha256(first) == file_sha256(second)
    named = build_unit(UNITS["ReferencePlant"], tmp_path / "ReferencePlant.fmu")
    assert validate_fmu(str(named)) == []


def test_its_car_is_the_scenarios_car() -> None:
    starts = {v.name: v.start for v in REFERENCE_PLANT}
    road = load_road(ROAD)
    assert make_setup(_vehicle(starts), road).parameters == make_setup(load_vehicle(VEHICLE), road).parameters


def test_its_road_is_the_papers_road() -> None:
    starts = {v.name: v.start for v in REFERENCE_PLANT}
    assert _road(starts) == load_road(ROAD)


@pytest.mark.e2e
def test_parameters_say_the_road_to_tools_without_strings(open_plant: Open, tmp_path: Path) -> None:
    parameters = {
        "road.segments": 2,
        "road.segment_1.theta_left": 0.3,
        "road.segment_1.theta_right": 0.8,
        "road.segment_1.class_left": 2,
        "road.segment_2.start": 5.0,
        "road.segment_2.class_left": 1,
        "road.segment_2.class_right": 1,
    }
    by_name = {name.replace(".", "__"): value for name, value in parameters.items()}
    unit = open_plant(initial__position=1.0, **by_name)
    assert [unit.get(f"theta.{wheel}") for wheel in WHEELS] == [0.3, 0.8, 0.3, 0.8]
    assert [unit.get(f"road_class.{side}") for side in ("left", "right")] == [2, 0]
    ahead = open_plant(initial__position=2.6, **by_name)
    assert [ahead.get(f"road_class.{side}") for side in ("left", "right")] == [1, 1]
    backwards = open_plant(**{**by_name, "road__segment_2__start": -1.0})
    assert "expected ascending starts" in backwards.log[0].text


@pytest.mark.e2e
def test_unit_and_plant_agree_bit_by_bit(open_plant: Open) -> None:
    unit = open_plant(initial__vehicle_speed=5.0)
    vehicle = load_vehicle(VEHICLE)
    to_front_m = vehicle.wheelbase_m - vehicle.cog_to_rear_axle_m
    state: PlantState = initial_state(vehicle, load_road(ROAD), 5.0, -to_front_m)
    for index in range(3500):
        unit.step(torques(*pulse(index)))
        state = advance(replace(state, wheel_torque_nm=pulse(index)), pulse(index), STEP_S)
    assert state.position_m > 20.0, "the first border is behind the rear axle"
    assert unit.get("vehicle_speed") == state.speed_m_s
    assert unit.get("position") == state.position_m + to_front_m
    assert unit.get("longitudinal_acceleration") == state.accel_x_m_s2
    for i, wheel in enumerate(WHEELS):
        assert unit.get(f"wheel_speed.{wheel}") == state.wheel_speed_rad_s[i]
        assert unit.get(f"tyre_force.{wheel}") == state.wheels.force_n[i]
        assert unit.get(f"theta.{wheel}") == state.wheels.theta[i] == 0.3
    assert unit.log == []


@pytest.fixture(scope="module")
def pulses_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    archive = build_unit(UNITS["TorquePulses"], tmp_path_factory.mktemp("unit") / "TorquePulses.fmu")
    assert validate_fmu(str(archive)) == []
    return unpack_unit(archive, tmp_path_factory.mktemp("unpacked"))


@pytest.mark.e2e
def test_torque_pulses_are_trapezia_in_turn_and_their_state_is_exact(pulses_folder: Path) -> None:
    unit = Unit(pulses_folder)
    unit.set({"drive.torque": 100.0, "drive.duration": 0.2, "drive.rear_share": 0.5, "brake.torque": 300.0})
    unit.set({"brake.duration": 0.3, "pulse.pause": 0.1, "pulse.ramp": 0.05})
    unit.initialise()
    expected = {
        0.1: 0.0,
        0.125: 50.0,
        0.2: 100.0,
        0.275: 50.0,
        0.35: 0.0,
        0.425: -150.0,
        0.55: -300.0,
        0.8: 0.0,
    }
    seen, state = {}, None
    for index in range(1, 1501):
        unit.step()
        seen[round(index * STEP_S, 3)] = (unit.get("wheel_torque.fl"), unit.get("wheel_torque.rr"))
        if index == 700:
            state = unit.slave.getFMUstate()
    for time_s, torque in expected.items():
        rear = 0.5 * torque if torque > 0.0 else torque
        assert seen[time_s] == pytest.approx((torque, rear), abs=1e-6)
        assert seen[round(time_s + 0.7, 3)] == pytest.approx((torque, rear), abs=1e-6), "the period is 0.7 s"
    unit.slave.setFMUstate(state)
    again = []
    for _ in range(701, 1501):
        unit.step()
        again.append((unit.get("wheel_torque.fl"), unit.get("wheel_torque.rr")))
    assert again == [seen[round(index * STEP_S, 3)] for index in range(701, 1501)]
    assert unit.log == []
    unit.free()


@pytest.mark.e2e
def test_files_replace_the_built_in_road_and_car(open_plant: Open, tmp_path: Path) -> None:
    road = tmp_path / "split.yaml"
    road.write_text(
        "schema: 1\nsegments:\n"
        "  - {start_m: 0.0, mu_left: 0.3, mu_right: 0.8, surface: dry, surface_left: snow_ice}\n"
        "  - {start_m: 5.0, mu_left: 0.6, mu_right: 0.6, surface: wet}\n"
    )
    car = tmp_path / "car.yaml"
    car.write_text(VEHICLE.read_text().replace("mass_kg: 1343.8", "mass_kg: 2000.0"))
    unit = open_plant(road_path=str(road), vehicle_path=str(car), initial__position=1.0)
    assert [unit.get(f"theta.{wheel}") for wheel in WHEELS] == [0.3, 0.8, 0.3, 0.8]
    assert [unit.get(f"road_class.{side}") for side in ("left", "right")] == [2, 0]
    assert sum(unit.get(f"vertical_load.{wheel}") for wheel in WHEELS) == pytest.approx(2000.0 * 9.81)
    ahead = open_plant(road_path=str(road), initial__position=2.6)
    assert [ahead.get(f"road_class.{side}") for side in ("left", "right")] == [1, 1]


@pytest.mark.e2e
def test_restored_state_repeats_the_run_bit_by_bit(open_plant: Open) -> None:
    unit, other = open_plant(initial__vehicle_speed=4.0), open_plant(vehicle__mass=3000.0)
    for index in range(300):
        unit.step(torques(*pulse(index)))
    saved = unit.slave.serializeFMUstate(unit.slave.getFMUstate())

    def run(one: Unit) -> list[dict[str, float | bool]]:
        trace = []
        for index in range(200):
            one.step(torques(*pulse(index + 300)))
            trace.append(one.outputs())
        return trace

    first = run(unit)
    other.slave.setFMUstate(other.slave.deSerializeFMUstate(saved))
    assert run(other) == first


@pytest.mark.e2e
@pytest.mark.parametrize("value", [math.nan, math.inf, 1e300])
def test_a_torque_that_is_none_is_told_once_and_the_last_good_one_acts(
    open_plant: Open, value: float
) -> None:
    reference, unit = open_plant(initial__vehicle_speed=5.0), open_plant(initial__vehicle_speed=5.0)
    for one in (unit, reference):
        one.step(torques(100.0, 100.0, 100.0, 100.0))
    unit.step({"wheel_torque.fl": value}, count=20)
    reference.step(count=20)
    assert unit.outputs() == reference.outputs()
    assert [line.status for line in unit.log] == [WARNING]
    assert "wheel_torque.fl" in unit.log[0].text


@pytest.mark.e2e
@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"vehicle__mass": -1.0, "initial__vehicle_speed": math.nan}, "vehicle.mass"),
        ({"vehicle__cog_to_rear_axle": 9.0}, "cog_to_rear_axle_m"),
        ({"road_path": "nowhere.yaml"}, "nowhere.yaml"),
        ({"vehicle_path": "nowhere.yaml"}, "nowhere.yaml"),
    ],
)
def test_what_cannot_be_driven_is_said_and_every_step_discarded(
    open_plant: Open, parameters: dict[str, object], said: str
) -> None:
    unit = open_plant(**parameters)
    assert [line.status for line in unit.log] == [ERROR]
    assert said in unit.log[0].text
    with pytest.raises(Exception, match=r"fmi2DoStep.*status 2"):
        unit.step()


@pytest.mark.e2e
def test_a_host_without_numba_is_told_so_in_one_sentence(plant_folder: Path) -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(plant_folder / 'resources')!r})\n"
        "sys.modules['numba'] = None\n"
        f"import {(plant_folder / 'resources' / 'slavemodule.txt').read_text()}"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    first_line = done.stderr.splitlines()[0]
    assert "ReferencePlant needs Python packages" in first_line
    assert f"{sys.executable} -m pip install numba" in first_line


@pytest.mark.e2e
def test_compiled_code_is_kept_beside_a_copy_that_outlives_the_unpacked_unit(
    plant_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    resources = plant_folder / "resources"
    code = (
        f"import sys; sys.path.insert(0, {str(resources)!r})\n"
        f"import {(resources / 'slavemodule.txt').read_text()}\n"
        "print(next(m.__file__ for n, m in sys.modules.items() if n.endswith('.plant.dynamics')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).is_relative_to(tmp_path / "trpac-fmu")


@pytest.mark.e2e
@pytest.mark.parametrize(("mass_kg", "told"), [(1e308, [ERROR]), (1e7, [ERROR]), (1e6, [])])
def test_a_car_whose_numbers_are_no_numbers_is_refused(
    open_plant: Open, mass_kg: float, told: list[int]
) -> None:
    """Up to the heaviest that is taken all outputs are numbers."""
    unit = open_plant(vehicle__mass=mass_kg)
    assert [line.status for line in unit.log] == told
    assert all(math.isfinite(value) for value in unit.outputs().values())


@pytest.mark.e2e
def test_a_plant_that_is_read_while_it_initialises_stands_where_it_will(open_plant: Open) -> None:
    unit = open_plant()
    unit.reset()
    unit.slave.setupExperiment(startTime=0.0)
    unit.slave.enterInitializationMode()
    unit.set({"initial.vehicle_speed": 22.0})
    early = unit.outputs()
    assert early["vehicle_speed"] == 22.0
    assert early["vertical_load.fl"] > 1000.0
    unit.slave.exitInitializationMode()
    assert unit.outputs() == early


@pytest.mark.e2e
def test_a_state_whose_road_is_gone_is_refused_as_such(open_plant: Open, tmp_path: Path) -> None:
    road = tmp_path / "road.yaml"
    road.write_bytes(ROAD.read_bytes())
    unit = open_plant(road_path=str(road))
    state = unit.slave.getFMUstate()
    unit.step(count=5)
    before = unit.outputs()
    road.unlink()
    unit.slave.setFMUstate(state)
    assert unit.outputs() == before
    assert "the state was not restored" in unit.log[-1].text
    assert "fault of the unit" not in unit.log[-1].text
