"""What is blamed on no effect: a hum, a slow sensor, a limited rate, rare faults, laws of another, gaps left open."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, clean, noisy, pulses, remeasured, trace

from scenarios.effects import EFFECTS
from sim2real.diagnose import find
from sim2real.observing.drive import WHEEL
from sim2real.result import Verdict
from sim2real.telling.findings import describe
from sim2real.telling.sentences import verdict as verdict_of
from sim2real.which.contest import silent
from sim2real.which.no_gap import NO_GAP_MISFIT

DURATION_S = 16.0


def only(*keys):
    return set(EFFECTS) - set(keys)


@pytest.fixture(scope="module")
def nominal():
    return clean(pulses(DURATION_S), 14.0)


# --- what is rare but far beyond noise


@pytest.mark.parametrize(
    ("faults", "verdict"),
    [((0, 0, 0), Verdict.NO_GAP), ((0, 1, 0), Verdict.NO_GAP), ((4, 4, 4), Verdict.UNKNOWN)],
    ids=["none", "one", "many"],
)
def test_what_is_rare_but_far_beyond_noise_is_a_gap(nominal, faults, verdict):
    """A wheel that reads 0.3 rad/s less for a tenth of a second, now and then: one block of 240 may be chance."""
    logs = []
    for seed, count in enumerate(faults):
        measured = nominal.measured.copy()
        for begin in 200 + 400 * np.arange(count):
            measured[begin : begin + 12, WHEEL.start] -= 0.3
        logs.append(noisy(remeasured(nominal, measured), seed))
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "wheel_radius_offset"))
    assert found.decision.before.misfit < NO_GAP_MISFIT
    assert found.decision.verdict is verdict


# --- an effect whose work a free curve does as well


def three_logs(effects):
    return [
        noisy(clean(f * pulses(DURATION_S), 14.0, effects=effects), seed)
        for seed, f in enumerate((1.0, 0.8, 1.2))
    ]


@pytest.fixture(scope="module")
def loaded():
    """Logs of a car that is 60 kg heavier than its simulation."""
    return three_logs({"mass_offset": {"mass_kg": 60.0}})


@pytest.fixture(scope="module")
def mistaken(loaded):
    """What is found where the library knows a torque's gain and no payload."""
    return find(MODEL, loaded[:2], loaded[2], exclude=only("torque_gain"))


@pytest.fixture(scope="module")
def told(mistaken):
    """What is said of it."""
    return describe(mistaken, seed=0, jobs=1, progress=silent)


def wide_drives(drive):
    """Three noisy logs from walking pace to 20 m/s and down again, by a function of torque and speed at the start."""
    logs = []
    for seed, (f, speed_m_s) in enumerate(((1.0, 3.0), (1.2, 5.0), (0.9, 4.0))):
        points = [
            (0.5, 0.0),
            (0.8, 200.0),
            (9.0, 200.0),
            (9.3, 0.0),
            (13.0, 0.0),
            (13.3, -200.0),
            (18.0, -200.0),
        ]
        logs.append(noisy(drive(f * trace(*points, (18.3, 0.0), duration_s=20.0), speed_m_s), seed))
    return logs


@pytest.mark.long
def test_two_resistances_stand_as_what_they_are():
    effects = {"aero_drag": {"drag_area_m2": 0.5}, "rolling_resistance": {"coefficient": 0.012}}
    logs = wide_drives(lambda torque_nm, speed_m_s: clean(torque_nm, speed_m_s, effects=effects))
    found = find(MODEL, logs[:2], logs[2], exclude=only("aero_drag", "rolling_resistance"))
    assert found.decision.verdict is Verdict.COMPOUND
    assert found.decision.winner.ids == ("aero_drag", "rolling_resistance")


# --- what an ambiguous verdict says


@pytest.mark.parametrize(
    ("rivals", "said"),
    [
        ([("mass_offset",)], "torque_gain or as well mass_offset: these"),
        ([("torque_gain", "aero_drag")], "torque_gain, perhaps not alone (with aero_drag): these"),
        (
            [("mass_offset", "road_grade"), *(("torque_gain", key) for key in "abcde")],
            "torque_gain or as well mass_offset with road_grade, perhaps not alone (with a or b or c or one of 2 more)",
        ),
    ],
)
def test_a_sentence_lists_a_few_rivals_and_counts_the_others(mistaken, told, monkeypatch, rivals, said):
    for key in "abcde":
        monkeypatch.setitem(EFFECTS, key, EFFECTS["aero_drag"])
    null = mistaken.contest.null
    decision = replace(
        mistaken.decision,
        verdict=Verdict.AMBIGUOUS,
        rivals=tuple(replace(null, ids=ids) for ids in rivals),
    )
    assert said in verdict_of(decision, told.gap, told.causes)


# --- an effect that is needed for what its form adds alone
