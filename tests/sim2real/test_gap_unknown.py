"""What no effect explains: free terms name the equation, the quantity, the sign and the shape."""

from dataclasses import replace

import numpy as np
import pytest
from gap_drives import MODEL, clean, noisy, pulses, random_drives, remeasured, road_of, trace
from scipy.sparse import csc_array

from sim2real.observing.drive import ACCEL, SPEED, WHEEL
from sim2real.observing.evidence import gather
from sim2real.result import Measure
from sim2real.where import terms
from sim2real.where.equations import EQUATIONS, OF_THE_MOTION, PER_DRIVE, QUANTITIES
from sim2real.where.terms import Term, explained, finer, fit_terms, refined, score, with_refined
from sim2real.where.unknown import characterise, seen_alone, shape_of, sign_of

EQUATION = {equation.key: equation for equation in EQUATIONS}


def terms_of(*drives):
    held = gather(MODEL, drives)
    return fit_terms(MODEL, held.drives, held.noises, 2)


def curve(quantity, x, y, equation="force"):
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    return Term(EQUATION[equation], quantity, x, y, 10.0, 100.0, len(x), 1000)


# --- found on drives


@pytest.fixture(scope="module")
def dragged():
    """A force that grows with the square of speed, between 3 and 35 m/s."""
    hidden = {"aero_drag": {"drag_area_m2": 1.5}}
    drives = [
        noisy(clean(pulses(10.0) * 1.3, v0, effects=hidden), seed) for seed, v0 in enumerate((6.0, 24.0))
    ]
    return terms_of(*drives)


def test_a_hidden_drag_is_a_force_on_the_car_that_depends_on_speed(dragged):
    found = characterise(dragged)
    assert (found.subsystem, found.depends_on, found.unit) == ("vehicle", "speed", "N")
    assert found.sign == "is negative throughout"
    assert found.share > 0.8
    np.testing.assert_allclose(found.y, -0.5 * 1.2 * 1.5 * found.x**2, atol=60.0)
    assert all(word in found.sentence for word in ("vehicle", "speed", "[m/s]", "negative"))


def test_terms_are_ranked_by_what_they_leave_and_what_they_take(dragged):
    assert [score(t) for t in dragged] == sorted(score(t) for t in dragged)
    assert len(dragged) == sum(len(e.quantities) for e in EQUATIONS)
    assert all(t.loss <= 1.01 * t.null_loss for t in dragged)


def test_a_hidden_scale_of_the_accelerometer_is_found_there():
    drive = noisy(clean(pulses(10.0), 14.0))
    measured = drive.measured.copy()
    measured[:, ACCEL] *= 1.1
    found = characterise(terms_of(remeasured(drive, measured)))
    assert (found.subsystem, found.depends_on) == ("accelerometer", "acceleration")
    assert found.shape in ("is proportional to it", "is a straight line")
    slope = np.polyfit(found.x, found.y, 1)[0]
    assert slope == pytest.approx(0.1, abs=0.015)


def test_a_dead_band_of_the_torque_is_found_at_the_wheels():
    commanded = pulses(12.0)
    band = 25.0
    actual = np.sign(commanded) * np.maximum(np.abs(commanded) - band, 0.0)
    found = characterise(terms_of(noisy(clean(actual, 14.0, commanded_nm=commanded))))
    assert found.subsystem in ("powertrain", "wheel")
    assert found.depends_on in ("torque", "acceleration")
    assert found.sign == "opposes it"
    driving = found.x > 0.5 * found.x.max()
    np.testing.assert_allclose(found.y[driving], -band, atol=8.0)


def test_a_speed_sensor_that_reads_too_much_at_speed_is_found_there():
    drive = noisy(clean(pulses(10.0), 14.0))
    measured = drive.measured.copy()
    measured[:, SPEED] += 0.003 * (measured[:, SPEED] - 10.0) ** 2
    found = characterise(terms_of(remeasured(drive, measured)))
    assert (found.subsystem, found.depends_on) == ("vehicle_speed_sensor", "speed")


def test_a_hill_is_found_in_the_road():
    """A grade that comes after five seconds: neither the car's nor the sensors' quantities tell of it."""
    flat = clean(pulses(10.0), 14.0)
    hilly = clean(pulses(10.0), 14.0, effects={"road_grade": {"grade": 0.04}})
    found = characterise(terms_of(noisy(hilly)))
    assert flat.time_s.size == hilly.time_s.size
    assert found.subsystem == "road"
    assert found.depends_on in ("time", "position")
    assert np.median(found.y) == pytest.approx(-9.81 * 0.04, rel=0.1)


