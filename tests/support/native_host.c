/* A host in C of the native unit, linked with its library or its sources.

   run IN OUT    drives it with the rows of a file; in the middle another instance takes over its serialised state
   threads IN    drives eight instances with the same rows at once; they must give the same
   fuzz SEED N   calls everything with values of no sense, and restores damaged states
   bench IN      the time of a step with set and get
   long IN S N   S steps of one instance, then N instances of one step; prints the resident memory of both, begin and end [kB]
   Rows are doubles: step size, the eight real inputs, road_class, frame_id. With -DFOUR_WHEELS it fuzzes the unit of four wheels; with -DFMI_3 it hosts one for FMI 3.0. */
#define _POSIX_C_SOURCE 200809L
#ifdef FMI_3
#include "native_fmi3.h"
#else
#include "fmi2Functions.h"
#endif
#include "tables.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#ifndef _WIN32
#include <pthread.h>
#include <unistd.h>
#endif

enum { INPUTS = 8, ROW = INPUTS + 3, MOST = 128, THREADS = 8 };
#ifdef FOUR_WHEELS
static const fmi2ValueReference real_inputs[INPUTS] = {VR_wheel_speed_fl, VR_wheel_torque_rr, VR_vehicle_speed,
    VR_road_class_confidence_left, VR_vertical_load_fr, VR_steering_angle, VR_lateral_acceleration, VR_yaw_rate};
static const fmi2ValueReference integer_inputs[2] = {VR_road_class_left, VR_frame_id};
#else
static const fmi2ValueReference real_inputs[INPUTS] = {VR_wheel_speed, VR_wheel_torque, VR_vehicle_speed,
    VR_road_class_confidence, VR_vertical_load, VR_steering_angle, VR_longitudinal_acceleration, VR_yaw_rate};
static const fmi2ValueReference integer_inputs[2] = {VR_road_class, VR_frame_id};
#endif
static fmi2ValueReference outputs[MOST];
static int output_count, told;
static double *rows;
static size_t row_count;

#ifdef COUNT_ALLOCATIONS
static long allocations;
void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_malloc(size_t size)
{
    allocations++;
    return __real_malloc(size);
}
void *__wrap_calloc(size_t n, size_t size)
{
    allocations++;
    return __real_calloc(n, size);
}
#endif

static void check(int good, const char *what)
{
    if (!good) {
        fprintf(stderr, "host: %s\n", what);
        exit(1);
    }
}

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
    fmi2String message, ...)
{
    (void)environment, (void)name, (void)category, (void)message;
    check(status == fmi2Warning || status == fmi2Error, "a message without a cause");
    told++;
}

static const fmi2CallbackFunctions callbacks = {log_message, NULL, NULL, NULL, NULL};

static fmi2Component opened(int method)
{
    const fmi2ValueReference reference = VR_estimator_method;
    fmi2Component unit = fmi2Instantiate("host", fmi2CoSimulation, GUID, "", &callbacks, fmi2False, fmi2True);
    check(unit != NULL, "not instantiated");
    check(fmi2SetupExperiment(unit, fmi2False, 0.0, 0.0, fmi2False, 0.0) == fmi2OK, "setup");
    if (method >= 0)
        check(fmi2SetInteger(unit, &reference, 1, &method) == fmi2OK, "method");
    check(fmi2EnterInitializationMode(unit) == fmi2OK, "enter");
    check(fmi2ExitInitializationMode(unit) == fmi2OK, "exit");
    return unit;
}

static void read_rows(const char *path)
{
    FILE *file = fopen(path, "rb");
    check(file != NULL, "no file of rows");
    check(fseek(file, 0, SEEK_END) == 0, "seek");
    row_count = (size_t)ftell(file) / (ROW * sizeof(double));
    rewind(file);
    rows = malloc(row_count * ROW * sizeof(double));
    check(rows && fread(rows, ROW * sizeof(double), row_count, file) == row_count, "rows");
    fclose(file);
}

static void step(fmi2Component unit, size_t k, const double *row, double *out)
{
    const fmi2Integer integers[2] = {(int)row[INPUTS + 1], (int)row[INPUTS + 2]};
    fmi2SetReal(unit, real_inputs, INPUTS, row + 1);
    fmi2SetInteger(unit, integer_inputs, 2, integers);
    check(fmi2DoStep(unit, 1e-3 * (double)k, row[0], fmi2True) == fmi2OK, "step");
    fmi2GetReal(unit, outputs, (size_t)output_count, out);
}

