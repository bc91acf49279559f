/* A car that is not ours, as a co-simulation unit for FMI 2.0: magic formula whose stiffness goes with the load,
   relaxation of slip, pitch of the body that moves the loads, air and rolling resistance. It drives straight on.
   It can be told to fail, to give no number, or to hang at a time. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "fmi2Functions.h"

enum { T_FL, T_FR, T_RL, T_RR, V, N_FL, N_FR, N_RL, N_RR, AX, X,
       M, R, I_W, CDA, CR, KX, MU, SIGMA, H, GAIN, V0, X0, FAIL_AT, NAN_AT, HANG_AT, COUNT };

typedef struct {
    double p[COUNT], v, x, a, pitch, pitch_rate, w[4], slip[4], time;
} Car;

static const double START[COUNT] = { [M] = 1343.8, [R] = 0.29, [I_W] = 1.2, [CDA] = 0.65, [CR] = 0.0065, [KX] = 15.0,
    [MU] = 0.9, [SIGMA] = 0.25, [H] = 0.54, [GAIN] = 1.0, [FAIL_AT] = 1e9, [NAN_AT] = 1e9, [HANG_AT] = 1e9 };
static const double G = 9.81, WHEELBASE = 2.305, TO_REAR = 1.193, STEP = 1e-4, SHAPE = 1.6, CURVATURE = 0.3;
static const double PITCH_RATE = 9.0, PITCH_DAMPING = 0.35;

static void begin(Car *c) {
    c->v = c->p[V0] / 3.6;
    c->x = c->p[X0];
    c->a = c->pitch = c->pitch_rate = c->time = 0.0;
    for (int i = 0; i < 4; i++) { c->w[i] = c->v / c->p[R]; c->slip[i] = 0.0; }
}

static double force(const Car *c, int i, double load) {
    double peak = c->p[MU] * load, b = c->p[KX] * load / (SHAPE * peak), s = b * c->slip[i];
    return peak * sin(SHAPE * atan(s - CURVATURE * (s - atan(s))));
}

static void step(Car *c) {
    const double *p = c->p;
    double front = p[M] * G * TO_REAR / WHEELBASE, rear = p[M] * G - front, moved = p[M] * c->pitch * p[H] / WHEELBASE;
    double total = 0.0;
    for (int i = 0; i < 4; i++) {
        double load = fmax(0.5 * (i < 2 ? front - moved : rear + moved), 50.0), f = force(c, i, load);
        double roll = c->w[i] > 0.05 ? p[CR] * load * p[R] : 0.0;
        c->slip[i] += STEP * (c->w[i] * p[R] - c->v - fabs(c->v) * c->slip[i]) / p[SIGMA];
        c->w[i] = fmax(c->w[i] + STEP * (p[GAIN] * p[T_FL + i] - f * p[R] - roll) / p[I_W], 0.0);
        total += f;
    }
    c->a = (total - 0.5 * 1.2 * p[CDA] * c->v * c->v) / p[M];
    c->pitch_rate += STEP * (PITCH_RATE * PITCH_RATE * (c->a - c->pitch) - 2.0 * PITCH_DAMPING * PITCH_RATE * c->pitch_rate);
    c->pitch += STEP * c->pitch_rate;
    c->v = fmax(c->v + STEP * c->a, 0.0);
    c->x += STEP * c->v;
}

static double value(const Car *c, unsigned i) {
    if (c->time >= c->p[NAN_AT] && i == V) return NAN;
    if (i == V) return 3.6 * c->v;
    if (i >= N_FL && i <= N_RR) return c->w[i - N_FL] * 30.0 / 3.14159265358979323846;
    if (i == AX) return c->a / 9.80665;
    return i == X ? c->x : c->p[i];
}

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String place,
                              const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name; (void)type; (void)guid; (void)place; (void)call; (void)visible; (void)logging;
    Car *c = calloc(1, sizeof *c);
    memcpy(c->p, START, sizeof START);
    return c;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    (void)c; (void)on; (void)n; (void)names;
    return fmi2OK;
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean told, fmi2Real tolerance, fmi2Real from, fmi2Boolean ends,
                               fmi2Real to) {
    (void)c; (void)told; (void)tolerance; (void)from; (void)ends; (void)to;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { begin(c); return fmi2OK; }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { begin(c); return fmi2OK; }
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real out[]) {
    for (size_t i = 0; i < n; i++) out[i] = value(c, r[i]);
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real in[]) {
    for (size_t i = 0; i < n; i++) ((Car *)c)->p[r[i]] = in[i];
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component component, fmi2Real now, fmi2Real size, fmi2Boolean keep) {
    Car *c = component;
    (void)keep;
    if (now >= c->p[FAIL_AT]) return fmi2Error;
    while (now >= c->p[HANG_AT]) { }
    for (long k = 0, count = lround(size / STEP); k < count; k++) step(c);
    c->time = now + size;
    return fmi2OK;
}

#define UNUSED(name, ...) fmi2Status name(__VA_ARGS__)
UNUSED(fmi2GetInteger, fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Integer v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Boolean v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2GetString, fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2SetInteger, fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Boolean v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2SetString, fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2String v[]) { (void)c; (void)r; (void)n; (void)v; return fmi2Error; }
UNUSED(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *s) { (void)c; (void)s; return fmi2Error; }
UNUSED(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate s) { (void)c; (void)s; return fmi2Error; }
UNUSED(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *s) { (void)c; (void)s; return fmi2Error; }
UNUSED(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate s, size_t *n) { (void)c; (void)s; (void)n; return fmi2Error; }
UNUSED(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) { (void)c; (void)s; (void)b; (void)n; return fmi2Error; }
UNUSED(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte b[], size_t n, fmi2FMUstate *s) { (void)c; (void)b; (void)n; (void)s; return fmi2Error; }
UNUSED(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference u[], size_t n, const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real o[]) { (void)c; (void)u; (void)n; (void)k; (void)m; (void)d; (void)o; return fmi2Error; }
UNUSED(fmi2SetRealInputDerivatives, fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], const fmi2Real v[]) { (void)c; (void)r; (void)n; (void)o; (void)v; return fmi2Error; }
UNUSED(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Integer o[], fmi2Real v[]) { (void)c; (void)r; (void)n; (void)o; (void)v; return fmi2Error; }
UNUSED(fmi2CancelStep, fmi2Component c) { (void)c; return fmi2Error; }
UNUSED(fmi2GetStatus, fmi2Component c, const fmi2StatusKind k, fmi2Status *s) { (void)c; (void)k; (void)s; return fmi2Error; }
UNUSED(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind k, fmi2Real *v) { (void)c; (void)k; (void)v; return fmi2Error; }
UNUSED(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) { (void)c; (void)k; (void)v; return fmi2Error; }
UNUSED(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) { (void)c; (void)k; (void)v; return fmi2Error; }
UNUSED(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind k, fmi2String *v) { (void)c; (void)k; (void)v; return fmi2Error; }
