"""Diagnoses made up by hand, one per verdict, on signals that a car could have: what the report is built against."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sim2real.result import (
    MEANING,
    Budget,
    Cause,
    Diagnosis,
    Gap,
    Interval,
    Measure,
    NextManoeuvre,
    Place,
    RmsError,
    Trace,
    Unexplained,
    Verdict,
)

STEP_S = 1.0 / 150.0
TIME_S = np.arange(0.0, 30.0, STEP_S)
RADIUS_M = 0.29
NOISE = {"wheel_speed": 0.05, "vehicle_speed_m_s": 0.02, "accel_x_m_s2": 0.08, "position_m": 0.02}
WHEELS = ("fl", "fr", "rl", "rr")


def traces(deviation: float, explained: float, seed: int = 3) -> tuple[Trace, ...]:
    """Measured and simulated signals.

    `deviation` scales what the simulation lacks, a ripple of the wheel speeds while torque changes; `explained` is
    the share of it that is modelled afterwards.
    """
    rng = np.random.default_rng(seed)
    accel = (
        2.5
        * np.sign(np.sin(2.0 * np.pi * TIME_S / 7.0))
        * np.minimum(1.0, np.abs(np.sin(TIME_S * 0.9)) * 2.0)
    )
    speed = np.maximum(8.0 + np.cumsum(accel) * STEP_S, 0.0)
    missing = deviation * np.exp(-(((TIME_S % 7.0) - 1.0) ** 2) / 0.1) * np.sin(20.0 * TIME_S)
    shapes = {
        "position_m": ("m", np.cumsum(speed) * STEP_S, 0.0 * missing),
        "vehicle_speed_m_s": ("m/s", speed, 0.05 * missing),
        **{f"wheel_speed_{w}_rad_s": ("rad/s", speed / RADIUS_M, missing) for w in WHEELS},
        "accel_x_m_s2": ("m/s^2", accel, 0.5 * missing),
    }
    made = []
    for signal, (unit, truth, lack) in shapes.items():
        noise = next(sd for name, sd in NOISE.items() if signal.startswith(name))
        measured = truth + lack + noise * rng.standard_normal(len(TIME_S))
        measured[400:404] = np.nan
        made.append(Trace(signal, unit, TIME_S, measured, truth, truth + explained * lack, noise))
    return tuple(made)


def _causes(*rows: tuple[str, float, dict[str, Interval], float, float]) -> tuple[Cause, ...]:
    return tuple(
        Cause(
            effect,
            probability,
            parameters,
            gap_after,
            Interval(shrink, shrink - 4.0, min(shrink + 3.0, 100.0), "%"),
            fit_bic=1200.0 + 90.0 * i,
            evidence_for=("The residual is proportional to the rate of force, at all speeds.",)
            if i < 2
            else (),
            evidence_against=("Leaves a pattern at low speed that noise does not make.",) if i else (),
            excited=effect != "camera_pitch",
        )
        for i, (effect, probability, parameters, gap_after, shrink) in enumerate(rows)
    )


HEAT_MAP = {
    "tyre": {"drive, low speed": 0.58, "drive, high speed": 0.07, "brake": 0.21, "coast": 0.01},
    "powertrain": {"drive, low speed": 0.04, "drive, high speed": 0.02, "brake": 0.03, "coast": 0.0},
    "vehicle": {"drive, low speed": 0.01, "drive, high speed": 0.02, "brake": 0.01, "coast": 0.0},
}
PLACES = (
    Place("wheel_speed_fl", "tyre", "drive, low speed", 1.2, 1.9, 0.31, "fit_1.csv"),
    Place("wheel_speed_rr", "tyre", "drive, low speed", 7.9, 8.6, 0.27, "fit_1.csv"),
    Place("wheel_speed_fl", "tyre", "brake", 15.0, 15.7, 0.21, "fit_2.csv"),
)
PROVENANCE = {
    "vehicle": {"path": "vehicle.yaml", "sha256": "9f2c" * 16},
    "fit": [
        {
            "path": "fit_1.csv",
            "sha256": "77de" * 16,
            "road": {"path": "road.yaml", "sha256": "01ab" * 16},
            "rate_hz": 999.9999999,
        }
    ],
    "holdout": {"path": "holdout.csv", "sha256": "c0ff" * 16, "rate_hz": 1000.0},
    "versions": {"trpac-fmu": "0.1.0", "numpy": "2.4.6", "scipy": "1.17.1"},
    "seed": 0,
}
LENGTH = Interval(0.30, 0.25, 0.36, "m")
OTHERS = (
    ("torque_lag", 0.03, {"time_constant_s": Interval(0.021, 0.012, 0.03, "s")}, 2.4, 41.0),
    ("driveline_compliance", 0.01, {"stiffness_nm_rad": Interval(9e3, 4e3, 2e4, "N m/rad")}, 2.9, 29.0),
    ("wheel_speed_delay", 0.0, {"delay_s": Interval(0.008, 0.005, 0.011, "s")}, 3.6, 12.0),
    ("aero_drag", 0.0, {"drag_area_m2": Interval(0.1, 0.0, 0.4, "m^2")}, 4.1, 0.2),
    ("camera_pitch", 0.0, {"pitch_rad": Interval(0.0, -0.05, 0.05, "rad")}, 4.1, 0.0),
)


def budget(**effects: float) -> Budget:
    """Shares of effects; of what they leave a tenth is noise."""
    rest = 1.0 - sum(effects.values())
    shares = {f"effect:{name}": share for name, share in effects.items()}
    shares |= {"structure": 0.9 * rest, "noise": 0.1 * rest}
    return Budget({name: Interval(value, 0.9 * value, 1.1 * value) for name, value in shares.items()})


def identified() -> Diagnosis:
    """One effect: tyre relaxation."""
    shown = traces(0.9, 0.97)
    return Diagnosis(
        verdict=Verdict.IDENTIFIED,
        sentence="The tyre's force lags its slip over 0.30 m (tyre_relaxation), which the simulation does not model; "
        "with it the gap on the hold-out shrinks from 4.1 to 1.1 noise floors.",
        gap=Gap(
            Measure(
                4.1,
                {"wheel_speed": 6.8, "vehicle_speed": 1.4, "accel_x": 2.1},
                {"wheel_speed [rad/s]": 0.34, "vehicle_speed [m/s]": 0.028, "accel_x [m/s^2]": 0.17},
            ),
            Measure(1.1, {"wheel_speed": 1.2, "vehicle_speed": 1.0, "accel_x": 1.05}),
            1.0,
        ),
        where=PLACES,
        heat_map=HEAT_MAP,
        causes=_causes(("tyre_relaxation", 0.93, {"length_m": LENGTH}, 1.1, 73.0), *OTHERS),
        cannot_rule_out=("camera_pitch",),
        budget=budget(tyre_relaxation=0.93),
        trpac=RmsError(
            0.081, 0.034, "road.yaml's friction", "The estimator's own tyre model has no place for a lag."
        ),
        rating={
            "wheel_speed_fl_rad_s": (0.990, 0.998),
            "accel_x_m_s2": (0.71, 0.86),
            "position_m": (None, None),
        },
        traces=shown,
        warnings=("fit_1.csv: 4 lost samples of vehicle_speed_m_s are bridged.",),
        provenance=PROVENANCE,
    )


def partial() -> Diagnosis:
    """A payload on a car whose tyres are another make than the simulation's."""
    x = np.linspace(-3.0, 3.0, 12)
    return replace(
        identified(),
        verdict=Verdict.PARTIAL,
        sentence="A part of the gap of 4.1 times the sensor noise is mass_offset (mass_kg 180 kg): it takes the gap "
        "from 4.1 to 2.5 times the sensor noise.",
        gap=replace(
            identified().gap, after=Measure(2.5, {"wheel_speed": 4.0, "vehicle_speed": 1.0, "accel_x": 1.1})
        ),
        causes=_causes(
            ("mass_offset", 0.91, {"mass_kg": Interval(180.0, 150.0, 211.0, "kg")}, 2.5, 39.0), *OTHERS[:2]
        ),
        traces=traces(0.9, 0.4),
        budget=budget(mass_offset=0.62),
        unexplained=Unexplained(
            "tyre",
            "wheel_speed",
            "acceleration",
            "-",
            "changes sign",
            "is a straight line",
            0.5,
            x,
            0.001 * x,
            "The tyre's slip is larger than the model's by 0.001 per m/s^2.",
        ),
    )


