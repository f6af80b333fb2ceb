"""A part as an engine plugin of MuJoCo: actuators and a sensor, built against the installed wheel.

An instance of the plugin is a part: one muscle, or several that share a tank, with an actuator for each (`actuator_roles`).
The first actuators are the muscles, in the part's order. The control of each is the command of the same name, or else the
next command that no muscle has. Commands that are left get actuators of their own behind the muscles, which do not pull.

The state of the part lies in ``act`` of the first actuator, divided by its size at rest, so that finite differences see
every number of it. The plugin takes a whole step of the part in ``actuator_act_dot`` and returns the difference over the
step, so that MuJoCo's Euler step lands on the next state. Parameters and last outputs lie in ``plugin_state``; nothing is a
pointer, so that data may be copied, pickled and used on threads.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..documents import write_text
from ..engine.soundness import SENTENCE
from ..errors import InputError
from ..extras import library
from .c_source import PartSource, build_library, c_ends, with_names
from .part import Part

LEAST_SIZE = 1e-6  # of a number of the state by which it is divided


class ActuatorRole(NamedTuple):
    """What an actuator is for a part: the muscle that pulls there, and the command that its control is; None for neither."""

    muscle: str | None
    command: str | None

    @property
    def name(self) -> str:
        """Name of the muscle, else of the command."""
        return self.muscle or self.command or ""


def actuator_roles(part: Part) -> tuple[ActuatorRole, ...]:
    """The actuators that a part needs, in their order."""
    left = [name for name in part.commands if name not in part.muscles]
    roles = []
    for muscle in part.muscles:
        named = muscle if muscle in part.commands else None
        roles.append(ActuatorRole(muscle, named or (left.pop(0) if left else None)))
    return (*roles, *(ActuatorRole(None, command) for command in left))


def state_sizes(part: Part) -> np.ndarray:
    """Usual size of each number of a part's state, its value at rest; 1 where that is next to nothing."""
    rested = np.abs(part.rest())
    return np.where(rested > LEAST_SIZE, rested, 1.0)


SENSED = ("pressure", "tension", "length", "temperature", "friction", "slack", "work")
"""What the sensor shows of each muscle, in this order, one muscle behind the other; of the last step."""


def export_mujoco(source: PartSource, out: Path) -> list[Path]:
    """Write a part as a plugin of MuJoCo, build it, and write an example model.

    Args:
        source: the C of a part.
        out: folder for the files.

    Raises:
        InputError: MuJoCo is not installed.
        EngineError: there is no C compiler, or it failed.
    """
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
    part, roles = source.part, actuator_roles(source.part)
    members = {(v.group, v.path): v.member for v in (*source.of("inputs"), *source.of("outputs"))}
    keys = []
    for variable in source.of("parameters"):
        (low, high), count = c_ends(variable.bounds), int(np.prod(variable.shape))
        key = config_key(variable.path)
        keys.append(f'    {{"{key}", offsetof({source.name}_parameters, {variable.member}), {count}, {low}, {high}}},')
    offsets = [f'"offset.{name}"' for name in part.muscles] if len(part.muscles) > 1 else ['"offset"']
    given, pulls, shown = [], [], []
    for k, role in enumerate(roles):
        if role.muscle is not None:
            of_muscle = {"tension": f"tension.{role.muscle}", "work": f"work.{role.muscle}"}
            span, rate = (members["inputs", f"{what}.{role.muscle}"] for what in ("span", "rate"))
            given.append(f"    inputs.{span} = q->offset[{k}] + d->actuator_length[output(m, q, {k})];")
            given.append(f"    inputs.{rate} = d->actuator_velocity[output(m, q, {k})];")
            given.append(f"    possible &= span_is_possible(q, {k}, inputs.{span});")
            tension = members["outputs", of_muscle["tension"]]
            pulls.append(f"        d->actuator_force[output(m, q, {k})] = -q->out.{tension};")
            paths = [of_muscle.get(name, f"muscle.{role.muscle}.{name}") for name in SENSED]
            shown.append(", ".join(f"q->out.{members['outputs', path]}" for path in paths))
        else:
            pulls.append(f"        d->actuator_force[output(m, q, {k})] = 0.0;")
        if role.command is not None:
            low, high = c_ends(part.command_limits(role.command))
            command = f"inputs.{members['inputs', f'command.{role.command}']}"
            given.append(f"    {command} = control(m, d, q, {k});")
            given.append(f'    say_command(q, {k}, "{role.command}", {command}, {low}, {high});')
    limits = [part.span_limits[name] for name in part.muscles]
    words: dict[str, Any] = {
        "KEYROWS": "\n".join(keys),
        "OFFSETKEYS": ", ".join(offsets),
        "SPANLIMITS": ", ".join(f"{{{low!r}, {high!r}}}" for low, high, _ in limits),
        "SIZES": ", ".join(repr(float(size)) for size in state_sizes(part)),
        "NMUSCLES": str(len(part.muscles)),
        "NACTUATORS": str(len(roles)),
        "NSEEN": str(len(SENSED) * len(part.muscles)),
        "ROLES": ", ".join(role.name for role in roles),
        "GIVEN": "\n".join(given),
        "PULLS": "\n".join(pulls),
        "SHOWN": ",\n        ".join(shown),
        "TITLE": plugin_name(source.name),
        "SENTENCE": json.dumps(SENTENCE.format("%g", "%s")),
    }
    return with_names(TEMPLATE, source.name, **words)


