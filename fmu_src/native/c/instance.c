#include "instance.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const KIND_NAMES[KINDS] = {"Real", "Integer", "Boolean", "String"};
static const char *const NEUTRAL[KINDS] = {"0.0", "0", "False", "''"};

void tell(Unit *unit, bool *told, Status status, const char *message)
{
    char line[LONGEST_LOG + 8];
    if (*told)
        return;
    *told = true;
    (void)snprintf(line, sizeof line, "%.*s%s", (int)LONGEST_LOG, message, strlen(message) > LONGEST_LOG ? " ..." : "");
    if (unit->logging)
        unit->log(unit, status, status == WARNING ? "logStatusWarning" : "logStatusError", line);
    if (status >= ERROR)
        (void)fprintf(stderr, "%s\n", line);
}

bool *told_of(Unit *unit, int subject, Unusable reason, const Sensors *sensors)
{
    enum { LOAD = 1 << 3 };
    if (reason == Unusable_READING)
        return &unit->told_readings[subject][implausible(sensors)];
    return reason == Unusable_LOAD ? &unit->told_readings[subject][LOAD] : &unit->told_reason[subject][reason];
}

static void begin(Unit *unit)
{
    memset(&unit->memory, 0, sizeof unit->memory);
    memcpy(unit->memory.real, REAL_STARTS, sizeof REAL_STARTS);
    memcpy(unit->memory.integer, INTEGER_STARTS, sizeof INTEGER_STARTS);
    memcpy(unit->memory.boolean, BOOLEAN_STARTS, sizeof BOOLEAN_STARTS);
    unit->initialising = unit->stale = unit->computed = unit->stepped = false;
    unit->unknown_count = 0;
    memset(unit->told, 0, sizeof unit->told);
    memset(unit->told_car, 0, sizeof unit->told_car);
    memset(unit->told_readings, 0, sizeof unit->told_readings);
    memset(unit->told_reason, 0, sizeof unit->told_reason);
    memset(unit->told_reference, 0, sizeof unit->told_reference);
    memset(unit->told_get, 0, sizeof unit->told_get);
}

/* Parameters that are not finite or out of their range, all in one text. */
static bool parameters_good(const Memory *memory, Text *problem)
{
    Text list = {0, ""};
    int count = 0;
    for (int k = 0; k < COUNT; k++) {
        const Variable *v = &VARIABLES[k];
        if (v->causality != PARAMETER || (v->kind != REAL && v->kind != INTEGER))
            continue;
        const double value = v->kind == REAL ? memory->real[v->index] : memory->integer[v->index];
        if (isfinite(value) && v->minimum <= value && value <= v->maximum)
            continue;
        if (count++)
            add(&list, "; ");
        add(&list, v->name);
        add(&list, " = ");
        if (v->kind == REAL)
            add_number(&list, value);
        else
            add_int(&list, memory->integer[v->index]);
        add(&list, ", expected a number from ");
        add_short(&list, v->minimum);
        add(&list, " to ");
        add_short(&list, v->maximum);
        if (v->unit[0]) {
            add(&list, " ");
            add(&list, v->unit);
        }
    }
    if (count) {
        add_int(problem, count);
        add(problem, " parameter(s) cannot be used: ");
        add(problem, list.text);
        add(problem, ".");
    }
    return count == 0;
}

static bool initialised(Unit *unit, Text *problem)
{
    return parameters_good(&unit->memory, problem) && unit_initialise(unit, problem);
}

bool begin_instance(Unit *unit, const char *guid, bool logging, Log *log, const char *problem)
{
    unit->log = log;
    unit->logging = logging;
    begin(unit);
    if (!problem && (!guid || strcmp(guid, GUID) != 0))
        problem = "its modelDescription.xml is of another build.";
    if (problem) {
        bool told = false;
        Text message = {0, ""};
        add(&message, MODEL " cannot be instantiated: ");
        add(&message, problem);
        tell(unit, &told, ERROR, message.text);
    }
    return !problem;
}

Status reset_instance(Unit *unit)
{
    if (!unit)
        return ERROR;
    begin(unit);
    return OK;
}

Status switch_logging(Unit *unit, bool on)
{
    if (!unit)
        return ERROR;
    unit->logging = on;
    return OK;
}

