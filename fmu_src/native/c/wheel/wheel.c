/* The unit of one wheel: its inputs as the estimator's sensors and frames, and what it tells. */
#include "unit.h"

#include <math.h>
#include <string.h>

static const double INITIAL_SLOPE = INITIAL_SLOPE_OF_THE_TYRE;

void settings_of(const Memory *memory, EstimatorConfig *settings);
extern const EstimatorConfig DEFAULT_SETTINGS;

/* What the parts of the settings refuse beyond the bounds of each. */
static bool settings_good(const EstimatorConfig *config, Text *problem)
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

bool unit_initialise(Unit *unit, Text *problem)
{
    Inner *inner = &unit->memory.inner;
    EstimatorConfig config = DEFAULT_SETTINGS;
    settings_of(&unit->memory, &config);
    if (!settings_good(&config, problem))
        return false;
    memset(inner, 0, sizeof *inner);
    inner->config = config;
    wheel_step_wheel_setup(&inner->known, &inner->config);
    wheel_step_first_state(&inner->state, &inner->config, &inner->known);
    wheel_step_first_estimate(&inner->last, &inner->config, &inner->known, &inner->state);
    Rates_at(&inner->rates, &inner->config, 0.0, 0.0);
    return true;
}

void unit_clear_volatile(Memory *memory)
{
    memory->integer[AT_image_base_lo] = memory->integer[AT_image_base_hi] = memory->integer[AT_image_size] = 0;
}

bool unit_sound(const Memory *memory)
{
    const Inner *inner = &memory->inner;
    const PreviewState *stamps = &inner->state.preview;
    const int most = (int)(sizeof stamps->surface / sizeof stamps->surface[0]);
    const ClassUnderWheel *seen = &inner->state.robust.memory;
    if (!memory->ready)
        return true;
    if (stamps->first < 0 || stamps->first >= most || stamps->count < 0 || stamps->count > most)
        return false;
    for (int k = 0; k < most; k++)
        if (stamps->surface[k] < Surface_DRY || stamps->surface[k] > Surface_SNOW_ICE)
            return false;
    for (int k = 0; k < STRINGS; k++)
        if (memory->string[k][STRING_SIZE - 1])
            return false;
    return seen->last >= -1 && seen->last <= Surface_SNOW_ICE && seen->stood >= -1
        && seen->stood <= Surface_SNOW_ICE && !inner->path[STRING_SIZE - 1];
}

/* An input that is connected from its first finite value other than 0. */
static opt_double optional(double value, bool *connected)
{
    if (!isfinite(value))
        return (opt_double){true, value};
    *connected = *connected || value != 0.0;
    return *connected ? (opt_double){true, value} : (opt_double){false, 0.0};
}

/* The inputs as the estimator's sensors; in a curve the speed is that of the wheel's contact. */
static Sensors sensors_of(Memory *memory)
{
    const double *real = memory->real;
    Inner *inner = &memory->inner;
    const EstimatorConfig *config = &inner->config;
    double speed = real[AT_vehicle_speed];
    const double steering = real[AT_steering_angle];
    const opt_double yaw = optional(real[AT_yaw_rate], &inner->yaw_connected);
    if (steering != 0.0 || (yaw.has && yaw.value != 0.0)) {
        const double4 speeds = local_speed_local_speeds(config->vehicle, speed, steering, yaw);
        speed = speeds.at[(config->front_axle ? 0 : 2) + (config->left_side ? 0 : 1)];
    }
    return (Sensors){real[AT_wheel_speed], real[AT_wheel_torque], speed,
        optional(real[AT_vertical_load], &inner->load_connected), steering,
        optional(real[AT_longitudinal_acceleration], &inner->acceleration_connected), yaw};
}

static bool in_memory(const Memory *memory)
{
    const int *integer = memory->integer;
    return integer[AT_image_size] != 0 && (integer[AT_image_base_lo] != 0 || integer[AT_image_base_hi] != 0);
}

/* Whether a class by bus cannot be used, and why. */
static bool class_bad(int road_class, double confidence, Text *why)
{
    bool bad = false;
    if (road_class < NO_ROAD_CLASS || road_class > Surface_SNOW_ICE) {
        add(why, "road_class is ");
        add_int(why, road_class);
        add(why, ", expected -1 (none), 0 (dry), 1 (wet) or 2 (snow or ice)");
        bad = true;
    }
    if (!(0.0 <= confidence && confidence <= 1.0)) {
        add(why, bad ? "; " : "");
        add(why, "road_class_confidence is ");
        add_number(why, confidence);
        add(why, ", expected 0 to 1");
        bad = true;
    }
    add(why, ".");
    return bad;
}

