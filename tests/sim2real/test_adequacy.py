"""What is said of logs before the fits: too little excitation, no torque, another car, a hold-out that is none."""

from __future__ import annotations

import re
import time

import numpy as np
import pandas as pd
import pytest
import yaml
from gap_drives import BARE, DRY, clean, noisy, pulses, trace
from gap_files import write_log, write_road

from scenarios.effects import EFFECTS
from scenarios.files import VehicleFile
from sim2real.adequacy import require_adequate
from sim2real.diagnose import diagnose_files, diagnose_sources
from sim2real.logs.errors import LogError
from sim2real.sources import read_sources
from trpac_core.vehicle import WHEELS

DURATION_S = 20.0


def cruise(duration_s=DURATION_S):
    return trace((0.0, 20.0), (2.0, 22.0), (4.0, 2.0), (8.0, 22.0), (duration_s, 10.0), duration_s=duration_s)


def braking(duration_s=DURATION_S):
    points = [(t, -60.0 - 50.0 * (k % 2)) for k, t in enumerate(np.arange(0.0, duration_s, 2.0))]
    return trace(*points, duration_s=duration_s)


@pytest.fixture
def sources(tmp_path):
    """Reads drives as two fit logs and a hold-out, of a car with other values than those driven."""

    def read(*drives, columns=None, vehicle=None):
        car = {**BARE.model_dump(by_alias=True), **(vehicle or {})}
        (tmp_path / "car.yaml").write_text(yaml.safe_dump(car), encoding="utf-8")
        write_road(DRY, tmp_path / "road.yaml")
        names = ["a.csv", "b.csv", "held.csv"][-len(drives) :]
        for name, drive in zip(names, drives, strict=True):
            write_log(drive, tmp_path / name, **(columns(drive) if columns else {}))
        *fit, held = (str(tmp_path / name) for name in names)
        return read_sources(tmp_path / "car.yaml", tmp_path / "road.yaml", fit, held)

    return read


def three(torque_of=pulses, speed_m_s=13.0, road=DRY, effects=None):
    """Three noisy drives of a torque, each from a speed of its own."""
    return [
        noisy(clean(torque_of(DURATION_S), speed_m_s + seed, road, effects=effects), seed)
        for seed in range(3)
    ]


def torques(values):
    return {f"wheel_torque_{w}_nm": values for w in WHEELS}


class TestNothingIsSaid:
    def test_of_a_clean_drive(self, sources):
        assert require_adequate(sources(*three())) == ()

    @pytest.mark.parametrize(
        "effects",
        [
            {"mass_offset": {"mass_kg": 400.0}},
            {"torque_gain": {"factor": 0.8}},
            {"torque_lag": {"time_constant_s": 0.3}},
            {"torque_delay": {"delay_s": 0.15}},
            {"wheel_radius_offset": {"radius_m": 0.305}},
            {"vehicle_speed_scale": {"factor": 1.05}},
            {"aero_drag": {"drag_area_m2": 2.0}},
            {"brake_drag": {"torque_nm": 60.0}},
            {"road_grade": {"grade": 0.06}},
            {"wheel_inertia_offset": {"inertia_kg_m2": 3.0}},
            {"tyre_stiffness_offset": {"stiffness_n": 20_000.0}},
            {"wheel_speed_quantisation": {"teeth": 48.0, "window_s": 0.02}},
        ],
        ids=lambda effects: next(iter(effects)),
    )
    def test_of_a_car_with_an_effect(self, sources, effects):
        assert require_adequate(sources(*three(effects=effects))) == ()

    def test_of_what_the_vehicle_file_models_already(self, sources):
        effects = {
            "torque_gain": {"factor": 0.4},
            "vehicle_speed_scale": {"factor": 1.25},
            "mass_offset": {"mass_kg": 900.0},
        }
        drives = three(effects=effects)
        assert require_adequate(sources(*drives, vehicle={"effects": effects})) == ()
        with pytest.raises(LogError, match="the wheels roll with radii"):
            require_adequate(sources(*drives))

    def test_of_lost_samples_and_a_short_log(self, sources):
        def holes(drive):
            gone = np.random.default_rng(1).random(len(drive)) < 0.05
            return {"vehicle_speed_m_s": np.where(gone, np.nan, drive.measured[:, 1])}

        assert require_adequate(sources(*three(), columns=holes)) == ()
        short = [noisy(clean(pulses(2.4), 13.0 + seed), seed) for seed in range(3)]
        require_adequate(sources(*short))

    def test_at_the_cost_of_milliseconds(self, sources):
        read = sources(*[noisy(clean(pulses(60.0), 13.0), seed) for seed in range(3)])
        require_adequate(read)
        began = time.perf_counter()
        require_adequate(read)
        assert time.perf_counter() - began < 1.0