static fmi2Component handed_over(fmi2Component unit, int method)
{
    fmi2FMUstate state = NULL, other_state = NULL;
    size_t size = 0;
    check(fmi2GetFMUstate(unit, &state) == fmi2OK, "get state");
    check(fmi2SerializedFMUstateSize(unit, state, &size) == fmi2OK, "size");
    char *bytes = malloc(size);
    check(bytes && fmi2SerializeFMUstate(unit, state, bytes, size) == fmi2OK, "serialise");
    fmi2FreeFMUstate(unit, &state);
    fmi2FreeInstance(unit);
    fmi2Component other = opened(method);
    check(fmi2DeSerializeFMUstate(other, bytes, size, &other_state) == fmi2OK, "deserialise");
    check(fmi2SetFMUstate(other, other_state) == fmi2OK, "set state");
    fmi2FreeFMUstate(other, &other_state);
    free(bytes);
    return other;
}

static void run(const char *path, int method)
{
    FILE *file = fopen(path, "wb");
    double out[MOST];
    fmi2Component unit = opened(method);
    check(file != NULL, "no place for outputs");
    for (size_t k = 0; k < row_count; k++) {
        if (k == row_count / 2)
            unit = handed_over(unit, method);
        step(unit, k, rows + k * ROW, out);
        fwrite(out, sizeof(double), (size_t)output_count, file);
    }
    fclose(file);
    fmi2FreeInstance(unit);
}

#ifndef _WIN32
static void *driven(void *result)
{
    fmi2Component unit = opened(-1);
    for (size_t k = 0; k < row_count; k++)
        step(unit, k, rows + k * ROW, result);
    fmi2FreeInstance(unit);
    return NULL;
}

static void threads(void)
{
    static double results[THREADS][MOST];
    pthread_t all[THREADS];
    for (int k = 0; k < THREADS; k++)
        check(pthread_create(&all[k], NULL, driven, results[k]) == 0, "thread");
    for (int k = 0; k < THREADS; k++)
        check(pthread_join(all[k], NULL) == 0, "join");
    for (int k = 1; k < THREADS; k++)
        check(memcmp(results[k], results[0], (size_t)output_count * sizeof(double)) == 0, "threads differ");
}

static long resident_kb(void)
{
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    check(file && fscanf(file, "%*d %ld", &pages) == 1, "no /proc/self/statm");
    fclose(file);
    return pages * (sysconf(_SC_PAGESIZE) / 1024);
}

/* The first tenth of both warms up. */
static void last_long(long steps, long instances)
{
    double out[MOST];
    long begun = resident_kb(); /* which takes a page itself */
    fmi2Component unit = opened(-1);
    for (long k = 0; k < steps; k++) {
        if (k == steps / 10)
            begun = resident_kb();
        step(unit, (size_t)k, rows + ((size_t)k % row_count) * ROW, out);
    }
    printf("%ld %ld", begun, resident_kb());
    fmi2FreeInstance(unit);
    for (long k = 0; k < instances; k++) {
        if (k == instances / 10)
            begun = resident_kb();
        unit = opened(-1);
        step(unit, 0, rows, out);
        fmi2FreeInstance(unit);
    }
    printf(" %ld %ld\n", begun, resident_kb());
}
#endif

static unsigned long long state_of_random;

static unsigned draw(unsigned below)
{
    state_of_random = state_of_random * 6364136223846793005ull + 1442695040888963407ull;
    return (unsigned)(state_of_random >> 33) % below;
}

static double odd(void)
{
    static const double all[] = {0.0, -0.0, 1.0, -1.0, 52.0, 15.0, 300.0, 3000.0, 1e-300, 1e300, -1e300, 0.001, 1e9};
    const unsigned k = draw(sizeof all / sizeof all[0] + 3);
    return k < sizeof all / sizeof all[0] ? all[k] * (0.9 + 0.0001 * draw(2000)) : k % 3 == 0 ? NAN : k % 3 == 1 ? INFINITY : -INFINITY;
}

static void spoilt_state(fmi2Component unit)
{
    fmi2FMUstate state = NULL, other = NULL;
    size_t size = 0;
    fmi2GetFMUstate(unit, &state);
    fmi2SerializedFMUstateSize(unit, state, &size);
    char *bytes = malloc(size);
    fmi2SerializeFMUstate(unit, state, bytes, size);
    for (unsigned k = draw(3); k > 0; k--)
        bytes[draw((unsigned)size)] ^= (char)(1u << draw(8));
    fmi2DeSerializeFMUstate(unit, bytes, draw(4) ? size : draw((unsigned)size), &other);
    fmi2SetFMUstate(unit, other);
    fmi2SetFMUstate(unit, state);
    fmi2FreeFMUstate(unit, &state);
    fmi2FreeFMUstate(unit, &other);
    free(bytes);
}

