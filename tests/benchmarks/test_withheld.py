"""The generator of withheld cases: its wall, its sensors, its cases."""

from __future__ import annotations

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.testing import assert_allclose

from benchmarks.gap.withheld.generator import kernel, severity
from benchmarks.gap.withheld.generator.camera_case import make_case
from benchmarks.gap.withheld.generator.car import Car, Road
from benchmarks.gap.withheld.generator.details import FLOOR_M_S
from benchmarks.gap.withheld.generator.driver import drive
from benchmarks.gap.withheld.generator.forms import ASPECTS, STYLES, draw_forms
from benchmarks.gap.withheld.generator.kernel import N, V, W, begin, integrate
from benchmarks.gap.withheld.generator.library import LIBRARY
from benchmarks.gap.withheld.generator.outside import OUTSIDE
from benchmarks.gap.withheld.generator.sensor_set import Sensors
from benchmarks.gap.withheld.generator.sensors import Noise, make_log, noise_of, read
from benchmarks.gap.withheld.generator.table import SIZES, Group, Spec, table
from benchmarks.gap.withheld.generator.world import nominal

ROOT = Path(__file__).resolve().parents[2]
GENERATOR = ROOT / "benchmarks" / "gap" / "withheld" / "generator"
ALLOWED = {"numpy", "numba", "scipy", "pandas", "yaml"}
OURS = {"scenarios", "trpac_core", "sim2real", "trpac_cli", "fmu_src", "models"}
CAR = Car()
QUIET = Noise(0.02, 0.01, 0.03, 0.0, 0.0, 0.01, 0.0, 0.0)


# --- the wall