def example_model(source: PartSource) -> str:
    """The text of a model: a mass that hangs from each muscle."""
    part, roles = source.part, actuator_roles(source.part)
    single, units = len(part.muscles) == 1, {drive.command: drive.unit for drive in part.hosted.drives}
    bodies, tendons, actuators = [], [], []
    for k, role in enumerate(roles):
        name = role.name
        words = {"name": name, "of": "" if single else f"_{name}", "x": f"{0.1 * k:g}"}
        words["plugin"] = plugin_name(source.name)
        words["actdim"] = f' actdim="{part.rest().size}"' if k == 0 else ""
        # A control has a range where its command is the opening of a valve.
        words["range"] = ' ctrllimited="true" ctrlrange="-1 1"' if units.get(role.command or "") == "1" else ""
        if role.muscle is None:
            words["of"] = "" if single else f"_{roles[0].name}"
            actuators.append(COMMANDER.format(**words))
            continue
        words["span"] = f"{-part.span[name]:.6g}"
        bodies.append(BODY.format(**words))
        tendons.append(TENDON.format(**words))
        actuators.append(ACTUATOR.format(**words))
    rows = ["".join(one).rstrip("\n") for one in (bodies, tendons, actuators)]
    names = ", ".join(role.name for role in roles)
    order = "" if len(roles) == 1 else f"    <!-- the actuators of an instance, in this order: {names} -->\n"
    return EXAMPLE.format(plugin=plugin_name(source.name), bodies=rows[0], tendons=rows[1], actuators=order + rows[2])


EXAMPLE = """<mujoco>
  <option timestep="0.001"/>
  <extension><plugin plugin="{plugin}"><instance name="m"/></plugin></extension>
  <worldbody>
{bodies}
  </worldbody>
  <tendon>
{tendons}
  </tendon>
  <actuator>
{actuators}
  </actuator>
  <sensor><plugin name="inside" plugin="{plugin}" instance="m"/></sensor>
</mujoco>
"""
BODY = """    <site name="anchor{of}" pos="{x} 0 0"/>
    <body pos="{x} 0 {span}">
      <joint name="height{of}" type="slide" axis="0 0 1"/>
      <geom type="sphere" size="0.03" mass="4" contype="0" conaffinity="0"/>
      <site name="hook{of}"/>
    </body>
"""
TENDON = """    <spatial name="cord{of}"><site site="anchor{of}"/><site site="hook{of}"/></spatial>
"""
ACTUATOR = """    <plugin name="{name}" plugin="{plugin}" instance="m" tendon="cord{of}"{actdim}{range}/>
"""
COMMANDER = """    <plugin name="{name}" plugin="{plugin}" instance="m" tendon="cord{of}" gear="0"{range}/>
"""

TEMPLATE = """/* MuJoCo engine plugin TITLE: actuators and sensor. The actuators of an instance are, in this order: ROLES. */
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
    double offset[MUSCLES], actuator[ACTUATORS], warned[MUSCLES + ACTUATORS];
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
    int a = m->actuator_actadr[(int)q->actuator[0]];
    double h = m->opt.timestep, numbers[SIZE];
    NAME_inputs inputs = NAME_default_inputs;
    int possible = 1;
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
"""
