"""Muscles of MuJoCo models: as an engine plugin built against the installed wheel, or by callbacks of Python.

A part, one muscle or several that share a tank, has an actuator for each muscle (`actuator_roles`). The first actuators are
the muscles, in the part's order. The control of each is the command of the same name, or else the next command that no
muscle has. Commands that are left get actuators of their own behind the muscles, which do not pull. The state of the part
lies in ``act`` of the first actuator, divided by its size at rest, so that finite differences see every number of it.

**The plugin** (`export_mujoco`), an instance of which is a part, takes a whole step of the part in ``actuator_act_dot`` and
returns the difference over the step, so that MuJoCo's Euler step lands on the next state. Parameters and last outputs lie
in ``plugin_state``; nothing is a pointer, so that data may be copied, pickled and used on threads.

**Callbacks** (`MuscleCallbacks`) need no compiler, take any part, and have half the speed of the plugin.

    model = mujoco.MjModel.from_xml_string(text)
    with MuscleCallbacks(model, {"muscle": part}):
        mujoco.mj_step(model, data)

An actuator of the model is a muscle if it has the name of one and

    <general name="muscle" tendon="cord" dyntype="user" gainprm="0" biastype="user" biasprm="0" actdim="25"/>

where ``actdim`` is `act_size` of the part and ``biasprm`` the span at length zero [m], zero on a spatial tendon. Of several
actuators only the first has ``dyntype`` and ``actdim``. State and mean tensions lie in ``act``; nothing is kept outside the
data, so that they may be copied, pickled and used on threads. MuJoCo has one callback of each kind for all models, and
calls it with the interpreter's lock.
"""

from __future__ import annotations

import json
import weakref
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from mckibben.answers import Caution, warn
from mckibben.documents import write_text
from mckibben.engine.soundness import SENTENCE, Soundness
from mckibben.errors import InputError
from mckibben.extras import library

from .c_source import PartSource, build_library, c_ends, shipped, with_names
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


def plugin_source(source: PartSource) -> str:
    """The C of the plugin."""
    part, roles = source.part, actuator_roles(source.part)
    members = {(v.group, v.path): v.member for v in (*source.of("inputs"), *source.of("outputs"))}
    keys = []
    for variable in source.of("parameters"):
        (low, high), count = c_ends(variable.bounds), int(np.prod(variable.shape))
        keys.append(
            f'    {{"{variable.path}", offsetof({source.name}_parameters, {variable.member}), {count}, {low}, {high}}},'
        )
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
    return with_names(shipped("mujoco/plugin.c"), source.name, **words)


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


def act_size(part: Part) -> int:
    """Number of activations of a part: its state, and the mean tension of each muscle."""
    return part.rest().size + len(part.muscles)


class _ModelPlaces(NamedTuple):
    """Where a part lies in a model.

    Attributes:
        act: first activation.
        muscles: actuators of the muscles, in the part's order.
        spans: places of their spans in the vector of inputs; those of the rates are behind them.
        offsets: spans at length zero [m].
        controls: controls of the commands.
        commands: their places in the vector of inputs.
    """

    act: int
    muscles: list[int]
    spans: list[int]
    offsets: np.ndarray
    controls: list[int]
    commands: list[int]


