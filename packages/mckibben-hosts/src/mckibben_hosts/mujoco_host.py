"""MuJoCo as `mckibben conform` sees it: a part as a plugin, or by callbacks of Python, in models of the scenarios.

A model is a mass on a tendon, or a hinge between two muscles at gears.
"""

from __future__ import annotations

import abc
import atexit
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.extras import library

from .adapters import HostAdapter, HostedMechanism, PartReadings
from .c_source import c_source
from .mujoco_muscles import SENSED, MuscleCallbacks, act_size, actuator_roles, export_mujoco, plugin_name, state_sizes
from .part import Part
from .scenarios import HostMoment, Scenario

NO_RESET = '<flag autoreset="disable"/>'  # a mass that is too small is to be seen, not set back


def model_text(
    scenario: Scenario, period: float, *, actuators: str, extension: str = "", sensors: str = "", flags: str = NO_RESET
) -> str:
    """The text of a model.

    Args:
        scenario: the scenario.
        period: of the steps [s].
        actuators: elements of the muscles.
        extension: element that names a plugin.
        sensors: element of the sensors.
        flags: elements of the options.
    """
    mechanism = scenario.mechanism
    inertia = repr(mechanism.inertia)
    if mechanism.rotary:
        all_axes = " ".join([inertia] * 3)
        limb = f'<inertial pos="0 0 0" mass="1" diaginertia="{all_axes}"/>'
        body = f'<joint name="q" type="hinge" axis="0 1 0"/>{limb}'
        tendon = ""
    else:
        ball = f'<inertial pos="0 0 0" mass="{inertia}" diaginertia="1 1 1"/>'
        body = f'<joint name="q" type="slide" axis="0 0 -1"/>{ball}<site name="hook"/>'
        tendon = '<tendon><spatial name="cord"><site site="anchor"/><site site="hook"/></spatial></tendon>'
    return f"""<mujoco><option timestep="{period!r}" gravity="0 0 0">{flags}</option>
{extension}
<worldbody><site name="anchor"/><body>{body}</body></worldbody>{tendon}
<actuator>{actuators}</actuator>{sensors}</mujoco>"""


def pulled_ends(scenario: Scenario) -> dict[str, str]:
    """What each muscle pulls at, as attributes of its actuator, in the order of the part."""
    mechanism = scenario.mechanism
    return {
        name: f'joint="q" gear="{-mechanism.arms[name]!r}"' if mechanism.rotary else 'tendon="cord"'
        for name in scenario.part.muscles
    }


def _mujoco() -> Any:
    return library("mujoco", "The host mujoco needs")


_plugins: dict[str, str] = {}  # names of those that this process has loaded, by the fingerprint of their part


