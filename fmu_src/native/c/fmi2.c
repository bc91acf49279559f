/* The functions of FMI 2.0 for co-simulation. They allocate an instance and its states, nothing else. */
#include "unit.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const KIND_NAMES[KINDS] = {"Real", "Integer", "Boolean", "String"};
static const char *const NEUTRAL[KINDS] = {"0.0", "0", "False", "''"};

/* A message as one short line without printf directives: hosts take it for a format. */
static void log_line(const char *message, char line[2 * LONGEST_LOG + 8], bool format)
{
    size_t n = 0;
    for (size_t k = 0; message[k]; k++) {
        if (k == LONGEST_LOG) {
            memcpy(line + n, " ...", 4);
            n += 4;
            break;
        }
        if (message[k] == '%' && format)
            line[n++] = '%';
        line[n++] = message[k];
    }
    line[n] = '\0';
}

void tell(Unit *unit, bool *told, fmi2Status status, const char *message)
{
    char line[2 * LONGEST_LOG + 8];
    if (*told)
        return;
    *told = true;
    if (unit->logging && unit->callbacks.logger) {
        log_line(message, line, true);
        unit->callbacks.logger(unit->callbacks.componentEnvironment, unit->name, status,
            status == fmi2Warning ? "logStatusWarning" : "logStatusError", line);
    }
    if (status >= fmi2Error) {
        log_line(message, line, false);
        (void)fprintf(stderr, "%s\n", line);
    }
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
    unit->initialising = unit->stale = unit->computed = false;
    unit->time_s = 0.0;
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

const char *fmi2GetTypesPlatform(void)
{
    return fmi2TypesPlatform;
}

const char *fmi2GetVersion(void)
{
    return fmi2Version;
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    (void)n, (void)categories;
    if (!c)
        return fmi2Error;
    ((Unit *)c)->logging = on != fmi2False;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible;
    Unit *unit = calloc(1, sizeof *unit);
    if (!unit)
        return NULL;
    if (callbacks)
        unit->callbacks = *callbacks;
    unit->logging = logging != fmi2False;
    (void)snprintf(unit->name, sizeof unit->name, "%s", name ? name : "");
    begin(unit);
    if (type != fmi2CoSimulation || !guid || strcmp(guid, GUID) != 0) {
        bool told = false;
        tell(unit, &told, fmi2Error,
            type != fmi2CoSimulation ? MODEL " cannot be instantiated: it is a unit for co-simulation only."
                                     : MODEL " cannot be instantiated: its modelDescription.xml is of another build.");
        free(unit);
        return NULL;
    }
    return unit;
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    if (!c)
        return fmi2Error;
    ((Unit *)c)->time_s = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    unit->initialising = unit->stale = true;
    return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    Unit *unit = c;
    Text problem = {0, ""}, message = {0, ""};
    if (!unit)
        return fmi2Error;
    unit->initialising = unit->stale = false;
    unit->memory.initialised = true;
    if (initialised(unit, &problem)) {
        unit->memory.ready = true;
        return fmi2OK;
    }
    unit->computed = false;
    add(&message, MODEL " cannot be initialised, and every step will be discarded: ");
    add(&message, problem.text);
    tell(unit, &unit->told[NOT_INITIALISED], fmi2Error, message.text);
    return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return c ? fmi2OK : fmi2Error;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    if (!c)
        return fmi2Error;
    begin(c);
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_back)
{
    Unit *unit = c;
    (void)no_back;
    if (!unit)
        return fmi2Error;
    if (!unit->memory.ready) {
        if (!unit->memory.initialised)
            tell(unit, &unit->told[NOT_READY], fmi2Error,
                MODEL ": a step was asked for before the initialisation has ended; it is discarded.");
        return fmi2Discard;
    }
    unit_step(unit, step);
    unit->time_s = now + step;
    return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

/* The variable of a value reference if it is of the kind, else -1. */
static int variable_of(fmi2ValueReference reference, Kind kind)
{
    return reference < COUNT && VARIABLES[reference].kind == kind ? (int)reference : -1;
}

/* Where a variable can be set now: its index, else -1 after a message. */
static int settable(Unit *unit, fmi2ValueReference reference, Kind kind)
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
        const unsigned key = (unsigned)reference * KINDS + (unsigned)kind;
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
    tell(unit, place, fmi2Error, text.text);
    return -1;
}

/* Bring the outputs up to date while the host initialises, and tell of references that are no variable. */
static void before_get(Unit *unit, const fmi2ValueReference references[], size_t n, Kind kind)
{
    Text text;
    if (unit->stale) {
        start(&text, "");
        unit->stale = unit->computed = false;
        unit->computed = initialised(unit, &text);
    }
    bool unknown = false;
    for (size_t k = 0; k < n; k++)
        unknown = unknown || variable_of(references[k], kind) < 0;
    if (!unknown || unit->told_get[kind])
        return;
    start(&text, MODEL ": value references [");
    bool first = true;
    for (size_t k = 0; k < n; k++) {
        if (variable_of(references[k], kind) >= 0)
            continue;
        add(&text, first ? "" : ", ");
        add_int(&text, (long)references[k]);
        first = false;
    }
    add(&text, "] are no ");
    add(&text, KIND_NAMES[kind]);
    add(&text, " of this unit: read as ");
    add(&text, NEUTRAL[kind]);
    add(&text, ".");
    tell(unit, &unit->told_get[kind], fmi2Error, text.text);
}

/* Whether a variable shows what the unit has worked out. */
static bool shown(const Unit *unit, int variable)
{
    return VARIABLES[variable].causality == OUTPUT && (unit->memory.ready || unit->computed);
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Real values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    for (size_t k = 0; k < n; k++) {
        const int index = settable(unit, references[k], REAL);
        if (index >= 0)
            unit->memory.real[index] = values[k];
    }
    return fmi2OK;
}

fmi2Status fmi2SetInteger(
    fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Integer values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    for (size_t k = 0; k < n; k++) {
        const int index = settable(unit, references[k], INTEGER);
        if (index >= 0)
            unit->memory.integer[index] = values[k];
    }
    return fmi2OK;
}

fmi2Status fmi2SetBoolean(
    fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2Boolean values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    for (size_t k = 0; k < n; k++) {
        const int index = settable(unit, references[k], BOOLEAN);
        if (index >= 0)
            unit->memory.boolean[index] = values[k] != fmi2False;
    }
    return fmi2OK;
}

fmi2Status fmi2SetString(
    fmi2Component c, const fmi2ValueReference references[], size_t n, const fmi2String values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    for (size_t k = 0; k < n; k++) {
        const int index = settable(unit, references[k], STRING);
        if (index < 0)
            continue;
        const char *value = values[k] ? values[k] : "";
        size_t length = strlen(value);
        if (length >= STRING_SIZE) {
            length = STRING_SIZE - 1;
            tell(unit, &unit->told[LONG_STRING], fmi2Error, MODEL ": a text was too long and is cut.");
        }
        memset(unit->memory.string[index], 0, STRING_SIZE);
        memcpy(unit->memory.string[index], value, length);
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Real values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    before_get(unit, references, n, REAL);
    for (size_t k = 0; k < n; k++) {
        const int v = variable_of(references[k], REAL);
        values[k] = v < 0 ? 0.0 : shown(unit, v) ? unit_real(unit, v) : unit->memory.real[VARIABLES[v].index];
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Integer values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    before_get(unit, references, n, INTEGER);
    for (size_t k = 0; k < n; k++) {
        const int v = variable_of(references[k], INTEGER);
        values[k] = v < 0 ? 0 : shown(unit, v) ? unit_integer(unit, v) : unit->memory.integer[VARIABLES[v].index];
    }
    return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2Boolean values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    before_get(unit, references, n, BOOLEAN);
    for (size_t k = 0; k < n; k++) {
        const int v = variable_of(references[k], BOOLEAN);
        values[k] = v < 0 ? false : shown(unit, v) ? unit_boolean(unit, v) : unit->memory.boolean[VARIABLES[v].index];
    }
    return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference references[], size_t n, fmi2String values[])
{
    Unit *unit = c;
    if (!unit)
        return fmi2Error;
    before_get(unit, references, n, STRING);
    for (size_t k = 0; k < n; k++) {
        const int v = variable_of(references[k], STRING);
        values[k] = v < 0 ? "" : unit->memory.string[VARIABLES[v].index];
    }
    return fmi2OK;
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

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *to)
{
    const Unit *unit = c;
    if (!unit || !to)
        return fmi2Error;
    if (!*to)
        *to = malloc(sizeof(State));
    State *state = *to;
    if (!state)
        return fmi2Error;
    state->problem = NULL;
    memcpy(&state->memory, &unit->memory, sizeof state->memory);
    unit_clear_volatile(&state->memory);
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate from)
{
    Unit *unit = c;
    const State *state = from;
    if (!unit || !state)
        return fmi2Error;
    if (state->problem) {
        Text text = {0, ""};
        add(&text, MODEL ": the state was not restored: ");
        add(&text, state->problem);
        add(&text, ".");
        tell(unit, &unit->told[state->message], fmi2Error, text.text);
        return fmi2OK;
    }
    memcpy(&unit->memory, &state->memory, sizeof unit->memory);
    unit->computed = false;
    unit->initialising = unit->stale = !unit->memory.initialised;
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    if (!state)
        return fmi2Error;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    if (!c || !state || !size)
        return fmi2Error;
    *size = STATE_SIZE;
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate from, fmi2Byte bytes[], size_t size)
{
    const State *state = from;
    unsigned char *to = (unsigned char *)bytes;
    if (!c || !state || !bytes || state->problem || size < STATE_SIZE)
        return fmi2Error;
    memcpy(to, MAGIC, MAGIC_SIZE);
    memcpy(to + MAGIC_SIZE, GUID, sizeof GUID);
    memcpy(to + HEADER_SIZE, &state->memory, sizeof state->memory);
    put_crc32(to + STATE_SIZE - CRC_SIZE, crc32_of(to, STATE_SIZE - CRC_SIZE));
    return fmi2OK;
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

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *to)
{
    if (!c || !to || (!bytes && size))
        return fmi2Error;
    if (!*to)
        *to = malloc(sizeof(State));
    State *state = *to;
    if (!state)
        return fmi2Error;
    state->problem = state_problem((const unsigned char *)bytes, size, state);
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
    const fmi2Integer order[], const fmi2Real value[])
{
    (void)c, (void)references, (void)n, (void)order, (void)value;
    return fmi2Error;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t n,
    const fmi2Integer order[], fmi2Real value[])
{
    (void)c, (void)references, (void)n, (void)order, (void)value;
    return fmi2Error;
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference of[], size_t n_of,
    const fmi2ValueReference by[], size_t n_by, const fmi2Real seed[], fmi2Real value[])
{
    (void)c, (void)of, (void)n_of, (void)by, (void)n_by, (void)seed, (void)value;
    return fmi2Error;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    const Unit *unit = c;
    if (!unit || !value || kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = unit->time_s;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value)
{
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
