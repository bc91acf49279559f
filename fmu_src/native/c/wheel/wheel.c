/* The unit of one wheel: its inputs as the estimator's sensors and frames, and what it tells. */
#include "frames.h"
#include "unit.h"

#include <string.h>

void settings_of(const Memory *memory, EstimatorConfig *settings);
extern const EstimatorConfig DEFAULT_SETTINGS;

bool unit_initialise(Unit *unit, Text *problem)
{
    Inner *inner = &unit->memory.inner;
    EstimatorConfig config = DEFAULT_SETTINGS;
    settings_of(&unit->memory, &config);
    if (!settings_good(&config, problem))
        return false;
    memset(inner, 0, sizeof *inner);
    begin_wheel(&inner->wheel, &config);
    return true;
}

void unit_clear_volatile(Memory *memory)
{
    memory->integer[AT_image_base_lo] = memory->integer[AT_image_base_hi] = memory->integer[AT_image_size] = 0;
}

bool unit_sound(const Memory *memory)
{
    return !memory->ready || (state_sound(&memory->inner.wheel.state) && !memory->inner.frame.path[STRING_SIZE - 1]);
}

/* The inputs as the estimator's sensors; in a curve the speed is that of the wheel's contact. */
static Sensors sensors_of(Memory *memory)
{
    const double *real = memory->real;
    Inner *inner = &memory->inner;
    const EstimatorConfig *config = &inner->wheel.config;
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

/* The class of this step where there is a new one that can be used. */
static opt_RoadClass next_class(Unit *unit)
{
    const Memory *memory = &unit->memory;
    FrameState *frame = &unit->memory.inner.frame;
    const int road_class = memory->integer[AT_road_class];
    const double confidence = memory->real[AT_road_class_confidence];
    const opt_RoadClass none = {false, {Surface_DRY, 0.0}};
    Text why, text;
    start(&why, "");
    if (new_frame(unit, frame, road_class != NO_ROAD_CLASS) != FROM_BUS)
        return none;
    if (class_good(&why, "road_class", road_class, "road_class_confidence", confidence))
        return (opt_RoadClass){true, {(Surface)road_class, confidence}};
    frame->failed = true;
    start(&text, MODEL ": ");
    add(&text, why.text);
    add(&text, ".");
    tell(unit, &unit->told[FRAME_CLASS], WARNING, text.text);
    return none;
}

/* Tell of a car that is not as it is told to be. */
static void tell_car(Unit *unit)
{
    const OneWheel *wheel = &unit->memory.inner.wheel;
    Text tyres, wheels;
    start(&tyres, MODEL ": ");
    start(&wheels, MODEL ": ");
    if (!unit->told_car[0] && add_tyres(&tyres, wheel))
        tell(unit, &unit->told_car[0], WARNING, tyres.text);
    if (!unit->told_car[1] && add_wheels(&wheels, wheel))
        tell(unit, &unit->told_car[1], WARNING, wheels.text);
}

void unit_step(Unit *unit, double step_s)
{
    Inner *inner = &unit->memory.inner;
    Sensors sensors = sensors_of(&unit->memory);
    const opt_RoadClass road_class = next_class(unit);
    unit_clear_volatile(&unit->memory);
    const Unusable reason = step_wheel(&inner->wheel, step_s, &sensors, road_class, inner->frame.failed);
    if (reason != Unusable_NOTHING) {
        Text text;
        start(&text, MODEL ": ");
        add_unusable(&text, reason, &sensors);
        tell(unit, told_of(unit, 0, reason, &sensors), WARNING, text.text);
    }
    tell_car(unit);
}
