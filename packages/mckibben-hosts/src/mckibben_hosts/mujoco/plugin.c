/* MuJoCo engine plugin TITLE: actuators and sensor. The actuators of an instance are, in this order: ROLES. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <mujoco/mujoco.h>
#include "NAME.h"

enum { SIZE = UPPER_STATE_SIZE, MUSCLES = NMUSCLES, ACTUATORS = NACTUATORS, SEEN = NSEEN };
static const double SCALES[SIZE] = {SIZES};
static const struct { const char *key; size_t at; int count; double low, high; } KEYS[] = {
KEYROWS
};
static const char *const OFFSETS[MUSCLES] = {OFFSETKEYS};
static const double SPANS[MUSCLES][2] = {SPANLIMITS}; /* that a muscle can take [m] */

/* doubles only, so that data may be copied, pickled and used on threads */
typedef struct {
    NAME_parameters parameters;
    NAME_outputs out;
    double offset[MUSCLES], actuator[ACTUATORS], warned[MUSCLES + ACTUATORS], config;
} instance_state;

static instance_state *of(const mjModel *m, const mjData *d, int instance)
{
    return (instance_state *)(d->plugin_state + m->plugin_stateadr[instance]);
}

static int output(const mjModel *m, const instance_state *q, int k)
{
    return m->actuator_outadr[(int)q->actuator[k]];
}

static double control(const mjModel *m, const mjData *d, const instance_state *q, int k)
{
    int c = m->actuator_ctrladr[(int)q->actuator[k]];
    if (!m->actuator_ctrllimited[c]) return d->ctrl[c];
    return mju_clip(d->ctrl[c], m->actuator_ctrlrange[2 * c], m->actuator_ctrlrange[2 * c + 1]);
}

/* Whether a muscle can be as long as its span; says once where it cannot. */
static int span_is_possible(instance_state *q, int k, double span)
{
    if (span >= SPANS[k][0] && span <= SPANS[k][1]) return 1;
    if (!q->warned[k])
        mju_warning("TITLE: a span of %g m is none that its muscle can take, %g m to %g m, and it does not pull; does '%s' "
                    "hold the span at length zero?", span, SPANS[k][0], SPANS[k][1], OFFSETS[k]);
    q->warned[k] = 1.0;
    return 0;
}

/* Say once of a control that it saturates, or can hardly be meant. */
static void say_command(instance_state *q, int k, const char *name, double value, double low, double high)
{
    if (value == 0.0 || (value >= low && value <= high) || q->warned[MUSCLES + k]) return;
    mju_warning("TITLE: a control %s of %g can hardly be meant: %g to %g have an effect of their own", name, value, low,
                high);
    q->warned[MUSCLES + k] = 1.0;
}

/* What tells the configuration of an instance from another: data may be stepped with a model that they were not made for,
   as rollouts of many models do, and the numbers are those of the model. */
static double config_of(const mjModel *m, int instance)
{
    const char *at = m->plugin_attr + m->plugin_attradr[instance];
    const char *end = m->plugin_attr + (instance + 1 < m->nplugin ? m->plugin_attradr[instance + 1] : m->npluginattr);
    unsigned long long hash = 14695981039346656037ULL; /* FNV-1a */
    for (; at < end; ++at) hash = (hash ^ (unsigned char)*at) * 1099511628211ULL;
    return (double)(hash >> 11); /* exact in a double */
}

static int number(const mjModel *m, int instance, const char *key, double low, double high, double *to, int count)
{
    const char *text = mj_getPluginConfig(m, instance, key);
    if (!text || !*text) return 1;
    for (int k = 0; k < count; ++k) {
        char *end;
        double value = strtod(text, &end);
        if (end == text || !(value >= low && value <= high)) {
            mju_warning("TITLE: %s must be between %g and %g, got '%s'", key, low, high, text);
            return 0;
        }
        to[k] = value;
        text = end;
    }
    return 1;
}

