/* The unit of four wheels: its inputs as the estimators' sensors and frames, and what it tells. */
#include "frames.h"
#include "unit.h"

#include <string.h>

void settings_of(const Memory *memory, FourWheelsConfig *settings);
extern const FourWheelsConfig DEFAULT_SETTINGS;

static const char *const NAMES[SUBJECTS] = {"fl", "fr", "rl", "rr", "car"};

/* The car's adhesion from the wheels' estimates. */
static void claim_car(Inner *inner, double4 loads_n)
{
    const OneWheel *w = inner->wheel;
    inner->car = four_wheels_car_claim(
        &w[0].last, &w[1].last, &w[2].last, &w[3].last, loads_n, inner->config.axle_deviation);
}

bool unit_initialise(Unit *unit, Text *problem)
{
    Inner *inner = &unit->memory.inner;
    FourWheelsConfig config = DEFAULT_SETTINGS;
    settings_of(&unit->memory, &config);
    if (!settings_good(&config.wheel, problem))
        return false;
    memset(inner, 0, sizeof *inner);
    inner->config = config;
    inner->known = four_wheels_car_setup(config.wheel.vehicle);
    for (int k = 0; k < WHEELS; k++) {
        EstimatorConfig of_wheel = config.wheel;
        of_wheel.front_axle = k < 2;
        of_wheel.left_side = k % 2 == 0;
        begin_wheel(&inner->wheel[k], &of_wheel);
    }
    claim_car(inner, inner->known.static_n);
    return true;
}

void unit_clear_volatile(Memory *memory)
{
    memory->integer[AT_image_base_lo] = memory->integer[AT_image_base_hi] = memory->integer[AT_image_size] = 0;
}

bool unit_sound(const Memory *memory)
{
    bool sound = !memory->inner.frame.path[STRING_SIZE - 1];
    for (int k = 0; k < WHEELS; k++)
        sound = sound && state_sound(&memory->inner.wheel[k].state);
    return !memory->ready || sound;
}

/* The inputs as the estimators' sensors. */
static CarSensors sensors_of(Memory *memory)
{
    const double *real = memory->real;
    Inner *inner = &memory->inner;
    CarSensors sensors;
    for (int k = 0; k < WHEELS; k++) {
        sensors.wheel_speed_rad_s.at[k] = real[AT_wheel_speed_fl + k];
        sensors.wheel_torque_nm.at[k] = real[AT_wheel_torque_fl + k];
    }
    sensors.vehicle_speed_m_s = real[AT_vehicle_speed];
    sensors.vertical_load_n._0 = optional(real[AT_vertical_load_fl], &inner->load_connected[0]);
    sensors.vertical_load_n._1 = optional(real[AT_vertical_load_fr], &inner->load_connected[1]);
    sensors.vertical_load_n._2 = optional(real[AT_vertical_load_rl], &inner->load_connected[2]);
    sensors.vertical_load_n._3 = optional(real[AT_vertical_load_rr], &inner->load_connected[3]);
    sensors.steering_angle_rad = real[AT_steering_angle];
    sensors.longitudinal_acceleration_m_s2
        = optional(real[AT_longitudinal_acceleration], &inner->acceleration_connected);
    sensors.lateral_acceleration_m_s2 = optional(real[AT_lateral_acceleration], &inner->lateral_connected);
    sensors.yaw_rate_rad_s = optional(real[AT_yaw_rate], &inner->yaw_connected);
    return sensors;
}

/* The classes of the left and of the right side where there are new ones that can be used. */
static void next_classes(Unit *unit, opt_RoadClass classes[SIDES])
{
    const Memory *memory = &unit->memory;
    FrameState *frame = &unit->memory.inner.frame;
    const int given[SIDES] = {memory->integer[AT_road_class_left], memory->integer[AT_road_class_right]};
    const double confidence[SIDES]
        = {memory->real[AT_road_class_confidence_left], memory->real[AT_road_class_confidence_right]};
    Text why, text;
    start(&why, "");
    for (int k = 0; k < SIDES; k++)
        classes[k] = (opt_RoadClass){false, {Surface_DRY, 0.0}};
    if (new_frame(unit, frame, given[0] != NO_ROAD_CLASS || given[1] != NO_ROAD_CLASS) != FROM_BUS)
        return;
    const bool left = class_good(&why, "road_class.left", given[0], "road_class_confidence.left", confidence[0]);
    const bool right = class_good(&why, "road_class.right", given[1], "road_class_confidence.right", confidence[1]);
    if (left && right) {
        for (int k = 0; k < SIDES; k++)
            if (given[k] != NO_ROAD_CLASS)
                classes[k] = (opt_RoadClass){true, {(Surface)given[k], confidence[k]}};
        return;
    }
    frame->failed = true;
    start(&text, MODEL ": ");
    add(&text, why.text);
    add(&text, ".");
    tell(unit, &unit->told[FRAME_CLASS], WARNING, text.text);
}

