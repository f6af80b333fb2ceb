/* An instance of the FMU, whatever the version of FMI. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* of functions that FMI prescribes */
#endif

/* All that changes. Numbers only, so that it is saved, restored and serialised by copy. */
typedef struct {
    part_parameters parameters;
    part_inputs inputs;
    part_state state;
    part_outputs outputs;
    double staggered, time;
    double initialised; /* 1 after the initialization mode */
    double stale;       /* 1 where the outputs do not belong to inputs and state any more */
#if MODEL_EXCHANGE
    part_rates rates;
    part_before before; /* what the last integrator step began with */
    double before_time;
    double open; /* integrator steps in a row whose balances do not close at all */
#endif
} model;

#define MOST_OPEN 5.0 /* such steps that end a run; one may be about something that jumps */

enum { INPUT, OUTPUT, FIXED, TUNABLE, STATE, RATE, TIME };

/* A variable of the model description: `count` numbers at an offset in the model. */
typedef struct {
    unsigned reference;
    unsigned count;
    int kind;
    size_t offset;
    double low, high;
    double least, most; /* a value beyond, except 0, is carried out with a warning */
    const char *name;
} variable;

/* A continuous state: `count` numbers, their rates, and their usual size. */
typedef struct {
    size_t state, rate, count;
    double nominal;
} continuous;

#include "variables.h"

enum { GOOD, WARNING, DISCARD, BAD }; /* the first of fmi2Status and fmi3Status */

typedef struct instance {
    model now;
    int exchange; /* model exchange, otherwise co-simulation */
    void (*log)(const struct instance *i, int status, const char *text);
    void (*callback)(void); /* of the importer, by which messages are logged */
    void *environment;
    char *name;
    char warned[sizeof VARIABLES / sizeof *VARIABLES];
} instance;

static const char *const CATEGORIES[] = {"logStatusOK", "logStatusWarning", "logStatusDiscard", "logStatusError"};

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static int report(const instance *i, int status, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (i->log) i->log(i, status, text);
    return status;
}

static double *numbers(instance *i, const variable *v) { return (double *)((char *)&i->now + v->offset); }

/* The variable of a value reference; those of an array follow each other. */
static const variable *find(unsigned reference)
{
    size_t low = 0, high = sizeof VARIABLES / sizeof *VARIABLES;
    while (low + 1 < high) {
        const size_t middle = (low + high) / 2;
        if (VARIABLES[middle].reference <= reference) low = middle;
        else high = middle;
    }
    return reference - VARIABLES[low].reference < VARIABLES[low].count ? &VARIABLES[low] : NULL;
}

static void set_defaults(instance *i)
{
    memset(&i->now, 0, sizeof i->now);
    i->now.parameters = DEFAULT_PARAMETERS;
    i->now.inputs = DEFAULT_INPUTS;
    i->now.stale = 1.0;
}

/* Why the outputs cannot be relied on. */
static const char *meaning(const instance *i) { return part_meaning(i->now.outputs.sound); }

static int ran_away(const instance *i)
{
    return report(i, BAD, "At %g s, %s: the importer's integrator needs a shorter step, or a method for stiff systems.",
                  i->now.time, meaning(i));
}

/* Rest at the present spans, commands and parameters. */
static int settle(instance *i)
{
    part_rest(&i->now.parameters, &i->now.inputs, &i->now.state);
    part_observe(&i->now.parameters, &i->now.state, &i->now.inputs, &i->now.outputs);
    i->now.stale = 0.0;
    if (i->now.outputs.sound != 1.0) return report(i, BAD, "The muscle cannot rest at these spans and parameters: %s.", meaning(i));
    return GOOD;
}

/* Outputs that belong to the moment; those of a step in co-simulation stay until the next. */
static int refresh(instance *i)
{
    if (i->now.stale != 1.0) return GOOD;
    if (i->now.initialised != 1.0) return settle(i);
    part_observe(&i->now.parameters, &i->now.state, &i->now.inputs, &i->now.outputs);
    if (i->now.outputs.sound != 1.0) return ran_away(i);
    i->now.stale = 0.0;
    return GOOD;
}

