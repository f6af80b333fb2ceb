/* The functions of FMI 2.0. */
#include "fmi2Functions.h"
#include "instance.h"

#define I instance *const i = (instance *)given
#define REFUSED(text) do { I; return (fmi2Status)report(i, BAD, text); } while (0)

static void log_message(const instance *i, int status, const char *text)
{
    const fmi2CallbackLogger message = (fmi2CallbackLogger)i->callback;
    if (message) message(i->environment, i->name, (fmi2Status)status, CATEGORIES[status], "%s", text);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component given, fmi2Boolean on, size_t n, const fmi2String categories[])
{
    return fmi2OK; /* warnings and errors only, and these always */
}

/* ---- instances */

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
    const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    return new_instance(name, guid, type == fmi2ModelExchange, functions ? (void (*)(void))functions->logger : NULL,
                        functions ? functions->componentEnvironment : NULL, log_message);
}

void fmi2FreeInstance(fmi2Component given) { free_instance((instance *)given); }

fmi2Status fmi2SetupExperiment(fmi2Component given, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
    fmi2Boolean stopDefined, fmi2Real stop)
{
    I;
    i->now.time = start;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component given) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component given) { I; return (fmi2Status)initialise(i); }
fmi2Status fmi2Terminate(fmi2Component given) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component given) { I; set_defaults(i); return fmi2OK; }

/* ---- variables: the elements of an array are variables of their own, with references that follow each other */

fmi2Status fmi2GetReal(fmi2Component given, const fmi2ValueReference references[], size_t n, fmi2Real values[])
{
    I;
    for (size_t k = 0; k < n; ++k) {
        const variable *const v = find(references[k]);
        if (!v) return (fmi2Status)report(i, BAD, "Unknown value reference %u.", references[k]);
        const double *const source = get_values(i, v);
        if (!source) return fmi2Error;
        values[k] = source[references[k] - v->reference];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component given, const fmi2ValueReference references[], size_t n, const fmi2Real values[])
{
    I;
    int worst = GOOD;
    for (size_t k = 0; k < n; ++k) {
        const variable *const v = find(references[k]);
        if (!v) return (fmi2Status)report(i, BAD, "Unknown value reference %u.", references[k]);
        const int status = set_values(i, v, references[k] - v->reference, 1, values + k);
        if (status > WARNING) return (fmi2Status)status;
        if (status > worst) worst = status;
    }
    return (fmi2Status)worst;
}

/* Types of which there are no variables. */
#define NONE(type) do { I; return n == 0 ? fmi2OK : (fmi2Status)report(i, BAD, "This FMU has no variables of the type " type "."); } while (0)
#define NO_VARIABLES(TYPE) \
    fmi2Status fmi2Get##TYPE(fmi2Component given, const fmi2ValueReference r[], size_t n, fmi2##TYPE v[]) { NONE(#TYPE); } \
    fmi2Status fmi2Set##TYPE(fmi2Component given, const fmi2ValueReference r[], size_t n, const fmi2##TYPE v[]) { NONE(#TYPE); }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component given, const fmi2ValueReference u[], size_t nu, const fmi2ValueReference k[],
    size_t nk, const fmi2Real seed[], fmi2Real s[]) { REFUSED("This FMU has no directional derivatives."); }

/* ---- saved states */

fmi2Status fmi2GetFMUstate(fmi2Component given, fmi2FMUstate *kept) { I; return (fmi2Status)save(i, kept); }
fmi2Status fmi2SetFMUstate(fmi2Component given, fmi2FMUstate kept) { I; return (fmi2Status)restore(i, kept); }
fmi2Status fmi2FreeFMUstate(fmi2Component given, fmi2FMUstate *kept) { free(*kept); *kept = NULL; return fmi2OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component given, fmi2FMUstate kept, size_t *size) { *size = SERIALISED; return fmi2OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component given, fmi2FMUstate kept, fmi2Byte bytes[], size_t size) { I; return (fmi2Status)serialise(i, kept, bytes, size); }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component given, const fmi2Byte bytes[], size_t size, fmi2FMUstate *kept) { I; return (fmi2Status)deserialise(i, bytes, size, kept); }