def ambiguous() -> Diagnosis:
    """Mild driving: payload and torque gain look alike; says what to drive."""
    time = np.arange(0.0, 12.0, 0.05)
    torque = 300.0 * np.sign(np.sin(time)) * (time > 1.0) + 40.0 * np.sin(5.0 * time)
    return replace(
        identified(),
        verdict=Verdict.AMBIGUOUS,
        sentence="Either a payload (mass_offset, +180 kg) or too little torque (torque_gain, 0.88) explains the gap: "
        "these drives cannot tell which.",
        causes=_causes(
            ("mass_offset", 0.48, {"mass_kg": Interval(180.0, 150.0, 211.0, "kg")}, 1.1, 73.0),
            ("torque_gain", 0.46, {"factor": Interval(0.88, 0.85, 0.91, "-")}, 1.15, 72.0),
            *OTHERS[1:],
        ),
        budget=budget(mass_offset=0.93),
        ambiguous_with=(("mass_offset", "torque_gain"),),
        next_manoeuvre=NextManoeuvre(
            "From 8 m/s, accelerate with full torque for 3 s, then brake to the grip limit; repeat once.",
            8.0,
            time,
            np.column_stack([torque, torque, 0.7 * torque, 0.7 * torque]),
            ("mass_offset", "torque_gain"),
            power_sigma=34.0,
            power_now_sigma=1.8,
        ),
    )