SIZES = trace((0, 0.6), (4, 1.5), (8, 2.5), (12, 1), (16, 2), duration_s=16.0)
"""Of the pulses of `with_share`: other sizes at other speeds."""


def with_share(share, commanded_nm, speeds_m_s):
    """Drives whose motors give a share of the commanded torque that depends on the motion."""
    drives = []
    for seed, v0 in enumerate(speeds_m_s):
        actual = commanded_nm
        for _ in range(5):  # the motion hangs on the torque
            actual = commanded_nm * share(clean(actual, v0, commanded_nm=commanded_nm))[:, None]
        drives.append(noisy(clean(actual, v0, commanded_nm=commanded_nm), seed))
    return drives


def test_motors_that_give_no_more_than_their_power_lack_a_share_of_torque_by_power():
    limit_w = 24e3

    def share(drive):
        power_w = (drive.torque_nm * drive.measured[:, WHEEL]).sum(axis=1)
        return limit_w / np.maximum(power_w, limit_w)

    found = characterise(terms_of(*with_share(share, 1.2 * SIZES * pulses(16.0), (6.0, 14.0, 22.0))))
    assert (found.subsystem, found.depends_on, found.unit) == ("powertrain", "power", "-")
    assert found.share > 0.9
    beyond = found.x > 1.5 * limit_w
    assert beyond.sum() >= 2
    np.testing.assert_allclose(found.y[beyond], limit_w / found.x[beyond] - 1.0, atol=0.06)
    np.testing.assert_allclose(found.y[found.x < 0.8 * limit_w], 0.0, atol=0.06)
    assert all(word in found.sentence for word in ("relative torque correction", "power", "[W]"))


@pytest.mark.long
def test_a_regeneration_that_fades_lacks_a_share_of_torque_where_it_brakes_slowly():
    def share(drive):
        left = np.clip((drive.measured[:, SPEED] - 2.0) / 4.0, 0.0, 1.0)
        return np.where(drive.torque_nm[:, 0] < 0.0, left, 1.0)

    found = characterise(terms_of(*with_share(share, 0.7 * SIZES * pulses(16.0), (3.0, 7.0, 12.0))))
    assert (found.subsystem, found.depends_on, found.unit) == ("powertrain", "driven speed", "-")
    assert found.share > 0.8
    np.testing.assert_allclose(found.y[(found.x > 0.0) | (found.x < -6.5)], 0.0, atol=0.03)
    slow = (found.x < 0.0) & (found.x > -4.0)
    assert slow.any()
    assert (found.y[slow] < -0.5).all()


def test_without_a_gap_no_term_takes_much():
    best = terms_of(noisy(clean(pulses(8.0), 14.0)))[0]
    assert 1.0 - best.loss / best.null_loss < 0.03


def test_a_term_is_fitted_through_a_sliding_wheel_too():
    """Other friction on ice is a term of the tyre."""
    drives = [
        noisy(
            clean(
                pulses(8.0) * 1.5, 14.0, road_of(0.9, 0.35, 0.9, 0.35), {"friction_offset": {"factor": 0.8}}
            )
        )
    ]
    best = terms_of(*drives)[0]
    assert best.equation.subsystem in ("tyre", "powertrain", "wheel", "wheel_speed_sensor")
    assert 1.0 - best.loss / best.null_loss > 0.2


def test_a_great_term_is_known_by_what_the_model_does_with_it():
    """A motor that gives half of its torque, close to sliding: slopes around its absence foretell too little."""
    commanded = 4.0 * pulses(12.0)
    actual = commanded.copy()
    actual[:, 2] *= 0.5
    held = gather(MODEL, [noisy(clean(actual, 14.0, commanded_nm=commanded))])
    terms = fit_terms(MODEL, held.drives, held.noises, 2)
    foretold = next(t for t in terms if t.equation.key == "motor rl")
    best = with_refined(MODEL, held.drives, held.noises, terms, 2)[0]
    assert best.equation.key == "motor rl"
    assert foretold.loss > 0.1 * foretold.null_loss
    assert best.loss < 0.01 * best.null_loss
    np.testing.assert_allclose(best.y, -0.5 * best.x, atol=20.0)


def test_a_term_that_is_small_stays_as_it_was_foretold():
    commanded = pulses(12.0)
    held = gather(MODEL, [noisy(clean(0.99 * commanded, 14.0, commanded_nm=commanded))])
    foretold = fit_terms(MODEL, held.drives, held.noises, 2, equations=[EQUATION["torque"]])[0]
    again = refined(MODEL, held.drives, held.noises, foretold)
    assert again.loss == pytest.approx(foretold.loss, rel=1e-3)
    np.testing.assert_allclose(again.y, foretold.y, atol=0.3)


