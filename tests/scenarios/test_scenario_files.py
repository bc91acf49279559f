from pathlib import Path

import numpy as np
import pytest
import yaml

from scenarios.errors import ScenarioError
from scenarios.files import load_manoeuvre, load_road, load_scenario, load_vehicle
from trpac_core.vehicle import Vehicle
from trpac_core.vision.classes import Surface

SCENARIOS = Path(__file__).parents[2] / "scenarios"
VEHICLE = SCENARIOS / "vehicles" / "four_in_wheel_motor_ev.yaml"
ROAD = SCENARIOS / "roads" / "paper_simulation.yaml"


def changed(path, tmp_path, change):
    data = yaml.safe_load(path.read_text())
    change(data)
    target = tmp_path / path.name
    target.write_text(yaml.safe_dump(data, sort_keys=False))
    return target


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.yaml")), ids=lambda p: p.stem)
def test_delivered_scenarios_load(path):
    scenario = load_scenario(path)
    assert scenario.camera_path is None or scenario.camera_path.is_file()
    assert scenario.manoeuvre.peak_torque_nm() <= scenario.vehicle.motor_peak_torque_nm


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("vehicles/*.yaml")), ids=lambda p: p.stem)
def test_delivered_vehicles_load(path):
    load_vehicle(path).make_effects()


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("roads/*.yaml")), ids=lambda p: p.stem)
def test_delivered_roads_load(path):
    load_road(path)


def test_vehicle_file_is_table_3():
    core = load_vehicle(VEHICLE).to_core()
    assert core == Vehicle(rolling_resistance=core.rolling_resistance)


def test_the_estimator_knows_the_rolling_resistance_of_the_file(tmp_path):
    assert load_vehicle(VEHICLE).to_core().rolling_resistance > 0.0
    bare = changed(VEHICLE, tmp_path, lambda d: d.pop("effects"))
    assert load_vehicle(bare).to_core().rolling_resistance == 0.0


def test_road_holds_each_segment_to_the_next():
    road = load_road(ROAD)
    places = [-5.0, 0.0, 19.999, 20.0, 40.0, 1e6]
    assert [road.segment_at(x).mu_left for x in places] == [0.9, 0.9, 0.9, 0.3, 0.5, 0.5]
    assert road.segment_at(25.0).surface_class is Surface.SNOW_ICE
    assert road.segment_at(45.0).surface_class is Surface.WET


def test_effects_may_be_left_out(tmp_path):
    assert load_vehicle(changed(VEHICLE, tmp_path, lambda d: d.pop("effects"))).make_effects() == ()


def test_all_problems_of_a_vehicle_come_in_one_message(tmp_path):
    def spoil(data):
        data["mass_kg"] = "heavy"
        data["wheel_radius_m"] = -0.29
        data["whelbase_m"] = data.pop("wheelbase_m")
        data["tyre"]["longitudinal_stifness_n"] = data["tyre"].pop("longitudinal_stiffness_n")

    path = changed(VEHICLE, tmp_path, spoil)
    with pytest.raises(ScenarioError) as caught:
        load_vehicle(path)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(str(path)) for line in lines)
    text = str(caught.value)
    assert "mass_kg: is 'heavy'" in text
    assert "wheel_radius_m: is -0.29" in text
    assert "wheelbase_m: missing" in text
    assert "whelbase_m: unknown key; did you mean 'wheelbase_m'?" in text
    assert "tyre.longitudinal_stifness_n: unknown key; did you mean 'longitudinal_stiffness_n'?" in text


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(mass_kg=float("nan")), "mass_kg: is nan"),
        (lambda d: d.update(mass_kg=True), "mass_kg: is True"),
        (lambda d: d.update(mass_kg="1300"), "mass_kg: is '1300'"),
        (lambda d: d.update(schema=2), "schema: is 2"),
        (lambda d: d["tyre"].update(model="brush"), "tyre.model: is 'brush'.*modified_dugoff"),
        (
            lambda d: d.update(cog_to_rear_axle_m=3.0),
            "cog_to_rear_axle_m is 3; expected less than wheelbase_m",
        ),
        (
            lambda d: d.update(effects={"aero_darg": {}}),
            "'aero_darg' is not an effect.*did you mean 'aero_drag'",
        ),
        (lambda d: d.update(effects={"aero_drag": {"drag_area_m2": -1.0}}), "expected 0 to 5"),
        (lambda d: d.update(effects={"aero_drag": {}}), "aero_drag needs drag_area_m2"),
    ],
)
def test_vehicle_problem_is_named(tmp_path, change, message):
    with pytest.raises(ScenarioError, match=message):
        load_vehicle(changed(VEHICLE, tmp_path, change))


