/* The functions of FMI 3.0 for co-simulation. */
#if defined(__clang__)
#pragma clang diagnostic ignored "-Wstrict-prototypes" /* of the standard's header */
#endif
#include "fmi3Functions.h"
#include "instance.h"

#include <stdlib.h>

typedef struct {
    Unit unit;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log_message;
} Instance;

static void log_to_host(const Unit *unit, Status status, const char *category, const char *message)
{
    const Instance *instance = (const Instance *)unit;
    if (instance->log_message)
        instance->log_message(instance->environment, (fmi3Status)status, category, message);
}

/* An instance; NULL, after a message, where there is a problem. */
static fmi3Instance instantiated(fmi3String token, fmi3Boolean logging, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log_message, const char *problem)
{
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    instance->environment = environment;
    instance->log_message = log_message;
    if (begin_instance(&instance->unit, token, logging, log_to_host, problem))
        return instance;
    free(instance);
    return NULL;
}

const char *fmi3GetVersion(void)
{
    return fmi3Version;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)n, (void)categories;
    return (fmi3Status)switch_logging(c, on);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early_return, const fmi3ValueReference intermediate[],
    size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
    fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)n, (void)update;
    return instantiated(token, logging, environment, log_message, events ? "it has no event mode." : NULL);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message)
{
    (void)name, (void)resources, (void)visible;
    return instantiated(token, logging, environment, log_message, CO_SIMULATION_ONLY);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log_message,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)resources, (void)visible, (void)update, (void)lock, (void)unlock;
    return instantiated(token, logging, environment, log_message, CO_SIMULATION_ONLY);
}

void fmi3FreeInstance(fmi3Instance c)
{
    free(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance_defined, fmi3Float64 tolerance,
    fmi3Float64 start_s, fmi3Boolean stop_defined, fmi3Float64 stop_s)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop_s;
    (void)set_time(c, start_s);
    return (fmi3Status)enter_initialisation(c);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    return (fmi3Status)exit_initialisation(c);
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    return c ? fmi3OK : fmi3Error;
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    return (fmi3Status)reset_instance(c);
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 now, fmi3Float64 step, fmi3Boolean no_back,
    fmi3Boolean *event_needed, fmi3Boolean *terminate, fmi3Boolean *early_return, fmi3Float64 *last_time)
{
    (void)no_back;
    if (!c || !event_needed || !terminate || !early_return || !last_time)
        return fmi3Error;
    const Status status = do_step(c, now, step);
    *event_needed = *terminate = *early_return = fmi3False;
    *last_time = ((const Instance *)c)->unit.memory.time_s;
    return (fmi3Status)status;
}

/* Each variable has one value, so there are as many values as references. */
#define SETTER(NAME, TYPE, SET)                                                                                  \
    fmi3Status NAME(                                                                                             \
        fmi3Instance c, const fmi3ValueReference references[], size_t n, const TYPE values[], size_t n_values)   \
    {                                                                                                            \
        if (!c || n != n_values)                                                                                 \
            return fmi3Error;                                                                                    \
        for (size_t k = 0; k < n; k++)                                                                           \
            SET(c, references[k], values[k]);                                                                    \
        return fmi3OK;                                                                                           \
    }

SETTER(fmi3SetFloat64, fmi3Float64, set_real)
SETTER(fmi3SetInt32, fmi3Int32, set_integer)
SETTER(fmi3SetBoolean, fmi3Boolean, set_boolean)
SETTER(fmi3SetString, fmi3String, set_string)

#define GETTER(NAME, TYPE, KIND, GET)                                                                            \
    fmi3Status NAME(                                                                                             \
        fmi3Instance c, const fmi3ValueReference references[], size_t n, TYPE values[], size_t n_values)         \
    {                                                                                                            \
        Text unknown;                                                                                            \
        if (!c || n != n_values)                                                                                 \
            return fmi3Error;                                                                                    \
        before_get(c, &unknown);                                                                                 \
        for (size_t k = 0; k < n; k++)                                                                           \
            values[k] = GET(c, references[k], &unknown);                                                         \
        after_get(c, KIND, &unknown);                                                                            \
        return fmi3OK;                                                                                           \
    }

