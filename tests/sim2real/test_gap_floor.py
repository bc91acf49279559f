"""A gap that no row shows is none; and how a small one is told."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, clean, noisy, pulses

from sim2real.observing.evidence import gather
from sim2real.result import Verdict
from sim2real.which.contest import Contest, Entry
from sim2real.which.fitting import Candidate, fit
from sim2real.which.goodness import Fitness, fitness
from sim2real.which.no_gap import is_noise
from sim2real.which.selection import Decision


def evidence(bias_m_s2, seed):
    drives = [clean(pulses(24.0), v0, effects=with_bias(bias_m_s2)) for v0 in (10.0, 16.0)]
    return gather(MODEL, [noisy(drive, seed + i) for i, drive in enumerate(drives)])


def with_bias(bias_m_s2):
    return {"accelerometer_bias": {"bias_m_s2": bias_m_s2}} if bias_m_s2 else None


def decided(fit_to, held, verdict=Verdict.IDENTIFIED):
    found = fit(Candidate(MODEL, ("accelerometer_bias",)), fit_to, steps=3)
    model = found.candidate.model(found.x)
    null, entry = (
        Entry(ids, it, *(part.whitened(part.residuals(m)) for part in (fit_to, held)))
        for ids, it, m in (((), None, MODEL), (("accelerometer_bias",), found, model))
    )
    fits = Fitness(1.3, {}), Fitness(1.0, {})
    said = Decision(verdict, entry, (), {"accelerometer_bias": 0.9}, *fits)
    return said, Contest(null, (entry,), ())


@pytest.fixture(scope="module")
def slight():
    """Logs with a slight gap, and their contest."""
    fit_to, held = evidence(0.004, 1), evidence(0.004, 5)
    return fit_to, held, decided(fit_to, held)[1]


def leaving(misfit, taken, fit_to, held, contest):
    """The contest if its model as it is had this misfit, and its only effect took this share off the loss."""
    [entry] = contest.singles
    louder = misfit / fitness(contest.null, fit_to, held).misfit
    z_fit, z_hold = louder * contest.null.z_fit, louder * contest.null.z_hold
    left = np.sqrt(1.0 - taken)
    return Contest(
        replace(contest.null, z_fit=z_fit, z_hold=z_hold),
        (replace(entry, z_fit=left * z_fit, z_hold=left * z_hold),),
        (),
    )


@pytest.mark.parametrize(
    ("misfit", "taken", "noise"),
    [
        (0.95, 0.10, True),
        (0.95, 0.14, False),
        (1.05, 0.10, False),
        (1.05, 0.02, True),
        (1.35, 0.05, False),
        (1.35, 0.02, True),
        (1.45, 0.02, False),
        (1.45, 0.01, True),
        (1.65, 0.0, False),
    ],
)
def test_what_an_effect_may_take_where_noise_is_left_hangs_on_the_misfit(misfit, taken, noise, slight):
    fit_to, held, _ = slight
    assert is_noise(leaving(misfit, taken, *slight), fit_to, held) is noise


def test_an_effect_that_is_next_to_none_may_take_what_it_will(slight):
    fit_to, held, _ = slight
    contest = leaving(0.95, 0.14, *slight)
    [entry] = contest.singles
    candidate = entry.fit.candidate
    none = replace(entry, fit=replace(entry.fit, x=candidate.neutral + 0.01 * candidate.scale))
    assert is_noise(replace(contest, singles=(none,)), fit_to, held)