class _AttachedPart:
    """A part with the actuators that have its muscles, in whatever model."""

    def __init__(self, names: tuple[str, ...], part: Part) -> None:
        self.part, self.roles, self.names = part, actuator_roles(part), names
        if len(names) != len(self.roles):
            wanted = ", ".join(role.name for role in self.roles)
            raise InputError("actuators", ", ".join(names), f"must be one actuator for each of {wanted}, in this order")
        self.sizes, self.count = state_sizes(part), len(part.muscles)
        self.total, self.code, self.sound = act_size(part), part.outputs.index("sound"), True
        self._said: set[str] = set()
        self.tensions = [part.outputs.index(f"{m}_tension" if self.count > 1 else "tension") for m in part.muscles]

    def places(self, model: Any) -> _ModelPlaces:
        """Find the part in a model; raises `InputError` where it does not fit."""
        mujoco = library("mujoco", "Muscles in MuJoCo need")
        kind = mujoco.mjtObj.mjOBJ_ACTUATOR
        ids = [mujoco.mj_name2id(model, kind, name) for name in self.names]
        for name, found in zip(self.names, ids, strict=True):
            if found < 0:
                raise InputError("actuator", name, known=tuple(model.actuator(k).name for k in range(model.nactuator)))
        first = ids[0]
        if int(model.actuator_dyntype[first]) != int(mujoco.mjtDyn.mjDYN_USER):
            raise InputError(f"dyntype of the actuator {self.names[0]}", None, 'must be "user"')
        if int(model.actuator_actnum[first]) != self.total:
            had = int(model.actuator_actnum[first])
            raise InputError(f"actdim of the actuator {self.names[0]}", had, f"must be {self.total}")
        if int(model.opt.integrator) == int(mujoco.mjtIntegrator.mjINT_RK4):
            raise InputError("integrator", "RK4", "must be Euler, implicit or implicitfast")
        for name, k in zip(self.names[: self.count], ids, strict=False):
            if int(model.actuator_biastype[k]) != int(mujoco.mjtBias.mjBIAS_USER):
                raise InputError(f"biastype of the actuator {name}", None, 'must be "user"')
        ordered, commands = sorted(self.part.muscles), sorted(self.part.commands)
        commanded = [(k, role.command) for k, role in zip(ids, self.roles, strict=True) if role.command is not None]
        return _ModelPlaces(
            int(model.actuator_actadr[first]),
            ids[: self.count],
            [ordered.index(muscle) for muscle in self.part.muscles],
            np.array([float(model.actuator_biasprm[k, 0]) for k in ids[: self.count]]),
            [int(model.actuator_ctrladr[k]) for k, _ in commanded],
            [2 * self.count + commands.index(command) for _, command in commanded],
        )

    def inputs(self, model: Any, data: Any, at: _ModelPlaces) -> np.ndarray:
        vector = np.zeros(2 * self.count + len(self.part.commands))
        outputs = model.actuator_outadr[at.muscles]
        vector[at.spans] = data.actuator_length[outputs] + at.offsets
        vector[[self.count + k for k in at.spans]] = data.actuator_velocity[outputs]
        controls = data.ctrl[at.controls]
        limited = model.actuator_ctrllimited[at.controls] != 0
        low, high = model.actuator_ctrlrange[at.controls].T
        vector[at.commands] = np.where(limited, np.clip(controls, low, high), controls)
        return vector

    def _possible(self, inputs: np.ndarray) -> bool:
        """Whether every muscle can be as long as its span; says once where it cannot, and of commands that saturate."""
        muscles, commands = sorted(self.part.muscles), sorted(self.part.commands)
        good = True
        for k, name in enumerate(muscles):
            low, high, _ = self.part.span_limits[name]
            if not low <= inputs[k] <= high:
                good = False
                problem = (
                    f"a span of {inputs[k]:g} m is none that {name} can take, {low:g} to {high:g} m: nothing pulls"
                )
                self._say(Caution(f"{problem}; does biasprm hold the span at length zero?", name))
        for k, name in enumerate(commands):
            value, (low, high) = float(inputs[2 * self.count + k]), self.part.command_limits(name)
            if value != 0.0 and not low <= value <= high:
                ends = f"{low:g} to {high:g} have an effect of their own"
                self._say(Caution(f"a control {name} of {value:g} can hardly be meant: {ends}", f"command {name}"))
        return good

    def _say(self, caution: Caution) -> None:
        if caution.parameter not in self._said:
            self._said.add(caution.parameter)
            warn([caution], stacklevel=4)

    def step(self, model: Any, data: Any, at: _ModelPlaces) -> None:
        """Take a whole step of the part, and write the rates that lead there."""
        period, act = float(model.opt.timestep), data.act[at.act : at.act + self.total]
        inputs = self.inputs(model, data, at)
        if not self._possible(inputs):
            data.act_dot[at.act : at.act + self.total] = 0.0
            data.act[at.act + self.sizes.size : at.act + self.total] = 0.0
            return
        state = act[: self.sizes.size] * self.sizes
        if not state[0] > 0.0:
            state = self.part.rest_vector(inputs)
        new, out = self.part.step_vector(state, inputs, period, staggered=True)
        code = Soundness(int(out[self.code]))
        if code != Soundness.SOUND and self.sound:  # once, until it is sound again
            sentence = self.part.unsound_sentence(period, out)
            warn([Caution(f"{', '.join(self.names)}, at {data.time:g} s: {sentence}")])
        self.sound = code == Soundness.SOUND
        following = np.concatenate([new / self.sizes, out[self.tensions]])
        data.act_dot[at.act : at.act + self.total] = (following - act) / period

    def observe(self, model: Any, data: Any, at: _ModelPlaces) -> Any:
        """Outputs at the end of the last step, at the spans where it ended."""
        act = data.act[at.act : at.act + self.total]
        state, inputs = act[: self.sizes.size] * self.sizes, self.inputs(model, data, at)
        inputs[: self.count] = self.part.reach(state)
        means = dict(zip((self.part.outputs[k] for k in self.tensions), act[self.sizes.size :].tolist(), strict=True))
        return self.part.observe_vector(state, inputs)._replace(**means)