def test_whole_numbers_serve_as_numbers(tmp_path):
    assert load_vehicle(changed(VEHICLE, tmp_path, lambda d: d.update(mass_kg=1344))).mass_kg == 1344.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d["segments"].reverse(), r"segments\[1\].start_m is 20 after 40; expected ascending"),
        (lambda d: d["segments"][1].update(surface="ice"), r"segments\[1\].surface: is 'ice'.*snow_ice"),
        (lambda d: d["segments"][2].update(mu_left=0.0), r"segments\[2\].mu_left: is 0.0"),
        (
            lambda d: d["segments"][0].update(mu_lft=0.9),
            r"segments\[0\].mu_lft: unknown key; did you mean 'mu_left'",
        ),
        (lambda d: d.update(segments=[]), "segments: is \\[\\]"),
    ],
)
def test_road_problem_is_named(tmp_path, change, message):
    with pytest.raises(ScenarioError, match=message):
        load_road(changed(ROAD, tmp_path, change))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("schema: 1\nsegments: [", "not valid YAML"),
        ("schema: 1\nschema: 1\n", "key 'schema' stands twice"),
        ("- 1\n", "holds no keys at its top"),
        ("", "holds no keys at its top"),
        (
            "schema: 1\nsegments: {{ road }}\n",
            "not valid YAML: row 2, column 12: a key that is no plain text",
        ),
        ("? [a]\n: 1\n", "not valid YAML: row 1, column 3: a key that is no plain text"),
        ("[" * 5000, "not valid YAML: nested too deeply"),
    ],
)
def test_broken_yaml_is_named(tmp_path, text, message):
    path = tmp_path / "road.yaml"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=f"(?s){message}") as caught:
        load_road(path)
    assert str(path) in str(caught.value)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ScenarioError, match=r"nowhere\.yaml: cannot be read: No such file"):
        load_vehicle(tmp_path / "nowhere.yaml")


def write_manoeuvre(tmp_path, *pulses):
    path = tmp_path / "manoeuvre.yaml"
    path.write_text(yaml.safe_dump({"schema": 1, "name": "test", "pulses": list(pulses)}))
    return path


def test_pulses_are_trapezoids_on_their_wheels_and_add_up(tmp_path):
    both = {"start_s": 1.0, "end_s": 2.0, "torque_nm": 100.0, "ramp_s": 0.2}
    rear = {"start_s": 1.5, "end_s": 2.5, "torque_nm": -30.0, "ramp_s": 0.1, "wheels": ["rl", "rr"]}
    manoeuvre = load_manoeuvre(write_manoeuvre(tmp_path, both, rear))
    torque = manoeuvre.torque(np.array([0.0, 1.0, 1.1, 1.2, 1.7, 1.9, 2.0, 2.3, 2.5, 9.0]))
    assert torque[:, 0] == pytest.approx([0, 0, 50, 100, 100, 50, 0, 0, 0, 0])
    assert torque[:, 3] == pytest.approx([0, 0, 50, 100, 70, 20, -30, -30, 0, 0])
    assert (torque[:, 0] == torque[:, 1]).all()
    assert (torque[:, 2] == torque[:, 3]).all()
    assert manoeuvre.peak_torque_nm() == pytest.approx(100.0)


def test_pulse_shorter_than_its_ramps_is_refused(tmp_path):
    pulse = {"start_s": 1.0, "end_s": 1.1, "torque_nm": 100.0, "ramp_s": 0.2}
    with pytest.raises(
        ScenarioError, match=r"pulses\[0\]: the pulse from 1 to 1.1 s is shorter than its two ramps"
    ):
        load_manoeuvre(write_manoeuvre(tmp_path, pulse))