def _plugin(part: Part) -> str:
    """Build and load the plugin of a part, once per process; its name."""
    if part.fingerprint in _plugins:
        return _plugins[part.fingerprint]
    name = f"conform_{part.fingerprint[:8]}"
    folder = Path(tempfile.mkdtemp(prefix="mckibben-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    built = export_mujoco(c_source(part, name), folder)
    _mujoco().mj_loadPluginLibrary(str(built[-1]))
    _plugins[part.fingerprint] = plugin_name(name)
    return _plugins[part.fingerprint]


def _plugin_model(scenario: Scenario, period: float) -> str:
    part, plugin, size = scenario.part, _plugin(scenario.part), scenario.part.rest().size
    several = len(part.muscles) > 1
    config = {f"offset.{n}" if several else "offset": scenario.mechanism.spans[n] for n in part.muscles}
    config |= dict(scenario.parameters)
    words = "".join(f'<config key="{key}" value="{value!r}"/>' for key, value in config.items())
    sizes = {part.muscles[0]: f' actdim="{size}"'}
    rows = [
        f'<plugin name="{name}" plugin="{plugin}" instance="p" {end}{sizes.get(name, "")}/>'
        for name, end in pulled_ends(scenario).items()
    ]
    return model_text(
        scenario,
        period,
        extension=f'<extension><plugin plugin="{plugin}"><instance name="p">{words}</instance></plugin></extension>',
        actuators="".join(rows),
        sensors=f'<sensor><plugin name="inside" plugin="{plugin}" instance="p"/></sensor>',
    )


def _callback_model(scenario: Scenario, period: float) -> str:
    part, rows = scenario.part, []
    for name, end in pulled_ends(scenario).items():
        dynamics = f' dyntype="user" actdim="{act_size(part)}"' if name == part.muscles[0] else ""
        span = scenario.mechanism.spans[name]
        rows.append(f'<general name="{name}" {end}{dynamics} gainprm="0" biastype="user" biasprm="{span!r}"/>')
    return model_text(scenario, period, actuators="".join(rows))


class _MujocoMechanism(HostedMechanism):
    """A scenario in MuJoCo, whatever the way of its muscles into it."""

    def __init__(self, scenario: Scenario, model: Any, data: Any) -> None:
        self.scenario, self.model, self.data, self.mujoco = scenario, model, data, _mujoco()
        self.names = scenario.part.muscles
        self._roles, self._sizes = actuator_roles(scenario.part), state_sizes(scenario.part)
        self._kind = self.mujoco.mjtState.mjSTATE_INTEGRATION

    @property
    def position(self) -> float:
        return float(self.data.qpos[0])

    @property
    def rate(self) -> float:
        return float(self.data.qvel[0])

    def _put(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self.data.qpos[0], self.data.qvel[0] = moment.position, moment.rate
        self.data.ctrl[:] = [moment.commands[role.command] for role in self._roles if role.command]
        self.data.qfrc_applied[0] = self.scenario.mechanism.load + moment.force

    def step(self, moment: HostMoment) -> PartReadings:
        self._put(moment)
        self.mujoco.mj_step(self.model, self.data)
        tensions = dict(zip(self.names, (-self.data.actuator_force).tolist(), strict=True))
        pressures, work = self.seen()
        return PartReadings(tensions, pressures, work, self.scenario.part.gas_mass(self._state()))

    def _state(self) -> np.ndarray:
        state: np.ndarray = self.data.act[: self._sizes.size] * self._sizes
        return state

    @abc.abstractmethod
    def seen(self) -> tuple[dict[str, float], float]:
        """Pressures of the muscles [Pa], and work of the host on all of them [J]."""

    def save(self) -> np.ndarray:
        state = np.empty(self.mujoco.mj_stateSize(self.model, self._kind))
        self.mujoco.mj_getState(self.model, self.data, state, self._kind)
        return state

    def restore(self, saved: np.ndarray) -> None:
        self.mujoco.mj_setState(self.model, self.data, saved, self._kind)

    def copy(self) -> HostedMechanism:
        data = self.mujoco.MjData(self.model)
        self.mujoco.mj_copyData(data, self.model, self.data)
        return type(self)(self.scenario, self.model, data)

    def reset(self) -> None:
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = self.scenario.mechanism.start

    def look(self, moment: HostMoment) -> None:
        self._put(moment)
        self.mujoco.mj_forward(self.model, self.data)


class _PluginMechanism(_MujocoMechanism):
    """A scenario in MuJoCo with the plugin."""

    def seen(self) -> tuple[dict[str, float], float]:
        seen = self.data.sensordata.reshape(len(self.names), len(SENSED))
        pressures = dict(zip(self.names, seen[:, SENSED.index("pressure")].tolist(), strict=True))
        return pressures, float(seen[:, SENSED.index("work")].sum())


class _CallbackMechanism(_MujocoMechanism):
    """A scenario in MuJoCo with callbacks of Python."""

    callbacks: MuscleCallbacks

    def seen(self) -> tuple[dict[str, float], float]:
        outputs = self.callbacks.observe(self.model, self.data, self.names[0])
        readings = PartReadings.of(self.scenario.part, self._state(), outputs)
        return readings.pressure, readings.work

    def copy(self) -> HostedMechanism:
        twin = super().copy()
        assert isinstance(twin, _CallbackMechanism)
        twin.callbacks = self.callbacks
        return twin


class _MujocoHost(HostAdapter):
    staggered = True

    def __init__(self) -> None:
        _mujoco().set_mju_user_warning(lambda sentence: None)  # of masses that are too small, which are looked for

    def version(self) -> str:
        return f"MuJoCo {_mujoco().__version__}"


class MujocoHost(_MujocoHost):
    """MuJoCo with the plugin, tendons for one muscle and gears at a hinge for two of one instance."""

    name, title = "mujoco", "MuJoCo, engine plugin, Euler"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        mujoco = _mujoco()
        model = mujoco.MjModel.from_xml_string(_plugin_model(scenario, period))
        hosted = _PluginMechanism(scenario, model, mujoco.MjData(model))
        hosted.reset()
        return hosted

    def close(self) -> None:
        """Let MuJoCo warn again; the plugin stays loaded until the process ends."""
        _mujoco().set_mju_user_warning(None)


class MujocoPythonHost(_MujocoHost):
    """MuJoCo with callbacks of Python, tendons for one muscle and gears at a hinge for two of one part."""

    name, title = "mujoco-python", "MuJoCo, callbacks of Python, Euler"

    def __init__(self) -> None:
        super().__init__()
        self._callbacks: MuscleCallbacks | None = None
        self._parts: dict[str, Part] = {}  # with the parameters of scenarios, so that each is compiled once

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start, and its callbacks instead of those of the last one."""
        mujoco = _mujoco()
        part = scenario.part.with_parameters(scenario.parameters)
        part = self._parts.setdefault(part.fingerprint, part)
        self._remove()
        model = mujoco.MjModel.from_xml_string(_callback_model(scenario, period))
        self._callbacks = MuscleCallbacks(model, {part.muscles: part})
        self._callbacks.install()
        hosted = _CallbackMechanism(scenario, model, mujoco.MjData(model))
        hosted.callbacks = self._callbacks
        hosted.reset()
        return hosted

    def _remove(self) -> None:
        if self._callbacks is not None:
            self._callbacks.remove()
            self._callbacks = None

    def close(self) -> None:
        """Remove the callbacks, and let MuJoCo warn again."""
        self._remove()
        _mujoco().set_mju_user_warning(None)