def test_torque_that_the_axles_share_otherwise_is_found_between_them():
    commanded = pulses(12.0)
    actual = commanded * np.array([0.85, 0.85, 1.15, 1.15])
    held = gather(MODEL, [noisy(clean(actual, 14.0, commanded_nm=commanded))])
    terms = fit_terms(MODEL, held.drives, held.noises, 2)
    found = characterise(terms)
    assert (found.subsystem, terms[0].equation.key) == ("powertrain", "axles")
    np.testing.assert_allclose(found.y, -0.15 * found.x, atol=4.0)


@pytest.mark.parametrize(("subsystem", "at"), [("road", "gravity"), ("vehicle", "force")])
def test_what_sways_within_two_seconds_is_followed_closely(subsystem, at):
    """Waves in the road, or a load that swings: the accelerometer feels the second only."""
    drive = clean(pulses(12.0), 14.0)
    sway = 0.3 * np.sin(2.0 * np.pi * 0.9 * drive.time_s)
    told = np.cumsum(sway) * (drive.time_s[1] - drive.time_s[0])
    measured = drive.measured.copy()
    measured[:, SPEED] += told - told.mean()
    measured[:, WHEEL] += ((told - told.mean()) / MODEL.vehicle.wheel_radius_m)[:, None]
    if at == "force":
        measured[:, ACCEL] += sway
    held = gather(MODEL, [noisy(remeasured(drive, measured))])
    terms = fit_terms(MODEL, held.drives, held.noises, 2)
    assert explained(terms[0]) < 0.5
    close = finer(MODEL, held.drives, held.noises, terms, 2)
    assert (close[0].equation.key, close[0].equation.subsystem) == (at, subsystem)
    assert explained(close[0]) > 0.6


def test_what_is_told_by_a_curve_over_the_motion_is_not_followed_closely(dragged):
    held = gather(MODEL, [noisy(clean(pulses(8.0), 14.0))])
    assert finer(MODEL, held.drives, held.noises, dragged) == dragged


@pytest.mark.parametrize("quantity", ["time", "speed"])
def test_a_curve_of_each_log_is_drawn_for_the_last(quantity):
    drives = [clean(pulses(d), 12.0) for d in (8.0, 12.0)]
    held = gather(MODEL, drives)
    (term,) = fit_terms(
        MODEL, held.drives, held.noises, equations=[EQUATION["force"]], quantities=(quantity,)
    )
    told = characterise([term])
    assert np.all(np.diff(told.x) > 0.0)
    assert len(told.x) == len(told.y) == (len(term.x) if quantity == "speed" else 7)  # 12 s in knots of 2 s
    assert told.y == pytest.approx(term.y[-len(told.y) :])


def test_a_log_whose_gap_is_elsewhere_in_time_shares_no_curve():
    """Curves over time are each log's own, so knots double with the logs."""
    drives = random_drives({}, count=2, seed=4, duration_s=6.0)
    terms = {(t.equation.key, t.quantity): t for t in terms_of(*drives)}
    one = {(t.equation.key, t.quantity): t for t in terms_of(drives[0])}
    assert terms["gravity", "time"].size == 2 * one["gravity", "time"].size
    assert terms["force", "speed"].size == one["force", "speed"].size


def test_a_curve_of_more_values_has_to_leave_less():
    short, long = curve("speed", [1, 2], [1, 1]), curve("time", range(30), np.ones(30))
    assert score(short) < score(long)


def test_what_is_shared_leaves_the_curves_over_time_out():
    held = gather(MODEL, [noisy(clean(pulses(3.0), 14.0))])
    found = fit_terms(MODEL, held.drives, held.noises, 1, quantities=OF_THE_MOTION)
    assert found
    assert not {t.quantity for t in found} & set(PER_DRIVE)


# --- words

X = np.linspace(-2.0, 5.0, 8)


@pytest.mark.parametrize(
    ("y", "words"),
    [
        (np.full(8, -3.0), "is constant"),
        (2.0 * X, "is proportional to it"),
        (-0.3 * X * np.abs(X), "grows with its square"),
        (-4.0 * np.sign(X), "has a constant size and the sign of the quantity"),
        (1.0 + 2.0 * X, "is a straight line"),
        (4.0 - X + 2.0 * X * X, "is a parabola"),
        (np.sin(2.5 * X), "has no simple form"),
    ],
)
def test_shapes_in_words(y, words):
    assert shape_of(curve("torque", X, y)) == words