static void tell_subject(Unit *unit, bool *told, int subject, const char *sentence)
{
    Text text;
    start(&text, MODEL ": ");
    add(&text, NAMES[subject]);
    add(&text, ": ");
    add(&text, sentence);
    tell(unit, told, WARNING, text.text);
}

/* Tell of unusable readings, by whom they concern; what all wheels share is the car's. */
static void tell_readings(
    Unit *unit, const CarSensors *car, const Unusable reasons[WHEELS], const Sensors sensors[WHEELS])
{
    Text texts[WHEELS];
    bool alike = true, any = false;
    for (int k = 0; k < WHEELS; k++) {
        start(&texts[k], "");
        any = any || reasons[k] != Unusable_NOTHING;
        if (reasons[k] != Unusable_NOTHING)
            add_unusable(&texts[k], reasons[k], &sensors[k]);
        alike = alike && reasons[k] != Unusable_NOTHING && strcmp(texts[k].text, texts[0].text) == 0;
    }
    if (!any)
        return;
    if (!four_wheels_lateral_plausible(car)) {
        Text text;
        start(&text, "lateral_acceleration_m_s2 is ");
        add_short(&text, car->lateral_acceleration_m_s2.value);
        add(&text, ", expected a number within +-");
        add_short(&text, MOST_longitudinal_acceleration_m_s2);
        add(&text, ". Check the signal's source and unit.");
        tell_subject(unit, &unit->told[LATERAL], CAR, text.text);
    } else if (alike) {
        tell_subject(unit, told_of(unit, CAR, reasons[0], &sensors[0]), CAR, texts[0].text);
    } else {
        for (int k = 0; k < WHEELS; k++)
            if (reasons[k] != Unusable_NOTHING)
                tell_subject(unit, told_of(unit, k, reasons[k], &sensors[k]), k, texts[k].text);
    }
}

/* Tell of a car that is not as it is told to be, once per axle and matter, by its left wheel where that says so. */
static void tell_car(Unit *unit)
{
    bool (*const about[])(Text *, const OneWheel *) = {add_tyres, add_wheels};
    for (int axle = 0; axle < 2; axle++) {
        const OneWheel *left = &unit->memory.inner.wheel[2 * axle], *right = left + 1;
        for (int k = 0; k < 2; k++) {
            bool *told = &unit->told_car[2 * axle + k];
            Text text;
            if (*told)
                continue;
            start(&text, MODEL ": ");
            if (about[k](&text, left) || about[k](&text, right))
                tell(unit, told, WARNING, text.text);
        }
    }
}

void unit_step(Unit *unit, double step_s)
{
    Inner *inner = &unit->memory.inner;
    const CarSensors car = sensors_of(&unit->memory);
    const Vehicle vehicle = inner->config.wheel.vehicle;
    opt_RoadClass classes[SIDES];
    next_classes(unit, classes);
    unit_clear_volatile(&unit->memory);
    const double4 speeds_m_s = four_wheels_wheel_speeds(vehicle, &car);
    const CarLoads loads = four_wheels_car_loads(vehicle, inner->known, &car);
    const opt_double given_n[WHEELS] = {loads.given_n._0, loads.given_n._1, loads.given_n._2, loads.given_n._3};
    Unusable reasons[WHEELS];
    Sensors sensors[WHEELS];
    bool any = false;
    for (int k = 0; k < WHEELS; k++) {
        sensors[k] = (Sensors){car.wheel_speed_rad_s.at[k], car.wheel_torque_nm.at[k], speeds_m_s.at[k], given_n[k],
            car.steering_angle_rad, car.longitudinal_acceleration_m_s2, car.yaw_rate_rad_s};
        reasons[k] = step_wheel(&inner->wheel[k], step_s, &sensors[k], classes[k % SIDES], inner->frame.failed);
        any = any || reasons[k] != Unusable_NOTHING;
    }
    claim_car(inner, loads.loads_n);
    if (any)
        tell_readings(unit, &car, reasons, sensors);
    tell_car(unit);
}