/* The class of this step where it is new: a changed path or frame number is a new frame; without numbers each picture
   in memory is one, and so is each step with a class by bus, because a bus signal holds its value. */
static opt_RoadClass next_class(Unit *unit)
{
    const Memory *memory = &unit->memory;
    Inner *inner = &unit->memory.inner;
    const int road_class = memory->integer[AT_road_class], frame_id = memory->integer[AT_frame_id];
    const char *path = memory->string[AT_image_path];
    const opt_RoadClass none = {false, {Surface_DRY, 0.0}};
    FrameSource source = path[0] ? FROM_PATH : FROM_NOTHING;
    if (memory->boolean[AT_image_buffers_enabled] && in_memory(memory))
        source = FROM_BUFFER;
    if (road_class != NO_ROAD_CLASS)
        source = FROM_BUS;
    if (source == FROM_NOTHING) {
        /* A picture in memory is set for one step only, so its absence now does not end the frame. */
        const bool stays = inner->source == FROM_BUFFER
            || (inner->source == FROM_NOTHING && inner->frame_id == frame_id);
        inner->path[0] = '\0';
        if (!stays) {
            inner->source = FROM_NOTHING;
            inner->frame_id = frame_id;
        }
        return none;
    }
    const bool by_path = source == FROM_PATH;
    const bool same = by_path ? strcmp(path, inner->path) == 0 : source == inner->source;
    if (same && frame_id == inner->frame_id && (by_path || frame_id != 0))
        return none;
    inner->source = source;
    inner->frame_id = frame_id;
    inner->frame_failed = false;
    if (by_path)
        memcpy(inner->path, path, STRING_SIZE);
    Text text = {0, ""};
    add(&text, MODEL ": ");
    if (source == FROM_BUS) {
        const double confidence = memory->real[AT_road_class_confidence];
        if (!class_bad(road_class, confidence, &text))
            return (opt_RoadClass){true, {(Surface)road_class, confidence}};
        inner->frame_failed = true;
        tell(unit, &unit->told[FRAME_CLASS], fmi2Warning, text.text);
        return none;
    }
    inner->frame_failed = true;
    add(&text, "it reads no pictures, as it needs nothing of its host: give the class of the road by road_class and "
               "road_class_confidence, or take the unit with the networks in it.");
    tell(unit, &unit->told[FRAME_PICTURE], fmi2Warning, text.text);
    return none;
}

/* Tell of readings that are no road car's, each set of them once. */
static void tell_readings(Unit *unit, const Sensors *sensors)
{
    const struct {
        const char *name;
        bool has;
        double value, most;
    } readings[PARTS] = {
        {"wheel_speed_rad_s", true, sensors->wheel_speed_rad_s, MOST_wheel_speed_rad_s},
        {"wheel_torque_nm", true, sensors->wheel_torque_nm, MOST_wheel_torque_nm},
        {"vehicle_speed_m_s", true, sensors->vehicle_speed_m_s, MOST_vehicle_speed_m_s},
        {"vertical_load_n", sensors->vertical_load_n.has, sensors->vertical_load_n.value, MOST_vertical_load_n},
        {"steering_angle_rad", true, sensors->steering_angle_rad, MOST_steering_angle_rad},
        {"longitudinal_acceleration_m_s2", sensors->longitudinal_acceleration_m_s2.has,
            sensors->longitudinal_acceleration_m_s2.value, MOST_longitudinal_acceleration_m_s2},
        {"yaw_rate_rad_s", sensors->yaw_rate_rad_s.has, sensors->yaw_rate_rad_s.value, MOST_yaw_rate_rad_s},
    };
    unsigned which = 0;
    Text text = {0, ""};
    add(&text, MODEL ": ");
    for (int k = 0; k < PARTS; k++) {
        if (!readings[k].has || fabs(readings[k].value) <= readings[k].most)
            continue;
        add(&text, which ? "; " : "");
        add(&text, readings[k].name);
        add(&text, " is ");
        add_short(&text, readings[k].value);
        add(&text, ", expected a number within +-");
        add_short(&text, readings[k].most);
        which |= 1u << k;
    }
    add(&text, ". Check the signal's source and unit.");
    tell(unit, &unit->told_parts[which], fmi2Warning, text.text);
}

