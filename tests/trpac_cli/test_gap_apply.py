"""`trpac gap apply`: the vehicle file with what a diagnosis names, and what it refuses."""

import json
import os
from dataclasses import replace

import made_up_diagnosis as made_up
import numpy as np
import pytest
import yaml
from command_line import run, words
from plant_drives import SCENARIOS

import trpac
from scenarios.files import load_vehicle
from sim2real.apply import load_diagnosis
from sim2real.reporting.report import write_diagnosis
from sim2real.result import Budget, Cause, Interval, Verdict
from trpac_core.files import file_sha256

CAR = SCENARIOS / "vehicles" / "four_in_wheel_motor_ev.yaml"
TORQUE = np.repeat(
    np.interp(np.arange(300) * 0.01, [0.0, 0.3, 1.5, 1.6, 3.0], [0, 250, 250, -200, -200])[:, None], 4, 1
)


def _share(value):
    return Interval(value, value, value)


def partial():
    return replace(
        made_up.identified(),
        verdict=Verdict.PARTIAL,
        budget=Budget(
            {"effect:tyre_relaxation": _share(0.6), "structure": _share(0.3), "noise": _share(0.1)}
        ),
    )


def car_of(folder, **more):
    """A vehicle file with comments, an effect of its own, and `more`."""
    values = {**yaml.safe_load(CAR.read_text()), "effects": {"aero_drag": {"drag_area_m2": 0.7}}, **more}
    path = folder / "car.yaml"
    path.write_text("# my car\n" + yaml.safe_dump(values, sort_keys=False))
    return path


def saved(folder, diagnosis, car):
    """The diagnosis.json of a diagnosis with that car."""
    vehicle = {"path": str(car), "sha256": file_sha256(car)}
    said = replace(diagnosis, traces=(), provenance={**diagnosis.provenance, "vehicle": vehicle})
    return write_diagnosis(said, folder / "gap")[0]


def changed(path, **values):
    path.write_text(json.dumps({**json.loads(path.read_text()), **values}))
    return path


