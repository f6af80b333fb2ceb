/* What both muscle kernels share: the linear law with threshold, tendon, end mass, gas with wall heat, tube, Dahl's friction.
 *
 * The equations are those of the package (muscles/laws/linear_threshold.py, muscles/bladder.py, assembly/muscle_unit.py,
 * pneumatics/volume.py, pneumatics/tubes.py, muscles/hysteresis/dahl.py), rearranged by hand: every factor that stays
 * over a run is formed once per lane, divisions share reciprocals, and choices between pieces are clips. SI throughout.
 */
#ifndef PARTS_H
#define PARTS_H
#include "simd.h"

#define MUSCLE_PARAMETERS(X) \
    X(per_pressure) X(shortest) X(threshold) X(passive) X(rest) X(upper) X(rest_volume) X(width) X(stop) \
    X(limit) X(limit_per_pressure) X(contact) X(mass) X(viscosity) X(stop_damping) X(stop_travel) \
    X(cord_stiffness) X(cord_slack) X(cord_toe) X(cord_loss) X(span) \
    X(gas_constant) X(heat_ratio) X(ambient) X(dead) X(conductance) X(wall) X(supply_temperature) \
    X(viscous) X(turbulent) X(tube_area) X(tube_length)

#ifndef MORE_PARAMETERS
#define MORE_PARAMETERS(X)
#endif
#define X(n) p_##n,
enum { MUSCLE_PARAMETERS(X) MORE_PARAMETERS(X) PARAMETERS };
#undef X
#define X(n) #n " "
static const char PARAMETER_NAMES[] = MUSCLE_PARAMETERS(X) MORE_PARAMETERS(X);
#undef X
#define P(name) load(at + p_##name * lanes)

typedef struct {
    V d0, y0, y1, room_width, b0, b1, pressure_width, bend, volume0, slope, passive, passive0, upper, stop;  /* law */
    V travel0, travel1, ambient, contact_per_mass;                                                    /* friction */
    V end, cord_quadratic, toe, cord, loss, viscosity, stop_damping, per_stop_travel, per_mass;          /* mechanics */
    V gamma, heat0, heat1, supply_rt, per_gas_constant;                                               /* gas */
    V per_area, viscous, turbulent, per_inertance;                                                    /* tube */
} Muscle;

typedef struct {
    V per_volume, per_length, tension, value;  /* dV/dP, dV/dL, N, m^3 */
} Law;

/* What stays over a run, once per lane; `at` is the first lane's first parameter, one lies `lanes` after the other. */
INLINE void hoist_muscle(Muscle *m, const REAL *at, long lanes) {
    V one = set1(1.0), half = set1(0.5), kg = P(per_pressure);
    V to_rest = P(rest) - P(shortest), to_upper = P(upper) - P(shortest);
    V braid0 = P(rest_volume) + half * kg * to_rest * to_rest;
    V upper_volume = braid0 - half * kg * to_upper * to_upper;
    V bladder = set1(0.6) * upper_volume, gm = P(heat_ratio) - one;
    m->room_width = set1(0.8) * upper_volume;
    m->d0 = P(shortest);
    m->y0 = (braid0 - bladder) / m->room_width + half;
    m->y1 = half * kg / m->room_width;
    m->pressure_width = P(width);
    m->b1 = one / P(width);
    m->b0 = half - (P(threshold) + P(ambient)) * m->b1;
    m->bend = set1(140.0) * m->b1 * m->room_width;
    m->volume0 = bladder + P(dead);
    m->slope = kg;
    m->passive = P(passive);
    m->passive0 = P(passive) * P(rest);
    m->upper = P(upper);
    m->stop = P(stop);
    m->travel0 = P(limit) / P(contact);
    m->travel1 = P(limit_per_pressure) / P(contact);
    m->ambient = P(ambient);
    m->per_mass = one / P(mass);
    m->contact_per_mass = P(contact) * m->per_mass;
    m->end = P(span) - P(cord_slack);
    m->cord_quadratic = half * P(cord_stiffness) / P(cord_toe);
    m->toe = P(cord_toe);
    m->cord = P(cord_stiffness);
    m->loss = P(cord_loss);
    m->viscosity = P(viscosity);
    m->stop_damping = P(stop_damping);
    m->per_stop_travel = one / P(stop_travel);
    m->gamma = P(heat_ratio);
    m->heat0 = gm * P(conductance) * P(wall);
    m->heat1 = gm * P(conductance) / P(gas_constant);
    m->supply_rt = P(gas_constant) * P(supply_temperature);
    m->per_gas_constant = one / P(gas_constant);
    m->per_area = set1(2.0) / P(tube_area);
    m->viscous = P(viscous);
    m->turbulent = P(turbulent);
    m->per_inertance = P(tube_area) / P(tube_length);
}