Status set_time(Unit *unit, double time_s)
{
    if (!unit)
        return ERROR;
    unit->memory.time_s = time_s;
    return OK;
}

Status enter_initialisation(Unit *unit)
{
    if (!unit)
        return ERROR;
    unit->initialising = unit->stale = true;
    return OK;
}

Status exit_initialisation(Unit *unit)
{
    Text problem = {0, ""}, message = {0, ""};
    if (!unit)
        return ERROR;
    unit->initialising = unit->stale = false;
    unit->memory.initialised = true;
    if (initialised(unit, &problem)) {
        unit->memory.ready = true;
        return OK;
    }
    unit->computed = false;
    add(&message, MODEL " cannot be initialised, and every step will be discarded: ");
    add(&message, problem.text);
    tell(unit, &unit->told[NOT_INITIALISED], ERROR, message.text);
    return OK;
}

/* Why a step cannot be taken: its sort of message, and the message. MESSAGES where it can. */
static int step_problem(const Unit *unit, double begin_s, double step_s, Text *text)
{
    static const char *const NO_TIME = " The step is discarded and no time has passed.";
    if (!(0.0 < step_s && step_s <= LONGEST_STEP)) {
        start(text, MODEL ": step size is ");
        add_number(text, step_s);
        add(text, " s; expected above 0 and up to ");
        add_short(text, LONGEST_STEP);
        add(text, " s. Step again with such a size.");
        add(text, NO_TIME);
        return STEP_SIZE;
    }
    const bool finite = isfinite(begin_s);
    if (finite && !(unit->stepped && fabs(begin_s - unit->memory.time_s) > GREATEST_JUMP * step_s))
        return MESSAGES;
    start(text, MODEL ": the step begins at ");
    add_number(text, begin_s);
    add(text, " s; expected ");
    if (finite) {
        add_number(text, unit->memory.time_s);
        add(text, " s, where the last one ended. Step again from there, or restore a state or reset the unit before "
                  "time jumps.");
    } else {
        add(text, "a finite time. Step again from one.");
    }
    add(text, NO_TIME);
    return STEP_BEGIN;
}

Status do_step(Unit *unit, double now_s, double step_s)
{
    Text text;
    if (!unit)
        return ERROR;
    if (!unit->memory.ready) {
        if (!unit->memory.initialised)
            tell(unit, &unit->told[NOT_READY], ERROR,
                MODEL ": a step was asked for before the initialisation has ended; it is discarded.");
        return DISCARD;
    }
    const int problem = step_problem(unit, now_s, step_s, &text);
    if (problem != MESSAGES) {
        tell(unit, &unit->told[problem], ERROR, text.text);
        return DISCARD;
    }
    unit_step(unit, step_s);
    unit->memory.time_s = now_s + step_s;
    unit->stepped = true;
    return OK;
}

/* The variable of a value reference if it is of the kind, else -1. */
static int variable_of(unsigned reference, Kind kind)
{
    return reference < COUNT && VARIABLES[reference].kind == kind ? (int)reference : -1;
}

/* Where a variable can be set now: its index, else -1 after a message. */
static int settable(Unit *unit, unsigned reference, Kind kind)
{
    const int k = variable_of(reference, kind);
    unit->stale = unit->initialising;
    if (k >= 0 && (VARIABLES[k].causality == INPUT
                      || (VARIABLES[k].causality == PARAMETER && !unit->memory.initialised)))
        return VARIABLES[k].index;
    bool told = true, *place = &told;
    if (reference < COUNT) {
        place = &unit->told_reference[reference];
    } else {
        const unsigned key = reference * KINDS + (unsigned)kind;
        bool known = false;
        for (int n = 0; n < unit->unknown_count; n++)
            known = known || unit->unknown[n] == key;
        if (!known && unit->unknown_count < UNKNOWN_TOLD) {
            unit->unknown[unit->unknown_count++] = key;
            told = false;
        }
    }
    if (*place)
        return -1;
    Text text = {0, ""};
    add(&text, MODEL ": value reference ");
    add_int(&text, (long)reference);
    add(&text, " (");
    add(&text, k >= 0 ? VARIABLES[k].name : "unknown");
    add(&text, ") is no ");
    add(&text, KIND_NAMES[kind]);
    add(&text, " that can be set now, and was ignored. Inputs can be set at any time, parameters until the "
               "initialisation ends.");
    tell(unit, place, ERROR, text.text);
    return -1;
}

