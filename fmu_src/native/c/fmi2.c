/* The functions of FMI 2.0 for co-simulation. */
#include "fmi2Functions.h"
#include "instance.h"

#include <stdio.h>
#include <stdlib.h>

typedef struct {
    Unit unit;
    fmi2CallbackFunctions callbacks;
    char name[256];
} Instance;

/* Tell the host, without printf directives: it takes a message for a format. */
static void log_to_host(const Unit *unit, Status status, const char *category, const char *message)
{
    const Instance *instance = (const Instance *)unit;
    char format[2 * LONGEST_LOG + 8];
    size_t n = 0;
    if (!instance->callbacks.logger)
        return;
    for (; *message; message++) {
        if (*message == '%')
            format[n++] = '%';
        format[n++] = *message;
    }
    format[n] = '\0';
    instance->callbacks.logger(
        instance->callbacks.componentEnvironment, instance->name, (fmi2Status)status, category, format);
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
    return (fmi2Status)switch_logging(c, on != fmi2False);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)resources, (void)visible;
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    if (callbacks)
        instance->callbacks = *callbacks;
    (void)snprintf(instance->name, sizeof instance->name, "%s", name ? name : "");
    if (begin_instance(&instance->unit, guid, logging != fmi2False, log_to_host,
            type == fmi2CoSimulation ? NULL : CO_SIMULATION_ONLY))
        return instance;
    free(instance);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c)
{
    free(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance, fmi2Real start_s,
    fmi2Boolean stop_defined, fmi2Real stop_s)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop_s;
    return (fmi2Status)set_time(c, start_s);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return (fmi2Status)enter_initialisation(c);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return (fmi2Status)exit_initialisation(c);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return c ? fmi2OK : fmi2Error;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    return (fmi2Status)reset_instance(c);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_back)
{
    (void)no_back;
    return (fmi2Status)do_step(c, now, step);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}

#define SETTER(NAME, TYPE, SET)                                                                                  \
    fmi2Status NAME(fmi2Component c, const fmi2ValueReference references[], size_t n, const TYPE values[])       \
    {                                                                                                            \
        if (!c)                                                                                                  \
            return fmi2Error;                                                                                    \
        for (size_t k = 0; k < n; k++)                                                                           \
            SET(c, references[k], values[k]);                                                                    \
        return fmi2OK;                                                                                           \
    }

SETTER(fmi2SetReal, fmi2Real, set_real)
SETTER(fmi2SetInteger, fmi2Integer, set_integer)
SETTER(fmi2SetBoolean, fmi2Boolean, set_boolean)
SETTER(fmi2SetString, fmi2String, set_string)

#define GETTER(NAME, TYPE, KIND, GET)                                                                            \
    fmi2Status NAME(fmi2Component c, const fmi2ValueReference references[], size_t n, TYPE values[])             \
    {                                                                                                            \
        Text unknown;                                                                                            \
        if (!c)                                                                                                  \
            return fmi2Error;                                                                                    \
        before_get(c, &unknown);                                                                                 \
        for (size_t k = 0; k < n; k++)                                                                           \
            values[k] = GET(c, references[k], &unknown);                                                         \
        after_get(c, KIND, &unknown);                                                                            \
        return fmi2OK;                                                                                           \
    }

GETTER(fmi2GetReal, fmi2Real, REAL, get_real)
GETTER(fmi2GetInteger, fmi2Integer, INTEGER, get_integer)
GETTER(fmi2GetBoolean, fmi2Boolean, BOOLEAN, get_boolean)
GETTER(fmi2GetString, fmi2String, STRING, get_string)

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *to)
{
    return (fmi2Status)save_state(c, to);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate from)
{
    return (fmi2Status)restore_state(c, from);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    return (fmi2Status)free_state(state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    return (fmi2Status)state_size(c, state, size);
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate from, fmi2Byte bytes[], size_t size)
{
    return (fmi2Status)serialise_state(c, from, (unsigned char *)bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *to)
{
    return (fmi2Status)deserialise_state(c, (const unsigned char *)bytes, size, to);
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
    const Instance *instance = c;
    if (!instance || !value || kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = instance->unit.memory.time_s;
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