class TestApplied:
    @pytest.mark.parametrize(
        ("diagnosis", "options", "added", "left"),
        [
            (made_up.identified, [], {"tyre_relaxation": {"length_m": 0.3}}, "4.10 before, 1.10 with tyre_relaxation"),
            (partial, [], {"tyre_relaxation": {"length_m": 0.3}}, "4.10 before, 1.10 with tyre_relaxation"),
            (
                made_up.compound, [], {"tyre_relaxation": {"length_m": 0.3}, "aero_drag": {"drag_area_m2": 0.65}},
                "4.10 before, 1.10 with tyre_relaxation and aero_drag",
            ),
            (
                made_up.compound, ["--effect", "aero_drag"], {"aero_drag": {"drag_area_m2": 0.65}},
                "4.10 before, 3.00 with aero_drag",
            ),
            (
                made_up.ambiguous, ["--effect", "torque_gain"], {"torque_gain": {"factor": 0.88}},
                "4.10 before, 1.15 with torque_gain",
            ),
        ],
    )  # fmt: skip
    def test_the_file_holds_the_car_and_what_was_found(self, tmp_path, diagnosis, options, added, left):
        car, out = car_of(tmp_path), tmp_path / "new" / "car.yaml"
        path = saved(tmp_path, diagnosis(), car)
        before = car.read_bytes()
        result = run("gap", "apply", path, "--vehicle", car, "--out", out, *options)
        assert result.exit_code == 0, result.output
        assert car.read_bytes() == before
        was, now = yaml.safe_load(car.read_text()), yaml.safe_load(out.read_text())
        assert now["effects"] == {**was["effects"], **added}
        assert {k: v for k, v in now.items() if k not in ("effects", "forms")} == {
            k: v for k, v in was.items() if k != "effects"
        }
        text = words(result.stdout)
        assert f"Gap on the hold-out: {left}; noise alone leaves 1.00." in text
        assert f"trpac gap diagnose --vehicle {out}" in text
        assert result.stdout.strip().endswith(str(out))
        assert [p.name for p in out.parent.iterdir()] == ["car.yaml"]

    def test_the_car_simulates_with_it(self, tmp_path):
        car, out = car_of(tmp_path), tmp_path / "lagging.yaml"
        path = saved(tmp_path, made_up.identified(), car)
        assert run("gap", "apply", path, "--vehicle", car, "--out", out).exit_code == 0
        road = trpac.Road.uniform(0.9)
        by_hand = trpac.Vehicle.load(car).with_effects([trpac.effects.TyreRelaxation(0.3)])
        log = trpac.simulate(out, road, torque=TORQUE)
        assert log.equals(trpac.simulate(by_hand, road, torque=TORQUE))
        assert not log.equals(trpac.simulate(car, road, torque=TORQUE))

    def test_a_form_with_further_parameters_is_kept(self, tmp_path):
        car, out = car_of(tmp_path), tmp_path / "loaded.yaml"
        values = {"mass_kg": Interval(200.0, 150.0, 250.0), "behind_m": Interval(0.4, 0.2, 0.6)}
        cause = replace(
            made_up.identified().causes[0], effect="mass_offset", parameters=values, form="where it lies"
        )
        path = saved(tmp_path, replace(made_up.identified(), causes=(cause,)), car)
        result = run("gap", "apply", path, "--vehicle", car, "--out", out)
        assert "mass_offset, where it lies: mass_kg 200, behind_m 0.4" in words(result.stdout)
        placed = load_vehicle(out).make_effects()[-1]
        assert (placed.form, placed.mass_kg, placed.behind_m) == ("where it lies", 200.0, 0.4)

    def test_an_effect_takes_the_place_of_the_cars_own(self, tmp_path):
        car, out = car_of(tmp_path, effects={"tyre_relaxation": {"length_m": 0.1}}), tmp_path / "new.yaml"
        path = saved(tmp_path, made_up.identified(), car)
        assert run("gap", "apply", path, "--vehicle", car, "--out", out).exit_code == 0
        assert load_vehicle(out).effects == {"tyre_relaxation": {"length_m": 0.3}}

    def test_what_the_values_do_not_say_is_said(self, tmp_path):
        car, out = car_of(tmp_path), tmp_path / "new.yaml"
        cause = replace(
            made_up.identified().causes[0],
            effect="camera_latency",
            parameters={"delay_s": Interval(0.1, 0.0, 0.2)},
        )
        said = replace(partial(), causes=(cause,))
        path = saved(tmp_path, said, car)
        changed(path, provenance={})
        text = words(run("gap", "apply", path, "--vehicle", car, "--out", out).stdout)
        assert "30 % of the squared gap is a model difference that no effect describes" in text
        assert "camera_latency acts in the camera chain" in text
        assert "does not name its vehicle file" in text
        assert load_vehicle(out).effects["camera_latency"] == {"delay_s": 0.1}

    def test_python_has_the_same_function(self, tmp_path):
        car = car_of(tmp_path)
        for make, effect in ((made_up.identified, None), (made_up.ambiguous, "mass_offset")):
            found, out = make(), tmp_path / f"{make.__name__}.yaml"
            pick = [] if effect is None else ["--effect", effect]
            path = saved(tmp_path, found, car)
            assert run("gap", "apply", path, "--vehicle", car, "--out", out, *pick).exit_code == 0
            better = trpac.Diagnosis(found).apply_to(load_vehicle(car), effect)
            assert better.model_dump() == load_vehicle(out).model_dump()
        for make in (made_up.unknown, made_up.no_gap, made_up.ambiguous):
            assert trpac.Diagnosis(make()).apply_to(load_vehicle(car)).effects == load_vehicle(car).effects
        with pytest.raises(trpac.TrpacError, match="did you mean 'mass_offset'"):
            trpac.Diagnosis(made_up.ambiguous()).apply_to(load_vehicle(car), "mas_offset")

    def test_a_diagnosis_is_read_back(self, tmp_path):
        found = partial()
        read = load_diagnosis(saved(tmp_path, found, car_of(tmp_path)))
        assert (read.verdict, read.gap.after.total, read.budget) == (
            found.verdict, found.gap.after.total, found.budget,
        )  # fmt: skip
        assert [(c.effect, c.form, c.probability, c.gap_after) for c in read.causes] == [
            (c.effect, c.form, c.probability, c.gap_after) for c in found.causes
        ]
        assert isinstance(read.causes[0], Cause)


