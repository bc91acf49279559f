"""Another build of the car beside any effect: its columns, its prior, the fits beside it, the decision over them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from gap_drives import MODEL, clean, noisy, pulses, road_of, trace
from long import long

from benchmarks.gap.builds.draw import COURSES, SIZES, write_case
from benchmarks.gap.builds.learn import Told, covariance_of, width_of
from scenarios.effects import EFFECTS, form_of
from scenarios.effects.mass_offset import MassOffset
from scenarios.effects.torque_gain import TorqueGain
from sim2real.diagnose import diagnose_files, find
from sim2real.discrepancy import posterior
from sim2real.discrepancy.beside import Hypothesis, Stack, block_means, stack_of
from sim2real.discrepancy.columns import of_build
from sim2real.discrepancy.posterior import judge
from sim2real.discrepancy.prior import prior_root
from sim2real.discrepancy.ridge import Scale, huber, read_scale, solve
from sim2real.discrepancy.verdict import beside_another_build
from sim2real.hypotheses.contest import first_round, hold_contest
from sim2real.hypotheses.fitting import Candidate
from sim2real.hypotheses.goodness import Fitness
from sim2real.hypotheses.selection import decide
from sim2real.observing.evidence import Evidence, gather
from sim2real.result import Verdict

FOREIGN_TYRE = {
    "tyre_formula": {"share": 1.0, "shape": 1.5, "curvature": -1.0},
    "tyre_load_stiffness": {"exponent": 0.9},
    "load_transfer": {"cog_height_m": 0.5},
    "tyre_relaxation": {"length_m": 0.06},
}
FEW = {
    "mass_offset",
    "torque_gain",
    "road_grade",
    "torque_lag",
    "aero_drag",
    "friction_offset",
    "friction_falloff",
}


def only(*keys):
    return set(EFFECTS) - set(keys)


def driven(effects, speed_m_s=14.0, seed=0, duration_s=16.0):
    return noisy(clean(pulses(duration_s), speed_m_s, effects=effects), seed)


@pytest.fixture(scope="module")
def stack():
    drive = driven({})
    fit_to = gather(MODEL, [drive])
    return stack_of(MODEL, fit_to, gather(MODEL, [driven({}, 17.0, 1)]))


# --- least squares


def test_with_small_residuals_the_solution_is_ridge_regression():
    rng = np.random.default_rng(0)
    z, columns = rng.normal(0.0, 0.5, (40, 7)), rng.normal(size=(40, 7, 3))
    precision = np.array([1.0, 4.0, 0.1])
    cost, b = solve(z, columns, np.full(z.shape, 2.0), 3.0, precision)
    design = columns.reshape(-1, 3) / 2.0
    expected = np.linalg.solve(design.T @ design / 3.0 + np.diag(precision), -design.T @ z.ravel() / 6.0)
    np.testing.assert_allclose(b, expected, rtol=1e-9)
    rest = z.ravel() / 2.0 + design @ b
    assert cost == pytest.approx((rest**2).sum() / 3.0 + (precision * b * b).sum())


def test_an_outlier_pulls_by_its_size_alone():
    assert huber(np.array([2.0, -30.0])) == pytest.approx([4.0, 2 * 3 * 30 - 9])
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(200, 7, 1))
    z = -0.5 * columns[..., 0] + 0.1 * rng.normal(size=(200, 7))
    z[:10] += 1e4
    _, b = solve(z, columns, np.ones(z.shape), 1.0, np.array([1e-6]))
    assert b[0] == pytest.approx(0.5, abs=0.06)


def test_a_remainders_size_is_read_by_channel_and_regime_and_its_memory_from_sums():
    rng = np.random.default_rng(2)
    limit = np.arange(600) % 3 == 0
    rest = rng.normal(size=(600, 7))
    rest[:, 1] *= 4.0
    rest[limit, 6] *= 9.0
    live = np.ones(rest.shape, dtype=bool)
    scale = read_scale(rest, live, limit)
    assert scale.size[:, 1] == pytest.approx(np.full(600, 4.0), rel=0.15)
    assert scale.size[limit, 6][0] == pytest.approx(9.0, rel=0.2)
    assert scale.size[~limit, 6][0] < 1.2
    assert scale.memory < 1.4
    held = np.repeat(rng.normal(size=(100, 7)), 6, axis=0)
    assert read_scale(held, live, limit).memory == pytest.approx(6.0, rel=0.2)


# --- columns


@pytest.mark.parametrize(
    ("name", "effect", "size"),
    [
        ("stiffness by load", {"tyre_load_stiffness": {"exponent": 0.5}}, 0.5),
        ("relaxation", {"tyre_relaxation": {"length_m": 0.05}}, 0.05),
        ("radius", {"wheel_radius_offset": {"radius_m": 0.29 * 0.999}}, 0.001),
        ("inertia", {"wheel_inertia_offset": {"inertia_kg_m2": 1.2 * 1.2}}, 0.2),
        ("share of acceleration", {"mass_offset": {"mass_kg": -0.01 * MODEL.vehicle.mass_kg}}, 0.01),
        ("resistance", {"road_grade": {"grade": -0.005}}, 0.005 * 9.81),
    ],
)
def test_a_column_is_what_the_plants_own_effect_leaves(name, effect, size):
    """The plant simulates the effect; the column only pushes the nominal observer."""
    height = {"load_transfer": {"cog_height_m": 0.54}}
    model = MODEL.with_effects(form_of("load_transfer", "")(0.54))
    torque = pulses(16.0)
    drive = clean(torque, 14.0, effects=height)
    noises = gather(MODEL, [noisy(drive)]).noises
    stack = stack_of(model, Evidence((drive,), noises), Evidence((drive,), noises))
    ((key, values),) = effect.items()
    other = stack.blocks(model.with_effects(form_of(key, "")(**values))) - stack.z
    column = stack.changes[..., stack.names.index(name)] * size
    wheels = slice(1, 7) if name == "resistance" else slice(2, 6)
    if name == "resistance":  # a hill is not felt, the column's force is
        other, column = other[:, 1:6], column[:, 1:6]
    else:
        other, column = other[:, wheels], column[:, wheels]
    cosine = (other * column).sum() / np.sqrt((other**2).sum() * (column**2).sum())
    assert cosine > 0.9
    assert np.sqrt((column**2).sum() / (other**2).sum()) == pytest.approx(1.0, abs=0.25)


def test_rows_near_the_tyres_limit_are_told():
    hard = trace((0, 0), (1, 0), (1.2, -900), (2.0, -900), (2.2, 0), duration_s=6.0)
    drive = clean(hard, 20.0, road=road_of(0.5))
    _, near = of_build(MODEL, drive)
    assert near[(drive.time_s > 1.3) & (drive.time_s < 2.0)].all()
    assert not near[(drive.time_s < 0.6) | (drive.time_s > 4.0)].any()
    assert not of_build(MODEL, clean(pulses(8.0), 14.0))[1].any()


def test_blocks_of_white_noise_keep_unit_size():
    drive = driven({})
    z = np.random.default_rng(0).normal(size=(len(drive), 7))
    assert block_means(z, drive).std() == pytest.approx(1.0, abs=0.03)


# --- prior


def test_the_prior_knows_every_change_and_is_a_covariance(stack):
    root = prior_root(stack.names)
    covariance = root @ root.T
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    sd = dict(zip(stack.names, np.sqrt(np.diag(covariance)), strict=True))
    assert 0.005 < sd["resistance"] < 0.05
    assert 0.3 < sd["stiffness by load"] < 1.2
    assert all(width_of(name) > 0.0 for name in stack.names)


def test_the_covariance_of_known_changes_is_learnt_back():
    rng = np.random.default_rng(3)
    names = ("pitch", "inertia")
    truth = np.array([[1.0, 0.8], [0.8, 1.0]]) * 4.0
    cars = []
    for values in rng.multivariate_normal(np.zeros(2), truth, 400):
        design = rng.normal(size=(50, 2)) * 3.0
        wanted = design @ values + rng.normal(size=50)
        cars.append(Told(names, design.T @ design, design.T @ wanted))
    found, covariance = covariance_of(cars)
    width = np.array([width_of(name) for name in found])
    np.testing.assert_allclose(covariance / np.outer(width, width), truth, rtol=0.2)


# --- the decision


def plain(ids, z, slopes, x=1.0):
    """A hypothesis of one parameter with neutral 0 and a noticeable change of 1."""
    candidate = SimpleNamespace(ids=ids, neutral=np.zeros(1), scale=np.ones(1))
    return Hypothesis(candidate, np.array([x]), z, slopes[..., None])


@pytest.fixture
def made_up():
    """A stack with two changes of the build, and the residuals of an effect that none of them makes."""
    rng = np.random.default_rng(4)
    noise = rng.normal(size=(900, 7))
    build = 20.0 * rng.normal(size=(900, 7, 2))
    effect = 3.0 * rng.normal(size=(900, 7))
    names = ("pitch", "inertia")
    stack = Stack(MODEL, (), noise, build, names, np.zeros(900, dtype=bool))
    return stack, effect


def judged(stack, singles, pairs=(), others=None):
    scale = Scale(np.ones(stack.z.shape), 1.0)
    return judge(stack, scale, singles, lambda: pairs, lambda: others or {})


def test_what_the_build_makes_is_no_effect(made_up):
    stack, effect = made_up
    stack = replace(stack, z=stack.z + stack.changes @ np.array([0.02, 0.1]))
    found = judged(stack, [plain(("mass_offset",), stack.z - 0.01 * effect, -effect, 0.01)])
    assert found.verdict is Verdict.UNKNOWN
    assert found.named == ()
    assert found.structure["inertia"] == pytest.approx(-0.1, abs=0.03)


def test_an_effect_beside_the_build_is_partial_and_its_like_makes_a_set(made_up):
    stack, effect = made_up
    stack = replace(stack, z=stack.z + effect + stack.changes @ np.array([0.02, 0.1]))
    true = plain(("mass_offset",), stack.z - effect, -effect)
    way = effect + 3.0 * np.random.default_rng(7).normal(size=effect.shape)  # does a half of it
    other = plain(("road_grade",), stack.z - 0.3 * way, -0.3 * way)
    found = judged(stack, [other, true])
    assert found.verdict is Verdict.PARTIAL
    assert [h.ids for h in found.named] == [("mass_offset",)]
    assert found.probability["mass_offset"] > 0.99
    like = plain(("torque_gain",), true.z, true.slopes[..., 0])
    found = judged(stack, [other, true, like])
    assert found.verdict is Verdict.AMBIGUOUS
    assert {h.ids for h in found.named} == {("mass_offset",), ("torque_gain",)}


def test_a_fault_that_no_effect_has_the_form_of_is_unknown(made_up):
    stack, effect = made_up
    fault = 3.0 * np.random.default_rng(5).normal(size=effect.shape)
    stack = replace(stack, z=stack.z + fault)
    near = 0.3 * fault + 0.3 * effect  # takes a part of it
    single = plain(("mass_offset",), stack.z - near, -near)
    assert judged(stack, [single]).verdict is Verdict.PARTIAL
    found = judged(stack, [single], others={"torque fl": fault[..., None]})
    assert found.verdict is Verdict.UNKNOWN
    assert found.outside["torque fl"] > found.drops["mass_offset"]


def test_an_effect_beside_which_the_body_moves_otherwise_is_not_named(made_up):
    """Another build does not move the body: what is left of the vehicle speed says that the effect is another one."""
    stack, effect = made_up
    left = 8.0 * np.random.default_rng(8).normal(size=len(effect))
    z = stack.z + effect
    z[:, 1] += left
    stack = replace(stack, z=z)
    assert judged(stack, [plain(("mass_offset",), z - effect, -effect)]).verdict is Verdict.UNKNOWN
    z = z.copy()
    z[:, 1] -= 0.7 * left
    stack = replace(stack, z=z)
    assert judged(stack, [plain(("mass_offset",), z - effect, -effect)]).verdict is Verdict.PARTIAL


@pytest.mark.parametrize(
    ("at_bound", "before", "named"), [([], 1e3, True), (["grade"], 1e3, False), ([], 0.0, False)]
)
def test_nothing_is_named_at_its_bound_or_that_leaves_more_than_there_was(
    monkeypatch, at_bound, before, named
):
    logs = [driven({"road_grade": {"grade": 0.03}}, v0, i, 8.0) for i, v0 in enumerate((14.0, 17.0))]
    fit_to, held = gather(MODEL, logs[:1]), gather(MODEL, logs[1:])
    contest = hold_contest(MODEL, fit_to, held, first_round(MODEL, fit_to, only("road_grade")))
    decision = replace(decide(contest, fit_to, held), verdict=Verdict.UNKNOWN, before=Fitness(before, {}))
    monkeypatch.setattr(Candidate, "at_bound", lambda self, x: at_bound)
    _, said = beside_another_build(decision, contest, MODEL, fit_to, held)
    assert said.verdict is (Verdict.PARTIAL if named else Verdict.UNKNOWN)


def test_two_effects_that_both_do_much_are_a_compound(made_up):
    stack, effect = made_up
    second = 3.0 * np.random.default_rng(6).normal(size=effect.shape)
    stack = replace(stack, z=stack.z + effect + second)
    singles = [
        plain(("mass_offset",), stack.z - effect, -effect),
        plain(("road_grade",), stack.z - second, -second),
    ]
    candidate = SimpleNamespace(ids=("mass_offset", "road_grade"), neutral=np.zeros(2), scale=np.ones(2))
    both = Hypothesis(candidate, np.ones(2), stack.z - effect - second, -np.stack([effect, second], axis=-1))
    found = judged(stack, singles, [both])
    assert found.verdict is Verdict.COMPOUND
    assert found.named[0].ids == ("mass_offset", "road_grade")


def test_an_effect_next_to_nothing_is_none(made_up):
    stack, effect = made_up
    stack = replace(stack, z=stack.z + effect)
    tiny = plain(("mass_offset",), stack.z - effect, np.zeros_like(effect), 0.5 * posterior.LEAST_SIZE)
    assert judged(stack, [tiny]).verdict is Verdict.UNKNOWN


# --- whole cars


@pytest.mark.parametrize(("fault", "first"), [({}, None), ({"road_grade": {"grade": 0.03}}, "road_grade")])
def test_on_foreign_tyres_a_fault_is_named_and_none_where_there_is_none(fault, first):
    logs = [driven({**FOREIGN_TYRE, **fault}, v0, i, 20.0) for i, v0 in enumerate((14.0, 17.0))]
    decision = find(MODEL, logs[:1], logs[1], exclude=only(*FEW)).decision
    if first is None:
        assert decision.verdict in (Verdict.UNKNOWN, Verdict.NO_GAP)
    else:
        assert decision.verdict is Verdict.PARTIAL
        assert decision.winner.ids == (first,)
        assert decision.build["stiffness by load"] != 0.0
        assert 0.9 < sum(decision.probability.values()) <= 1.0
        interval = decision.intervals[first, "grade"]
        assert interval.low < 0.03 < interval.high


def test_two_faults_on_foreign_tyres_share_the_probability():
    fault = {"road_grade": {"grade": 0.03}, "torque_lag": {"time_constant_s": 0.15}}
    logs = [driven({**FOREIGN_TYRE, **fault}, v0, i, 20.0) for i, v0 in enumerate((14.0, 17.0))]
    decision = find(MODEL, logs[:1], logs[1], exclude=only("road_grade", "torque_lag", "brake_drag")).decision
    assert decision.verdict is Verdict.COMPOUND
    assert set(decision.winner.ids) == {"road_grade", "torque_lag"}
    assert 0.9 < sum(decision.probability.values()) <= 1.0
    assert decision.probability["brake_drag"] < 0.05


@long
def test_what_the_car_had_before_is_not_the_fault():
    """A baseline with the same effect says that it is how the car is, not what happened to it."""
    heavy = {**FOREIGN_TYRE, "mass_offset": {"mass_kg": 200.0}}
    logs = [driven(heavy, v0, i, 16.0) for i, v0 in enumerate((14.0, 17.0))]
    sound = driven(FOREIGN_TYRE, 15.0, 7, 16.0)
    said = find(MODEL, logs[:1], logs[1], baseline=[sound], exclude=only(*FEW)).decision
    assert "mass_offset" in {key for entry in (said.winner, *said.rivals) for key in entry.ids}
    again = driven(heavy, 15.0, 7, 16.0)
    said = find(MODEL, logs[:1], logs[1], baseline=[again], exclude=only(*FEW)).decision
    assert said.verdict is Verdict.UNKNOWN


def test_a_fault_acts_on_the_logs_and_not_on_the_baseline(stack):
    drive = stack.logs[0][0]
    sound = gather(MODEL, [driven({}, 15.0, 3)])
    both = stack_of(MODEL, gather(MODEL, [drive]), gather(MODEL, [drive]), sound)
    other = both.blocks(MODEL.with_effects(MassOffset(100.0), TorqueGain(0.9)))
    rows = len(block_means(np.zeros((len(sound.drives[0]), 7)), sound.drives[0]))
    np.testing.assert_array_equal(other[-rows:], both.z[-rows:])
    assert np.abs(other[:-rows] - both.z[:-rows]).max() > 1.0


# --- drawn builds


@pytest.mark.long
def test_drawn_cases_can_be_read_and_tell_their_truth(tmp_path):
    truth = write_case(tmp_path, 1, "mass_offset", COURSES[0])
    assert truth["effects"] == ["mass_offset"]
    assert set(truth["fault"]) == {"mass_kg"}
    assert set(SIZES) <= set(EFFECTS)
    said = diagnose_files(
        tmp_path / "vehicle.yaml",
        tmp_path / "road_fit.yaml",
        [str(tmp_path / "fit.csv")],
        f"{tmp_path / 'holdout.csv'}@{tmp_path / 'road_holdout.yaml'}",
        exclude=only("mass_offset", "torque_gain", "friction_offset", "aero_drag"),
    )
    assert said.verdict in (Verdict.PARTIAL, Verdict.AMBIGUOUS, Verdict.IDENTIFIED)
    assert said.causes[0].effect in ("mass_offset", "torque_gain")
    assert sum(said.budget.to_json().values()) == pytest.approx(1.0)
