/* New frames from a unit's inputs. */
#ifndef FRAMES_H
#define FRAMES_H

#include "unit.h"

/* The source of a frame that is new in this step, else FROM_NOTHING; `by_bus` tells whether a class is there. A picture
   is told of and has failed; whether a class can be used the unit itself says. */
FrameSource new_frame(Unit *unit, FrameState *seen, bool by_bus);

#endif