GETTER(fmi3GetFloat64, fmi3Float64, REAL, get_real)
GETTER(fmi3GetInt32, fmi3Int32, INTEGER, get_integer)
GETTER(fmi3GetBoolean, fmi3Boolean, BOOLEAN, get_boolean)
GETTER(fmi3GetString, fmi3String, STRING, get_string)

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *to)
{
    return (fmi3Status)save_state(c, to);
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState from)
{
    return (fmi3Status)restore_state(c, from);
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    return (fmi3Status)free_state(state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    return (fmi3Status)state_size(c, state, size);
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState from, fmi3Byte bytes[], size_t size)
{
    return (fmi3Status)serialise_state(c, from, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *to)
{
    return (fmi3Status)deserialise_state(c, bytes, size, to);
}

/* What the standard wants exported, and a unit without these types, events, clocks and derivatives does not offer. */
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define NOT_OFFERED(NAME, ...)                                                                                   \
    fmi3Status NAME(fmi3Instance c, __VA_ARGS__)                                                                 \
    {                                                                                                            \
        return fmi3Error;                                                                                        \
    }
#define NO_MODE(NAME)                                                                                            \
    fmi3Status NAME(fmi3Instance c)                                                                              \
    {                                                                                                            \
        return fmi3Error;                                                                                        \
    }
#define NO_TYPE(GET, SET, TYPE)                                                                                  \
    NOT_OFFERED(GET, const fmi3ValueReference references[], size_t n, TYPE values[], size_t n_values)            \
    NOT_OFFERED(SET, const fmi3ValueReference references[], size_t n, const TYPE values[], size_t n_values)

NO_TYPE(fmi3GetFloat32, fmi3SetFloat32, fmi3Float32)
NO_TYPE(fmi3GetInt8, fmi3SetInt8, fmi3Int8)
NO_TYPE(fmi3GetUInt8, fmi3SetUInt8, fmi3UInt8)
NO_TYPE(fmi3GetInt16, fmi3SetInt16, fmi3Int16)
NO_TYPE(fmi3GetUInt16, fmi3SetUInt16, fmi3UInt16)
NO_TYPE(fmi3GetUInt32, fmi3SetUInt32, fmi3UInt32)
NO_TYPE(fmi3GetInt64, fmi3SetInt64, fmi3Int64)
NO_TYPE(fmi3GetUInt64, fmi3SetUInt64, fmi3UInt64)
NOT_OFFERED(fmi3GetBinary, const fmi3ValueReference references[], size_t n, size_t sizes[], fmi3Binary values[],
    size_t n_values)
NOT_OFFERED(fmi3SetBinary, const fmi3ValueReference references[], size_t n, const size_t sizes[],
    const fmi3Binary values[], size_t n_values)
NOT_OFFERED(fmi3GetClock, const fmi3ValueReference references[], size_t n, fmi3Clock values[])
NOT_OFFERED(fmi3SetClock, const fmi3ValueReference references[], size_t n, const fmi3Clock values[])

NOT_OFFERED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference reference, size_t *n)
NOT_OFFERED(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elements_of_dependent[],
    fmi3ValueReference independents[], size_t elements_of_independents[], fmi3DependencyKind kinds[], size_t n)
NOT_OFFERED(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
    fmi3Float64 sensitivity[], size_t n_sensitivity)
NOT_OFFERED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t n_unknowns,
    const fmi3ValueReference knowns[], size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
    fmi3Float64 sensitivity[], size_t n_sensitivity)
NOT_OFFERED(fmi3GetOutputDerivatives, const fmi3ValueReference references[], size_t n, const fmi3Int32 orders[],
    fmi3Float64 values[], size_t n_values)

NO_MODE(fmi3EnterConfigurationMode)
NO_MODE(fmi3ExitConfigurationMode)
NO_MODE(fmi3EnterEventMode)
NO_MODE(fmi3EnterStepMode)
NO_MODE(fmi3EnterContinuousTimeMode)
NO_MODE(fmi3EvaluateDiscreteStates)
NOT_OFFERED(fmi3UpdateDiscreteStates, fmi3Boolean *update_needed, fmi3Boolean *terminate,
    fmi3Boolean *nominals_changed, fmi3Boolean *values_changed, fmi3Boolean *next_defined, fmi3Float64 *next)

NOT_OFFERED(fmi3GetIntervalDecimal, const fmi3ValueReference references[], size_t n, fmi3Float64 intervals[],
    fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetIntervalFraction, const fmi3ValueReference references[], size_t n, fmi3UInt64 counters[],
    fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NOT_OFFERED(fmi3GetShiftDecimal, const fmi3ValueReference references[], size_t n, fmi3Float64 shifts[])
NOT_OFFERED(fmi3GetShiftFraction, const fmi3ValueReference references[], size_t n, fmi3UInt64 counters[],
    fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetIntervalDecimal, const fmi3ValueReference references[], size_t n, const fmi3Float64 intervals[])
NOT_OFFERED(fmi3SetIntervalFraction, const fmi3ValueReference references[], size_t n, const fmi3UInt64 counters[],
    const fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3SetShiftDecimal, const fmi3ValueReference references[], size_t n, const fmi3Float64 shifts[])
NOT_OFFERED(fmi3SetShiftFraction, const fmi3ValueReference references[], size_t n, const fmi3UInt64 counters[],
    const fmi3UInt64 resolutions[])
NOT_OFFERED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)

NOT_OFFERED(fmi3CompletedIntegratorStep, fmi3Boolean no_back, fmi3Boolean *enter_event_mode, fmi3Boolean *terminate)
NOT_OFFERED(fmi3SetTime, fmi3Float64 time)
NOT_OFFERED(fmi3SetContinuousStates, const fmi3Float64 states[], size_t n)
NOT_OFFERED(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t n)
NOT_OFFERED(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t n)
NOT_OFFERED(fmi3GetContinuousStates, fmi3Float64 states[], size_t n)
NOT_OFFERED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t n)
NOT_OFFERED(fmi3GetNumberOfEventIndicators, size_t *n)
NOT_OFFERED(fmi3GetNumberOfContinuousStates, size_t *n)
