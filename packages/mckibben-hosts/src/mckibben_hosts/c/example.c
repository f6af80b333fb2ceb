/* TITLE: held at the span of its start and filled for a tenth of a second. */
#include <stdio.h>
#include "NAME.h"

int main(void)
{
    NAME_state state = {0};
    NAME_inputs inputs = NAME_default_inputs;
    NAME_outputs outputs;
    inputs.COMMAND = VALUE;
    for (int k = 1; k <= 100; ++k) {
        NAME_step(&NAME_default_parameters, &state, &inputs, 1e-3, UPPER_SYNCHRONOUS, &outputs);
        if (outputs.sound != 1.0) return 1;
        if (k % 20 == 0) printf("%.3f s  %.17g N\n", 1e-3 * k, outputs.TENSION);
    }
    return 0;
}
