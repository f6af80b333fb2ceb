"""A part with one muscle as an engine plugin of MuJoCo: an actuator and a sensor, built against the installed wheel.

The state of the part lies in ``act``, divided by its size at rest, so that finite differences see every number of it. The
plugin takes a whole step of the part in ``actuator_act_dot`` and returns the difference over the step, so that MuJoCo's
Euler step lands on the next state. Parameters and last outputs lie in ``plugin_state``; nothing is a pointer, so that data
may be copied, pickled and used on threads.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..documents import write_text
from ..errors import InputError
from ..extras import library
from .c_source import PartSource, with_names
from .compiler import build_library

LEAST_SIZE = 1e-6  # of a number of the state by which it is divided
SENSED = ("pressure", "tension", "length", "temperature", "friction", "slack", "work")
"""What the sensor shows, in this order; of the last step."""


def export_mujoco(source: PartSource, out: Path) -> list[Path]:
    """Write a part as a plugin of MuJoCo, build it, and write an example model.

    Args:
        source: the C of a part with one muscle and one command.
        out: folder for the files.

    Raises:
        InputError: the part has more muscles or commands, or MuJoCo is not installed.
        EngineError: there is no C compiler, or it failed.
    """
    part = source.part
    if len(part.muscles) != 1 or len(part.commands) != 1:
        had = f"{len(part.muscles)} muscles and {len(part.commands)} commands"
        raise InputError(
            "part", had, "must have one muscle and one command for MuJoCo; use an actuator for each muscle"
        )
    place = Path(str(library("mujoco", "The MuJoCo plugin needs").__file__)).parent
    files = source.write(out)
    files.append(write_text(out / f"{source.name}_plugin.c", plugin_source(source)))
    files.append(write_text(out / f"{source.name}.xml", example_model(source)))
    engine = next(iter(sorted(place.glob("libmujoco*"))), None)
    if engine is None:
        raise InputError("mujoco", str(place), "must contain the library of MuJoCo")
    sources = [out / f"{source.name}.c", out / f"{source.name}_plugin.c"]
    link = [str(engine), f"-Wl,-rpath,{place}"]
    files.append(build_library(sources, out / f"{source.name}_plugin.so", include=[place / "include"], link=link))
    return files


def plugin_name(name: str) -> str:
    """Name by which a model asks for the plugin of a part."""
    return f"mckibben.{name}"


def config_key(path: str) -> str:
    """Key by which a model sets a parameter, from its dotted path."""
    return path.replace(".__self__", "")


def plugin_source(source: PartSource) -> str:
    """The C of the plugin."""
    muscle, command = source.part.muscles[0], source.part.commands[0]
    members = {(v.group, v.path): v.member for v in (*source.of("inputs"), *source.of("outputs"))}
    rested = np.abs(source.part.rest())
    sizes = ", ".join(repr(float(x)) if x > LEAST_SIZE else "1.0" for x in rested)
    keys = []
    for variable in source.of("parameters"):
        low, high = (repr(float(np.clip(b, -1.7e308, 1.7e308))) for b in variable.bounds)
        key = config_key(variable.path)
        count = int(np.prod(variable.shape))
        keys.append(f'    {{"{key}", offsetof({source.name}_parameters, {variable.member}), {count}, {low}, {high}}},')
    outputs = {"tension": f"tension.{muscle}", "work": f"work.{muscle}"}
    shown = [members["outputs", outputs.get(name, f"muscle.{muscle}.{name}")] for name in SENSED]
    words: dict[str, Any] = {
        "KEYROWS": "\n".join(keys),
        "SIZES": sizes,
        "SPAN": members["inputs", f"span.{muscle}"],
        "RATE": members["inputs", f"rate.{muscle}"],
        "COMMAND": members["inputs", f"command.{command}"],
        "TENSION": members["outputs", f"tension.{muscle}"],
        "SHOWN": ", ".join(f"q->out.{member}" for member in shown),
        "TITLE": plugin_name(source.name),
    }
    return with_names(TEMPLATE, source.name, **words)


def example_model(source: PartSource) -> str:
    """The text of a model: a mass that hangs from the muscle."""
    span = source.part.span[source.part.muscles[0]]
    return EXAMPLE.format(plugin=plugin_name(source.name), span=f"{-span:.6g}", numbers=source.part.rest().size)


EXAMPLE = """<mujoco>
  <option timestep="0.001"/>
  <extension><plugin plugin="{plugin}"><instance name="m"/></plugin></extension>
  <worldbody>
    <site name="anchor"/>
    <body pos="0 0 {span}">
      <joint name="height" type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.03" mass="4" contype="0" conaffinity="0"/>
      <site name="hook"/>
    </body>
  </worldbody>
  <tendon><spatial name="cord"><site site="anchor"/><site site="hook"/></spatial></tendon>
  <actuator>
    <plugin name="muscle" plugin="{plugin}" instance="m" tendon="cord" actdim="{numbers}"
            ctrllimited="true" ctrlrange="-1 1"/>
  </actuator>
  <sensor><plugin name="inside" plugin="{plugin}" instance="m"/></sensor>
