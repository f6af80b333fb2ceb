/* The functions of FMI 3.0. */
#include "fmi3Functions.h"
#include "instance.h"

#define I instance *const i = (instance *)given
#define REFUSED(text) do { I; return (fmi3Status)report(i, BAD, text); } while (0)

static void log_message(const instance *i, int status, const char *text)
{
    const fmi3LogMessageCallback message = (fmi3LogMessageCallback)i->callback;
    if (message) message(i->environment, (fmi3Status)status, CATEGORIES[status], text);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance given, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    return fmi3OK; /* warnings and errors only, and these always */
}

/* ---- instances */

static fmi3Instance instantiate(fmi3String name, fmi3String token, int exchange, fmi3InstanceEnvironment environment,
                                fmi3LogMessageCallback message)
{
    return new_instance(name, token, exchange, (void (*)(void))message, environment, log_message);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean eventMode, fmi3Boolean earlyReturn, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback message, fmi3IntermediateUpdateCallback update)
{
    return instantiate(name, token, 0, environment, message);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback message)
{
    return instantiate(name, token, 1, environment, message);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
    fmi3Boolean visible, fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback message,
    fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    if (message) message(environment, fmi3Error, CATEGORIES[BAD], "This FMU has no scheduled execution.");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance given) { free_instance((instance *)given); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance given, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
    fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop)
{
    I;
    i->now.time = start;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance given) { I; return (fmi3Status)initialise(i); }
fmi3Status fmi3Terminate(fmi3Instance given) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance given) { I; set_defaults(i); return fmi3OK; }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance given) { REFUSED("This FMU has no structural parameters."); }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance given) { REFUSED("This FMU has no structural parameters."); }

/* ---- variables */

fmi3Status fmi3GetFloat64(fmi3Instance given, const fmi3ValueReference references[], size_t n, fmi3Float64 values[], size_t size)
{
    I;
    size_t at = 0;
    for (size_t k = 0; k < n; ++k) {
        const variable *const v = find(references[k]);
        if (!v || v->reference != references[k])
            return (fmi3Status)report(i, BAD, "Unknown value reference %u.", references[k]);
        if (at + v->count > size) return (fmi3Status)report(i, BAD, "%s has %u values; there is no place for them.", v->name, v->count);
        const double *const source = get_values(i, v);
        if (!source) return fmi3Error;
        memcpy(values + at, source, v->count * sizeof *values);
        at += v->count;
    }
    return at == size ? fmi3OK : (fmi3Status)report(i, BAD, "The variables have %d values, got a place for %d.", (int)at, (int)size);
}

fmi3Status fmi3SetFloat64(fmi3Instance given, const fmi3ValueReference references[], size_t n, const fmi3Float64 values[], size_t size)
{
    I;
    int worst = GOOD;
    size_t at = 0;
    for (size_t k = 0; k < n; ++k) {
        const variable *const v = find(references[k]);
        if (!v || v->reference != references[k])
            return (fmi3Status)report(i, BAD, "Unknown value reference %u.", references[k]);
        if (at + v->count > size) return (fmi3Status)report(i, BAD, "%s needs %u values.", v->name, v->count);
        const int status = set_values(i, v, 0, v->count, values + at);
        if (status > WARNING) return (fmi3Status)status;
        if (status > worst) worst = status;
        at += v->count;
    }
    return at == size ? (fmi3Status)worst : (fmi3Status)report(i, BAD, "The variables have %d values, got %d.", (int)at, (int)size);
}

/* Types of which there are no variables. */
#define NONE(n, type) do { I; return n == 0 ? fmi3OK : (fmi3Status)report(i, BAD, "This FMU has no variables of the type " type "."); } while (0)
#define NO_VARIABLES(TYPE) \
    fmi3Status fmi3Get##TYPE(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3##TYPE v[], size_t size) { NONE(n, #TYPE); } \
    fmi3Status fmi3Set##TYPE(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3##TYPE v[], size_t size) { NONE(n, #TYPE); }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
fmi3Status fmi3GetBinary(fmi3Instance given, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary v[], size_t size) { NONE(n, "Binary"); }
fmi3Status fmi3SetBinary(fmi3Instance given, const fmi3ValueReference r[], size_t n, const size_t sizes[], const fmi3Binary v[], size_t size) { NONE(n, "Binary"); }
fmi3Status fmi3GetClock(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3Clock v[]) { NONE(n, "Clock"); }
fmi3Status fmi3SetClock(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3Clock v[]) { NONE(n, "Clock"); }
fmi3Status fmi3GetIntervalDecimal(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3Float64 v[], fmi3IntervalQualifier q[]) { NONE(n, "Clock"); }
fmi3Status fmi3GetIntervalFraction(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 v[], fmi3IntervalQualifier q[]) { NONE(n, "Clock"); }
fmi3Status fmi3GetShiftDecimal(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3Float64 v[]) { NONE(n, "Clock"); }
fmi3Status fmi3GetShiftFraction(fmi3Instance given, const fmi3ValueReference r[], size_t n, fmi3UInt64 c[], fmi3UInt64 v[]) { NONE(n, "Clock"); }
fmi3Status fmi3SetIntervalDecimal(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]) { NONE(n, "Clock"); }
fmi3Status fmi3SetIntervalFraction(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 v[]) { NONE(n, "Clock"); }
fmi3Status fmi3SetShiftDecimal(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3Float64 v[]) { NONE(n, "Clock"); }
fmi3Status fmi3SetShiftFraction(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3UInt64 c[], const fmi3UInt64 v[]) { NONE(n, "Clock"); }

