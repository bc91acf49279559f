#include "common.h"

#include <math.h>
#include <string.h>

static const double INITIAL_SLOPE = INITIAL_SLOPE_OF_THE_TYRE;

bool settings_good(const EstimatorConfig *config, Text *problem)
{
    const Vehicle *car = &config->vehicle;
    const Partition *sets = &config->gains.difference_sets;
    if (!(0.0 < car->cog_to_rear_axle_m && car->cog_to_rear_axle_m < car->wheelbase_m)) {
        add(problem, "cog_to_rear_axle_m is ");
        add_short(problem, car->cog_to_rear_axle_m);
        add(problem, "; expected less than wheelbase_m (");
        add_short(problem, car->wheelbase_m);
        add(problem, ") and more than 0: the centre of gravity lies between the axles.");
        return false;
    }
    if (!(sets->small < sets->medium && sets->medium < sets->big)) {
        add(problem, "Fuzzy sets lie at ");
        add_short(problem, sets->small);
        add(problem, ", ");
        add_short(problem, sets->medium);
        add(problem, ", ");
        add_short(problem, sets->big);
        add(problem, "; expected S below M below B.");
        return false;
    }
    return true;
}

opt_double optional(double value, bool *connected)
{
    if (!isfinite(value))
        return (opt_double){true, value};
    *connected = *connected || value != 0.0;
    return *connected ? (opt_double){true, value} : (opt_double){false, 0.0};
}

void begin_wheel(OneWheel *wheel, const EstimatorConfig *config)
{
    memset(wheel, 0, sizeof *wheel);
    wheel->config = *config;
    wheel_step_wheel_setup(&wheel->known, config);
    wheel_step_first_state(&wheel->state, config, &wheel->known);
    wheel_step_first_estimate(&wheel->last, config, &wheel->known, &wheel->state);
    Rates_at(&wheel->rates, config, 0.0, 0.0);
}

Unusable step_wheel(OneWheel *wheel, double step_s, Sensors *sensors, opt_RoadClass road_class, bool failed)
{
    const EstimatorConfig *config = &wheel->config;
    Frame frame = {road_class.has || failed, {false, {Surface_DRY, 0.0, false, 0.0}}};
    if (road_class.has)
        frame.seen = (opt_Outcome){true, wheel_step_outcome_of(config, road_class.value, wheel->state.time_s)};
    const Unusable reason = wheel_step_unusable_input(config, step_s, sensors, road_class);
    Estimate estimate;
    if (reason == Unusable_NOTHING) {
        Rates rates;
        wheel_step_rates_of(&rates, &wheel->rates, config, step_s, wheel->state.step_s);
        wheel->rates = rates;
        wheel_step_stepped(
            &estimate, &wheel->state, &wheel->last, config, &wheel->known, &wheel->rates, sensors, frame, step_s);
    } else {
        wheel_step_held(&estimate, &wheel->state, &wheel->last, config, &wheel->known, sensors, frame, step_s);
    }
    wheel->last = estimate;
    return reason;
}

bool class_good(Text *why, const char *name, int road_class, const char *confidence_name, double confidence)
{
    bool good = true;
    if (road_class < NO_ROAD_CLASS || road_class > Surface_SNOW_ICE) {
        add(why, why->length ? "; " : "");
        add(why, name);
        add(why, " is ");
        add_int(why, road_class);
        add(why, ", expected -1 (none), 0 (dry), 1 (wet) or 2 (snow or ice)");
        good = false;
    }
    if (road_class != NO_ROAD_CLASS && !(0.0 <= confidence && confidence <= 1.0)) {
        add(why, why->length ? "; " : "");
        add(why, confidence_name);
        add(why, " is ");
        add_number(why, confidence);
        add(why, ", expected 0 to 1");
        good = false;
    }
    return good;
}

/* A reading, and its greatest size. */
typedef struct {
    const char *name;
    bool has;
    double value, most;
} Read;

static void readings_of(const Sensors *sensors, Read readings[PARTS])
{
    const opt_double load = sensors->vertical_load_n, yaw = sensors->yaw_rate_rad_s;
    const opt_double acceleration = sensors->longitudinal_acceleration_m_s2;
    readings[0] = (Read){"wheel_speed_rad_s", true, sensors->wheel_speed_rad_s, MOST_wheel_speed_rad_s};
    readings[1] = (Read){"wheel_torque_nm", true, sensors->wheel_torque_nm, MOST_wheel_torque_nm};
    readings[2] = (Read){"vehicle_speed_m_s", true, sensors->vehicle_speed_m_s, MOST_vehicle_speed_m_s};
    readings[3] = (Read){"vertical_load_n", load.has, load.value, MOST_vertical_load_n};
    readings[4] = (Read){"steering_angle_rad", true, sensors->steering_angle_rad, MOST_steering_angle_rad};
    readings[5] = (Read){"longitudinal_acceleration_m_s2", acceleration.has, acceleration.value,
        MOST_longitudinal_acceleration_m_s2};
    readings[6] = (Read){"yaw_rate_rad_s", yaw.has, yaw.value, MOST_yaw_rate_rad_s};
}

