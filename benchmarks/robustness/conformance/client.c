/* A host on the FMI headers alone. It reads one command per line and answers each with log lines and "= STATUS VALUE".
 * Numbers travel as hexadecimal floats, serialised states as hexadecimal bytes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

#define SLOTS 8

static void *library;
static fmi2Component units[SLOTS];
static fmi2FMUstate states[SLOTS];

static void *function(const char *name)
{
    void *found = library ? dlsym(library, name) : NULL;
    if (!found) {
        printf("= 3 %s is missing\n", name);
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

static fmi2CallbackFunctions callbacks = {log_message, calloc, free, NULL, NULL};

static void serialise(fmi2Component unit, fmi2FMUstate state)
{
    size_t size = 0;
    int status = ((fmi2SerializedFMUstateSizeTYPE *)function("fmi2SerializedFMUstateSize"))(unit, state, &size);
    fmi2Byte *bytes = malloc(size + 1);
    if (!status)
        status = ((fmi2SerializeFMUstateTYPE *)function("fmi2SerializeFMUstate"))(unit, state, bytes, size);
    printf("= %d ", status);
    for (size_t i = 0; i < size; i++)
        printf("%02x", (unsigned char)bytes[i]);
    printf("\n");
    free(bytes);
}

static int deserialise(fmi2Component unit, fmi2FMUstate *state, const char *text)
{
    size_t size = strlen(text) / 2;
    fmi2Byte *bytes = malloc(size + 1);
    for (size_t i = 0; i < size; i++) {
        unsigned value;
        sscanf(text + 2 * i, "%2x", &value);
        bytes[i] = (fmi2Byte)value;
    }
    int status = ((fmi2DeSerializeFMUstateTYPE *)function("fmi2DeSerializeFMUstate"))(unit, bytes, size, state);
    free(bytes);
    return status;
}

static int set_one(fmi2Component unit, const char *kind, fmi2ValueReference vr, const char *text)
{
    fmi2Real real = strtod(text, NULL);
    fmi2Integer integer = (fmi2Integer)strtol(text, NULL, 10);
    if (!strcmp(kind, "Real"))
        return ((fmi2SetRealTYPE *)function("fmi2SetReal"))(unit, &vr, 1, &real);
    if (!strcmp(kind, "Integer"))
        return ((fmi2SetIntegerTYPE *)function("fmi2SetInteger"))(unit, &vr, 1, &integer);
    if (!strcmp(kind, "Boolean"))
        return ((fmi2SetBooleanTYPE *)function("fmi2SetBoolean"))(unit, &vr, 1, &integer);
    return ((fmi2SetStringTYPE *)function("fmi2SetString"))(unit, &vr, 1, &text);
}

static void get_one(fmi2Component unit, const char *kind, fmi2ValueReference vr)
{
    fmi2Real real = 0.0;
    fmi2Integer integer = 0;
    fmi2String text = "";
    if (!strcmp(kind, "Real")) {
        int status = ((fmi2GetRealTYPE *)function("fmi2GetReal"))(unit, &vr, 1, &real);
        printf("= %d %a\n", status, real);
    } else if (!strcmp(kind, "String")) {
        int status = ((fmi2GetStringTYPE *)function("fmi2GetString"))(unit, &vr, 1, &text);
        printf("= %d %s\n", status, text);
    } else {
        int status = !strcmp(kind, "Integer")
                         ? ((fmi2GetIntegerTYPE *)function("fmi2GetInteger"))(unit, &vr, 1, &integer)
                         : ((fmi2GetBooleanTYPE *)function("fmi2GetBoolean"))(unit, &vr, 1, &integer);
        printf("= %d %d\n", status, integer);
    }
}

/* Commands without a value in the answer; their number in FMI's order of a simulation. */
static int plain(const char *verb, int slot, const char *first, const char *second)
{
    fmi2Component unit = units[slot];
    if (!strcmp(verb, "setup"))
        return ((fmi2SetupExperimentTYPE *)function("fmi2SetupExperiment"))(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0);
    if (!strcmp(verb, "enter"))
        return ((fmi2EnterInitializationModeTYPE *)function("fmi2EnterInitializationMode"))(unit);
    if (!strcmp(verb, "leave"))
        return ((fmi2ExitInitializationModeTYPE *)function("fmi2ExitInitializationMode"))(unit);
    if (!strcmp(verb, "step"))
        return ((fmi2DoStepTYPE *)function("fmi2DoStep"))(unit, strtod(first, NULL), strtod(second, NULL), fmi2True);
    if (!strcmp(verb, "reset"))
        return ((fmi2ResetTYPE *)function("fmi2Reset"))(unit);
    if (!strcmp(verb, "terminate"))
        return ((fmi2TerminateTYPE *)function("fmi2Terminate"))(unit);
    if (!strcmp(verb, "free")) {
        ((fmi2FreeInstanceTYPE *)function("fmi2FreeInstance"))(unit);
        return 0;
    }
    if (!strcmp(verb, "save"))
        return ((fmi2GetFMUstateTYPE *)function("fmi2GetFMUstate"))(unit, &states[atoi(first)]);
    if (!strcmp(verb, "restore"))
        return ((fmi2SetFMUstateTYPE *)function("fmi2SetFMUstate"))(unit, states[atoi(first)]);
    if (!strcmp(verb, "drop"))
        return ((fmi2FreeFMUstateTYPE *)function("fmi2FreeFMUstate"))(unit, &states[atoi(first)]);
    if (!strcmp(verb, "deserialise"))
        return deserialise(unit, &states[atoi(first)], second);
    fprintf(stderr, "unknown command %s\n", verb);
    exit(2);
}

static int load(const char *path)
{
    library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library)
        fprintf(stderr, "%s\n", dlerror());
    return library ? 0 : 3;
}

static int instantiate(int slot, char *rest)
{
    const char *name = strsep(&rest, " "), *guid = strsep(&rest, " "), *resources = strsep(&rest, " ");
    units[slot] = ((fmi2InstantiateTYPE *)function("fmi2Instantiate"))(
        name, fmi2CoSimulation, guid, resources, &callbacks, fmi2False, atoi(rest));
    return units[slot] ? 0 : 3;
}

int main(void)
{
    char *line = NULL;
    size_t room = 0;
    setvbuf(stdout, NULL, _IOLBF, 0);
    while (getline(&line, &room, stdin) > 0) {
        line[strcspn(line, "\n")] = 0;
        char *rest = line, *verb = strsep(&rest, " ");
        if (!strcmp(verb, "load")) {
            printf("= %d\n", load(rest));
        } else if (!strcmp(verb, "unload")) {
            printf("= %d\n", dlclose(library) ? 3 : 0);
        } else {
            int slot = atoi(strsep(&rest, " "));
            if (!strcmp(verb, "instantiate")) {
                printf("= %d\n", instantiate(slot, rest));
            } else if (!strcmp(verb, "set") || !strcmp(verb, "get")) {
                const char *kind = strsep(&rest, " ");
                fmi2ValueReference vr = (fmi2ValueReference)atol(strsep(&rest, " "));
                if (*verb == 's')
                    printf("= %d\n", set_one(units[slot], kind, vr, rest ? rest : ""));
                else
                    get_one(units[slot], kind, vr);
            } else if (!strcmp(verb, "serialise")) {
                serialise(units[slot], states[atoi(rest)]);
            } else {
                const char *first = strsep(&rest, " ");
                printf("= %d\n", plain(verb, slot, first, rest));
            }
        }
    }
    free(line);
    return 0;
}