static void fuzz(unsigned seed, int calls)
{
    static const char *const texts[] = {"", "road.png", "%s%n%s", NULL};
    fmi2Component unit = opened((int)(seed % 3));
    double out[MOST], now_s = 0.0;
    state_of_random = seed;
    for (int k = 0; k < calls; k++) {
        const fmi2ValueReference any = draw(200) ? draw(COUNT) : draw(100000);
        const fmi2Real real = odd();
        const fmi2Integer integer = (int)draw(7) - 3;
        const fmi2Boolean truth = (int)draw(2);
        const fmi2String text = texts[draw(4)];
        fmi2Integer got;
        fmi2Boolean shown;
        fmi2String string;
        fmi2SetReal(unit, &real_inputs[draw(INPUTS)], 1, &real);
        switch (draw(12)) {
        case 0: fmi2SetReal(unit, &any, 1, &real); break;
        case 1: fmi2SetInteger(unit, &any, 1, &integer); break;
        case 2: fmi2SetBoolean(unit, &any, 1, &truth); break;
        case 3: fmi2SetString(unit, &any, 1, &text); break;
        case 4: fmi2GetInteger(unit, &any, 1, &got); break;
        case 5: fmi2GetBoolean(unit, &any, 1, &shown); break;
        case 6: fmi2GetString(unit, &any, 1, &string); break;
        case 7: if (!draw(20)) spoilt_state(unit); break;
        case 8:
            if (!draw(200)) {
                fmi2Reset(unit);
                fmi2EnterInitializationMode(unit);
                fmi2SetReal(unit, &any, 1, &real);
                fmi2SetInteger(unit, &any, 1, &integer);
                fmi2GetReal(unit, outputs, (size_t)output_count, out);
                fmi2ExitInitializationMode(unit);
            }
            break;
        default: break;
        }
        const double begin_s = draw(20) ? now_s : odd(), step_s = draw(20) ? 0.001 : odd();
        if (fmi2DoStep(unit, begin_s, step_s, fmi2True) == fmi2OK)
            now_s = begin_s + step_s;
        fmi2GetReal(unit, outputs, (size_t)output_count, out);
    }
    fmi2FreeInstance(unit);
}

#ifndef _WIN32
static double seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double left = *(const double *)a, right = *(const double *)b;
    return (left > right) - (left < right);
}

/* Prints the mean time of a step, and the median of the slowest tenth [ns]. */
static void bench(int method)
{
    double out[MOST], total = 0.0, *all = malloc(row_count * sizeof(double));
    fmi2Component unit = opened(method);
    check(all != NULL, "memory");
    for (size_t k = 0; k < row_count; k++) {
        const double begun = seconds();
        step(unit, k, rows + k * ROW, out);
        const double passed = seconds() - begun;
        total += passed;
        all[k] = passed;
    }
    qsort(all, row_count, sizeof(double), ascending);
    printf("%.0f %.0f\n", 1e9 * total / (double)row_count, 1e9 * all[row_count * 19 / 20]);
    free(all);
    fmi2FreeInstance(unit);
}
#endif

int main(int argc, char **argv)
{
    check(argc >= 3, "arguments");
    for (int k = 0; k < COUNT; k++)
        if (VARIABLES[k].causality == OUTPUT && VARIABLES[k].kind == REAL)
            outputs[output_count++] = (fmi2ValueReference)k;
    if (strcmp(argv[1], "fuzz") == 0) {
        fuzz((unsigned)atoi(argv[2]), atoi(argv[3]));
        return 0;
    }
    read_rows(argv[2]);
#ifdef COUNT_ALLOCATIONS
    fmi2Component unit = opened(-1);
    const long before = allocations;
    double out[MOST];
    for (size_t k = 0; k < row_count; k++)
        step(unit, k, rows + k * ROW, out);
    check(allocations == before, "memory was allocated in a step");
    fmi2FreeInstance(unit);
    for (int k = 0; k < 10000; k++)
        fmi2FreeInstance(fmi2Instantiate("one", fmi2CoSimulation, GUID, "", &callbacks, fmi2False, fmi2False));
    check(allocations == before + 10000, "an instance is one piece of memory");
    return 0;
#endif
#ifndef _WIN32
    if (strcmp(argv[1], "threads") == 0)
        threads();
    if (strcmp(argv[1], "bench") == 0)
        bench(argc > 3 ? atoi(argv[3]) : -1);
    if (strcmp(argv[1], "long") == 0)
        last_long(atol(argv[3]), atol(argv[4]));
#endif
    if (strcmp(argv[1], "run") == 0)
        run(argv[3], argc > 4 ? atoi(argv[4]) : -1);
    return 0;
}