</mujoco>
"""

TEMPLATE = """/* MuJoCo engine plugin TITLE: actuator and sensor. */
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <mujoco/mujoco.h>
#include "NAME.h"

enum { SIZE = UPPER_STATE_SIZE, SEEN = 7 };
static const double SCALES[SIZE] = {SIZES};
static const struct { const char *key; size_t at; int count; double low, high; } KEYS[] = {
KEYROWS
};

/* doubles only, so that data may be copied, pickled and used on threads */
typedef struct { NAME_parameters parameters; NAME_outputs out; double offset, actuator; } instance_state;

static instance_state *of(const mjModel *m, const mjData *d, int instance)
{
    return (instance_state *)(d->plugin_state + m->plugin_stateadr[instance]);
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
    for (int i = 0; i < m->nactuator; ++i)
        if (m->actuator_plugin[i] == instance) { q->actuator = i; count++; }
    int good = number(m, instance, "offset", -10.0, 10.0, &q->offset, 1);
    for (size_t k = 0; good && k < sizeof KEYS / sizeof *KEYS; ++k)
        good = number(m, instance, KEYS[k].key, KEYS[k].low, KEYS[k].high,
                      (double *)((char *)&q->parameters + KEYS[k].at), KEYS[k].count);
    if (good && count != 1) {
        mju_warning("TITLE: an instance must have one actuator, got %d", count);
        good = 0;
    }
    if (good && m->actuator_actnum[(int)q->actuator] != SIZE) {
        mju_warning("TITLE: actdim must be %d, got %d", SIZE, m->actuator_actnum[(int)q->actuator]);
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
    int i = (int)q->actuator, a = m->actuator_actadr[i], o = m->actuator_outadr[i];
    double h = m->opt.timestep, command = d->ctrl[m->actuator_ctrladr[i]], numbers[SIZE];
    NAME_inputs inputs = NAME_default_inputs;
    if (m->actuator_ctrllimited[i])
        command = mju_clip(command, m->actuator_ctrlrange[2 * i], m->actuator_ctrlrange[2 * i + 1]);
    for (int k = 0; k < SIZE; ++k) numbers[k] = d->act[a + k] * SCALES[k];
    inputs.SPAN = q->offset + d->actuator_length[o];
    inputs.RATE = d->actuator_velocity[o];
    inputs.COMMAND = command;
    NAME_step(&q->parameters, (NAME_state *)numbers, &inputs, h, UPPER_STAGGERED, &q->out);
    for (int k = 0; k < SIZE; ++k) d->act_dot[a + k] = (numbers[k] / SCALES[k] - d->act[a + k]) / h;
}

static void compute(const mjModel *m, mjData *d, int instance, int capability)
{
    instance_state *q = of(m, d, instance);
    if (capability == mjPLUGIN_ACTUATOR) {
        d->actuator_force[m->actuator_outadr[(int)q->actuator]] = -q->out.TENSION;
        return;
    }
    const double shown[SEEN] = {SHOWN};
    for (int s = 0; s < m->nsensor; ++s)
        if (m->sensor_type[s] == mjSENS_PLUGIN && m->sensor_plugin[s] == instance)
            memcpy(d->sensordata + m->sensor_adr[s], shown, sizeof shown);
}

mjPLUGIN_LIB_INIT(mckibben)
{
    static const char *keys[1 + sizeof KEYS / sizeof *KEYS];
    mjpPlugin plugin;
    int count = 0;
    keys[count++] = "offset";
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
"""
