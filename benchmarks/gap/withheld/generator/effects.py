"""Forms of the effects: readings of what the contract leaves open, each with the edition that it came with.

A form acts only through its effect, is the nominal car where the effect is none, and keeps what a parameter means:
what varies does so about the value that is told. Shares are of the deviation, or of the value, that the effect has.
The first form of each effect is the library's.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import lfilter

from . import falling
from .details import PROFILE_STEP_M, USUAL_RAD_S
from .kernel import COMMAND_STEP_S, GRAVITY
from .library import LIBRARY
from .outside import WIND_S
from .world import AIR_KG_M3, Array, Parameters, World

Apply = Callable[[World, Parameters], World]
Forms = dict[str, tuple[int, Apply]]

HZ = 2.0 * np.pi
MESSAGE_S, AVERAGE_S, LOST = 0.02, 0.04, 0.08
"""From one message of a bus to the next; what a speed sensor averages over; share of messages that is lost."""
TURN_S, EPOCH_S = 0.006, 0.1
"""From the mean to what is read or told last; of a satellite receiver; each no more than the delay."""


def own(effect: str) -> Apply:
    return LIBRARY[effect].apply


def moved(effect: str, **physics: Any) -> Apply:
    """The library's, with some physics more."""
    return lambda world, given: own(effect)(world, given).moved(**physics)


def sensed(effect: str, **sensors: Any) -> Apply:
    """The library's, with some more about the sensors."""
    return lambda world, given: own(effect)(world, given).sensed(**sensors)


def alone(parameter: str, name: str, **physics: Any) -> Apply:
    """A parameter in another place than the library's, with some physics more."""
    return lambda world, given: world.moved(**{name: given[parameter]}, **physics)


def sharing(effect: str, parameter: str, nominal: str | None = None, **shares: float) -> Apply:
    """The library's, and shares of the deviation from the `nominal` physics, or of the parameter itself."""

    def apply(world: World, given: Parameters) -> World:
        more = given[parameter] - (getattr(world.physics, nominal) if nominal else 0.0)
        return own(effect)(world, given).moved(**{name: share * more for name, share in shares.items()})

    return apply


# --- air


def _drag(world: World, given: Parameters, lift: float = 0.0, height: float = 0.0) -> World:
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(drag=drag, lift=lift * drag, drag_height=height)


def _lift_at(front: float) -> Apply:
    """A lift, as a share of the drag, all of it at the front axle (or the rear, if negative): a lift and a moment."""

    def apply(world: World, given: Parameters) -> World:
        wheelbase = world.physics.front_arm + world.physics.rear_arm
        return _drag(world, given, abs(front), 0.5 * front * wheelbase)

    return apply


def _fanning(world: World, given: Parameters) -> World:
    """Of free-rolling wheels, turning as fans with 12 % of the drag, it takes the power that the body's has less."""
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(drag=(1.0 - 0.12) * drag, fanning=0.12 * drag * world.physics.radius**3 / 4.0)


BREEZES = ((1.3, 13.0, 0.7), (0.7, 5.6, 2.1))
"""Of a light wind that turns: size [m/s], period [s], phase."""


def _breeze(world: World, given: Parameters) -> World:
    """A drag in air that itself moves a little, now with the car and now against it."""
    clock = np.arange(0.0, WIND_S, COMMAND_STEP_S)
    wind = sum(size * np.sin(2.0 * np.pi * clock / period + phase) for size, period, phase in BREEZES)
    drag = 0.5 * AIR_KG_M3 * given["drag_area_m2"]
    return world.moved(drag=drag, gust_drag=drag, wind=wind)


AERO_DRAG: Forms = {
    "drag_alone": (3, own("aero_drag")),
    "with_lift": (3, lambda w, g: _drag(w, g, lift=0.3)),  # a saloon's
    "at_height": (3, lambda w, g: _drag(w, g, height=0.6)),  # presses the rear wheels [m]
    "fanning_wheels": (4, _fanning),
    "rear_lift": (4, _lift_at(-0.2)),  # an estate car without a spoiler
    "shutters": (5, moved("aero_drag", drag_fast=-0.06)),  # before the radiator, closed at speed
    "breeze": (5, _breeze),
    "front_lift": (6, _lift_at(0.15)),  # a small car with a blunt nose
    "cross_wind": (6, moved("aero_drag", drag_cross=3.5)),  # a fresh breeze from the side [m/s]
    "in_traffic": (7, moved("aero_drag", drag_wake=0.15)),  # less behind others, more between them
    "less_when_fast": (8, moved("aero_drag", drag_power=-0.08)),  # falls with the Reynolds number
    "sheltered_stretches": (9, moved("aero_drag", drag_shelter=0.15)),  # less between walls or woods
    "nodding": (10, moved("aero_drag", drag_nod=0.1)),  # more of a car that squats
}


def _moment(**physics: float) -> Apply:
    return alone("coefficient", "roll_moment", **physics)