/* What the model description does not offer. */
fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance given, fmi3ValueReference r, size_t *n) { REFUSED("This FMU states no dependencies per element."); }
fmi3Status fmi3GetVariableDependencies(fmi3Instance given, fmi3ValueReference r, size_t e[], fmi3ValueReference of[], size_t f[],
    fmi3DependencyKind kinds[], size_t n) { REFUSED("This FMU states no dependencies per element."); }
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance given, const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[],
    size_t nk, const fmi3Float64 seed[], size_t ns, fmi3Float64 s[], size_t n) { REFUSED("This FMU has no directional derivatives."); }
fmi3Status fmi3GetAdjointDerivative(fmi3Instance given, const fmi3ValueReference u[], size_t nu, const fmi3ValueReference k[],
    size_t nk, const fmi3Float64 seed[], size_t ns, fmi3Float64 s[], size_t n) { REFUSED("This FMU has no adjoint derivatives."); }
fmi3Status fmi3GetOutputDerivatives(fmi3Instance given, const fmi3ValueReference r[], size_t n, const fmi3Int32 orders[],
    fmi3Float64 v[], size_t size) { REFUSED("This FMU has no derivatives of outputs."); }
fmi3Status fmi3ActivateModelPartition(fmi3Instance given, fmi3ValueReference clock, fmi3Float64 time) { REFUSED("This FMU has no scheduled execution."); }

/* ---- saved states */

fmi3Status fmi3GetFMUState(fmi3Instance given, fmi3FMUState *kept) { I; return (fmi3Status)save(i, kept); }
fmi3Status fmi3SetFMUState(fmi3Instance given, fmi3FMUState kept) { I; return (fmi3Status)restore(i, kept); }
fmi3Status fmi3FreeFMUState(fmi3Instance given, fmi3FMUState *kept) { free(*kept); *kept = NULL; return fmi3OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance given, fmi3FMUState kept, size_t *size) { *size = SERIALISED; return fmi3OK; }
fmi3Status fmi3SerializeFMUState(fmi3Instance given, fmi3FMUState kept, fmi3Byte bytes[], size_t size) { I; return (fmi3Status)serialise(i, kept, bytes, size); }
fmi3Status fmi3DeserializeFMUState(fmi3Instance given, const fmi3Byte bytes[], size_t size, fmi3FMUState *kept) { I; return (fmi3Status)deserialise(i, bytes, size, kept); }

/* ---- co-simulation */

fmi3Status fmi3EnterStepMode(fmi3Instance given) { REFUSED("This FMU has no event mode in co-simulation."); }

fmi3Status fmi3DoStep(fmi3Instance given, fmi3Float64 time, fmi3Float64 period, fmi3Boolean noReturn, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    I;
    const int status = advance(i, time, period);
    *event = *terminate = *early = fmi3False;
    *last = i->now.time;
    return (fmi3Status)status;
}

/* ---- model exchange */

fmi3Status fmi3EnterEventMode(fmi3Instance given) { return fmi3OK; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance given) { I; begin_integrator_step(i); return fmi3OK; }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance given) { return fmi3OK; }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance given, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
    fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *next)
{
    *again = *terminate = *nominals = *values = *defined = fmi3False;
    *next = 0.0;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance given, fmi3Boolean noReturn, fmi3Boolean *event, fmi3Boolean *terminate)
{
    I;
    *event = *terminate = fmi3False;
    return (fmi3Status)complete_integrator_step(i);
}

fmi3Status fmi3SetTime(fmi3Instance given, fmi3Float64 time) { I; i->now.time = time; i->now.stale = 1.0; return fmi3OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance given, const fmi3Float64 x[], size_t n) { I; return (fmi3Status)exchange_states(i, WRITE_STATES, NULL, x, n); }
fmi3Status fmi3GetContinuousStates(fmi3Instance given, fmi3Float64 x[], size_t n) { I; return (fmi3Status)exchange_states(i, READ_STATES, x, NULL, n); }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance given, fmi3Float64 x[], size_t n) { I; return (fmi3Status)exchange_states(i, READ_RATES, x, NULL, n); }
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance given, fmi3Float64 x[], size_t n) { I; return (fmi3Status)exchange_states(i, READ_NOMINALS, x, NULL, n); }
fmi3Status fmi3GetEventIndicators(fmi3Instance given, fmi3Float64 v[], size_t n) { return n == 0 ? fmi3OK : fmi3Error; }
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance given, size_t *n) { *n = 0; return fmi3OK; }
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance given, size_t *n) { *n = STATES; return fmi3OK; }