class TestExcitation:
    def test_speed_and_torque_that_never_change_are_refused(self, sources):
        still = [noisy(clean(trace((0.0, 0.0), duration_s=10.0), 15.0 + seed), seed) for seed in range(3)]
        with pytest.raises(
            LogError, match=r"a.csv, b.csv, held.csv: speed and torque are constant; .* Record 30 s"
        ):
            require_adequate(sources(*still))
        lively = three()
        require_adequate(sources(still[0], lively[1], lively[2]))  # one of the fit logs may be dull
        with pytest.raises(LogError, match=r"held.csv: speed and torque are constant"):
            require_adequate(sources(lively[0], lively[1], still[2]))

    @pytest.mark.parametrize(
        ("torque_of", "speed_m_s", "said"),
        [
            (cruise, 20.0, "The fit logs contain only coasting and have little excitation"),
            (braking, 40.0, "The fit logs contain only braking"),
            (lambda duration_s: -braking(duration_s), 3.0, "The fit logs contain only driving"),
        ],
        ids=["cruising", "braking", "accelerating"],
    )
    def test_one_manoeuvre_alone_is_said_with_what_to_record(self, sources, torque_of, speed_m_s, said):
        (told,) = require_adequate(sources(*three(torque_of, speed_m_s)))
        assert told.startswith(said)
        assert "a verdict of no gap has little weight. Record 30 s or more" in told
        other = three()[1]
        assert require_adequate(sources(three(torque_of, speed_m_s)[0], other, three()[2])) == ()

    def test_a_car_that_stands_from_the_first_moments_on_is_refused(self, sources):
        def stopped(drive):
            return {"vehicle_speed_m_s": np.maximum(0.75 - drive.time_s, 0.0)}

        with pytest.raises(LogError, match=r"held.csv: the car moves only in the first 0.3 s"):
            require_adequate(sources(*three(), columns=stopped))

    def test_of_both_in_short_windows_is_not_said_to_be_one(self, sources):
        """A launch from standstill, and then a lift: each is shorter than what smoothing takes off its ends."""
        lively = lambda duration_s: trace(  # noqa: E731
            (0.0, 500.0), (1.4, 500.0), (1.5, -70.0), (2.8, -70.0), duration_s=duration_s
        )
        for drives in (
            [noisy(clean(lively(2.8), 3.0), 0), three()[2]],
            [
                noisy(clean(trace((0.0, 500.0), (2.0, 300.0), duration_s=2.0), 3.0), 0),
                noisy(clean(trace((0.0, -70.0), duration_s=2.0), 15.0), 1),
                three()[2],
            ],
        ):
            told = require_adequate(sources(*drives))
            assert not any("contain only" in text for text in told), told


class TestTorque:
    @pytest.mark.parametrize("value", [0.0, 55.0])
    def test_that_never_changes_is_refused(self, sources, value):
        with pytest.raises(
            LogError, match=r"a.csv: the wheel torques never change .*expected the commanded torque"
        ):
            require_adequate(sources(*three(), columns=lambda drive: torques(np.full(len(drive), value))))

    def test_of_a_coast_down_may_be_none(self, sources):
        rolling = {"aero_drag": {"drag_area_m2": 2.0}, "rolling_resistance": {"coefficient": 0.02}}
        coast = [
            noisy(clean(trace((0.0, 0.0), duration_s=15.0), 30.0 + seed, effects=rolling), seed)
            for seed in range(3)
        ]
        (told,) = require_adequate(sources(*coast))
        assert "contain only coasting" in told

    def test_of_the_wrong_sign_is_refused(self, sources):
        turned = lambda drive: torques(-drive.torque_nm[:, 0])  # noqa: E731
        with pytest.raises(LogError, match="positive in driving"):
            require_adequate(sources(*three(), columns=turned))

    def test_of_another_signal_is_said(self, sources):
        def other(drive):
            return torques(150.0 * np.sin(1.7 * drive.time_s))

        told = require_adequate(sources(*three(), columns=other))
        assert any("the wheel torques explain" in text for text in told), told

    def test_without_that_of_the_brakes_is_said(self, sources):
        told = require_adequate(
            sources(*three(), columns=lambda drive: torques(np.maximum(drive.torque_nm[:, 0], -40.0)))
        )
        assert any("the logged torque in braking is 0." in text for text in told)