def imports_of(path: Path) -> set[str]:
    """Top-level packages that a file imports, and "..x" for relative ones that leave its folder."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.ImportFrom) and node.level > 1:
            found.add(f"..{node.module}")
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in {
            "__import__",
            "importlib.import_module",
        }:
            found.add(ast.unparse(node))
    return found


@pytest.mark.parametrize("path", sorted(GENERATOR.glob("*.py")), ids=lambda p: p.name)
def test_generator_imports_nothing_of_the_product(path):
    assert imports_of(path) - ALLOWED - sys.stdlib_module_names == set()


def test_generator_loads_nothing_of_the_product():
    made = "benchmarks.gap.withheld.generator.camera_case"
    code = f"import sys, {made} as _; print(*{{m.split('.')[0] for m in sys.modules}})"
    loaded = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert OURS & set(loaded.split()) == set()


def test_product_imports_nothing_of_the_benchmark():
    for package in OURS:
        for path in (ROOT / package).rglob("*.py"):
            assert "benchmarks" not in imports_of(path), path


# --- sensors


@pytest.fixture(scope="module")
def rising():
    """Path of a car that speeds up evenly."""
    world, command = nominal(CAR, Road()), np.full((601, 4), 150.0)
    path = np.zeros((6001, N + 1))
    y = begin(world.physics, 0.0, 10.0, np.full(4, 10.0 / CAR.wheel_radius_m), 0.0, command)
    path[0, :N] = y
    integrate(world.physics, y, 0, 6000, world.split, command, path)
    return path


def test_delay_scale_and_bias_read_as_they_should(rising):
    at = np.arange(1.0, 5.0, 0.01)
    true = read(rising, Sensors(), at)
    off = read(
        rising, Sensors(wheel_delay_s=0.05, speed_delay_s=0.2, speed_scale=1.02, accel_bias_m_s2=0.3), at
    )
    assert_allclose(off[:, :4], read(rising, Sensors(), at - 0.05)[:, :4])
    assert_allclose(off[:, 4], 1.02 * read(rising, Sensors(), at - 0.2)[:, 4])
    assert_allclose(off[:, 5], true[:, 5] + 0.3)


def test_pulse_counting_keeps_the_revolutions(rising):
    window, teeth = 0.02, 96.0
    at = np.arange(0.5, 5.5, window) + 1e-6
    counted = read(rising, Sensors(wheel_teeth=teeth, wheel_window_s=window), at)[:, 0]
    steps = counted * teeth * window / (2.0 * np.pi)
    assert_allclose(steps, np.round(steps), atol=1e-9)
    # The first window ended at most one window before the first row.
    clock = np.arange(len(rising)) * 1e-3
    late, early = (
        np.diff(np.interp(at[[0, -1]] - back * window, clock, rising[:, kernel.ANGLE]))[0]
        for back in (1.0, 2.0)
    )
    tooth = 2.0 * np.pi / teeth
    assert early - tooth < counted[:-1].sum() * window < late + tooth


def test_noise_has_its_size_and_colour():
    noise = Noise(0.05, 0.02, 0.1, 0.0, 0.4, 0.01, 0.0, 0.0)
    values = noise_of(noise, np.arange(200_000) * 1e-3, np.random.default_rng(0))
    assert_allclose(values.std(axis=0), noise.sigmas, rtol=0.02)
    lag = 10
    correlation = np.mean(values[lag:] * values[:-lag], axis=0) / noise.sigmas**2
    assert_allclose(correlation, 0.4 * np.exp(-1.0), atol=0.02)


def test_losses_and_jitter_are_in_the_log(rising):
    noise = replace(QUIET, jitter=0.1, lost=0.01)
    log = make_log(rising, np.full((601, 4), 150.0), Sensors(), noise, 200.0, np.random.default_rng(0))
    speeds = log.filter(like="speed")
    assert 0.005 < speeds.isna().to_numpy().mean() < 0.015
    steps = np.diff(log["time_s"])
    assert steps.min() > 0.0
    assert 0.05 < steps.std() * 200.0 < 0.3


# --- cases


@pytest.fixture(scope="module")
def case():
    return make_case(table("small")[0], seed=1)


@pytest.mark.long
def test_a_case_repeats_and_other_seeds_give_others():
    calm = next(spec for spec in table("full") if spec.group is Group.NO_GAP and not spec.rich)
    case, again, other = (make_case(calm, seed) for seed in (1, 1, 2))
    for name, log in case.logs.items():
        pd.testing.assert_frame_equal(log, again.logs[name])
    assert case.seal() == again.seal() != other.seal()


def test_files_keep_the_contract_and_the_secret(case, tmp_path):
    case.write(tmp_path)
    log = pd.read_csv(tmp_path / "holdout.csv")
    wheels = ("fl", "fr", "rl", "rr")
    assert list(log) == [
        "time_s",
        *(f"wheel_torque_{w}_nm" for w in wheels),
        *(f"wheel_speed_{w}_rad_s" for w in wheels),
        "vehicle_speed_m_s",
        "accel_x_m_s2",
        "position_m",
    ]
    assert np.all(np.diff(log["time_s"]) > 0.0)
    torque = log.filter(like="torque")
    assert torque.to_numpy().max() <= case.car.motor_peak_torque_nm + 1e-3
    vehicle = yaml.safe_load((tmp_path / "vehicle.yaml").read_text(encoding="utf-8"))
    assert not set(vehicle["effects"]) & set(case.spec.effects)
    files = sorted(p.name for p in tmp_path.iterdir())
    assert files == [
        "fit_1.csv",
        "fit_2.csv",
        "fresh.csv",
        "holdout.csv",
        "road.yaml",
        "road_holdout.yaml",
        "vehicle.yaml",
    ]
    for path in tmp_path.iterdir():
        assert not [e for e in case.spec.effects if e in path.read_text(encoding="utf-8")]


@pytest.mark.long
def test_a_case_without_a_deviation_has_no_gap():
    spec = Spec("quiet", Group.NO_GAP, (), 1.0, "quiet")
    assert make_case(spec, seed=3).truth.gap.total < 1.05


@pytest.mark.long
def test_severity_reaches_the_wanted_gap():
    target, effect = 5.5, "wheel_radius_offset"
    case = make_case(Spec(f"rich-{effect}-x", Group.RICH, (effect,), target, f"rich-{effect}-x"), seed=3)
    assert case.truth.gap.total == pytest.approx(target, rel=0.15)


@pytest.mark.parametrize(
    ("gap_at", "severity_found"),
    [(lambda s: 9.0, 0.0), (lambda s: 1.0 + s, 1.0), (lambda s: 2.0 * 16.0**s, 0.5)],
)
def test_severity_search(gap_at, severity_found):
    assert severity.find_severity(gap_at, 8.0) == pytest.approx(severity_found, abs=0.04)


def test_drives_stay_on_the_road_that_the_plant_is_for(case):
    for driven in case.drives.values():
        assert driven.path[:, V].min() > FLOOR_M_S
        assert driven.path[:, V].max() < 45.0


def test_every_form_is_drawn_and_a_seal_tells_those_of_its_case(case):
    drawn = [draw_forms(np.random.default_rng(seed), ASPECTS) for seed in range(250)]
    assert {a: {forms[a] for forms in drawn} for a in ASPECTS} == {a: set(f) for a, f in ASPECTS.items()}
    assert {a: f for a, f in case.seal()["forms"].items() if f not in ASPECTS[a]} == {}


def test_given_forms_are_taken_and_change_no_other_draw(case):
    forms = dict(case.forms) | {"digits": "all", "noise": "white_and_coloured"}
    other = make_case(case.spec, 1, forms, attempt=0)
    assert other.forms == forms
    assert (other.car, other.roads, other.truth.effects) == (case.car, case.roads, case.truth.effects)


@pytest.mark.parametrize("rich", [True, False])
@pytest.mark.parametrize("style", range(len(STYLES)))
@pytest.mark.long
def test_every_driver_stays_within_the_car_and_excites_what_he_should(style, rich):
    world = nominal(CAR, Road((0.0, 60.0, 120.0), (0.9, 0.3, 0.9)) if rich else Road())
    done = drive(CAR, world, rich, 30.0, np.random.default_rng(6), list(STYLES.values())[style])
    speed, wheels = done.path[:, V], done.path[:, W : W + 4]
    slides = np.any(np.abs(wheels * CAR.wheel_radius_m - speed[:, None]) > 0.15 * speed[:, None], axis=1)
    assert speed.min() > FLOOR_M_S
    assert speed.max() < 45.0
    assert done.command.max() <= CAR.motor_peak_torque_nm
    assert np.any(slides) == rich


def test_tables_have_unique_names_and_every_effect_and_deviation():
    for size in SIZES:
        names = [spec.name for spec in table(size)]
        assert len(set(names)) == len(names)
    groups = [spec.group for spec in table("full")]
    assert {group: groups.count(group) for group in Group} == {
        Group.RICH: 5 * len(LIBRARY),
        Group.TYRE: len(LIBRARY),
        Group.MILD: 2 * len(LIBRARY),
        Group.NO_GAP: 75,
        Group.PAIR: 45,
        Group.OUTSIDE: 3 * len(OUTSIDE),
        Group.REMOVED: 2 * len(LIBRARY),
        Group.TIMING: 1,
    }
    assert (len(LIBRARY), len(OUTSIDE)) == (22, 63)