static void tell_unusable(Unit *unit, Unusable reason, double step_s, const Sensors *sensors)
{
    enum { LOAD_PART = 1 << 3 };
    Text text = {0, ""};
    if (reason == Unusable_READING) {
        tell_readings(unit, sensors);
        return;
    }
    add(&text, MODEL ": ");
    bool *told = &unit->told[STEP_SIZE];
    if (reason == Unusable_STEP) {
        add(&text, "Step size is ");
        add_number(&text, step_s);
        add(&text, " s; expected 0 to ");
        add_short(&text, LONGEST_STEP);
        add(&text, " s. No time has passed.");
    } else if (reason == Unusable_LOAD) {
        told = &unit->told_parts[LOAD_PART];
        add(&text, "vertical_load_n is ");
        add_short(&text, sensors->vertical_load_n.value);
        add(&text, ": a wheel without load has no friction to estimate.");
    } else if (reason == Unusable_ROLLING_BACK) {
        told = &unit->told[ROLLING_BACK];
        add(&text, "The car rolls backwards: the camera looks the other way, and the estimate is held.");
    } else {
        told = &unit->told[TURNING_BACK];
        add(&text, "The wheel turns backwards while the car drives forwards; check the sign of wheel_speed_rad_s.");
    }
    tell(unit, told, fmi2Warning, text.text);
}

/* Tell of a car that is not as it is told to be. */
static void tell_car(Unit *unit)
{
    const Inner *inner = &unit->memory.inner;
    const RobustState *state = &inner->state.robust;
    const RobustSetup *known = &inner->known.robust;
    const char *axle = inner->config.front_axle ? "Front" : "Rear";
    if (!unit->told[CAR_TYRES]) {
        const double load_n = inner->known.static_load_n;
        const opt_double learnt_n = messages_learnt_stiffness_n(state, known, load_n);
        if (learnt_n.has) {
            Text text = {0, ""};
            add(&text, MODEL ": ");
            add(&text, axle);
            add(&text, " tyres do not follow the told curve: slip stiffness learnt ");
            add_fixed(&text, 1e-3 * learnt_n.value, 0, false);
            add(&text, " kN per unit slip at ");
            add_fixed(&text, 1e-3 * load_n, 1, false);
            add(&text, " kN load, told ");
            add_fixed(&text, 1e-3 * (INITIAL_SLOPE * known->wheel.stiffness_n), 0, false);
            add(&text, " kN (");
            add_short(&text, INITIAL_SLOPE);
            add(&text, " C_x). TRPAC is an interval here; adjust tyre.longitudinal_stiffness_n in vehicle.yaml.");
            tell(unit, &unit->told[CAR_TYRES], fmi2Warning, text.text);
        }
    }
    if (!unit->told[CAR_WHEELS]) {
        const double told_m = known->wheel.radius_m;
        const opt_double offset = messages_learnt_offset(state);
        if (offset.has) {
            Text text = {0, ""};
            add(&text, MODEL ": ");
            add(&text, axle);
            add(&text, " wheels do not have the told radius: slip without force learnt ");
            add_fixed(&text, 100.0 * offset.value, 1, true);
            add(&text, " %, as of a radius of ");
            add_fixed(&text, told_m * (1.0 - offset.value), 4, false);
            add(&text, " m, told ");
            add_fixed(&text, told_m, 4, false);
            add(&text, " m. Adjust wheel_radius_m in vehicle.yaml.");
            tell(unit, &unit->told[CAR_WHEELS], fmi2Warning, text.text);
        }
    }
}

void unit_step(Unit *unit, double step_s)
{
    Inner *inner = &unit->memory.inner;
    Sensors sensors = sensors_of(&unit->memory);
    if (!unit->memory.boolean[AT_image_buffers_enabled] && in_memory(&unit->memory))
        tell(unit, &unit->told[BUFFERS_OFF], fmi2Warning,
            MODEL ": the inputs image.* point to a picture in memory, which is not read: the parameter "
                  "image.buffers_enabled is false. Set it to true before the initialisation ends, or give pictures by "
                  "image_path.");
    const opt_RoadClass road_class = next_class(unit);
    unit_clear_volatile(&unit->memory);
    Frame frame = {road_class.has || inner->frame_failed, {false, {Surface_DRY, 0.0, false, 0.0}}};
    if (road_class.has)
        frame.seen
            = (opt_Outcome){true, wheel_step_outcome_of(&inner->config, road_class.value, inner->state.time_s)};
    const Unusable reason = wheel_step_unusable_input(&inner->config, step_s, &sensors, road_class);
    Estimate estimate;
    if (reason == Unusable_NOTHING) {
        Rates rates;
        wheel_step_rates_of(&rates, &inner->rates, &inner->config, step_s, inner->state.step_s);
        inner->rates = rates;
        wheel_step_stepped(&estimate, &inner->state, &inner->last, &inner->config, &inner->known, &inner->rates,
            &sensors, frame, step_s);
    } else {
        wheel_step_held(&estimate, &inner->state, &inner->last, &inner->config, &inner->known, &sensors, frame, step_s);
        tell_unusable(unit, reason, step_s, &sensors);
    }
    inner->last = estimate;
    tell_car(unit);
}
