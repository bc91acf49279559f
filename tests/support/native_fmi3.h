/* The calls of FMI 2.0 that `native_host.c` makes, by those of FMI 3.0. */
#if defined(__clang__)
#pragma clang diagnostic ignored "-Wstrict-prototypes" /* of the standard's header */
#endif
#include "fmi3Functions.h"

typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef fmi3ValueReference fmi2ValueReference;
typedef fmi3Status fmi2Status;
typedef fmi3Float64 fmi2Real;
typedef fmi3Int32 fmi2Integer;
typedef fmi3Boolean fmi2Boolean;
typedef fmi3String fmi2String;
#define fmi2False fmi3False
#define fmi2True fmi3True
#define fmi2OK fmi3OK
#define fmi2Warning fmi3Warning
#define fmi2Error fmi3Error
enum { fmi2CoSimulation = 1 };

typedef struct {
    void (*logger)(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...);
    void *allocate, *free, *step_finished, *environment;
} fmi2CallbackFunctions;

static void log_by_callbacks(void *environment, fmi3Status status, fmi3String category, fmi3String message)
{
    ((const fmi2CallbackFunctions *)environment)->logger(NULL, "", status, category, message);
}

static inline fmi2Component fmi2Instantiate(fmi2String name, int type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)type;
    return fmi3InstantiateCoSimulation(name, guid, resources, visible, logging, fmi3False, fmi3False, NULL, 0,
        (void *)callbacks, log_by_callbacks, NULL);
}

static inline fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
    fmi2Real start, fmi2Boolean stop_defined, fmi2Real stop)
{
    (void)c, (void)tolerance_defined, (void)tolerance, (void)start, (void)stop_defined, (void)stop;
    return fmi3OK;
}

static inline fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return fmi3EnterInitializationMode(c, fmi3False, 0.0, 0.0, fmi3False, 0.0);
}

static inline fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real step, fmi2Boolean no_back)
{
    fmi3Boolean event_needed = fmi3True, terminate = fmi3True, early_return = fmi3True;
    fmi3Float64 last_time = -1.0;
    const fmi3Status status
        = fmi3DoStep(c, now, step, no_back, &event_needed, &terminate, &early_return, &last_time);
    const int took = 0.0 <= step && step <= 1.0;
    return event_needed || terminate || early_return || (took && last_time != now + step) ? fmi3Fatal : status;
}

#define ACCESS(NAME, NAME_3, TYPE)                                                                               \
    static inline fmi2Status NAME(fmi2Component c, const fmi2ValueReference references[], size_t n, TYPE values[]) \
    {                                                                                                            \
        return NAME_3(c, references, n, values, n);                                                              \
    }

ACCESS(fmi2SetReal, fmi3SetFloat64, const fmi2Real)
ACCESS(fmi2SetInteger, fmi3SetInt32, const fmi2Integer)
ACCESS(fmi2SetBoolean, fmi3SetBoolean, const fmi2Boolean)
ACCESS(fmi2SetString, fmi3SetString, const fmi2String)
ACCESS(fmi2GetReal, fmi3GetFloat64, fmi2Real)
ACCESS(fmi2GetInteger, fmi3GetInt32, fmi2Integer)
ACCESS(fmi2GetBoolean, fmi3GetBoolean, fmi2Boolean)
ACCESS(fmi2GetString, fmi3GetString, fmi2String)

#define fmi2FreeInstance fmi3FreeInstance
#define fmi2ExitInitializationMode fmi3ExitInitializationMode
#define fmi2Reset fmi3Reset
#define fmi2GetFMUstate fmi3GetFMUState
#define fmi2SetFMUstate fmi3SetFMUState
#define fmi2FreeFMUstate fmi3FreeFMUState
#define fmi2SerializedFMUstateSize fmi3SerializedFMUStateSize
#define fmi2SerializeFMUstate(c, state, bytes, size) fmi3SerializeFMUState(c, state, (fmi3Byte *)(bytes), size)
#define fmi2DeSerializeFMUstate(c, bytes, size, state) \
    fmi3DeserializeFMUState(c, (const fmi3Byte *)(bytes), size, state)