static void begin_integrator_step(instance *i)
{
#if MODEL_EXCHANGE
    remember(&i->now.before, &i->now.state, &i->now.inputs);
    i->now.before_time = i->now.time;
#else
    (void)i;
#endif
}

static int initialise(instance *i)
{
    const int status = settle(i);
    if (status == GOOD) i->now.initialised = 1.0;
    begin_integrator_step(i);
    return status;
}

static int get_rates(instance *i)
{
#if MODEL_EXCHANGE
    const int status = i->now.initialised == 1.0 ? GOOD : refresh(i);
    if (status != GOOD) return status;
    part_derivatives(&i->now.parameters, &i->now.state, &i->now.inputs, &i->now.rates);
    const char *const now = (const char *)&i->now;
    for (size_t k = 0; k < sizeof CONTINUOUS / sizeof *CONTINUOUS; ++k)
        for (size_t j = 0; j < CONTINUOUS[k].count; ++j)
            if (!isfinite(((const double *)(now + CONTINUOUS[k].rate))[j]))
                return report(i, DISCARD, "A rate is not finite at %g s: %s.", i->now.time, part_meaning(0.0));
    return GOOD;
#else
    return report(i, BAD, "This FMU has co-simulation only.");
#endif
}

/* The values of a variable, brought up to date; NULL if that fails. */
static const double *get_values(instance *i, const variable *v)
{
    int status = GOOD;
    if (v->kind == OUTPUT || v->kind == STATE) status = refresh(i);
    else if (v->kind == RATE) status = get_rates(i);
    return status == GOOD ? numbers(i, v) : NULL;
}

static int set_values(instance *i, const variable *v, size_t first, size_t count, const double *values)
{
    const int settable = v->kind == INPUT || v->kind == TUNABLE || (v->kind == FIXED && i->now.initialised != 1.0);
    if (!settable)
        return report(i, BAD, v->kind == FIXED ? "%s is fixed after the initialization." : "%s cannot be set.", v->name);
    for (size_t k = 0; k < count; ++k)
        if (!(values[k] >= v->low && values[k] <= v->high))
            return report(i, BAD, "%s must be between %g and %g, got %g.", v->name, v->low, v->high, values[k]);
    memcpy(numbers(i, v) + first, values, count * sizeof *values);
    if (i->exchange || i->now.initialised != 1.0) i->now.stale = 1.0;
    for (size_t k = 0; k < count; ++k)
        if (values[k] != 0.0 && !(values[k] >= v->least && values[k] <= v->most) && !i->warned[v - VARIABLES]) {
            i->warned[v - VARIABLES] = 1;
            return report(i, WARNING, "%s of %g can hardly be meant: %g to %g have an effect of their own.", v->name,
                          values[k], v->least, v->most);
        }
    return GOOD;
}

/* Go on by a step of the importer; where that is not possible, nothing has changed. */
static int advance(instance *i, double time, double period)
{
    if (i->exchange) return report(i, BAD, "A step can be taken in co-simulation only.");
    if (i->now.initialised != 1.0) return report(i, BAD, "A step can be taken after the initialization only.");
    if (!(period > 0.0 && period <= DBL_MAX)) return report(i, BAD, "A step must be greater than 0 s, got %g s.", period);
    const part_state state = i->now.state;
    const part_outputs outputs = i->now.outputs;
    part_step(&i->now.parameters, &i->now.state, &i->now.inputs, period, i->now.staggered > 0.5, &i->now.outputs);
    if (i->now.outputs.sound != 1.0) {
        const char *const why = meaning(i);
        i->now.state = state;
        i->now.outputs = outputs;
        return report(i, DISCARD, SENTENCE, period, why);
    }
    i->now.time = time + period;
    return GOOD;
}

/* Model exchange: friction and other memory go along the integrator step that has ended; no step can be taken back. */
static int complete_integrator_step(instance *i)
{
#if MODEL_EXCHANGE
    const double duration = i->now.time - i->now.before_time;
    if (!(duration > 0.0)) return GOOD;
    set_duration(&i->now.before, duration);
    part_complete(&i->now.parameters, &i->now.state, &i->now.inputs, &i->now.before, &i->now.outputs);
    i->now.stale = 0.0;
    i->now.open = i->now.outputs.sound > 1.0 ? i->now.open + 1.0 : 0.0;
    begin_integrator_step(i);
    return i->now.open >= MOST_OPEN || i->now.outputs.sound == 0.0 ? ran_away(i) : GOOD;
#else
    (void)i;
    return GOOD;
#endif
}

