/* What the FMI functions need of a unit: its memory, its variables and what it does with them. */
#ifndef UNIT_H
#define UNIT_H

#include "inner.h"
#include "tables.h"
#include "text.h"

#include <stdbool.h>

enum { LONGEST_LOG = 1000, UNKNOWN_TOLD = 32 };

/* What a call comes to, by the numbers of FMI 2.0 and FMI 3.0. */
typedef enum { OK, WARNING, DISCARD, ERROR } Status;

/* All that a state of the unit holds. */
typedef struct {
    bool ready, initialised;
    double time_s;
    double real[REALS + 1];
    int integer[INTEGERS + 1];
    bool boolean[BOOLEANS + 1];
    char string[STRINGS + 1][STRING_SIZE];
    Inner inner;
} Memory;

/* An instance. */
typedef struct Unit Unit;
struct Unit {
    Memory memory;
    bool initialising, stale, computed; /* outputs can be read while the host initialises */
    bool stepped; /* the next step begins at memory.time_s; else at any time */
    /* What has been told already: each sort of message is told once. */
    bool told[MESSAGES], told_reference[COUNT], told_get[KINDS], told_car[CAR_TEXTS];
    bool told_readings[SUBJECTS][1 << PARTS], told_reason[SUBJECTS][REASONS];
    unsigned unknown[UNKNOWN_TOLD];
    int unknown_count;
    bool logging;
    void (*log)(const Unit *unit, Status status, const char *category, const char *message);
};

/* Tell a message of a sort once. */
void tell(Unit *unit, bool *told, Status status, const char *message);

/* Where it is noted that a subject's unusable input has been told: by the readings that the message names. */
bool *told_of(Unit *unit, int subject, Unusable reason, const Sensors *sensors);

/* Of the unit itself: begin anew with the values that were set; false, with the reason, where they cannot be used. */
bool unit_initialise(Unit *unit, Text *problem);
/* Take a step. */
void unit_step(Unit *unit, double step_s);
/* The outputs after the last step. */
double unit_real(const Unit *unit, int variable);
int unit_integer(const Unit *unit, int variable);
bool unit_boolean(const Unit *unit, int variable);
/* Forget the inputs of one step. */
void unit_clear_volatile(Memory *memory);
/* Whether a memory that came from outside can be gone on with: no index in it leads out of its array. */
bool unit_sound(const Memory *memory);

#endif
