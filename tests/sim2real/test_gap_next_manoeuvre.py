"""The next manoeuvre: driven, it does tell apart what the logs at hand do not."""

from dataclasses import dataclass

import numpy as np
import pytest
from gap_drives import BARE, DRY, MODEL, STEP_S, clean, noisy, road_of, trace

from scenarios.effects import EFFECTS
from sim2real.diagnose import find
from sim2real.hypotheses.contest import Contest, first_round, hold_contest
from sim2real.hypotheses.fitting import fit
from sim2real.hypotheses.selection import decide
from sim2real.next_manoeuvre import PROFILES, SEPARATE_SIGMA, propose, torque_of
from sim2real.observing.drive import Drive
from sim2real.observing.evidence import Evidence, gather
from sim2real.result import NextManoeuvre, Verdict

MILD = ((0, 0), (2, 40), (6, 40), (8, -40), (10, -40))
FIRMER = ((0, 0), (2, 120), (5, 120), (7, -120), (10, -120))


@dataclass(frozen=True)
class Doubtful:
    """Mild logs of a car with `truth`, on which its rival does as well."""

    truth: dict[str, dict[str, float]]
    rival: str
    points: tuple[tuple[float, float], ...]

    @property
    def effect(self) -> str:
        return next(iter(self.truth))

    @property
    def exclude(self) -> set[str]:
        return set(EFFECTS) - {self.effect, self.rival}


PAIRS = (
    Doubtful({"rolling_resistance": {"coefficient": 0.02}}, "brake_drag", MILD),
    Doubtful({"mass_offset": {"mass_kg": 60.0}}, "torque_gain", MILD),
    Doubtful({"torque_lag": {"time_constant_s": 0.05}}, "torque_delay", FIRMER),
)


@dataclass(frozen=True)
class Proposed:
    case: Doubtful
    logs: list[Drive]
    contest: Contest
    held: Evidence
    profile: NextManoeuvre


@pytest.fixture(scope="module", params=PAIRS, ids=lambda case: f"{case.effect} or {case.rival}")
def proposed(request) -> Proposed:
    case = request.param
    torque = trace(*case.points, duration_s=10.0)
    logs = [noisy(clean(f * torque, 12.0, effects=case.truth), seed) for seed, f in enumerate((1.0, 0.8))]
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    contest = hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, case.exclude))
    assert decide(contest, fit_to, held).verdict is Verdict.AMBIGUOUS
    entries = {e.ids[0]: e for e in contest.singles}
    profile = propose(
        MODEL, entries[case.effect], entries[case.rival], DRY, held.noises[0], 1.0, held.drives[0].step_s
    )
    return Proposed(case, logs, contest, held, profile)


def drive_it(profile: NextManoeuvre, effects, seed=5) -> Drive:
    """The profile as the JSON holds it, driven by the real car."""
    duration_s = float(profile.time_s[-1])
    time_s = np.arange(round(duration_s / STEP_S) + 1) * STEP_S
    torque = np.column_stack([np.interp(time_s, profile.time_s, t) for t in profile.wheel_torque_nm.T])
    return noisy(clean(torque, profile.initial_speed_m_s, effects=effects), seed)


def distance(proposed: Proposed, drive: Drive) -> float:
    """By how many standard deviations the truth fits a drive better than the rival, both at their best."""
    entries = {e.ids[0]: e for e in proposed.contest.singles}
    held = gather(MODEL.with_effects(*entries[proposed.case.effect].fit.candidate.effects(
        entries[proposed.case.effect].fit.x)), [drive])  # fmt: skip
    true, rival = (
        fit(entries[key].fit.candidate, held, entries[key].fit.x)
        for key in (proposed.case.effect, proposed.case.rival)
    )
    return float(np.sign(rival.loss - true.loss) * np.sqrt(abs(rival.loss - true.loss)))


def test_the_proposed_profile_when_driven_tells_the_effects_apart(proposed):
    drive = drive_it(proposed.profile, proposed.case.truth)
    found = distance(proposed, drive)
    assert proposed.profile.power_sigma > SEPARATE_SIGMA
    assert found > 0.4 * proposed.profile.power_sigma
    assert found > max(SEPARATE_SIGMA, distance(proposed, proposed.logs[1]))


def test_with_the_proposed_drive_the_diagnosis_is_sure(proposed):
    logs = [*proposed.logs, drive_it(proposed.profile, proposed.case.truth)]
    decision = find(MODEL, logs[1:], logs[0], exclude=proposed.case.exclude).decision
    assert decision.winner.ids == (proposed.case.effect,)
    # A few sigmas between two forms that may both be a little off make nobody sure.
    if proposed.profile.power_sigma > 3.0 * SEPARATE_SIGMA:
        assert decision.verdict is Verdict.IDENTIFIED
        assert decision.probability[proposed.case.effect] > 0.8


def test_a_proposal_says_what_to_drive_and_what_for(proposed):
    profile = proposed.profile
    assert set(profile.separates) == {proposed.case.effect, proposed.case.rival}
    assert profile.time_s.shape == (len(profile.wheel_torque_nm),)
    assert profile.wheel_torque_nm.shape[1] == 4
    assert (np.diff(profile.time_s) > 0.0).all()
    assert np.isfinite(profile.wheel_torque_nm).all()
    assert all(name in profile.sentence for name in profile.separates)
    assert profile.power_now_sigma == 1.0


def test_the_predicted_power_is_what_a_noisy_drive_shows(proposed):
    """Within half; drives at the logs' rate hold fewer rows than the imagined one."""
    found = np.mean([distance(proposed, drive_it(proposed.profile, proposed.case.truth, s)) for s in (7, 8)])
    assert 0.4 < found / proposed.profile.power_sigma < 2.0


def test_the_profile_that_is_told_is_the_one_that_was_judged(proposed):
    (profile,) = [p for p in PROFILES if proposed.profile.sentence.startswith(p.sentence)]
    time_s, torque = torque_of(profile, BARE, DRY)
    told = proposed.profile
    for at_wheel, judged in zip(told.wheel_torque_nm.T, torque.T, strict=True):
        off = np.interp(time_s, told.time_s, at_wheel) - judged
        assert np.abs(off).max() < 0.12 * BARE.motor_peak_torque_nm  # of a ramp of 30 ms, half a row's
    assert told.initial_speed_m_s == profile.initial_speed_m_s


# --- the profiles


@pytest.mark.parametrize("profile", PROFILES, ids=lambda p: p.name)
def test_a_profile_can_be_driven(profile):
    time_s, torque = torque_of(profile, BARE, DRY)
    assert torque.shape == (len(time_s), 4)
    assert torque.max() <= BARE.motor_peak_torque_nm
    assert np.abs(np.diff(torque, axis=0)).max() < BARE.motor_peak_torque_nm
    assert len(profile.times_s) == len(profile.shares)
    assert list(profile.times_s) == sorted(profile.times_s)


def test_brakes_go_to_the_limit_of_the_best_stretch_and_not_beyond():
    (limit,) = [p for p in PROFILES if p.name == "brake to the limit"]
    core = BARE.to_core()
    for grip in (0.3, 0.9):
        _, torque = torque_of(limit, BARE, road_of(0.2, grip))
        for wheel, front in ((0, True), (2, False)):
            most = grip * core.wheel_load(front=front) * BARE.wheel_radius_m
            assert 0.9 * most < -torque[:, wheel].min() < most
