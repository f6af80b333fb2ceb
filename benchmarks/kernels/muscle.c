/* One muscle on a supply of commanded pressure: the yardstick that the library's kernels are measured by.
 *
 * Supply - tube with inertance - muscle with friction on a mass and a spring, integrated as engine/step.py does: Runge-Kutta of
 * order 4 with the friction split around it, commands held per sample. Muscles in the lanes; no branch depends on a value.
 */
#include "parts.h"

typedef struct {
    V length, velocity, pressure, gas, flow, deflection;
} State;
typedef Muscle Coefficients;
#define COMMANDS 1 /* absolute pressure of the supply */
#define OUTPUT_1 length
#define OUTPUT_2 pressure

INLINE void hoist(Coefficients *c, const REAL *at, long lanes) { hoist_muscle(c, at, lanes); }

/* Rates of the state at a supply pressure, without friction; what is not used is not computed. */
INLINE State rate(const Muscle *m, State y, const V *commands) {
    State k = y;
    Law at = law(m, y.length, y.pressure);
    V supply = commands[0], per_gas, per_sum, per_room, pv = y.pressure * at.value;
    V room = at.value + m->gamma * y.pressure * at.per_volume;
    reciprocals3(y.gas, supply + y.pressure, room, &per_gas, &per_sum, &per_room);
    V rt = pv * per_gas;
    V carried = y.flow * where_ge(y.flow, set1(0.0), m->supply_rt, rt);
    V swelling = y.pressure * (at.per_length * y.velocity);
    k.pressure = (m->gamma * (carried + swelling) + (m->heat0 - m->heat1 * rt)) * per_room;
    k.gas = y.flow;
    k.flow = tube(m, supply - y.pressure, carried * per_sum * m->per_area);
    k.length = y.velocity;
    k.velocity = acceleration(m, y.length, y.velocity, at.tension);
    return k;
}

INLINE State along(State y, V h, State k) {
    State at = y;
    at.length = y.length + h * k.length;
    at.velocity = y.velocity + h * k.velocity;
    at.pressure = y.pressure + h * k.pressure;
    at.gas = y.gas + h * k.gas;
    at.flow = y.flow + h * k.flow;
    return at;
}

#define SUMS SUM(length), SUM(velocity), SUM(pressure), SUM(gas), SUM(flow)
#define MUSCLE(c) (c)

#include "step.h"
#include "march.h"
