/* The yardstick S1: ideal braid, 5 kg lifted, damper, stop, polytropic gas, one valve that fills or vents.
 *
 * Three states, Runge-Kutta of order 4, the command straight from sample to sample. Only one way through the valve is open at a
 * time, so one orifice is computed; see valve.c for how its division and root are arranged.
 */
#include "simd.h"
#define PARAMETER_LIST(X) \
    X(rest) X(thread) X(turns) X(mass) X(damping) X(stop) X(gravity) X(supply) X(room) X(gas_constant) X(temperature) \
    X(exponent) X(conductance) X(ratio) X(band) X(density)
#define X(n) p_##n,
enum { PARAMETER_LIST(X) PARAMETERS };
#undef X
#define X(n) #n " "
static const char PARAMETER_NAMES[] = PARAMETER_LIST(X);
#undef X
#define P(name) load(at + p_##name * lanes)

typedef struct {
    V contraction, velocity, pressure;
} State;
#define STRAIGHT
#define COMMANDS 1 /* -1 vents, 1 fills */
#define OUTPUT_1 contraction
#define OUTPUT_2 pressure

typedef struct {
    V rest, volume0, volume1, slope0, slope1, per_mass, damping, stop, gravity, supply, room, rt, exponent, left, most, band;
} Coefficients;

INLINE void hoist(Coefficients *c, const REAL *at, long lanes) {
    V per_turn = set1(1.0) / (set1(4.0 * 3.14159265358979323846) * P(turns) * P(turns));
    V one = set1(1.0);
    c->rest = P(rest);
    c->volume0 = P(thread) * P(thread) * per_turn;
    c->volume1 = per_turn;
    c->slope0 = c->volume0;
    c->slope1 = set1(3.0) * per_turn;
    c->per_mass = one / P(mass);
    c->damping = P(damping) * c->per_mass;
    c->stop = P(stop) * c->per_mass;
    c->gravity = P(gravity);
    c->supply = P(supply);
    c->room = P(room);
    c->rt = P(exponent) * P(gas_constant) * P(temperature);
    c->exponent = P(exponent);
    c->left = one - P(ratio);
    c->most = P(conductance) * P(density) / c->left;
    c->band = P(band);
}

INLINE State rate(const Coefficients *c, State y, V command) {
    State k;
    V zero = set1(0.0), one = set1(1.0), length = c->rest - y.contraction, square = length * length;
    V volume = length * (c->volume0 - c->volume1 * square), slope = c->slope0 - c->slope1 * square;
    V a = where_ge(command, zero, c->supply, y.pressure), b = where_ge(command, zero, y.pressure, c->room);
    V full = vmax(a, b) * c->left, d = vmin(vabs(a - b), full), e = vmin(c->band, set1(0.5) * full), twice = full + full;
    V start = e * (twice - e), at = d * (twice - d), per_volume, per_start;
    reciprocals2(volume, start, &per_volume, &per_start);
    V share = vmin(at * per_start, one);
    V flow = c->most * vabs(command) * root(vmax(at, start)) * (share * (set1(1.5) - set1(0.5) * share));
    V signed_flow = where_ge((a - b) * command, zero, flow, zero - flow);
    k.contraction = y.velocity;
    k.velocity = (c->room - y.pressure) * slope * c->per_mass - c->gravity - c->damping * y.velocity +
                 c->stop * vmax(zero - y.contraction, zero);
    k.pressure = (c->rt * signed_flow + c->exponent * y.pressure * (slope * y.velocity)) * per_volume;
    return k;
}

INLINE State along(State y, V h, State k) {
    State at = {y.contraction + h * k.contraction, y.velocity + h * k.velocity, y.pressure + h * k.pressure};
    return at;
}

INLINE void step(const Coefficients *c, State *state, const V *commands, V share, V width, V h) {
    State y = *state, k1, k2, k3, k4;
    V half = set1(0.5) * h, begin = commands[0] + commands[1] * share, more = commands[1] * width;
    V middle = begin + set1(0.5) * more;
    k1 = rate(c, y, begin);
    k2 = rate(c, along(y, half, k1), middle);
    k3 = rate(c, along(y, half, k2), middle);
    k4 = rate(c, along(y, h, k3), begin + more);
    V sixth = h * set1(1.0 / 6.0), two = set1(2.0);
#define SUM(x) state->x = y.x + sixth * (k1.x + two * (k2.x + k3.x) + k4.x)
    SUM(contraction), SUM(velocity), SUM(pressure);
#undef SUM
}

#include "march.h"