class TestRefused:
    @pytest.mark.parametrize(
        ("make", "options", "named"),
        [
            (made_up.unknown, [], "the verdict is unknown, which names no effect"),
            (made_up.no_gap, [], "the verdict is no_gap, which names no effect"),
            (made_up.unknown, ["--effect", "aero_drag"], "the verdict is unknown, which names no effect"),
            (made_up.ambiguous, [], "--effect mass_offset or --effect torque_gain"),
            (
                made_up.ambiguous,
                ["--effect", "aero_drag"],
                "'aero_drag' is not an effect that the diagnosis names",
            ),
            (
                made_up.identified,
                ["--effect", "torque_lag"],
                "'torque_lag' is not an effect that the diagnosis names",
            ),
        ],
    )
    def test_a_verdict_that_names_none(self, tmp_path, make, options, named):
        car = car_of(tmp_path)
        assert named in self.refused(tmp_path, saved(tmp_path, make(), car), car, *options)

    def test_another_vehicle_file(self, tmp_path):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        car_of(tmp_path, mass_kg=1500.0)
        assert "car.yaml: is not the vehicle file that the diagnosis was made with" in self.refused(
            tmp_path, path, car
        )

    @pytest.mark.parametrize(
        ("change", "named"),
        [
            (lambda p: p.write_text("{"), "is no JSON text"),
            (lambda p: p.write_text("[]"), "is no diagnosis"),
            (lambda p: p.write_bytes(b"\xff\xfe"), "UTF-8"),
            (lambda p: p.unlink(), "No such file"),
            (lambda p: changed(p, schema=2), "schema"),
            (lambda p: changed(p, verdict="certain"), "verdict"),
            (lambda p: changed(p, causes=3), "causes"),
            (lambda p: changed(p, causes=[]), "names no effect"),
        ],
    )
    def test_a_file_that_is_no_diagnosis(self, tmp_path, change, named):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        change(path)
        said = self.refused(tmp_path, path, car)
        assert named in said

    @pytest.mark.parametrize(
        ("change", "named"),
        [
            ({"effect": "tyre_relaxtion"}, "did you mean 'tyre_relaxation'"),
            ({"form": "sideways"}, "has no form 'sideways'"),
            ({"parameters": {"lenght_m": {"value": 0.3}}}, "expected length_m"),
            ({"parameters": {"length_m": {"value": 1e9}}}, "tyre_relaxation.length_m is 1e+09"),
            ({"parameters": {"length_m": {"value": None}}}, "causes"),
        ],
    )
    def test_a_cause_that_the_plant_does_not_have(self, tmp_path, change, named):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        first, *others = json.loads(path.read_text())["causes"]
        changed(path, causes=[{**first, **change}, *others])
        assert named in self.refused(tmp_path, path, car)

    def test_a_vehicle_file_that_is_none(self, tmp_path):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        car.write_text("schema: 1\n")
        assert "mass_kg: missing" in self.refused(tmp_path, path, car)

    def test_the_vehicle_file_itself_and_a_folder(self, tmp_path):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        before = car.read_bytes()
        assert "expected another file" in self.refused(tmp_path, path, car, out=car)
        (tmp_path / "folder").mkdir()
        assert "folder" in self.refused(tmp_path, path, car, out=tmp_path / "folder")
        assert car.read_bytes() == before

    @pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
    def test_a_folder_that_is_not_ours(self, tmp_path):
        car = car_of(tmp_path)
        path = saved(tmp_path, made_up.identified(), car)
        closed = tmp_path / "closed"
        closed.mkdir(mode=0o500)
        assert "closed" in self.refused(tmp_path, path, car, out=closed / "new.yaml")

    @staticmethod
    def refused(tmp_path, path, car, *options, out=None):
        there = sorted(p for p in tmp_path.rglob("*") if p != path)
        result = run("gap", "apply", path, "--vehicle", car, "--out", out or tmp_path / "new.yaml", *options)
        assert result.exit_code == 2, result.output
        assert result.stderr.startswith("trpac gap apply: ")
        assert result.stderr.count("\n") == 1
        assert sorted(p for p in tmp_path.rglob("*") if p != path) == there
        return result.stderr


def test_the_diagnosis_says_how_to_go_on(tmp_path, monkeypatch):
    for name, pick in (
        ("identified", ""),
        ("ambiguous", " --effect mass_offset|torque_gain"),
        ("unknown", None),
    ):
        said = replace(made_up.ALL[name](), traces=())
        monkeypatch.setattr("sim2real.diagnose.diagnose_files", lambda *_, said=said, **__: said)
        options = ["--vehicle", "my car.yaml", "--road", "r", "--fit", "a", "--holdout", "b"]
        text = run("gap", "diagnose", *options, "--out", tmp_path).stdout
        command = f"trpac gap apply {tmp_path}/diagnosis.json --vehicle 'my car.yaml' --out 'my car_with_effect.yaml'"
        assert (pick is not None) == (f"{command}{pick}" in text)
        assert (name == "identified") == ("trpac gap apply" in (tmp_path / "report.html").read_text())
