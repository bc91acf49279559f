/* What the unit of four wheels remembers between its steps. */
#ifndef INNER_H
#define INNER_H

#include "common.h"

enum { WHEELS = 4, SIDES = 2 };
/* Whom messages on readings concern: each wheel, and the car; and the sentences on the tyres and wheels of each axle. */
enum { CAR = WHEELS, SUBJECTS, CAR_TEXTS = 4 };

typedef struct {
    FourWheelsConfig config;
    CarSetup known;
    OneWheel wheel[WHEELS];
    CarClaim car;
    FrameState frame;
    /* Optional inputs that have been other than 0 once. */
    bool load_connected[WHEELS], acceleration_connected, lateral_connected, yaw_connected;
} Inner;

#endif
