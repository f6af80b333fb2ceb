
void NAME_step(const NAME_parameters *restrict parameters, NAME_state *restrict state, const NAME_inputs *restrict inputs,
               double period, int staggered, NAME_outputs *restrict outputs)
{
    const NAME_timing timing = {period, staggered == UPPER_STAGGERED ? 1.0 : 0.0};
    if (!(state->started > 0.0)) NAME_rest(parameters, inputs, state);
    NAME_advance(parameters, state, inputs, &timing, outputs);
}

const char *NAME_meaning(double sound)
{
    static const char *const meanings[] = {MEANINGS};
    return meanings[(int)sound];
}
