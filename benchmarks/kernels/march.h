/* The time loop around `step(coefficients, state, commands, share, width, h)`, and what goes in and out of it.
 *
 * A kernel defines State (a struct of V), Coefficients, `hoist`, `step`, OUTPUT_1, OUTPUT_2 and COMMANDS before. Commands are
 * held over a sample; with STRAIGHT they go on to the next, their changes follow their values in what `step` is given, and
 * `share` and `width` say which part of the sample the step is. The lanes are a whole number of LANES.
 */
#define STATES ((int)(sizeof(State) / sizeof(V)))

#ifdef COUNT
/* Algebraic operations of one step. */
EXPORT long operations(double h, const double *state, const double *parameters, const double *commands) {
    Coefficients c;
    State y;
    V in[2 * COMMANDS];
    for (int i = 0; i < STATES; i++) ((V *)&y)[i] = set1(state[i]);
    for (int i = 0; i < 2 * COMMANDS; i++) in[i] = set1(commands[i]);
    hoist(&c, parameters, 1);
    counted = 0;
    step(&c, &y, in, set1(0.0), set1(0.1), set1(h));
    return counted;
}
#else
EXPORT const char *parameter_names(void) { return PARAMETER_NAMES; }
EXPORT long lanes_at_once(void) { return LANES; }

/* n lanes for a number of samples. Arrays by rows of n: parameters, commands (samples, COMMANDS; a sample more where they are
 * straight), state (in and out), and what is kept at the samples 0 to `samples`. */
EXPORT void march(long n, long samples, long inner, double h, const REAL *parameters, const REAL *commands, REAL *state,
                  REAL *first, REAL *second) {
    V dt = set1(h), width = set1(1.0 / (double)inner);
    for (long lane = 0; lane < n; lane += LANES) {
        Coefficients c;
        State y;
        for (int i = 0; i < STATES; i++) ((V *)&y)[i] = load(state + i * n + lane);
        hoist(&c, parameters + lane, n);
        for (long s = 0; s < samples; s++) {
            V in[2 * COMMANDS];
            for (int k = 0; k < COMMANDS; k++) {
                const REAL *at = commands + (s * COMMANDS + k) * n + lane;
                in[k] = load(at);
#ifdef STRAIGHT
                in[COMMANDS + k] = load(at + COMMANDS * n) - in[k];
#endif
            }
            store(first + s * n + lane, y.OUTPUT_1);
            store(second + s * n + lane, y.OUTPUT_2);
            for (long i = 0; i < inner; i++) step(&c, &y, in, set1((double)i / (double)inner), width, dt);
        }
        for (int i = 0; i < STATES; i++) store(state + i * n + lane, ((V *)&y)[i]);
        store(first + samples * n + lane, y.OUTPUT_1);
        store(second + samples * n + lane, y.OUTPUT_2);
    }
}
#endif
