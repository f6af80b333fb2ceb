/* A host of FMI 3.0 in C: holds the span, fills the muscle, and prints time and tension. Arguments: library, token. */
#include <dlfcn.h>
#include <stdio.h>
#include "fmi3Functions.h"

static void message(fmi3InstanceEnvironment e, fmi3Status status, fmi3String category, fmi3String text)
{
    (void)e;
    fprintf(stderr, "%d %s %s\n", (int)status, category, text);
}

int main(int count, char **words)
{
    void *library = count == 3 ? dlopen(words[1], RTLD_NOW | RTLD_LOCAL) : NULL;
    if (!library) return 1;
#define OF(name) name##TYPE *const name##_ = (name##TYPE *)dlsym(library, #name)
    OF(fmi3InstantiateCoSimulation);
    OF(fmi3EnterInitializationMode);
    OF(fmi3ExitInitializationMode);
    OF(fmi3SetFloat64);
    OF(fmi3GetFloat64);
    OF(fmi3DoStep);
    OF(fmi3FreeInstance);
    fmi3Instance part = fmi3InstantiateCoSimulation_("part", words[2], "", 0, 0, 0, 0, NULL, 0, NULL, message, NULL);
    if (!part) return 2;
    const fmi3ValueReference inputs[] = {1, 2, 3}, tension = 4;
    const double still[] = {0.14, 0.0, 0.0}, filling[] = {0.14, 0.0, 1.0};
    if (fmi3SetFloat64_(part, inputs, 3, still, 3) || fmi3EnterInitializationMode_(part, 0, 0.0, 0.0, 0, 0.0)
        || fmi3ExitInitializationMode_(part) || fmi3SetFloat64_(part, inputs, 3, filling, 3)) return 3;
    for (int k = 0; k < 50; ++k) {
        fmi3Boolean event, terminate, early;
        double last, mean;
        if (fmi3DoStep_(part, 1e-3 * k, 1e-3, 1, &event, &terminate, &early, &last)) return 4;
        if (fmi3GetFloat64_(part, &tension, 1, &mean, 1)) return 5;
        printf("%.17g\n", mean);
    }
    fmi3FreeInstance_(part);
    return dlclose(library);
}
