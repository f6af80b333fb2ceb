/* One step as engine/step.py takes it: the friction slides, Runge-Kutta of order 4 with it held, the friction slides on.
 *
 * A kernel defines State, Coefficients, `rate(coefficients, state, commands)` without friction, `along`, SUMS and MUSCLE before.
 */
INLINE void step(const Coefficients *c, State *state, const V *commands, V share, V width, V h) {
    (void)share, (void)width; /* commands are held */
    const Muscle *m = MUSCLE(c);
    State y = *state, k1, k2, k3, k4, quarter;
    V half = set1(0.5) * h, z = y.deflection, rub = z * m->contact_per_mass;
    k1 = rate(c, y, commands);
    V free = k1.velocity;
    k1.velocity = free - rub;
    /* to the middle, as a prediction of second order, with the friction as it was */
    quarter = rate(c, along(y, set1(0.5) * half, k1), commands);
    V to_middle = half * quarter.length, middle_pressure = y.pressure + half * quarter.pressure;
    V middle = yield(m, middle_pressure);
    z = slide(z, to_middle, yield(m, y.pressure), middle);
    rub = z * m->contact_per_mass;
    k1.velocity = free - rub;
    k2 = rate(c, along(y, half, k1), commands);
    k2.velocity = k2.velocity - rub;
    k3 = rate(c, along(y, half, k2), commands);
    k3.velocity = k3.velocity - rub;
    k4 = rate(c, along(y, h, k3), commands);
    k4.velocity = k4.velocity - rub;
    V sixth = h * set1(1.0 / 6.0), two = set1(2.0);
#define SUM(x) state->x = y.x + sixth * (k1.x + two * (k2.x + k3.x) + k4.x)
    SUMS;
#undef SUM
    V rest = (state->length - y.length) - to_middle;
    state->deflection = slide(z, rest, middle, yield(m, state->pressure));
}