class TestForceBalance:
    """Torque that asks for another acceleration than the car's, in logs too short for a regression of the mass."""

    SAID = (
        r"The logged torque would accelerate this car at 1\d m/s2 where it accelerates at [45]\.?\d* m/s2: "
        r"torque scale, gear or mass is wrong\."
    )

    def launch(self, duration_s=5.0):
        """Torque that falls with speed, as an engine's does, so that a drag of a wrong sign would fit as well."""
        return trace((0.0, 560.0), (3.5, 440.0), (3.8, -70.0), (5.0, -70.0), duration_s=duration_s)

    def scaled(self, factor):
        return lambda drive: torques(factor * drive.torque_nm[:, 0])

    def falling(self, drive):
        """3.3 to 1.9 times the torque in driving, and the torque itself in coasting."""
        factor = np.interp(drive.time_s, [0.0, 3.5, 3.8], [3.3, 1.9, 1.0])
        return torques(factor * drive.torque_nm[:, 0])

    def drives(self, duration_s=5.0):
        return [noisy(clean(self.launch(duration_s), 3.0 + seed), seed) for seed in range(3)]

    def test_is_said_of_one_short_log(self, sources):
        (told,) = require_adequate(sources(*self.drives(), columns=self.falling))
        assert re.fullmatch(r"a\.csv, b\.csv, held\.csv: " + self.SAID, told), told

    def test_is_said_of_several_too_short_ones_together(self, sources):
        (told,) = [
            text
            for text in require_adequate(sources(*self.drives(2.2), columns=self.scaled(2.5)))
            if "contain only" not in text
        ]
        assert re.fullmatch(f"All logs together: {self.SAID}", told), told

    @pytest.mark.parametrize("factor", [0.8, 1.0, 1.3])
    def test_is_not_said_of_what_a_calibration_or_payload_does(self, sources, factor):
        told = require_adequate(sources(*self.drives(), columns=self.scaled(factor)))
        assert not any("would accelerate" in text for text in told), told

    def test_too_little_torque_is_said_too(self, sources):
        told = require_adequate(sources(*self.drives(2.2), columns=self.scaled(0.2)))
        assert any(
            re.search(r"would accelerate this car at [01]\.\d+ m/s2 where it accelerates at [45]", text)
            for text in told
        ), told


class TestAnotherCar:
    @pytest.mark.parametrize(("share", "factor"), [(0.5, "2"), (2.0, "0.5")])
    def test_half_or_double_the_mass_is_said_and_torque_as_the_other_reading(self, sources, share, factor):
        """Within what a gain of the torque can be, so it is no refusal."""
        heavy = VehicleFile.model_validate(
            {**BARE.model_dump(by_alias=True), "mass_kg": share * BARE.mass_kg}
        )
        drives = [noisy(clean(pulses(DURATION_S), 13.0 + seed, car=heavy), seed) for seed in range(3)]
        (told,) = require_adequate(sources(*drives))
        mass_kg = float(told.split("about ")[1].split(" kg")[0])
        assert mass_kg == pytest.approx(share * BARE.mass_kg, rel=0.03)
        assert told.startswith("a.csv, b.csv, held.csv: the wheel torques move a car of about")
        assert "the vehicle file says 1344 kg: these logs are of another car, or" in told
        assert float(told.split("or ")[1].split(" times")[0]) == pytest.approx(float(factor), rel=0.05)

    def test_torque_before_the_gears_is_refused(self, sources):
        """Ten times the mass is beyond every effect of the library."""
        before = lambda drive: torques(10.0 * drive.torque_nm[:, 0])  # noqa: E731
        with pytest.raises(
            LogError, match=r"move a car of about 13\d+ kg.*No effect of the library is so large"
        ):
            require_adequate(sources(*three(), columns=before))

    @pytest.mark.parametrize("share", [0.8, 1.25])
    def test_another_wheel_radius_is_refused(self, sources, share):
        drives = three()
        with pytest.raises(LogError, match=r"the wheels roll with radii of fl 0.2.* the vehicle file says"):
            require_adequate(sources(*drives, vehicle={"wheel_radius_m": share * BARE.wheel_radius_m}))

    def test_a_radius_that_is_off_by_a_tenth_is_said(self, sources):
        (told,) = require_adequate(sources(*three(), vehicle={"wheel_radius_m": 1.1 * BARE.wheel_radius_m}))
        assert "the vehicle file says 0.319 m" in told


class TestHoldOut:
    @pytest.mark.parametrize("rows", [slice(None), slice(500, 1500)], ids=["whole", "piece"])
    def test_that_holds_the_rows_of_a_fit_log_is_said(self, sources, tmp_path, rows):
        assert require_adequate(sources(*three())) == ()
        table = pd.read_csv(tmp_path / "b.csv").assign(yaw_rate_rad_s=0.0)
        table.iloc[rows].to_csv(tmp_path / "held.csv", index=False)
        fit = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
        again = read_sources(tmp_path / "car.yaml", tmp_path / "road.yaml", fit, str(tmp_path / "held.csv"))
        (told,) = require_adequate(again)
        assert told.startswith(
            "held.csv: holds the same samples as b.csv; expected a hold-out of another drive."
        )


class TestInTheDiagnosis:
    def test_a_refusal_comes_before_any_fit(self, sources, tmp_path, monkeypatch):
        sources(*three(), columns=lambda drive: torques(np.zeros(len(drive))))
        monkeypatch.setattr("sim2real.diagnose.find", lambda *_, **__: pytest.fail("fitted"))
        files = [str(tmp_path / name) for name in ("a.csv", "held.csv")]
        with pytest.raises(LogError, match="the wheel torques never change"):
            diagnose_files(tmp_path / "car.yaml", tmp_path / "road.yaml", files[:1], files[1])

    def test_a_warning_is_in_the_diagnosis(self, sources):
        read = sources(*[noisy(clean(cruise(6.0), 20.0), seed) for seed in range(2)])
        said = diagnose_sources(read, exclude=set(EFFECTS) - {"mass_offset"})
        assert any(text.startswith("The fit logs contain only coasting") for text in said.warnings)
