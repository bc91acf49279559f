/* What the unit of one wheel remembers between its steps. */
#ifndef INNER_H
#define INNER_H

#include "common.h"

/* Whom messages on readings concern: the wheel; and the sentences on the car. */
enum { SUBJECTS = 1, CAR_TEXTS = 2 };

typedef struct {
    OneWheel wheel;
    FrameState frame;
    /* Optional inputs that have been other than 0 once. */
    bool load_connected, acceleration_connected, yaw_connected;
} Inner;

#endif
