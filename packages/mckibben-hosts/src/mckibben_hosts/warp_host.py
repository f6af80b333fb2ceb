"""MuJoCo Warp and Newton as `mckibben conform` sees them: one world, or one robot, of each scenario on the processor."""

from __future__ import annotations

import abc
import atexit
import importlib.util
import shutil
import tempfile
import warnings
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from mckibben.extras import library

from .adapters import HostAdapter, HostedMechanism, PartReadings, RebuiltMechanism
from .c_source import c_source
from .mujoco_host import model_text, pulled_ends
from .mujoco_muscles import actuator_roles
from .part import Part
from .scenarios import HostMoment, Scenario
from .warp_export import export_warp

DEVICE = "cpu"
KEPT = ("qpos", "qvel", "qacc_warmstart", "time", "act")  # of the data, by which a moment is saved


def quiet_warp(purpose: str) -> Any:
    """Warp, which says nothing of the kernels that it compiles."""
    warp: Any = library("warp", purpose)
    warp.config.log_level = warp.LOG_WARNING
    return warp


def _mujoco_warp() -> Any:
    quiet_warp("The host warp needs")
    return library("mujoco_warp", "The host warp needs")


_modules: dict[str, ModuleType] = {}  # those that this process has exported, by the fingerprint of their part


def exported_module(part: Part) -> ModuleType:
    """Export a part and import what was written, once per process."""
    if part.fingerprint in _modules:
        return _modules[part.fingerprint]
    folder = Path(tempfile.mkdtemp(prefix="mckibben-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    path, *_ = export_warp(c_source(part, f"conform_{part.fingerprint[:8]}"), folder)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    _modules[part.fingerprint] = module
    return module


def _readings(part: Part, module: ModuleType, stepped: Any) -> PartReadings:
    seen = dict(zip(module.OUTPUTS, stepped.outputs.numpy()[0].tolist(), strict=True))
    tension, pressure, work = (
        {name: seen[place.format(name)] for name in part.muscles}
        for place in ("tension.{}", "muscle.{}.pressure", "work.{}")
    )
    return PartReadings(tension, pressure, sum(work.values()), part.gas_mass(stepped.following.numpy()[0]))


class _DeviceMechanism(RebuiltMechanism):
    """A mechanism whose state is in arrays of Warp."""

    @abc.abstractmethod
    def _arrays(self) -> list[Any]: ...

    def save(self) -> Any:
        return [one.numpy().copy() for one in self._arrays()]

    def restore(self, saved: Any) -> None:
        for one, values in zip(self._arrays(), saved, strict=True):
            one.assign(values)


class _WarpMechanism(_DeviceMechanism):
    """A scenario in one world of MuJoCo Warp."""

    def build(self) -> None:
        scenario, period = self.scenario, self.period
        self._warp, self.module = _mujoco_warp(), exported_module(scenario.part)
        mujoco: Any = library("mujoco", "The host warp needs")
        self._roles, ends = actuator_roles(scenario.part), pulled_ends(scenario).items()
        actuators = "".join(f'<general name="{name}" {end} gainprm="0"/>' for name, end in ends)
        model = mujoco.MjModel.from_xml_string(model_text(scenario, period, actuators=actuators, flags=""))
        start = mujoco.MjData(model)
        start.qpos[0] = scenario.mechanism.start
        self.model = self._warp.put_model(model)
        self.data = self._warp.put_data(model, start)
        self.muscles = self.module.MujocoMuscles(
            model, self.model, self.data, offsets=scenario.mechanism.spans, parameters=dict(scenario.parameters)
        )

    @property
    def position(self) -> float:
        return float(self.data.qpos.numpy()[0, 0])

    @property
    def rate(self) -> float:
        return float(self.data.qvel.numpy()[0, 0])

    def _put(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self.data.qpos.fill_(moment.position)
            self.data.qvel.fill_(moment.rate)
        commands = [[moment.commands[role.command] for role in self._roles if role.command]]
        self.data.ctrl.assign(np.array(commands, np.float32))
        self.data.qfrc_applied.fill_(self.scenario.mechanism.load + moment.force)

    def step(self, moment: HostMoment) -> PartReadings:
        self._put(moment)
        self._warp.step(self.model, self.data)
        return _readings(self.scenario.part, self.module, self.muscles)

    def _arrays(self) -> list[Any]:
        return [*(getattr(self.data, name) for name in KEPT), *self.muscles.arrays()]

    def look(self, moment: HostMoment) -> None:
        self._put(moment)
        self._warp.forward(self.model, self.data)


class WarpHost(HostAdapter):
    """MuJoCo Warp on the processor; its mechanics are in float32, the muscles in float64."""

    name, title, staggered = "warp", "MuJoCo Warp on the processor, Euler, float32 beside muscles in float64", True
    caveats = (
        "One world on the processor, most of whose step is MuJoCo Warp's own; the code is compiled for GPUs too, on which "
        "it has not run.",
    )

    def __init__(self) -> None:
        _mujoco_warp()

    def version(self) -> str:
        """Versions of MuJoCo Warp and Warp."""
        return f"MuJoCo Warp {metadata.version('mujoco-warp')}, Warp {metadata.version('warp-lang')}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        library("warp", "The host warp needs").set_device(DEVICE)
        return _WarpMechanism(scenario, period)


def _newton() -> Any:
    quiet_warp("The host newton needs")
    return library("newton", "The host newton needs")


class _NewtonMechanism(_DeviceMechanism):
    """A scenario as a model of Newton with one joint, under the solver of Featherstone's method."""

    def build(self) -> None:
        scenario = self.scenario
        newton, warp = _newton(), quiet_warp("The host newton needs")
        self.module = exported_module(scenario.part)
        mechanism = scenario.mechanism
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, 0.0))
        mass = 1.0 if mechanism.rotary else mechanism.inertia
        link = builder.add_link(mass=mass, inertia=warp.mat33(np.eye(3) * mechanism.inertia))
        add = builder.add_joint_revolute if mechanism.rotary else builder.add_joint_prismatic
        builder.add_articulation([add(-1, link, axis=newton.Axis.Z, armature=0.0)])
        model = builder.finalize(device=DEVICE)
        self._solver = newton.solvers.SolverFeatherstone(model, angular_damping=0.0)
        arms, spans, parameters = map(dict, (mechanism.arms, mechanism.spans, scenario.parameters))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # a scenario may begin elsewhere than at angle zero
            self.drive = self.module.newton_drive(1, arms=arms, spans=spans, device=DEVICE, parameters=parameters)
        joints = warp.zeros(len(arms), dtype=warp.uint32, device=DEVICE)  # all muscles are at one joint
        self._actuator = newton.actuators.Actuator(joints, self.drive)
        self._state, self._after, self._control = model.state(), model.state(), model.control()
        self._now, self._following = self._actuator.state(), self._actuator.state()
        self._control.muscle_commands = warp.zeros((1, len(self.module.COMMANDS)), dtype=float, device=DEVICE)
        self._state.joint_q.fill_(mechanism.start)

    @property
    def position(self) -> float:
        return float(self._state.joint_q.numpy()[0])

    @property
    def rate(self) -> float:
        return float(self._state.joint_qd.numpy()[0])

    def _pull(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self._state.joint_q.fill_(moment.position)
            self._state.joint_qd.fill_(moment.rate)
        commands = [[moment.commands[name] for name in self.module.COMMANDS]]
        self._control.muscle_commands.assign(np.array(commands, np.float32))
        self._control.joint_f.fill_(self.scenario.mechanism.load + moment.force)
        self._actuator.step(self._state, self._control, self._now, self._following, self.period)

    def step(self, moment: HostMoment) -> PartReadings:
        self._pull(moment)
        self._solver.step(self._state, self._after, self._control, None, self.period)
        self._state, self._after = self._after, self._state
        self._now, self._following = self._following, self._now
        return _readings(self.scenario.part, self.module, self.drive.part)

    def _arrays(self) -> list[Any]:
        return [self._state.joint_q, self._state.joint_qd, self._now.drive_state.numbers]

    def look(self, moment: HostMoment) -> None:
        self._pull(moment)


class NewtonHost(HostAdapter):
    """Newton on the processor; its mechanics are in float32, the muscles in float64."""

    name, title, staggered = "newton", "Newton on the processor, Featherstone, float32 beside muscles in float64", True
    caveats = (
        "One robot on the processor, most of whose step is Newton's own; the code is compiled for GPUs too, on which it has "
        "not run.",
    )

    def __init__(self) -> None:
        _newton()

    def version(self) -> str:
        """Versions of Newton and Warp."""
        return f"Newton {metadata.version('newton')}, Warp {metadata.version('warp-lang')}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        quiet_warp("The host newton needs").set_device(DEVICE)
        return _NewtonMechanism(scenario, period)