ROLLING_RESISTANCE: Forms = {
    "force_on_body": (1, own("rolling_resistance")),
    "moment_at_wheel": (2, _moment()),
    "grows_with_speed": (3, _moment(roll_growth=0.08)),
    "linear_in_speed": (4, _moment(roll_linear=0.15)),  # more at double speed
    "more_when_wet": (4, _moment(roll_wet=0.2)),
    "coarse_stretches": (5, _moment(roll_texture=0.25)),
    "unlike_axles": (5, _moment(roll_tilt=0.2)),
    "as_on_the_drum": (6, _moment(roll_linear=0.05, roll_growth=0.06, roll_load=-0.1)),
    "unlike_sides": (6, _moment(roll_side=0.15)),  # grit at the road's edge
    "warming": (7, _moment(roll_warm=-0.15)),
    "more_under_torque": (8, _moment(roll_torque=0.1)),  # a tread that creeps, with the square
    "seals_when_slow": (9, _moment(roll_slow=0.4)),
    "flat_spots": (10, _moment(roll_flat=0.3)),  # of a car that has stood for weeks
}

# --- the road's grade


def _noise_along(length_m: float, over_m: float, most: float, seed: int) -> Array:
    """Smooth and of chance, closed in a ring, none on the whole, `most` at most."""
    rows = round(length_m / PROFILE_STEP_M)
    keep = np.exp(-PROFILE_STEP_M / over_m)
    pushes = np.tile(np.random.default_rng(seed).standard_normal(rows), 3)
    wave = lfilter([1.0], [1.0, -2.0 * keep, keep**2], pushes)[-rows:]
    wave -= wave.mean()
    return np.asarray(most * wave / np.abs(wave).max())


def _profile(profile: Array) -> Apply:
    """How much more or less of a grade there is along the road, none on the whole."""
    mean_free = profile - profile.mean()
    return lambda world, given: world.moved(grade=given["grade"], profile=mean_free)


def _through(places_m: tuple[float, ...], shares: tuple[float, ...]) -> Apply:
    return _profile(np.interp(np.arange(0.0, places_m[-1], PROFILE_STEP_M), places_m, shares))


def _waves(*waves: tuple[int, float, float]) -> Apply:
    """Waves in 220 m: number, size, phase."""
    turns = 2.0 * np.pi * np.arange(0.0, 220.0, PROFILE_STEP_M) / 220.0
    return _profile(np.sum([size * np.sin(n * turns + phase) for n, size, phase in waves], axis=0))


def _crests() -> Apply:
    """Crests and sags in 340 m: parabolas, so that the grade goes straight up and down."""
    return _profile(0.35 * (4.0 * np.abs(np.arange(0.0, 1.0, PROFILE_STEP_M / 340.0) - 0.5) - 1.0))


def _slopes(share: float, length_m: float) -> Apply:
    return lambda w, g: w.moved(grade=g["grade"], wave_slope=share * g["grade"], wave_length=length_m)


_SECTIONS_M = (0.0, 35.0, 55.0, 95.0, 115.0, 150.0, 165.0, 205.0, 220.0)
_BRIDGES_M = (0.0, 85.0, 100.0, 125.0, 140.0, 235.0, 250.0, 275.0, 290.0, 385.0)
_BENDS_M = (0.0, 60.0, 75.0, 95.0, 110.0, 180.0, 195.0, 220.0, 235.0, 275.0, 290.0, 310.0, 325.0)
_BENDS = (0.1, 0.1, -0.4, -0.4, 0.1, 0.1, -0.4, -0.4, 0.1, 0.1, -0.4, -0.4, 0.1)
ROAD_GRADE: Forms = {
    "even": (3, own("road_grade")),
    "uneven": (3, _slopes(0.2, 110.0)),
    "sections": (4, _through(_SECTIONS_M, (0.25, 0.25, -0.3, -0.3, 0.2, 0.2, -0.15, -0.15, 0.25))),
    "rolling_country": (4, _waves((1, 0.15, 0.4), (3, 0.12, 1.9), (7, 0.06, 4.1))),
    "crests": (5, _crests()),
    "surveyed": (5, _profile(_noise_along(600.0, 30.0, 0.3, seed=8))),
    # A road that has sunk on either side of a bridge, and over a pipe.
    "bridges": (6, _through(_BRIDGES_M, (0.0, 0.0, 0.4, -0.4, 0.0, 0.0, -0.35, 0.35, 0.0, 0.0))),
    "pass": (6, _through(_BENDS_M, _BENDS)),  # flatter in its bends
    "ever_steeper": (7, _through((0.0, 30.0, 200.0, 240.0, 270.0), (-0.3, -0.3, 0.4, 0.0, -0.3))),
    "settled_slabs": (8, _slopes(0.35, 16.0)),
}

# --- mass, and how loads shift


def payload(behind: float) -> Apply:
    """Behind the centre of gravity by a share of the way to the rear axle: the centre of gravity moves back with it."""

    def apply(world: World, given: Parameters) -> World:
        p = world.physics
        mass = p.mass + given["mass_kg"]
        back = behind * p.rear_arm * given["mass_kg"] / mass
        return world.moved(mass=mass, front_arm=p.front_arm + back, rear_arm=p.rear_arm - back)

    return apply


