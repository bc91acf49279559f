/* A host that is not Python: steps the unit and prints TRPAC and the statuses that it saw. */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2FunctionTypes.h"

static void *library;

static void *function(const char *name)
{
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "%s is missing\n", name);
        exit(2);
    }
    return found;
}

static void log_message(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                        fmi2String category, fmi2String message, ...)
{
    va_list arguments;
    (void)environment, (void)category;
    printf("log %s %d: ", instance, status);
    va_start(arguments, message);
    vprintf(message, arguments);
    va_end(arguments);
    printf("\n");
}

/* Arguments: library, guid, resource URI, picture path, value references of the six variables below. */
int main(int argc, char **argv)
{
    if (argc != 11)
        return 2;
    library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 3;
    }
    fmi2InstantiateTYPE *instantiate = function("fmi2Instantiate");
    fmi2SetupExperimentTYPE *setup = function("fmi2SetupExperiment");
    fmi2EnterInitializationModeTYPE *enter = function("fmi2EnterInitializationMode");
    fmi2ExitInitializationModeTYPE *leave = function("fmi2ExitInitializationMode");
    fmi2SetRealTYPE *set_real = function("fmi2SetReal");
    fmi2SetStringTYPE *set_string = function("fmi2SetString");
    fmi2SetIntegerTYPE *set_integer = function("fmi2SetInteger");
    fmi2GetRealTYPE *get_real = function("fmi2GetReal");
    fmi2DoStepTYPE *step = function("fmi2DoStep");
    fmi2TerminateTYPE *terminate = function("fmi2Terminate");
    fmi2FreeInstanceTYPE *release = function("fmi2FreeInstance");

    fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};
    fmi2ValueReference signals[3], image = atoi(argv[8]), road = atoi(argv[9]), output = atoi(argv[10]);
    fmi2Real values[3] = {52.0, 150.0, 15.0}, result = -1.0;
    fmi2String picture = argv[4];
    fmi2Integer none = -1;
    int worst = fmi2OK;
    for (int i = 0; i < 3; i++)
        signals[i] = atoi(argv[5 + i]);

    fmi2Component unit = instantiate("c_host", fmi2CoSimulation, argv[2], argv[3], &callbacks, 0, fmi2True);
    if (!unit)
        return 4;
    worst |= setup(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    worst |= enter(unit);
    worst |= leave(unit);
    worst |= set_integer(unit, &road, 1, &none);
    worst |= set_string(unit, &image, 1, &picture);
    for (int i = 0; i < 500; i++) {
        worst |= set_real(unit, signals, 3, values);
        worst |= step(unit, i * 0.001, 0.001, fmi2True);
        worst |= get_real(unit, &output, 1, &result);
    }
    worst |= terminate(unit);
    release(unit);
    printf("TRPAC %.17g status %d\n", result, worst);
    return 0;
}