def compound() -> Diagnosis:
    """Two effects that are needed together."""
    return replace(
        identified(),
        verdict=Verdict.COMPOUND,
        sentence="Two effects are needed together: tyre_relaxation (0.30 m) and aero_drag (0.65 m^2).",
        causes=_causes(
            ("tyre_relaxation", 0.47, {"length_m": LENGTH}, 2.0, 51.0),
            ("aero_drag", 0.45, {"drag_area_m2": Interval(0.65, 0.6, 0.7, "m^2")}, 3.0, 27.0),
            *OTHERS[:3],
        ),
        budget=budget(tyre_relaxation=0.6, aero_drag=0.33),
    )


def unknown() -> Diagnosis:
    """A gap that no effect of the library explains."""
    x = np.linspace(0.0, 28.0, 30)
    shown = traces(0.9, 0.0)
    before = identified().gap.before
    return replace(
        identified(),
        verdict=Verdict.UNKNOWN,
        sentence="There is a gap of 4.1 times the sensor noise, and no effect of the library explains it: "
        "the force balance lacks a force that opposes motion and grows with speed.",
        gap=Gap(before, before, 1.0),
        causes=_causes(
            ("aero_drag", 0.05, {"drag_area_m2": Interval(0.9, 0.8, 1.0, "m^2")}, 2.9, 29.0), *OTHERS[:2]
        ),
        traces=shown,
        budget=budget(),
        rating={},
        trpac=None,
        unexplained=Unexplained(
            "vehicle",
            "accel_x",
            "vehicle_speed_m_s",
            "N",
            "opposes motion",
            "grows in proportion",
            0.82,
            x,
            -18.0 * x + 12.0 * np.sin(x),
            "The force balance lacks a force of about 18 N per m/s that opposes motion and grows in proportion to "
            "vehicle speed; it takes 82 % of what is unexplained.",
        ),
    )


def no_gap() -> Diagnosis:
    """Nothing but sensor noise."""
    quiet = Measure(1.02, {"wheel_speed": 1.01, "vehicle_speed": 1.03, "accel_x": 1.02})
    return replace(
        identified(),
        verdict=Verdict.NO_GAP,
        sentence=MEANING[Verdict.NO_GAP],
        gap=Gap(quiet, quiet, 1.0),
        where=(),
        heat_map={},
        causes=_causes(*OTHERS[:3]),
        cannot_rule_out=("friction_offset",),
        budget=None,
        trpac=None,
        rating={},
        traces=traces(0.0, 0.0),
        warnings=(),
    )


ALL = {
    "identified": identified,
    "partial": partial,
    "ambiguous": ambiguous,
    "compound": compound,
    "unknown": unknown,
    "no_gap": no_gap,
}