def _at_height(behind: float, height_m: float, least: float = 0.0) -> Apply:
    """A load above or below the centre of gravity; its height counts only where loads shift at all."""

    def apply(world: World, given: Parameters) -> World:
        loaded = payload(behind)(world, given)
        p = loaded.physics
        up = height_m * given["mass_kg"] / p.mass if p.cog_height > 0.0 else 0.0
        return loaded.moved(cog_height=max(p.cog_height + up, least * p.cog_height))

    return apply


def _sinking(world: World, given: Parameters) -> World:
    """On the rear seats; the tyres below roll on a radius less by a tenth of what they give way (4e-7 m/N)."""
    loaded = payload(0.5)(world, given)
    weight = given["mass_kg"] * GRAVITY
    rear = weight * (world.physics.front_arm + 0.5 * world.physics.rear_arm)
    rear /= world.physics.front_arm + world.physics.rear_arm
    less = 0.5 * 4e-7 * np.array([weight - rear, rear])
    return loaded.moved(radius=world.physics.radius - less.mean(), radius_tilt=0.5 * float(less[1] - less[0]))


def _loose(world: World, given: Parameters) -> World:
    """On the seats, 40 % of it not tied down; what a car has less is nothing that could sway."""
    loaded = payload(0.35)(world, given)
    share = 0.4 * max(given["mass_kg"], 0.0) / loaded.physics.mass
    return loaded.moved(slosh_share=share, slosh_rate=HZ * 1.1)


def _stiffening(world: World, given: Parameters) -> World:
    """The longer contact of a loaded tyre is stiffer, by half of the share that its load is more."""
    p = world.physics
    more = 1.0 + 0.5 * given["mass_kg"] / p.mass
    loaded = payload(0.35)(world, given)
    return loaded.moved(stiffness_drive=p.stiffness_drive * more, stiffness_brake=p.stiffness_brake * more)


def _load_sensitive(world: World, given: Parameters) -> World:
    """Rubber that is pressed harder grips a little less for its load."""
    p = world.physics
    grip = (1.0 + given["mass_kg"] / p.mass) ** -0.12
    loaded = payload(0.35)(world, given)
    return loaded.moved(factor_left=p.factor_left * grip, factor_right=p.factor_right * grip)


def _on_one_side(world: World, given: Parameters) -> World:
    """On the driver's seat, 0.4 m to the left of the middle with half a track of 0.75 m."""
    loaded = payload(0.3)(world, given)
    return loaded.moved(load_side=given["mass_kg"] * 0.4 / (loaded.physics.mass * 0.75))


MASS_OFFSET: Forms = {
    "at_centre": (1, own("mass_offset")),
    "rear_seats": (2, payload(0.5)),
    "boot": (3, payload(0.9)),
    "front_boot": (4, payload(-0.7)),
    "roof": (4, _at_height(0.2, 1.0, least=0.5)),
    "carrier": (5, payload(1.7)),  # behind the car
    "sinking_tyres": (5, _sinking),
    "loose_load": (6, _loose),
    "stiffening_tyres": (6, _stiffening),
    "in_the_floor": (7, _at_height(-0.2, -0.25)),  # a larger battery
    "load_sensitive_tyres": (7, _load_sensitive),
    "on_one_side": (9, _on_one_side),
}


def _height(**physics: float) -> Apply:
    return moved("load_transfer", **physics)


LOAD_TRANSFER: Forms = {
    "at_once": (1, own("load_transfer")),
    "through_springs": (2, _height(pitch_time=0.04)),  # a damped pitch of about 2 Hz, less what links carry
    "links_and_springs": (3, _height(springs_share=1.0 - 0.4, springs_time=0.06)),
    "pitching_body": (3, _height(body_rate=HZ * 2.2)),
    "anti_dive": (4, _height(springs_share=1.0 - 0.4, springs_tilt=0.15, springs_time=0.07)),
    "dives_sooner": (5, _height(pitch_time=0.05, pitch_sign=0.35)),
    "soft_body": (6, _height(body_rate=HZ * 1.4)),
    # The dampers' friction carries 0.6 m/s^2 before the springs move.
    "sticking_dampers": (7, _height(springs_share=1.0, springs_time=0.06, springs_rub=0.6)),
    "jacking_links": (9, _height(height_jack=0.12)),  # lift the body in driving, draw it down in braking
    "springs_with_stops": (10, _height(pitch_time=0.06, pitch_stops=0.8)),
}

# --- wheels


def _rolling_alone(world: World, given: Parameters) -> World:
    """The force keeps its lever: with another pressure a tyre sinks in, its belt's length changes less."""
    return world.moved(radius=given["radius_m"], lever=world.physics.radius / given["radius_m"])


def _other_size(world: World, given: Parameters) -> World:
    """Wheels of another size have another inertia too: by the cube of the radius."""
    p = world.physics
    return world.moved(radius=given["radius_m"], inertia=p.inertia * (given["radius_m"] / p.radius) ** 3.0)


def _radius(**shares: float) -> Apply:
    return sharing("wheel_radius_offset", "radius_m", "radius", **shares)


