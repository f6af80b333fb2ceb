/* The same muscle behind a valve: supply - orifice - port - tube - muscle, and an orifice from the port to the room.
 *
 * Orifices by ISO 6358 with the rounded start of pneumatics/orifice.py. By hand: with K = p1 (1 - b), d = min(p1 - p2, K) and
 * e = min(band, K/2) the root's argument is d (2K - d)/K^2 and its start e (2K - e)/K^2, so that K cancels, one root serves
 * both pieces and takes the temperature's along, and one division is left.
 */
#define MORE_PARAMETERS(X) \
    X(port_volume) X(supply_pressure) X(room_pressure) X(room_temperature) X(fill_conductance) X(fill_ratio) X(fill_band) \
    X(vent_conductance) X(vent_ratio) X(vent_band) X(reference_density) X(reference_temperature)
#include "parts.h"

typedef struct {
    V length, velocity, pressure, gas, flow, port_pressure, port_gas, deflection;
} State;
#define COMMANDS 2 /* openings of fill and vent */
#define OUTPUT_1 length
#define OUTPUT_2 pressure

typedef struct {
    V most, left, band; /* conductance at choking over 1 - b, 1 - b, linear zone */
} Orifice;

typedef struct {
    Muscle muscle;
    Orifice fill, vent;
    V supply, room, room_rt, per_supply_rt, per_room_rt, port_volume, per_port_volume;
} Coefficients;

INLINE Orifice orifice(V conductance, V ratio, V band, const REAL *at, long lanes) {
    Orifice o;
    o.left = set1(1.0) - ratio;
    o.most = conductance * P(reference_density) * root(P(reference_temperature) * P(gas_constant)) / o.left;
    o.band = band;
    return o;
}

INLINE void hoist(Coefficients *c, const REAL *at, long lanes) {
    hoist_muscle(&c->muscle, at, lanes);
    c->fill = orifice(P(fill_conductance), P(fill_ratio), P(fill_band), at, lanes);
    c->vent = orifice(P(vent_conductance), P(vent_ratio), P(vent_band), at, lanes);
    c->supply = P(supply_pressure);
    c->room = P(room_pressure);
    c->room_rt = P(gas_constant) * P(room_temperature);
    c->per_supply_rt = set1(1.0) / c->muscle.supply_rt;
    c->per_room_rt = set1(1.0) / c->room_rt;
    c->port_volume = P(port_volume);
    c->per_port_volume = set1(1.0) / P(port_volume);
}

typedef struct {
    V opened, ends, parabola, root; /* conductance, signed difference, start of the root, its argument */
} Passage;

/* All but the division of an orifice from a to b, whose temperatures' R T have reciprocals. */
INLINE Passage passage(const Orifice *o, V opening, V pa, V pb, V per_rt) {
    Passage out;
    V upstream = vmax(pa, pb), k = upstream * o->left, d = vmin(vabs(pa - pb), k), e = vmin(o->band, set1(0.5) * k);
    V twice = k + k;
    out.parabola = e * (twice - e);
    out.root = d * (twice - d);
    out.opened = o->most * opening * root(vmax(out.root, out.parabola) * per_rt);
    out.ends = pa - pb;
    return out;
}

INLINE V passed(Passage x, V per_parabola) {
    V share = vmin(x.root * per_parabola, set1(1.0));
    V flow = x.opened * share * (set1(1.5) - set1(0.5) * share);
    return where_ge(x.ends, set1(0.0), flow, set1(0.0) - flow);
}

INLINE State rate(const Coefficients *c, State y, const V *commands) {
    const Muscle *m = &c->muscle;
    State k = y;
    Law at = law(m, y.length, y.pressure);
    V per_gas, per_sum, per_room, per_port, per_port_gas, per_in, per_out, zero = set1(0.0);
    V room = at.value + m->gamma * y.pressure * at.per_volume;
    reciprocals3(y.gas, y.port_pressure + y.pressure, room, &per_gas, &per_sum, &per_room);
    reciprocals2(y.port_pressure, y.port_gas, &per_port, &per_port_gas);
    V rt = y.pressure * at.value * per_gas;
    V port_rt = y.port_pressure * c->port_volume * per_port_gas;
    V per_port_rt = y.port_gas * c->per_port_volume * per_port;
    V fills = c->supply - y.port_pressure, vents = y.port_pressure - c->room;
    Passage in = passage(&c->fill, commands[0], c->supply, y.port_pressure, where_ge(fills, zero, c->per_supply_rt, per_port_rt));
    Passage out = passage(&c->vent, commands[1], y.port_pressure, c->room, where_ge(vents, zero, per_port_rt, c->per_room_rt));
    reciprocals2(in.parabola, out.parabola, &per_in, &per_out);
    V filled = passed(in, per_in), vented = passed(out, per_out);
    V carried_in = filled * where_ge(fills, zero, m->supply_rt, port_rt);
    V carried_out = vented * where_ge(vents, zero, port_rt, c->room_rt);
    V carried = y.flow * where_ge(y.flow, zero, port_rt, rt);
    V swelling = y.pressure * (at.per_length * y.velocity);
    k.pressure = (m->gamma * (carried + swelling) + (m->heat0 - m->heat1 * rt)) * per_room;
    k.gas = y.flow;
    k.port_gas = filled - y.flow - vented;
    k.port_pressure = (m->gamma * (carried_in - carried - carried_out) + (m->heat0 - m->heat1 * port_rt)) * c->per_port_volume;
    k.flow = tube(m, y.port_pressure - y.pressure, carried * per_sum * m->per_area);
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
    at.port_pressure = y.port_pressure + h * k.port_pressure;
    at.port_gas = y.port_gas + h * k.port_gas;
    return at;
}
#define SUMS SUM(length), SUM(velocity), SUM(pressure), SUM(gas), SUM(flow), SUM(port_pressure), SUM(port_gas)
#define MUSCLE(c) (&(c)->muscle)

#include "step.h"
#include "march.h"
