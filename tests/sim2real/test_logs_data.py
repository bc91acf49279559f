"""The mapping files of the project, on the logs that they are for."""

from pathlib import Path

import numpy as np
import pytest

from sim2real.logs import REQUIRED, load_mapping, read_log, resample
from sim2real.logs.errors import LogError

MAPPINGS = Path(__file__).parents[2] / "sim2real" / "mappings"
FOLDERS = {"plants": 10, "carsim_vhf": 4, "bmw_m8_roadview": 1}


def test_a_shipped_mapping_is_found_by_its_name():
    assert load_mapping("plants").path == MAPPINGS / "plants.yaml"
    with pytest.raises(LogError, match="did you mean 'plants'"):
        load_mapping("plant")


@pytest.mark.parametrize("path", sorted(MAPPINGS.glob("*.yaml")), ids=lambda p: p.stem)
def test_every_mapping_file_is_valid_and_complete(path):
    assert set(load_mapping(path).columns) >= set(REQUIRED)


@pytest.mark.data
@pytest.mark.parametrize("folder", FOLDERS)
def test_logs_of_others_are_read(trpac_data, folder):
    mapping = load_mapping(MAPPINGS / f"{folder}.yaml")
    paths = sorted((trpac_data / "vehicle_logs" / folder).glob("*.csv"))
    assert len(paths) == FOLDERS[folder]
    for path in paths:
        log = read_log(path, mapping)
        assert {*REQUIRED} - {"time_s"} <= set(log.signals)
        assert log.derived == {"position_m"}
        assert log.gaps == ()
        slow = folder == "carsim_vhf"
        assert log.rate_hz == pytest.approx(40.0 if slow else 100.0)
        assert bool(log.warnings) == slow
        _, signals = resample(log, 0.05)
        assert all(np.isfinite(values).all() for values in signals.values())


@pytest.mark.data
def test_positions_agree_with_the_plants_own(trpac_data):
    mapping = load_mapping(MAPPINGS / "plants.yaml")
    for path in sorted((trpac_data / "vehicle_logs" / "plants").glob("*_truth.csv")):
        column = path.read_text().splitlines()[0].split(",").index("x")
        x = np.loadtxt(path, delimiter=",", skiprows=1, usecols=column)
        position = read_log(path, mapping).signals["position_m"]
        assert position - position[0] == pytest.approx(x - x[0], abs=0.3)


@pytest.mark.data
def test_the_m8s_torque_is_shared_out_without_a_rest(trpac_data):
    path = trpac_data / "vehicle_logs" / "bmw_m8_roadview" / "accel_coast_absbrake.csv"
    names = path.read_text().splitlines()[0].split(",")
    columns = [names.index(n) for n in ("engine_torque_at_wheels", "brake_torque_demand")]
    total = np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns).sum(axis=1)
    log = read_log(path, load_mapping(MAPPINGS / "bmw_m8_roadview.yaml"))
    wheels = sum(log.signals[f"wheel_torque_{w}_nm"] for w in ("fl", "fr", "rl", "rr"))
    assert wheels == pytest.approx(total, abs=1e-6)