static bool bad(const Read *reading)
{
    return reading->has && !(fabs(reading->value) <= reading->most);
}

unsigned implausible(const Sensors *sensors)
{
    Read readings[PARTS];
    unsigned which = 0;
    readings_of(sensors, readings);
    for (unsigned k = 0; k < PARTS; k++)
        which |= bad(&readings[k]) ? 1u << k : 0u;
    return which;
}

static void add_readings(Text *text, const Sensors *sensors)
{
    Read readings[PARTS];
    bool first = true;
    readings_of(sensors, readings);
    for (int k = 0; k < PARTS; k++) {
        if (!bad(&readings[k]))
            continue;
        add(text, first ? "" : "; ");
        add(text, readings[k].name);
        add(text, " is ");
        add_short(text, readings[k].value);
        add(text, ", expected a number within +-");
        add_short(text, readings[k].most);
        first = false;
    }
    add(text, ". Check the signal's source and unit.");
}

void add_unusable(Text *text, Unusable reason, const Sensors *sensors)
{
    if (reason == Unusable_READING) {
        add_readings(text, sensors);
    } else if (reason == Unusable_LOAD) {
        add(text, "vertical_load_n is ");
        add_short(text, sensors->vertical_load_n.value);
        add(text, ": a wheel without load has no friction to estimate.");
    } else if (reason == Unusable_ROLLING_BACK) {
        add(text, "The car rolls backwards: the camera looks the other way, and the estimate is held.");
    } else {
        add(text, "The wheel turns backwards while the car drives forwards; check the sign of wheel_speed_rad_s.");
    }
}

static bool add_implausible(Text *text, const OneWheel *wheel, const char *what)
{
    if (!messages_is_implausible(&wheel->state.robust, &wheel->known.robust, wheel->known.static_load_n))
        return false;
    add(text, what);
    add(text, ": the measured wheel torque or a speed is wrong, or vehicle.yaml.");
    return true;
}

bool add_tyres(Text *text, const OneWheel *wheel)
{
    const RobustState *state = &wheel->state.robust;
    const RobustSetup *known = &wheel->known.robust;
    const double load_n = wheel->known.static_load_n;
    const opt_double learnt_n = messages_learnt_stiffness_n(state, known, load_n);
    if (!learnt_n.has)
        return false;
    add(text, wheel->config.front_axle ? "Front" : "Rear");
    if (add_implausible(text, wheel, " tyres are further from the expected curve than any tyre"))
        return true;
    add(text, " tyres do not follow the expected curve: slip stiffness estimated ");
    add_fixed(text, 1e-3 * learnt_n.value, 0, false);
    add(text, " kN per unit slip at ");
    add_fixed(text, 1e-3 * load_n, 1, false);
    add(text, " kN load, expected ");
    add_fixed(text, 1e-3 * (INITIAL_SLOPE * known->wheel.stiffness_n), 0, false);
    add(text, " kN (");
    add_short(text, INITIAL_SLOPE);
    add(text, " C_x). Use TRPAC_low and TRPAC_high, and adjust tyre.longitudinal_stiffness_n in vehicle.yaml.");
    return true;
}

bool add_wheels(Text *text, const OneWheel *wheel)
{
    const RobustState *state = &wheel->state.robust;
    const RobustSetup *known = &wheel->known.robust;
    const double told_m = known->wheel.radius_m;
    const opt_double offset = messages_learnt_offset(state);
    if (!offset.has)
        return false;
    add(text, wheel->config.front_axle ? "Front" : "Rear");
    if (add_implausible(text, wheel, " wheels slip without force, which no radius explains"))
        return true;
    add(text, " wheels do not have the expected radius: slip without force estimated ");
    add_fixed(text, 100.0 * offset.value, 1, true);
    add(text, " %, as of a radius of ");
    add_fixed(text, told_m * (1.0 - offset.value), 4, false);
    add(text, " m, expected ");
    add_fixed(text, told_m, 4, false);
    add(text, " m. Adjust wheel_radius_m in vehicle.yaml.");
    return true;
}

bool state_sound(const EstimatorState *state)
{
    const PreviewState *stamps = &state->preview;
    const int most = (int)(sizeof stamps->surface / sizeof stamps->surface[0]);
    const ClassUnderWheel *seen = &state->robust.memory;
    if (stamps->first < 0 || stamps->first >= most || stamps->count < 0 || stamps->count > most)
        return false;
    for (int k = 0; k < most; k++)
        if (stamps->surface[k] < Surface_DRY || stamps->surface[k] > Surface_SNOW_ICE)
            return false;
    return seen->last >= -1 && seen->last <= Surface_SNOW_ICE && seen->stood >= -1
        && seen->stood <= Surface_SNOW_ICE;
}