WHEEL_RADIUS_OFFSET: Forms = {
    "lever_too": (3, own("wheel_radius_offset")),
    "rolling_alone": (3, _rolling_alone),
    "unlike_axles": (4, _radius(radius_tilt=0.25, radius_growth=0.0)),
    "less_at_speed": (4, _radius(radius_tilt=0.0, radius_growth=-0.08)),  # where the belt stretches
    "each_its_own": (5, _radius(radius_side=0.2, radius_tilt=0.1)),  # pressures that nobody has looked at
    "unlike_sides": (6, _radius(radius_sides=0.2)),  # worn by a camber that all roads have
    "other_size": (6, _other_size),
    "warming": (7, _radius(radius_warm=-0.1)),  # pressure comes nearer to what it should be
    "deflecting": (8, _radius(radius_load=0.5)),  # half of it the tyre's deflection
    "less_when_wet": (9, _radius(radius_wet=-0.25)),
    "one_other": (10, _radius(radius_tilt=0.25, radius_side=-0.25, radius_sides=0.25)),  # the right rear one
}


def _rotor(world: World, given: Parameters) -> World:
    """Half of what is more, or is left, is the motor's and turns on a shaft of 55 Hz that gives way a little."""
    rotor = 0.5 * abs(given["inertia_kg_m2"] - world.physics.inertia)
    series = rotor * (given["inertia_kg_m2"] - rotor) / given["inertia_kg_m2"]
    stiffness = max((2.0 * np.pi * 55.0) ** 2 * series, 1.0)
    return world.moved(
        inertia=given["inertia_kg_m2"],
        motor_inertia=rotor,
        shaft_stiffness=stiffness,
        shaft_damping=2.0 * 0.1 * float(np.sqrt(stiffness * series)),
    )


def _inertia(**shares: float) -> Apply:
    return sharing("wheel_inertia_offset", "inertia_kg_m2", "inertia", **shares)


WHEEL_INERTIA_OFFSET: Forms = {
    "all_alike": (3, own("wheel_inertia_offset")),
    "unlike_axles": (3, _inertia(inertia_tilt=0.25)),
    "rotor_on_shaft": (5, _rotor),
    "each_its_own": (5, _inertia(inertia_side=0.2, inertia_tilt=-0.1)),
    "spare_wheel": (7, _inertia(inertia_tilt=-0.3, inertia_side=-0.3, inertia_sides=0.3)),  # the right rear
    "more_at_speed": (9, _inertia(inertia_speed=0.25)),  # a sealant that spreads outward
}

# --- tyres and their friction


def _relaxation(**physics: Any) -> Apply:
    return moved("tyre_relaxation", **physics)


def _partly_at_once(world: World, given: Parameters) -> World:
    """A fifth of the slip acts at once, the rest takes longer: a step of the slip covers the length that is told."""
    return world.moved(relaxation=given["length_m"] / (1.0 - 0.2), relaxation_direct=0.2)


TYRE_RELAXATION: Forms = {
    "slip": (1, own("tyre_relaxation")),
    "force": (2, alone("length_m", "force_relaxation")),
    "with_load": (3, _relaxation(relaxation_load=True)),
    "shrinks_in_sliding": (3, _relaxation(relaxation_shrinks=True)),
    "grows_with_speed": (4, _relaxation(relaxation_speed=0.15)),
    "unlike_axles": (5, _relaxation(relaxation_tilt=0.2)),  # tyres of another size behind
    "partly_at_once": (6, _partly_at_once),
    "warming": (7, _relaxation(relaxation_warm=-0.12)),  # higher pressure
    "let_go_sooner": (9, _relaxation(relaxation_rise=0.2)),
    "each_its_own": (10, _relaxation(relaxation_side=0.2)),
}


def _stiffness(**shares: float) -> Apply:
    return sharing("tyre_stiffness_offset", "stiffness_n", "stiffness_drive", **shares)


def _stiffer_in_driving(sign: float, side: float) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        told, more = given["stiffness_n"], given["stiffness_n"] - world.physics.stiffness_drive
        return world.moved(
            stiffness_drive=told + sign * more,
            stiffness_brake=told - sign * more,
            stiffness_side=side * more,
        )

    return apply


TYRE_STIFFNESS_OFFSET: Forms = {
    "everywhere": (3, own("tyre_stiffness_offset")),
    "with_load": (3, _stiffness(stiffness_load=0.5)),
    "unlike_axles": (4, _stiffness(stiffness_tilt=0.25)),
    "unlike_in_braking": (5, _stiffer_in_driving(0.12, 0.0)),
    "each_its_own": (5, _stiffer_in_driving(0.0, 0.2)),
    "warming": (6, _stiffness(stiffness_warm=0.15, stiffness_speed=0.0)),
    "less_at_speed": (6, _stiffness(stiffness_warm=0.0, stiffness_speed=-0.15)),
    "on_coarse_stretches": (7, _stiffness(stiffness_texture=0.2)),
    "less_when_wet": (8, _stiffness(stiffness_wet=-0.3)),
    "unlike_sides": (10, _stiffness(stiffness_sides=0.2)),  # by wear
}


def _falls(curve: int) -> Apply:
    """By a curve of the kernel's."""
    return moved("friction_falloff", falloff_curve=curve)