class MuscleCallbacks:
    """Parts in a MuJoCo model, stepped by callbacks; a context that installs them.

    Args:
        model: the model. Copies of it, and models with the same names, are served too; other models are left alone.
        parts: parts by the name of their actuator, or by a tuple of names, one for each; see `actuator_roles`.

    Raises:
        InputError: names what does not fit.
        MissingLibraryError: MuJoCo is not installed.
    """

    def __init__(self, model: Any, parts: Mapping[str | tuple[str, ...], Part]) -> None:
        self._mujoco: Any = library("mujoco", "Muscles in MuJoCo need")
        self._parts = [
            _AttachedPart((names,) if isinstance(names, str) else tuple(names), part) for names, part in parts.items()
        ]
        self._models: weakref.WeakKeyDictionary[Any, tuple[dict[int, Any], dict[int, int]]] = weakref.WeakKeyDictionary(
            {model: self._places(model)}
        )
        self._before: tuple[Any, Any] | None = None

    def _places(self, model: Any) -> tuple[dict[int, Any], dict[int, int]]:
        """By actuator: the part that is stepped there, with its places; and the activation of the mean tension."""
        steps: dict[int, Any] = {}
        pulls: dict[int, int] = {}
        for one in self._parts:
            at = one.places(model)
            steps[at.muscles[0]] = (one, at)
            pulls |= {k: at.act + one.sizes.size + j for j, k in enumerate(at.muscles)}
        return steps, pulls

    def _lookup(self, model: Any) -> tuple[dict[int, Any], dict[int, int]]:
        """As `_places`, found once for each model; of a model without the parts, such as one in the making, none."""
        known = self._models.get(model)
        if known is None:
            try:
                known = self._places(model)
            except InputError:
                known = {}, {}
            self._models[model] = known
        return known

    def _act_dyn(self, model: Any, data: Any, actuator: int) -> float:
        found = self._lookup(model)[0].get(actuator)
        if found is not None:
            part, at = found
            part.step(model, data, at)
        return 0.0

    def _act_bias(self, model: Any, data: Any, actuator: int) -> float:
        place = self._lookup(model)[1].get(actuator)
        if place is None:
            return 0.0
        return -float(data.act[place] + model.opt.timestep * data.act_dot[place])

    def install(self) -> None:
        """Make them the callbacks of MuJoCo."""
        if self._before is None:
            self._before = self._mujoco.get_mjcb_act_dyn(), self._mujoco.get_mjcb_act_bias()
        self._mujoco.set_mjcb_act_dyn(self._act_dyn)
        self._mujoco.set_mjcb_act_bias(self._act_bias)

    def remove(self) -> None:
        """Bring the callbacks back that were there before."""
        if self._before is not None:
            self._mujoco.set_mjcb_act_dyn(self._before[0])
            self._mujoco.set_mjcb_act_bias(self._before[1])
            self._before = None

    def __enter__(self) -> MuscleCallbacks:
        self.install()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.remove()

    def observe(self, model: Any, data: Any, actuator: str) -> Any:
        """Outputs of the part after the last step, at least one, as `Part.step` returns them.

        Args:
            model: the model.
            data: its data.
            actuator: name of one of the part's actuators.

        Raises:
            InputError: no part has the actuator.
        """
        for part, at in self._lookup(model)[0].values():
            if actuator in part.names:
                return part.observe(model, data, at)
        raise InputError("actuator", actuator, known=tuple(name for part in self._parts for name in part.names))
