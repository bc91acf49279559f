"""Random drives: what is drawn of the tyre is put on the car beside its other effects."""

import pytest

from benchmarks.accuracy import random_drives
from benchmarks.accuracy.random_drives import BY_LOAD, CAR_FILE, CarError, Tyre, make_drive
from scenarios.files import load_vehicle

CAR = load_vehicle(CAR_FILE)


class NotDrivenError(Exception):
    """Instead of the drive."""


@pytest.fixture
def driven(monkeypatch):
    """Cars that would have been driven."""
    cars = []

    def stop(car, *_):
        cars.append(car)
        raise NotDrivenError

    monkeypatch.setattr(random_drives, "_driven", stop)
    return cars


@pytest.mark.parametrize("tyre", [None, Tyre(1.6, -0.5, relaxation_m=0.3)])
def test_the_stiffness_of_all_drawn_cars_goes_with_the_load(driven, tyre):
    for seed in range(20):
        with pytest.raises(NotDrivenError):
            make_drive(seed, CarError(stiffness=0.1), tyre=tyre)
    for car in driven:
        assert car.forms["tyre_stiffness_offset"] == "with load"
        assert car.effects["tyre_stiffness_offset"]["stiffness_n"] == pytest.approx(
            1.1 * CAR.tyre.longitudinal_stiffness_n
        )
    drawn = [car.effects["tyre_stiffness_offset"]["by_load"] for car in driven]
    assert len(set(drawn)) == 20
    assert BY_LOAD[0] <= min(drawn) < 0.78 < 0.92 < max(drawn) <= BY_LOAD[1]


def test_another_formula_leaves_the_cars_other_effects():
    car = Tyre(1.6, -0.5, relaxation_m=0.3).put_on(CAR)
    assert {name: car.effects[name] for name in CAR.effects} == CAR.effects
    assert car.effects["tyre_formula"] == {"share": 1.0, "shape": 1.6, "curvature": -0.5}
    assert car.effects["tyre_relaxation"] == {"length_m": 0.3}
    assert "tyre_relaxation" not in Tyre(1.6, -0.5).put_on(CAR).effects