INLINE V clip01(V x) { return vmin(vmax(x, set1(0.0)), set1(1.0)); }

/* The rounded ramp of degree 7 over its width, and its slope; y is x/width + 1/2. */
INLINE void ramp(V y, V *value, V *slope) {
    V u = clip01(y), u2 = u * u, u4 = u2 * u2;
    V beyond = vmax(y - set1(1.0), set1(0.0));
    *value = u4 * (u * (set1(7.0) + u * (set1(-14.0) + u * (set1(10.0) - set1(2.5) * u)))) + beyond;
    *slope = u4 * (set1(35.0) + u * (set1(-84.0) + u * (set1(70.0) - set1(20.0) * u)));
}

/* Tension, volume and its derivatives at a length and an absolute pressure. */
INLINE Law law(const Muscle *m, V length, V p) {
    Law out;
    V room, room1, carried, carried1, d = length - m->d0, b = m->b0 + m->b1 * p, u = clip01(b), bell = u - u * u;
    ramp(m->y0 - m->y1 * (d * d), &room, &room1);
    ramp(b, &carried, &carried1);
    V slope = m->slope * d * room1, over = vmax(length - m->upper, set1(0.0));
    out.value = m->volume0 + carried1 * (m->room_width * room);
    out.per_volume = m->bend * (bell * bell) * (bell * room);
    out.per_length = carried1 * slope; /* negative of dV/dL */
    out.tension = (m->passive * length - m->passive0) + m->stop * (over * over) + m->pressure_width * carried * slope;
    return out;
}

/* Acceleration of the end mass without friction. */
INLINE V acceleration(const Muscle *m, V length, V velocity, V tension) {
    V stretch = m->end - length, toe = vmin(vmax(stretch, set1(0.0)), m->toe);
    V elastic = m->cord_quadratic * (toe * toe) + m->cord * vmax(stretch - m->toe, set1(0.0));
    V pull = elastic * vmax(set1(1.0) - m->loss * velocity, set1(0.0));
    V b = clip01((length - m->upper) * m->per_stop_travel);
    V damping = m->viscosity + m->stop_damping * (b * b);
    return (pull - tension - damping * velocity) * m->per_mass;
}

/* Acceleration of the gas in the tube, with `pace` = 2 w R T/(P1 + P2) of the gas that flows. */
INLINE V tube(const Muscle *m, V drop, V pace) {
    V speed = pace;
    return (drop - speed * (m->viscous + m->turbulent * vabs(speed))) * m->per_inertance;
}

INLINE V yield(const Muscle *m, V p) { return m->travel0 + m->travel1 * vmax(p - m->ambient, set1(0.0)); }

/* Deflection of Dahl's contact after a piece of path dx, between the yields at its ends. */
INLINE V slide(V z, V dx, V before, V after) {
    V travel = vmax(set1(0.5) * (before + after), set1(1e-12)), half = set1(0.5) * vabs(dx);
    V relaxed = (z * (travel - half) + dx * travel) * reciprocal(travel + half);
    return vmin(vmax(relaxed, set1(0.0) - after), after);
}
#endif