/* The variable of a value reference that is to be read; what is none is noted. */
static int readable(unsigned reference, Kind kind, Text *unknown)
{
    const int v = variable_of(reference, kind);
    if (v < 0) {
        if (unknown->length)
            add(unknown, ", ");
        add_int(unknown, (long)reference);
    }
    return v;
}

void before_get(Unit *unit, Text *unknown)
{
    if (unit->stale) {
        Text problem = {0, ""};
        unit->stale = unit->computed = false;
        unit->computed = initialised(unit, &problem);
    }
    start(unknown, "");
}

void after_get(Unit *unit, Kind kind, const Text *unknown)
{
    if (!unknown->length || unit->told_get[kind])
        return;
    Text text = {0, ""};
    add(&text, MODEL ": value references [");
    add(&text, unknown->text);
    add(&text, "] are no ");
    add(&text, KIND_NAMES[kind]);
    add(&text, " of this unit: read as ");
    add(&text, NEUTRAL[kind]);
    add(&text, ".");
    tell(unit, &unit->told_get[kind], ERROR, text.text);
}

/* Whether a variable shows what the unit has worked out. */
static bool shown(const Unit *unit, int variable)
{
    return VARIABLES[variable].causality == INDEPENDENT
        || (VARIABLES[variable].causality == OUTPUT && (unit->memory.ready || unit->computed));
}

void set_real(Unit *unit, unsigned reference, double value)
{
    const int index = settable(unit, reference, REAL);
    if (index >= 0)
        unit->memory.real[index] = value;
}

void set_integer(Unit *unit, unsigned reference, int value)
{
    const int index = settable(unit, reference, INTEGER);
    if (index >= 0)
        unit->memory.integer[index] = value;
}

void set_boolean(Unit *unit, unsigned reference, bool value)
{
    const int index = settable(unit, reference, BOOLEAN);
    if (index >= 0)
        unit->memory.boolean[index] = value;
}

void set_string(Unit *unit, unsigned reference, const char *value)
{
    const int index = settable(unit, reference, STRING);
    if (index < 0)
        return;
    size_t length = value ? strlen(value) : 0;
    if (length >= STRING_SIZE) {
        length = STRING_SIZE - 1;
        tell(unit, &unit->told[LONG_STRING], ERROR, MODEL ": a text was too long and is cut.");
    }
    memset(unit->memory.string[index], 0, STRING_SIZE);
    if (length)
        memcpy(unit->memory.string[index], value, length);
}

double get_real(const Unit *unit, unsigned reference, Text *unknown)
{
    const int v = readable(reference, REAL, unknown);
    return v < 0 ? 0.0 : shown(unit, v) ? unit_real(unit, v) : unit->memory.real[VARIABLES[v].index];
}

int get_integer(const Unit *unit, unsigned reference, Text *unknown)
{
    const int v = readable(reference, INTEGER, unknown);
    return v < 0 ? 0 : shown(unit, v) ? unit_integer(unit, v) : unit->memory.integer[VARIABLES[v].index];
}

bool get_boolean(const Unit *unit, unsigned reference, Text *unknown)
{
    const int v = readable(reference, BOOLEAN, unknown);
    return v < 0 ? false : shown(unit, v) ? unit_boolean(unit, v) : unit->memory.boolean[VARIABLES[v].index];
}

const char *get_string(const Unit *unit, unsigned reference, Text *unknown)
{
    const int v = readable(reference, STRING, unknown);
    return v < 0 ? "" : unit->memory.string[VARIABLES[v].index];
}

/* A state: what is wrong with it, and a memory where nothing is. */
typedef struct {
    const char *problem;
    int message;
    Memory memory;
} State;

enum { MAGIC_SIZE = 8, CRC_SIZE = 4, HEADER_SIZE = MAGIC_SIZE + sizeof GUID, STATE_SIZE = HEADER_SIZE + sizeof(Memory) + CRC_SIZE };
static const char MAGIC[MAGIC_SIZE + 1] = "TRPACst1";