/* Copy continuous states, rates or nominal values to or from an array of the importer. */
enum { READ_STATES, WRITE_STATES, READ_RATES, READ_NOMINALS };
static int exchange_states(instance *i, int what, double *target, const double *source, size_t size)
{
    if (size != STATES) return report(i, BAD, "The FMU has %d continuous states, got %d.", (int)STATES, (int)size);
    if (what == READ_STATES && refresh(i) != GOOD) return BAD;
    if (what == READ_RATES) {
        const int status = get_rates(i);
        if (status != GOOD) return status;
    }
#if MODEL_EXCHANGE
    char *now = (char *)&i->now;
    for (size_t k = 0, at = 0; k < sizeof CONTINUOUS / sizeof *CONTINUOUS; at += CONTINUOUS[k++].count) {
        const continuous *c = &CONTINUOUS[k];
        const size_t bytes = c->count * sizeof(double);
        if (what == READ_STATES) memcpy(target + at, now + c->state, bytes);
        else if (what == WRITE_STATES) memcpy(now + c->state, source + at, bytes);
        else if (what == READ_RATES) memcpy(target + at, now + c->rate, bytes);
        else for (size_t j = 0; j < c->count; ++j) target[at + j] = c->nominal;
    }
#endif
    if (what == WRITE_STATES) i->now.stale = 1.0;
    return GOOD;
}

/* ---- instances, and their saved states */

static instance *new_instance(const char *name, const char *token, int exchange, void (*callback)(void), void *environment,
                              void (*log)(const instance *, int, const char *))
{
    instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    i->log = log;
    i->callback = callback;
    i->environment = environment;
    i->exchange = exchange;
    i->name = calloc(1, (name ? strlen(name) : 0) + 1);
    if (i->name && name) strcpy(i->name, name);
    const int other = !token || strcmp(token, TOKEN) != 0;
    if (other) report(i, BAD, "The token of the importer is not that of this FMU: it is of another one.");
    else if (exchange && !MODEL_EXCHANGE) report(i, BAD, "This FMU has co-simulation only.");
    else {
        if (exchange && MEMORY)
            report(i, WARNING, "Friction follows the importer's integrator steps in model exchange; co-simulation is more accurate.");
        set_defaults(i);
        return i;
    }
    free(i->name);
    free(i);
    return NULL;
}

static void free_instance(instance *i)
{
    if (!i) return;
    free(i->name);
    free(i);
}

static int save(instance *i, void **kept)
{
    if (!*kept) *kept = malloc(sizeof i->now);
    if (!*kept) return report(i, BAD, "There is no memory for a state.");
    memcpy(*kept, &i->now, sizeof i->now);
    return GOOD;
}

static int restore(instance *i, const void *kept)
{
    if (!kept) return report(i, BAD, "There is no state to restore.");
    memcpy(&i->now, kept, sizeof i->now);
    return GOOD;
}

/* A state as bytes: the token of the FMU, and the numbers. */
enum { SERIALISED = sizeof TOKEN + sizeof(model) };

static int serialise(instance *i, const void *kept, void *bytes, size_t size)
{
    if (!kept || size < SERIALISED) return report(i, BAD, "A state needs %d bytes, got %d.", (int)SERIALISED, (int)size);
    memcpy(bytes, TOKEN, sizeof TOKEN);
    memcpy((char *)bytes + sizeof TOKEN, kept, sizeof(model));
    return GOOD;
}

static int deserialise(instance *i, const void *bytes, size_t size, void **kept)
{
    if (size != SERIALISED || memcmp(bytes, TOKEN, sizeof TOKEN) != 0)
        return report(i, BAD, "These bytes are no state of this FMU.");
    if (!*kept) *kept = malloc(sizeof(model));
    if (!*kept) return report(i, BAD, "There is no memory for a state.");
    memcpy(*kept, (const char *)bytes + sizeof TOKEN, sizeof(model));
    return GOOD;
}

#endif
