"""MuJoCo as `mckibben conform` sees it: the plugin of a part in models of the scenarios."""

from __future__ import annotations

import atexit
import functools
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..extras import library
from .adapters import HostAdapter, HostedMechanism, PartReadings
from .c_source import c_source
from .mujoco_export import SENSED, config_key, export_mujoco, plugin_name
from .scenarios import HostMoment, Scenario, single_part


def _mujoco() -> Any:
    return library("mujoco", "The host mujoco needs")


@functools.cache
def _plugin() -> tuple[str, int]:
    """Build and load the plugin of one muscle, once per process; its name, and the length of its state."""
    part = single_part()
    name = f"conform_{part.fingerprint[:8]}"
    folder = Path(tempfile.mkdtemp(prefix="mckibben-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    built = export_mujoco(c_source(part, name), folder)
    _mujoco().mj_loadPluginLibrary(str(built[-1]))
    return plugin_name(name), part.rest().size


def _model_text(scenario: Scenario, period: float) -> str:
    """The model of a scenario: a mass on a tendon, or a hinge between two muscles at gears."""
    mechanism, (plugin, numbers) = scenario.mechanism, _plugin()
    instances, actuators, sensors = [], [], []
    for name, arm in mechanism.arms.items():
        config = {"offset": mechanism.spans[name]}
        for chamber, pressure in scenario.part.hosted.start.items():
            owner, _, more = chamber.partition(".")
            if owner == name:
                config["start.muscle" + (f".{more}" if more else "")] = float(pressure)
        config |= {config_key(path): value for path, value in scenario.parameters.items()}
        words = "".join(f'<config key="{key}" value="{value!r}"/>' for key, value in config.items())
        instances.append(f'<instance name="{name}">{words}</instance>')
        end = f'joint="q" gear="{-arm!r}"' if mechanism.rotary else 'tendon="cord"'
        actuators.append(f'<plugin name="{name}" plugin="{plugin}" instance="{name}" actdim="{numbers}" {end}/>')
        sensors.append(f'<plugin name="{name}" plugin="{plugin}" instance="{name}"/>')
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
    return f"""<mujoco><option timestep="{period!r}" gravity="0 0 0"><flag autoreset="disable"/></option>
<extension><plugin plugin="{plugin}">{"".join(instances)}</plugin></extension>
<worldbody><site name="anchor"/><body>{body}</body></worldbody>{tendon}
<actuator>{"".join(actuators)}</actuator><sensor>{"".join(sensors)}</sensor></mujoco>"""


class MujocoMechanism(HostedMechanism):
    """A scenario in MuJoCo."""

    def __init__(self, scenario: Scenario, model: Any, data: Any) -> None:
        self.scenario, self.model, self.data, self.mujoco = scenario, model, data, _mujoco()
        self.names = tuple(scenario.mechanism.arms)
        self._kind = self.mujoco.mjtState.mjSTATE_INTEGRATION

    @property
    def position(self) -> float:
        """Position [m] or [rad]."""
        return float(self.data.qpos[0])

    @property
    def rate(self) -> float:
        """Rate of the position [m/s] or [rad/s]."""
        return float(self.data.qvel[0])

    def _put(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self.data.qpos[0], self.data.qvel[0] = moment.position, moment.rate
        self.data.ctrl[:] = [moment.commands[name] for name in self.names]
        self.data.qfrc_applied[0] = self.scenario.mechanism.load + moment.force

    def step(self, moment: HostMoment) -> PartReadings:
        """Go on by one step of MuJoCo."""
        self._put(moment)
        self.mujoco.mj_step(self.model, self.data)
        seen = self.data.sensordata.reshape(len(self.names), len(SENSED))
        tensions = (-self.data.actuator_force).tolist()
        pressures = seen[:, SENSED.index("pressure")].tolist()
        work = float(seen[:, SENSED.index("work")].sum())
        return PartReadings(
            dict(zip(self.names, tensions, strict=True)), dict(zip(self.names, pressures, strict=True)), work
        )

    def save(self) -> Any:
        """The state of the integration."""
        state = np.empty(self.mujoco.mj_stateSize(self.model, self._kind))
        self.mujoco.mj_getState(self.model, self.data, state, self._kind)
        return state

    def restore(self, saved: Any) -> None:
        """Return to a state."""
        self.mujoco.mj_setState(self.model, self.data, saved, self._kind)

    def copy(self) -> HostedMechanism:
        """Another one at the same moment, by ``mj_copyData``."""
        data = self.mujoco.MjData(self.model)
        self.mujoco.mj_copyData(data, self.model, self.data)
        return MujocoMechanism(self.scenario, self.model, data)

    def reset(self) -> None:
        """Return to the start."""
        self.mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = self.scenario.mechanism.start

    def look(self, moment: HostMoment) -> None:
        """Evaluate by ``mj_forward``."""
        self._put(moment)
        self.mujoco.mj_forward(self.model, self.data)


class MujocoHost(HostAdapter):
    """MuJoCo with the plugin, tendons for one muscle and gears at a hinge for two."""

    name, title, staggered = "mujoco", "MuJoCo, engine plugin, Euler", True

    def __init__(self) -> None:
        _mujoco().set_mju_user_warning(lambda sentence: None)  # of masses that are too small, which are looked for

    def version(self) -> str:
        """Version of MuJoCo."""
        return f"MuJoCo {_mujoco().__version__}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        mujoco = _mujoco()
        model = mujoco.MjModel.from_xml_string(_model_text(scenario, period))
        hosted = MujocoMechanism(scenario, model, mujoco.MjData(model))
        hosted.reset()
        return hosted

    def close(self) -> None:
        """Let MuJoCo warn again; the plugin stays loaded until the process ends."""
        _mujoco().set_mju_user_warning(None)