/* ---- co-simulation */

/* The first derivative of a span is its rate; commands hold over a step. */
fmi2Status fmi2SetRealInputDerivatives(fmi2Component given, const fmi2ValueReference references[], size_t n, const fmi2Integer orders[],
    const fmi2Real values[])
{
    I;
    int status = GOOD;
    for (size_t k = 0; k < n; ++k) {
        const variable *const v = find(references[k]), *rate = NULL;
        for (size_t s = 0; s < sizeof SPANS / sizeof *SPANS; ++s)
            if (SPANS[s].span == references[k]) rate = find(SPANS[s].rate);
        if (!v || v->kind != INPUT) return (fmi2Status)report(i, BAD, "The value reference %u is no input.", references[k]);
        if (orders[k] == 1 && rate) status = set_values(i, rate, 0, 1, values + k);
        else status = report(i, WARNING, "%s has no derivative of order %d that the muscle can use.", v->name, orders[k]);
        if (status == BAD) break;
    }
    return (fmi2Status)status;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component given, const fmi2ValueReference r[], size_t n, const fmi2Integer orders[],
    fmi2Real v[]) { REFUSED("This FMU has no derivatives of outputs."); }

fmi2Status fmi2DoStep(fmi2Component given, fmi2Real time, fmi2Real period, fmi2Boolean noReturn) { I; return (fmi2Status)advance(i, time, period); }
fmi2Status fmi2CancelStep(fmi2Component given) { REFUSED("This FMU has no step to cancel: steps end before they return."); }
fmi2Status fmi2GetStatus(fmi2Component given, const fmi2StatusKind kind, fmi2Status *v) { REFUSED("This FMU has no pending steps."); }
fmi2Status fmi2GetIntegerStatus(fmi2Component given, const fmi2StatusKind kind, fmi2Integer *v) { REFUSED("This FMU has no status of that kind."); }
fmi2Status fmi2GetStringStatus(fmi2Component given, const fmi2StatusKind kind, fmi2String *v) { REFUSED("This FMU has no pending steps."); }

fmi2Status fmi2GetRealStatus(fmi2Component given, const fmi2StatusKind kind, fmi2Real *v)
{
    I;
    if (kind != fmi2LastSuccessfulTime) return (fmi2Status)report(i, BAD, "This FMU has no status of that kind.");
    *v = i->now.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component given, const fmi2StatusKind kind, fmi2Boolean *v)
{
    I;
    if (kind != fmi2Terminated) return (fmi2Status)report(i, BAD, "This FMU has no status of that kind.");
    *v = fmi2False;
    return fmi2OK;
}

/* ---- model exchange */

fmi2Status fmi2EnterEventMode(fmi2Component given) { return fmi2OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component given) { I; begin_integrator_step(i); return fmi2OK; }

fmi2Status fmi2NewDiscreteStates(fmi2Component given, fmi2EventInfo *info)
{
    memset(info, 0, sizeof *info);
    return fmi2OK;
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component given, fmi2Boolean noReturn, fmi2Boolean *event, fmi2Boolean *terminate)
{
    I;
    *event = *terminate = fmi2False;
    return (fmi2Status)complete_integrator_step(i);
}

fmi2Status fmi2SetTime(fmi2Component given, fmi2Real time) { I; i->now.time = time; i->now.stale = 1.0; return fmi2OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component given, const fmi2Real x[], size_t n) { I; return (fmi2Status)exchange_states(i, WRITE_STATES, NULL, x, n); }
fmi2Status fmi2GetContinuousStates(fmi2Component given, fmi2Real x[], size_t n) { I; return (fmi2Status)exchange_states(i, READ_STATES, x, NULL, n); }
fmi2Status fmi2GetDerivatives(fmi2Component given, fmi2Real x[], size_t n) { I; return (fmi2Status)exchange_states(i, READ_RATES, x, NULL, n); }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component given, fmi2Real x[], size_t n) { I; return (fmi2Status)exchange_states(i, READ_NOMINALS, x, NULL, n); }
fmi2Status fmi2GetEventIndicators(fmi2Component given, fmi2Real v[], size_t n) { return n == 0 ? fmi2OK : fmi2Error; }
