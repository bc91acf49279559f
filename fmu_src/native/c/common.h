/* What the units of one wheel and of the car share: optional inputs, frames, and sentences. */
#ifndef COMMON_H
#define COMMON_H

#include "tables.h"
#include "text.h"
#include "trpac.h"

/* Sorts of messages, each told once. */
enum {
    NOT_INITIALISED,
    NOT_READY,
    STEP_SIZE,
    STEP_BEGIN,
    LONG_STRING,
    STATE_OTHER,
    STATE_BUILD,
    STATE_DAMAGE,
    BUFFERS_OFF,
    FRAME_CLASS,
    FRAME_PICTURE,
    LATERAL,
    MESSAGES
};
/* How many readings a wheel has, and reasons besides those on readings. */
enum { PARTS = 7, REASONS = Unusable_CONFIDENCE + 1 };

/* Where the newest frame came from, its number, whether it could not be used, and the last path that was taken. */
typedef enum { FROM_NOTHING, FROM_BUS, FROM_BUFFER, FROM_PATH } FrameSource;
typedef struct {
    FrameSource source;
    int frame_id;
    bool failed;
    char path[STRING_SIZE];
} FrameState;

/* The estimator of one wheel. */
typedef struct {
    EstimatorConfig config;
    WheelSetup known;
    EstimatorState state;
    Estimate last;
    Rates rates;
} OneWheel;

/* Begin with these settings. */
void begin_wheel(OneWheel *wheel, const EstimatorConfig *config);
/* A step with a class of the road ahead, if one came, or a frame that failed; what makes its input unusable. */
Unusable step_wheel(OneWheel *wheel, double step_s, Sensors *sensors, opt_RoadClass road_class, bool failed);
/* An input that is connected from its first finite value other than 0. */
opt_double optional(double value, bool *connected);
/* Whether the parts of the settings fit each other; else the reason. */
bool settings_good(const EstimatorConfig *config, Text *problem);
/* Whether a class by bus can be used; else what is wrong with it is added to what is wrong with others. */
bool class_good(Text *why, const char *name, int road_class, const char *confidence_name, double confidence);
/* The sentence on what makes a step's input unusable. */
void add_unusable(Text *text, Unusable reason, const Sensors *sensors);
/* Which readings are no road car's, as bits. */
unsigned implausible(const Sensors *sensors);
/* The sentences on a tyre or a wheel that differs from its description; false where neither does. */
bool add_tyres(Text *text, const OneWheel *wheel);
bool add_wheels(Text *text, const OneWheel *wheel);
/* Whether no index in a state leads out of its array. */
bool state_sound(const EstimatorState *state);

#endif
