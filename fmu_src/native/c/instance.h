/* An instance by calls that FMI 2.0 and FMI 3.0 have in common. Each refuses a missing instance. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include "unit.h"

/* Why another kind of unit is not instantiated. */
#define CO_SIMULATION_ONLY "it is a unit for co-simulation only."

/* What gives a message to the host. */
typedef void Log(const Unit *unit, Status status, const char *category, const char *message);

/* Begin an instance whose bytes are 0; false, after a message, where it cannot be used or there is a problem already. */
bool begin_instance(Unit *unit, const char *guid, bool logging, Log *log, const char *problem);
/* Begin again. */
Status reset_instance(Unit *unit);
Status switch_logging(Unit *unit, bool on);
Status set_time(Unit *unit, double time_s);
Status enter_initialisation(Unit *unit);
Status exit_initialisation(Unit *unit);
Status do_step(Unit *unit, double now_s, double step_s);

/* Set a variable; what is none, or cannot be set now, is told and ignored. */
void set_real(Unit *unit, unsigned reference, double value);
void set_integer(Unit *unit, unsigned reference, int value);
void set_boolean(Unit *unit, unsigned reference, bool value);
void set_string(Unit *unit, unsigned reference, const char *value);

/* Values are read between these two: outputs become those of the values that were set while the host initialises, and
   references that are no variable of the kind, which are read as 0, are told. */
void before_get(Unit *unit, Text *unknown);
void after_get(Unit *unit, Kind kind, const Text *unknown);
double get_real(const Unit *unit, unsigned reference, Text *unknown);
int get_integer(const Unit *unit, unsigned reference, Text *unknown);
bool get_boolean(const Unit *unit, unsigned reference, Text *unknown);
const char *get_string(const Unit *unit, unsigned reference, Text *unknown);

Status save_state(const Unit *unit, void **to);
Status restore_state(Unit *unit, const void *from);
Status free_state(void **state);
Status state_size(const Unit *unit, const void *state, size_t *size);
Status serialise_state(const Unit *unit, const void *from, unsigned char *to, size_t size);
Status deserialise_state(const Unit *unit, const unsigned char *bytes, size_t size, void **to);

#endif