static uint32_t crc32_of(const unsigned char *bytes, size_t size)
{
    uint32_t table[256], crc = 0xFFFFFFFFu;
    for (uint32_t k = 0; k < 256; k++) {
        table[k] = k;
        for (int bit = 0; bit < 8; bit++)
            table[k] = table[k] & 1u ? 0xEDB88320u ^ table[k] >> 1 : table[k] >> 1;
    }
    for (size_t k = 0; k < size; k++)
        crc = table[(crc ^ bytes[k]) & 0xFFu] ^ crc >> 8;
    return ~crc;
}

static void put_crc32(unsigned char *to, uint32_t crc)
{
    for (int k = 0; k < CRC_SIZE; k++)
        to[k] = (unsigned char)(crc >> 8 * k & 0xFFu);
}

Status save_state(const Unit *unit, void **to)
{
    if (!unit || !to)
        return ERROR;
    if (!*to)
        *to = malloc(sizeof(State));
    State *state = *to;
    if (!state)
        return ERROR;
    state->problem = NULL;
    memcpy(&state->memory, &unit->memory, sizeof state->memory);
    unit_clear_volatile(&state->memory);
    return OK;
}

Status restore_state(Unit *unit, const void *from)
{
    const State *state = from;
    if (!unit || !state)
        return ERROR;
    if (state->problem) {
        Text text = {0, ""};
        add(&text, MODEL ": the state was not restored: ");
        add(&text, state->problem);
        add(&text, ".");
        tell(unit, &unit->told[state->message], ERROR, text.text);
        return OK;
    }
    memcpy(&unit->memory, &state->memory, sizeof unit->memory);
    unit->computed = unit->stepped = false;
    unit->initialising = unit->stale = !unit->memory.initialised;
    return OK;
}

Status free_state(void **state)
{
    if (!state)
        return ERROR;
    free(*state);
    *state = NULL;
    return OK;
}

Status state_size(const Unit *unit, const void *state, size_t *size)
{
    if (!unit || !state || !size)
        return ERROR;
    *size = STATE_SIZE;
    return OK;
}

Status serialise_state(const Unit *unit, const void *from, unsigned char *to, size_t size)
{
    const State *state = from;
    if (!unit || !state || !to || state->problem || size < STATE_SIZE)
        return ERROR;
    memcpy(to, MAGIC, MAGIC_SIZE);
    memcpy(to + MAGIC_SIZE, GUID, sizeof GUID);
    memcpy(to + HEADER_SIZE, &state->memory, sizeof state->memory);
    put_crc32(to + STATE_SIZE - CRC_SIZE, crc32_of(to, STATE_SIZE - CRC_SIZE));
    return OK;
}

static const char *state_problem(const unsigned char *bytes, size_t size, State *state)
{
    unsigned char crc[CRC_SIZE];
    state->message = STATE_OTHER;
    if (size < HEADER_SIZE || memcmp(bytes, MAGIC, MAGIC_SIZE) != 0)
        return "it is not a state of this unit";
    state->message = STATE_BUILD;
    if (memcmp(bytes + MAGIC_SIZE, GUID, sizeof GUID) != 0)
        return "it was saved by another build of the unit";
    state->message = STATE_DAMAGE;
    if (size != STATE_SIZE)
        return "it is damaged";
    put_crc32(crc, crc32_of(bytes, STATE_SIZE - CRC_SIZE));
    if (memcmp(crc, bytes + STATE_SIZE - CRC_SIZE, CRC_SIZE) != 0)
        return "it is damaged";
    memcpy(&state->memory, bytes + HEADER_SIZE, sizeof state->memory);
    return unit_sound(&state->memory) ? NULL : "it is damaged";
}

Status deserialise_state(const Unit *unit, const unsigned char *bytes, size_t size, void **to)
{
    if (!unit || !to || (!bytes && size))
        return ERROR;
    if (!*to)
        *to = malloc(sizeof(State));
    State *state = *to;
    if (!state)
        return ERROR;
    state->problem = state_problem(bytes, size, state);
    return OK;
}