def test_noise_on_a_curve_does_not_change_its_shape():
    rng = np.random.default_rng(0)
    assert shape_of(curve("torque", X, 2.0 * X + 0.2 * rng.standard_normal(8))) == "is proportional to it"


def test_a_curve_over_time_has_no_shape():
    assert shape_of(curve("time", X, 2.0 * X)) == "varies"


@pytest.mark.parametrize(
    ("quantity", "y", "words"),
    [
        ("speed", np.full(8, 2.0), "is positive throughout"),
        ("speed", np.full(8, -2.0), "is negative throughout"),
        ("torque", -X, "opposes it"),
        ("torque", X, "changes sign"),
        ("speed", -X, "changes sign"),
    ],
)
def test_signs_in_words(quantity, y, words):
    assert sign_of(curve(quantity, X, y)) == words


def test_a_characterised_term_keeps_its_curve():
    found = characterise([curve("speed", X, 2.0 * X), curve("time", X, X)])
    np.testing.assert_array_equal(found.x, X)
    np.testing.assert_array_equal(found.y, 2.0 * X)
    assert found.share == pytest.approx(0.9)
    assert "90 %" in found.sentence


def small_term(taken: float):
    """A tyre's term that takes so much of the misfit."""
    told = curve("slip", [0.0, 0.1], [0.0, 0.1], "tyre")
    return characterise([replace(told, loss=100.0 * (1.0 - taken))])


@pytest.mark.parametrize(
    ("sizes", "taken", "subsystem"),
    [
        ((3.3, 1.0, 1.0), 0.01, "wheel_speed_sensor"),
        ((36.0, 1.3, 2.3), 0.02, "wheel_speed_sensor"),
        ((1.0, 8.0, 1.1), 0.02, "vehicle_speed_sensor"),
        ((0.9, 1.0, 5.0), 0.02, "accelerometer"),
        ((3.3, 1.0, 1.0), 0.4, "tyre"),
        ((2.2, 1.1, 1.3), 0.02, "tyre"),
        ((1.3, 1.0, 1.0), 0.02, "tyre"),
    ],
)
def test_what_one_sensor_alone_shows_and_no_term_explains_is_that_sensors(sizes, taken, subsystem):
    before = Measure(0.0, dict(zip(("wheel_speed", "vehicle_speed", "accel_x"), sizes, strict=True)))
    told = seen_alone(small_term(taken), before)
    assert told.subsystem == subsystem
    assert ("shows the gap" in told.sentence) is (subsystem != "tyre")


def test_every_quantity_has_a_unit_and_every_equation_asks_for_known_ones():
    assert {q for e in EQUATIONS for q in e.quantities} <= set(QUANTITIES)
    assert len({e.key for e in EQUATIONS}) == len(EQUATIONS)


def test_slopes_along_drives_are_what_a_run_for_each_knot_gives(monkeypatch):
    held = gather(MODEL, [noisy(clean(pulses(12.0), 12.0), seed) for seed in range(2)])
    seen = [MODEL.predict(drive) for drive in held.drives]
    free = terms._free(MODEL, held.drives, held.noises, seen, EQUATION["force"], "time")
    z = free.left(np.zeros(len(free.hats)))
    together = free.slopes(z, np.zeros(len(free.hats))).toarray()
    monkeypatch.setattr(terms, "sets_apart", lambda weights, _: [[i] for i in range(len(weights))])
    alone = free.slopes(z, np.zeros(len(free.hats))).toarray()
    assert np.count_nonzero(together) < 0.6 * together.size
    # Runs are told apart after four memories: e^-4 of a slope.
    assert np.abs(together - alone).max() < 0.03 * np.abs(alone).max()


def test_a_sparse_matrix_is_solved_as_the_dense_one_is():
    rng = np.random.default_rng(5)
    dense = np.where(rng.random((400, 7)) < 0.3, rng.normal(size=(400, 7)), 0.0)
    z = rng.normal(size=400) + dense @ np.arange(7.0)
    for a, b in zip(terms._solve(z, csc_array(dense)), terms._solve(z, dense), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9)


def test_a_knot_that_no_row_lies_at_has_no_slope():
    stretch = np.array([1.0, 2.0])
    matrix = terms._columns([[(0, stretch)], [], [(1, stretch), (4, stretch)]], 6).toarray()
    expected = np.array([[1, 2, 0, 0, 0, 0], [0] * 6, [0, 1, 2, 0, 1, 2]], dtype=float).T
    np.testing.assert_array_equal(matrix, expected)