static int fill(const mjModel *m, int instance, instance_state *q)
{
    int count = 0;
    memset(q, 0, sizeof *q);
    q->parameters = NAME_default_parameters;
    q->config = config_of(m, instance);
    for (int i = 0; i < m->nactuator; ++i)
        if (m->actuator_plugin[i] == instance && count++ < ACTUATORS) q->actuator[count - 1] = i;
    int good = 1;
    for (int k = 0; good && k < MUSCLES; ++k)
        good = number(m, instance, OFFSETS[k], -10.0, 10.0, &q->offset[k], 1);
    for (size_t k = 0; good && k < sizeof KEYS / sizeof *KEYS; ++k)
        good = number(m, instance, KEYS[k].key, KEYS[k].low, KEYS[k].high,
                      (double *)((char *)&q->parameters + KEYS[k].at), KEYS[k].count);
    if (good && count != ACTUATORS) {
        mju_warning("TITLE: an instance must have %d actuator(s), in this order: ROLES; got %d", ACTUATORS, count);
        good = 0;
    }
    if (good && m->actuator_actnum[(int)q->actuator[0]] != SIZE) {
        mju_warning("TITLE: actdim of the first actuator must be %d, got %d", SIZE,
                    m->actuator_actnum[(int)q->actuator[0]]);
        good = 0;
    }
    if (good && m->opt.integrator == mjINT_RK4) {
        mju_warning("TITLE: integrator must be Euler, implicit or implicitfast, got RK4");
        good = 0;
    }
    return good;
}

static int nstate(const mjModel *m, int instance)
{
    (void)m; (void)instance;
    return (int)(sizeof(instance_state) / sizeof(mjtNum));
}

static int nsensordata(const mjModel *m, int instance, int sensor)
{
    (void)m; (void)instance; (void)sensor;
    return SEEN;
}

static int init(const mjModel *m, mjData *d, int instance)
{
    instance_state q;
    d->plugin_data[instance] = 0;
    return fill(m, instance, &q) ? 0 : -1;
}

static void reset(const mjModel *m, mjtNum *state, void *data, int instance)
{
    (void)data;
    fill(m, instance, (instance_state *)state);
}

static void act_dot(const mjModel *m, mjData *d, int instance)
{
    instance_state *q = of(m, d, instance);
    int possible = 1;
    if (q->config != config_of(m, instance)) {
        const NAME_outputs out = q->out;
        possible = fill(m, instance, q);
        q->out = out;
    }
    int a = m->actuator_actadr[(int)q->actuator[0]];
    double h = m->opt.timestep, numbers[SIZE];
    NAME_inputs inputs = NAME_default_inputs;
    for (int k = 0; k < SIZE; ++k) numbers[k] = d->act[a + k] * SCALES[k];
GIVEN
    if (!possible) { /* nothing pulls, and the state stays */
        memset(&q->out, 0, sizeof q->out);
        for (int k = 0; k < SIZE; ++k) d->act_dot[a + k] = 0.0;
        return;
    }
    const double before = q->out.sound;
    NAME_step(&q->parameters, (NAME_state *)numbers, &inputs, h, UPPER_STAGGERED, &q->out);
    if (q->out.sound != 1.0 && (before == 1.0 || d->time == 0.0))
        mju_warning("TITLE, at %g s: " SENTENCE, d->time, h, NAME_meaning(q->out.sound));
    for (int k = 0; k < SIZE; ++k) d->act_dot[a + k] = (numbers[k] / SCALES[k] - d->act[a + k]) / h;
}

static void compute(const mjModel *m, mjData *d, int instance, int capability)
{
    instance_state *q = of(m, d, instance);
    if (capability == mjPLUGIN_ACTUATOR) {
PULLS
        return;
    }
    const double shown[SEEN] = {
        SHOWN
    };
    for (int s = 0; s < m->nsensor; ++s)
        if (m->sensor_type[s] == mjSENS_PLUGIN && m->sensor_plugin[s] == instance)
            memcpy(d->sensordata + m->sensor_adr[s], shown, sizeof shown);
}

mjPLUGIN_LIB_INIT(mckibben)
{
    static const char *keys[MUSCLES + sizeof KEYS / sizeof *KEYS];
    mjpPlugin plugin;
    int count = 0;
    for (int k = 0; k < MUSCLES; ++k) keys[count++] = OFFSETS[k];
    for (size_t k = 0; k < sizeof KEYS / sizeof *KEYS; ++k) keys[count++] = KEYS[k].key;
    mjp_defaultPlugin(&plugin);
    plugin.name = "TITLE";
    plugin.capabilityflags = mjPLUGIN_ACTUATOR | mjPLUGIN_SENSOR;
    plugin.needstage = mjSTAGE_ACC;
    plugin.nattribute = count;
    plugin.attributes = keys;
    plugin.nstate = nstate;
    plugin.nsensordata = nsensordata;
    plugin.init = init;
    plugin.reset = reset;
    plugin.compute = compute;
    plugin.actuator_act_dot = act_dot;
    mjp_registerPlugin(&plugin);
}
