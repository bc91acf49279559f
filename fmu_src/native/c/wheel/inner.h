/* What the unit of one wheel remembers between its steps. */
#ifndef INNER_H
#define INNER_H

#include "tables.h"
#include "trpac.h"

/* Sorts of messages, each told once; those on readings are told apart by the readings that they name. */
enum {
    NOT_INITIALISED,
    NOT_READY,
    LONG_STRING,
    STATE_OTHER,
    STATE_BUILD,
    STATE_DAMAGE,
    BUFFERS_OFF,
    FRAME_CLASS,
    FRAME_PICTURE,
    STEP_SIZE,
    ROLLING_BACK,
    TURNING_BACK,
    CAR_TYRES,
    CAR_WHEELS,
    MESSAGES
};
/* How many readings there are. */
enum { PARTS = 7 };

/* Where the newest frame came from. */
typedef enum { FROM_NOTHING, FROM_BUS, FROM_BUFFER, FROM_PATH } FrameSource;

typedef struct {
    EstimatorConfig config;
    WheelSetup known;
    EstimatorState state;
    Estimate last;
    Rates rates;
    /* The newest frame, and the last path that was taken. */
    FrameSource source;
    int frame_id;
    bool frame_failed;
    char path[STRING_SIZE];
    /* Optional inputs that have been other than 0 once. */
    bool load_connected, acceleration_connected, yaw_connected;
} Inner;

#endif