def _slow_to_fall(world: World, given: Parameters) -> World:
    """A sliding contact gets warm in 20 ms."""
    rubbing = 0.02 if given["falloff_s_m"] > 0.0 else 0.0
    return own("friction_falloff")(world, given).moved(falloff_time=rubbing)


FRICTION_FALLOFF: Forms = {
    "exponential": (1, own("friction_falloff")),
    "hyperbolic": (2, _falls(falling.HYPERBOLIC)),
    "saturating": (2, _falls(falling.SATURATING)),
    "straight": (3, _falls(falling.STRAIGHT)),
    "power": (3, _falls(falling.POWER)),
    "logarithmic": (4, _falls(falling.LOGARITHMIC)),
    "slow_to_fall": (4, _slow_to_fall),
    "arctangent": (5, _falls(falling.ARCTANGENT)),
    "two_rates": (6, _falls(falling.TWO_RATES)),
    "rooted": (7, _falls(falling.ROOTED)),
    "sooner_when_wet": (8, moved("friction_falloff", falloff_wet=0.3)),
    "line_and_tail": (10, _falls(falling.LINE_AND_TAIL)),
}

_REPAIRS_M = (30.0, 75.0, 110.0, 125.0, 180.0, 240.0, 265.0, 330.0)


def _repaired() -> Array:
    """Repairs, whose friction deviates by half more than the rest's; none on the whole."""
    places = np.arange(0.0, _REPAIRS_M[-1], PROFILE_STEP_M)
    profile = 0.5 * (np.searchsorted(_REPAIRS_M, places, side="right") % 2)
    return np.asarray(profile - profile.mean())


def _grip(effect: str) -> Forms:
    """What a friction that is off everywhere and one that is off on one side have in common."""
    return {
        "everywhere": (3, own(effect)),
        "patchy": (3, moved(effect, patch_depth=0.3)),
        "stretches": (4, moved(effect, stretch_depth=0.3)),
        "blotches": (5, moved(effect, blotches=_noise_along(420.0, 9.0, 0.45, seed=5))),
        "cleared": (5, moved(effect, grip_tilt=0.15)),  # the rear wheels go where the front ones have cleared
        "repairs": (6, moved(effect, blotches=_repaired())),
        "more_at_speed": (6, moved(effect, grip_speed=0.25)),  # the surface's drainage matters more
    }


FRICTION_OFFSET: Forms = {
    **_grip("friction_offset"),
    "drying": (7, moved("friction_offset", grip_warm=-0.2)),
    "more_when_wet": (8, moved("friction_offset", grip_wet=0.15)),
    "more_in_braking": (9, moved("friction_offset", grip_sign=-0.15)),  # by the tread's direction
    "less_under_load": (10, moved("friction_offset", grip_load=-0.3)),  # which presses a film away
}
MU_SPLIT: Forms = {
    **_grip("mu_split"),
    "weaving": (7, moved("mu_split", grip_sway=0.25)),  # more on one side of the lane
    "more_when_wet": (8, moved("mu_split", grip_wet=0.15)),
    "swept_away": (9, moved("mu_split", grip_slide=-0.25)),  # sand
    "thawing": (10, moved("mu_split", grip_warm=-0.25)),
}

# --- motors, brakes and shafts


def _lag(**physics: float) -> Apply:
    return moved("torque_lag", **physics)


def _stages(world: World, given: Parameters) -> World:
    """A fifth of the lag is the motor current's."""
    whole = given["time_constant_s"]
    return world.moved(lag=(1.0 - 0.2) * whole, lag_first=0.2 * whole)


def _in_a_task(world: World, given: Parameters) -> World:
    """A controller hears of a command only in its next cycle of 10 ms, which is part of what looks like a lag."""
    whole = given["time_constant_s"]
    cycle = min(0.01, whole)
    return world.moved(lag=whole - 0.5 * cycle, delay=0.5 * cycle, message=cycle)


def _direct_in_part(world: World, given: Parameters) -> World:
    """A fifth at once; the rest takes longer, so that a step of the torque lacks as much as is told."""
    return world.moved(lag=given["time_constant_s"] / (1.0 - 0.2), lag_direct=0.2)


def _slow_tail(world: World, given: Parameters) -> World:
    """A quarter with twice the mean lag and the rest sooner, as of a caliper whose pads have to give way first."""
    whole = given["time_constant_s"]
    if whole == 0.0:
        return world
    sooner = (1.0 - 0.25 * 2.0) / (1.0 - 0.25)
    return world.moved(lag=sooner * whole, lag_tail=0.25, lag_slow=2.0 * whole)


TORQUE_LAG: Forms = {
    "one_stage": (3, own("torque_lag")),
    "two_stages": (3, _stages),
    "swinging": (4, _lag(lag_damping=0.7)),  # a controlled current; damping over the critical one
    "brakes_later": (4, _lag(lag_sign=-0.25)),
    "unlike_axles": (5, _lag(lag_tilt=0.25)),
    "slower_at_speed": (5, _lag(lag_speed=0.2)),  # the field is weakened
    "let_go_sooner": (6, _lag(lag_rise=0.3)),
    "each_its_own": (6, _lag(lag_side=0.2)),
    "in_a_task": (6, _in_a_task),
    "longer_for_much": (7, _lag(lag_load=0.25)),  # the voltage is what limits
    "partly_at_once": (7, _direct_in_part),
    "gentle_about_zero": (8, _lag(lag_zero=0.5)),  # lets its gears change sides gently
    "less_when_warm": (9, _lag(lag_warm=-0.2)),  # warm oil
    "slow_tail": (10, _slow_tail),
}