def write_scenario(tmp_path, **changes):
    pulse = {"start_s": 0.0, "end_s": 1.0, "torque_nm": 100.0, "ramp_s": 0.2}
    write_manoeuvre(tmp_path, pulse)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "vehicle.yaml").write_text(VEHICLE.read_text())
    (tmp_path / "road.yaml").write_text(ROAD.read_text())
    data = {
        "schema": 1, "name": "test", "vehicle": "sub/vehicle.yaml", "road": "road.yaml",
        "manoeuvre": "manoeuvre.yaml", "step_s": 0.001, "end": {"position_m": 10.0, "time_s": 5.0}, **changes,
    }  # fmt: skip
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump(data))
    return path


def test_scenario_paths_are_relative_to_its_file(tmp_path, monkeypatch):
    path = write_scenario(tmp_path)
    monkeypatch.chdir("/")
    scenario = load_scenario(path)
    assert scenario.vehicle.mass_kg == 1343.8
    assert scenario.camera_path is None
    assert scenario.wheel == "fl"
    assert scenario.sensors.wheel_speed_noise_rad_s == 0.0


def test_problems_of_all_files_of_a_scenario_come_at_once(tmp_path):
    path = write_scenario(tmp_path, camera="no_camera.yaml", road="no_road.yaml")
    vehicle = tmp_path / "sub" / "vehicle.yaml"
    vehicle.write_text(VEHICLE.read_text().replace("mass_kg", "mass"))
    with pytest.raises(ScenarioError) as caught:
        load_scenario(path)
    for part in ("no_camera.yaml: no such file", "no_road.yaml: cannot be read", "did you mean 'mass_kg'"):
        assert part in str(caught.value)


def test_scenario_refuses_more_than_the_motors_give(tmp_path):
    path = write_scenario(tmp_path)
    write_manoeuvre(tmp_path, {"start_s": 0.0, "end_s": 1.0, "torque_nm": 400.0, "ramp_s": 0.2})
    with pytest.raises(ScenarioError, match="with 400 N m; expected at most the motor's peak of 320"):
        load_scenario(path)


def test_misspelt_nested_scenario_key_is_suggested(tmp_path):
    path = write_scenario(tmp_path, sensors={"wheel_speed_nois_rad_s": 0.1}, step_s=1.0)
    with pytest.raises(ScenarioError, match="did you mean 'wheel_speed_noise_rad_s'") as caught:
        load_scenario(path)
    assert "step_s: is 1.0" in str(caught.value)


def test_the_file_says_which_form_of_an_effect_is_meant(tmp_path):
    plain = load_vehicle(VEHICLE)
    wanted = changed(VEHICLE, tmp_path, lambda d: d.update(forms={"rolling_resistance": "force on the body"}))
    other = load_vehicle(wanted)
    assert {e.id: e.form for e in plain.make_effects()}["rolling_resistance"] == "moment at the wheels"
    assert {e.id: e.form for e in other.make_effects()}["rolling_resistance"] == "force on the body"
    assert other.to_core().rolling_resistance == 0.0  # the wheels' own balance does not feel it


@pytest.mark.parametrize(
    ("forms", "words"),
    [
        ({"rolling_resistance": "moment"}, "expected one of 'moment at the wheels', 'force on the body'"),
        ({"mu_split": ""}, "effects does not switch on"),
    ],
)
def test_a_form_that_is_not_known_is_told(tmp_path, forms, words):
    with pytest.raises(ScenarioError, match=words):
        load_vehicle(changed(VEHICLE, tmp_path, lambda d: d.update(forms=forms)))


def test_numbers_with_an_exponent_are_numbers(tmp_path):
    path = tmp_path / "road.yaml"
    path.write_text(
        "schema: 1\nsegments: [{start_m: 0, mu_left: 9e-1, mu_right: 90.e-2, surface: dry}, "
        "{start_m: 5.0e1, mu_left: .9E0, mu_right: 0.9e+0, surface: dry}]\n"
    )
    road = load_road(path)
    assert [s.start_m for s in road.segments] == [0.0, 50.0]
    assert {s.mu_left for s in road.segments} == {s.mu_right for s in road.segments} == {0.9}