def _delay(**shares: float) -> Apply:
    return sharing("torque_delay", "delay_s", **shares)


def _delayed(name: str, seconds: float, factor: float = 1.0, **physics: Any) -> Apply:
    """The library's, with a time that is no longer than the delay, or a multiple of it."""
    return lambda world, given: own("torque_delay")(world, given).moved(
        **{name: min(seconds, factor * given["delay_s"])}, **physics
    )


def _losing(world: World, given: Parameters) -> World:
    """Messages of which some are lost; without those it would be less late."""
    message = min(MESSAGE_S, given["delay_s"])
    return world.moved(delay=given["delay_s"] - LOST * message, message=message, message_lost=LOST)


def _filtered(world: World, given: Parameters) -> World:
    """Late, and in part (8 ms at most) by a filter that spares the gears."""
    lag = min(0.3 * given["delay_s"], 0.008)
    return world.moved(delay=given["delay_s"] - lag, lag=lag)


TORQUE_DELAY: Forms = {
    "shifted": (1, own("torque_delay")),
    "messages": (2, _delayed("message", MESSAGE_S, 2.0)),
    "beating": (3, _delayed("beat", 0.02)),  # two senders whose clocks differ
    "joined_messages": (4, _delayed("message", MESSAGE_S, message_joined=True)),
    "loaded_bus": (4, _delayed("wait", 0.02)),
    "unlike_axles": (5, _delay(delay_tilt=0.1)),
    "losing_messages": (5, _losing),
    "longer_in_braking": (6, _delay(delay_sign=0.15)),
    "smoothed": (6, _filtered),
    "in_turn": (7, _delayed("delay_turn", TURN_S)),
    "queue": (8, _delay(delay_jump=0.15)),
    "older_when_slow": (9, _delay(delay_speed=0.2)),  # a motor's own turn
    "ever_later": (10, _delay(delay_warm=0.15)),  # a controller has more and more to do
}


def _gain(**physics: float) -> Apply:
    return moved("torque_gain", **physics)


def _gains(*shares: float) -> Apply:
    """Each motor's own, front left and right and rear left and right; the mean is as told."""
    return lambda world, given: world.moved(gain=1.0 + (given["factor"] - 1.0) * np.array(shares))


TORQUE_GAIN: Forms = {
    "all_alike": (3, own("torque_gain")),
    "unlike_axles": (3, _gains(1.15, 1.15, 0.85, 0.85)),
    "unlike_in_braking": (4, _gain(gain_sign=0.2)),
    "less_at_speed": (4, _gain(gain_speed=-0.2)),
    "unlike_sides": (5, _gains(1.2, 0.8, 1.2, 0.8)),
    "saturating": (5, _gain(gain_load=-0.2)),  # iron, at double torque
    "each_its_own": (6, _gains(1.25, 0.95, 0.85, 0.95)),
    "warming": (6, _gain(gain_warm=0.15)),  # magnets
    "by_map": (7, _gain(gain_map=0.12)),  # between the points of a torque map
    "hunting": (8, _gain(gain_sway=0.15)),  # the estimate of the motor's flux
    "over_a_turn": (9, _gain(gain_turn=0.2)),  # a rotor's angle is read a little off
    "with_power": (10, _gain(gain_power=0.15)),  # the battery's voltage sags
}


def _pads(*shares: float) -> Apply:
    """Each wheel's share of the drag, the mean is as told."""
    return moved("brake_drag", brake_share=np.array(shares))


BRAKE_DRAG: Forms = {
    "even": (3, own("brake_drag")),
    "pulsating": (3, moved("brake_drag", brake_pulse=0.4)),  # over a turn of a disc that wobbles
    "unlike_axles": (3, _pads(0.75, 0.75, 1.25, 1.25)),
    "each_its_own": (4, _pads(1.3, 0.8, 1.1, 0.8)),
    "knocked_back": (5, moved("brake_drag", brake_release=0.25)),  # less at double speed
    "hand_brake": (6, _pads(0.3, 0.3, 1.7, 1.7)),
    "warming": (7, moved("brake_drag", brake_warm=0.2)),
    "one_circuit": (8, _pads(1.6, 0.4, 0.4, 1.6)),
    "less_when_wet": (9, moved("brake_drag", brake_wet=-0.25)),
    "shaken_free": (10, moved("brake_drag", brake_texture=-0.25)),  # on coarse asphalt
}


def _shaft(**physics: float) -> Apply:
    return moved("driveline_compliance", **physics)


def _at_motor(world: World, given: Parameters) -> World:
    """The speed is that of the motor's own sensor; where nothing gives way, it is the wheel's."""
    shafts = own("driveline_compliance")(world, given)
    return shafts.sensed(wheel_at_motor=given["motor_inertia_kg_m2"] > 0.0)


DRIVELINE_COMPLIANCE: Forms = {
    "shafts": (4, own("driveline_compliance")),
    "with_play": (4, _shaft(shaft_play=0.0035)),  # half of it [rad]
    "unequal_shafts": (4, _shaft(shaft_tilt=0.2)),  # a short left one is the stiffer one
    "rubbing_joints": (5, _shaft(shaft_friction=1.5)),  # [N m]
    "unlike_axles": (5, _shaft(shaft_axles=0.15)),
    "rubber_joints": (6, _shaft(shaft_rise=0.25)),  # stiffen from rest to a large torque
    "read_at_motor": (7, _at_motor),
    "softer_in_braking": (8, _shaft(shaft_sign=0.15)),  # mounts
    "bent_joints": (9, _shaft(shaft_turn=0.15)),  # twice in a turn
    "warming_rubber": (10, _shaft(shaft_warm=-0.12)),
}

# --- sensors


def _late(sensor: str, *names: str, seconds: float, factor: float = 1.0, **more: Any) -> Apply:
    """A delay, and times with these names that last so long, but no longer than `factor` of it."""

    def apply(world: World, given: Parameters) -> World:
        lasting = min(seconds, factor * given["delay_s"])
        told = dict.fromkeys((f"{sensor}_{name}_s" for name in names), lasting)
        others = {f"{sensor}_{name}": value for name, value in more.items()}
        return world.sensed(**{f"{sensor}_delay_s": given["delay_s"]}, **told, **others)

    return apply


def _later(sensor: str, name: str, share: float) -> Apply:
    """A delay of which a share is another."""
    return lambda world, given: world.sensed(
        **{f"{sensor}_delay_s": given["delay_s"], f"{sensor}_{name}_s": share * given["delay_s"]}
    )


def _sensor_losing(sensor: str) -> Apply:
    def apply(world: World, given: Parameters) -> World:
        message = min(MESSAGE_S, given["delay_s"])
        waiting = LOST / (1.0 - LOST) * message
        told = {"delay_s": given["delay_s"] - waiting, "message_s": message, "lost": LOST}
        return world.sensed(**{f"{sensor}_{name}": value for name, value in told.items()})

    return apply


def _smoothed(sensor: str) -> Apply:
    """As a filter in part, of half of the delay at most."""
    return _late(sensor, "filter", seconds=0.02, factor=0.5)


def _averaged_twice(world: World, given: Parameters) -> World:
    """A mean that another device takes the mean of; no longer than the delay, so that neither sees ahead."""
    delay = given["delay_s"]
    return world.sensed(
        speed_delay_s=delay, speed_average_s=min(AVERAGE_S, delay), speed_average_twice=delay > 0.0
    )


def _sensor_delays(effect: str, sensor: str) -> Forms:
    """What a wheel's speed and the car's have in common."""
    return {
        "shifted": (1, own(effect)),
        "averaged": (2, _late(sensor, "average", seconds=AVERAGE_S)),
        "messages": (2, _late(sensor, "message", seconds=MESSAGE_S, factor=2.0)),
        "beating": (3, _late(sensor, "beat", seconds=0.02)),
        "joined_messages": (3, _late(sensor, "message", seconds=MESSAGE_S, factor=2.0, joined=True)),
        "loaded_bus": (4, _late(sensor, "wait", seconds=0.02)),
        "smoothed": (4, _smoothed(sensor)),
    }


WHEEL_SPEED_DELAY: Forms = {
    **_sensor_delays("wheel_speed_delay", "wheel"),
    "in_turn": (5, _late("wheel", "turn", seconds=TURN_S)),
    "losing_messages": (5, _sensor_losing("wheel")),
    "unlike_axles": (6, _later("wheel", "axles", 0.1)),
    "older_when_slow": (6, _later("wheel", "paced", 0.3)),  # a part goes with the distance covered
    "queue": (7, _later("wheel", "queue", 0.15)),  # a gateway's holds one more
    "smoothed_twice": (8, _late("wheel", "filter", seconds=0.015, factor=0.4, filter_twice=True)),
    "median": (9, _late("wheel", "median", seconds=0.05, factor=2.0)),
    "means": (10, _late("wheel", "average", "message", seconds=0.03)),
}
VEHICLE_SPEED_DELAY: Forms = {
    **_sensor_delays("vehicle_speed_delay", "speed"),
    "epochs": (5, _late("speed", "average", "message", seconds=EPOCH_S)),
    "losing_messages": (5, _sensor_losing("speed")),
    "older_when_slow": (6, _later("speed", "paced", 0.3)),  # a sensor's grid
    "averaged_twice": (7, _averaged_twice),
    "joined_epochs": (8, _late("speed", "message", seconds=EPOCH_S, joined=True)),
    "extrapolated_epochs": (9, _late("speed", "message", seconds=EPOCH_S, extrapolated=True)),
    "fitted_line": (10, _late("speed", "fitted", seconds=0.2, factor=2.0)),  # through places
}


def _counter(**sensors: Any) -> Apply:
    return sensed("wheel_speed_quantisation", **sensors)


def _late_task(world: World, given: Parameters) -> World:
    """Windows that end sooner, by a tenth and the time of a pulse at most, so that the pulses are what shows."""
    pulses = USUAL_RAD_S * given["teeth"] * given["window_s"] / (2.0 * np.pi)
    return _counter(wheel_window_jitter=min(0.1, 1.0 / max(pulses, 1.0)))(world, given)


WHEEL_SPEED_QUANTISATION: Forms = {
    "window_by_window": (1, own("wheel_speed_quantisation")),
    "running_window": (2, _counter(wheel_window_runs=True)),
    "shared_windows": (3, _counter(wheel_window_shared=True)),
    "uneven_teeth": (3, _counter(wheel_uneven=0.4)),  # a tone wheel off its centre [teeth]
    "overlapping_windows": (4, _counter(wheel_window_parts=4)),
    "late_flanks": (4, _counter(wheel_flanks=0.25)),  # every second one [teeth]
    "late_task": (5, _late_task),
    "scattered_teeth": (5, _counter(wheel_scatter=0.1)),
    "every_second_window": (6, _counter(wheel_window_parts=0.5)),  # the bus is slower than the counter
    "shaking_sensor": (7, _counter(wheel_shakes=0.3)),  # as the wheel hops [teeth]
    "longer_when_slow": (8, _counter(wheel_window_slow=0.4)),  # two windows below this share of usual pulses
    "halved_when_fast": (10, _counter(wheel_halves_rad_s=USUAL_RAD_S)),  # every second pulse is handed on
}


def _scale(**sensors: float) -> Apply:
    return sensed("vehicle_speed_scale", **sensors)


VEHICLE_SPEED_SCALE: Forms = {
    "steady": (3, own("vehicle_speed_scale")),
    "swaying": (3, _scale(speed_sway=0.12)),
    "grows_with_speed": (4, _scale(speed_scale_growth=0.15)),
    "with_pitch": (4, _scale(speed_scale_pitch=0.04)),  # [1/(m/s^2)]
    "on_coarse_stretches": (5, _scale(speed_scale_grain=0.15)),
    "warming": (5, _scale(speed_scale_warming=0.12)),
    "in_jumps": (6, _scale(speed_scale_jumps=0.12)),  # from one lock to the next
    "wandering": (7, _scale(speed_scale_wander=0.2)),
    "by_table": (8, _scale(speed_scale_table=0.15)),  # between a calibration's points
    "shaking_bracket": (9, _scale(speed_scale_mount=0.3)),
    "over_waves": (10, _scale(speed_scale_waves=0.2)),  # the body goes up and down with the road
}


def _bias(**sensors: float) -> Apply:
    return sensed("accelerometer_bias", **sensors)


def _tilted(world: World, given: Parameters) -> World:
    """A bias that is gravity's: the sensor is mounted askew, and reads a little less of all else."""
    lean = min(abs(given["bias_m_s2"]) / GRAVITY, 1.0)
    return world.sensed(accel_bias_m_s2=given["bias_m_s2"], accel_scale=float(np.sqrt(1.0 - lean**2)))


ACCELEROMETER_BIAS: Forms = {
    "steady": (3, own("accelerometer_bias")),
    "warming": (3, _bias(accel_warming=0.1)),
    "with_vibration": (4, _bias(accel_bias_growth=0.2)),
    "tilted": (5, _tilted),
    "wandering": (5, _bias(accel_wander=0.25)),
    "on_coarse_stretches": (6, _bias(accel_bias_grain=0.2)),
    "remembering": (7, _bias(accel_bias_memory=0.2)),  # more after one direction than the other
    "aired": (8, _bias(accel_bias_aired=0.2)),  # less after a while in the air stream
    "in_jumps": (9, _bias(accel_bias_jumps=0.2)),  # a beam goes from one stress to another
    "with_a_fan": (10, _bias(accel_bias_fan=0.2)),
}

EFFECT_FORMS: dict[str, Forms] = {
    "rolling_resistance": ROLLING_RESISTANCE,
    "mass_offset": MASS_OFFSET,
    "load_transfer": LOAD_TRANSFER,
    "tyre_relaxation": TYRE_RELAXATION,
    "friction_falloff": FRICTION_FALLOFF,
    "torque_delay": TORQUE_DELAY,
    "wheel_speed_delay": WHEEL_SPEED_DELAY,
    "wheel_speed_quantisation": WHEEL_SPEED_QUANTISATION,
    "vehicle_speed_delay": VEHICLE_SPEED_DELAY,
    "aero_drag": AERO_DRAG,
    "road_grade": ROAD_GRADE,
    "wheel_radius_offset": WHEEL_RADIUS_OFFSET,
    "wheel_inertia_offset": WHEEL_INERTIA_OFFSET,
    "tyre_stiffness_offset": TYRE_STIFFNESS_OFFSET,
    "friction_offset": FRICTION_OFFSET,
    "torque_lag": TORQUE_LAG,
    "torque_gain": TORQUE_GAIN,
    "brake_drag": BRAKE_DRAG,
    "vehicle_speed_scale": VEHICLE_SPEED_SCALE,
    "accelerometer_bias": ACCELEROMETER_BIAS,
    "mu_split": MU_SPLIT,
    "driveline_compliance": DRIVELINE_COMPLIANCE,
}
