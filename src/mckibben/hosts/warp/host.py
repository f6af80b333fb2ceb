"""MuJoCo Warp as `mckibben conform` sees it: one world of each scenario, on the processor."""

from __future__ import annotations

import atexit
import importlib.util
import shutil
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...extras import library
from ..actuators import actuator_roles
from ..adapters import HostAdapter, HostedMechanism, PartReadings
from ..c_source import c_source
from ..mujoco_model import model_text, pulled_ends
from ..part import Part
from ..scenarios import HostMoment, Scenario
from .export import export_warp

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
    (path,) = export_warp(c_source(part, f"conform_{part.fingerprint[:8]}"), folder)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    _modules[part.fingerprint] = module
    return module


class WarpMechanism(HostedMechanism):
    """A scenario in one world of MuJoCo Warp."""

    def __init__(self, scenario: Scenario, period: float) -> None:
        self.scenario, self.period = scenario, period
        self._warp, self.module = _mujoco_warp(), exported_module(scenario.part)
        mujoco: Any = library("mujoco", "The host warp needs")
        self.names, self._roles = scenario.part.muscles, actuator_roles(scenario.part)
        actuators = "".join(
            f'<general name="{name}" {end} gainprm="0"/>' for name, end in pulled_ends(scenario).items()
        )
        model = mujoco.MjModel.from_xml_string(model_text(scenario, period, actuators=actuators, flags=""))
        start = mujoco.MjData(model)
        start.qpos[0] = scenario.mechanism.start
        self._size = model.nv
        self.model = self._warp.put_model(model)
        self.data = self._warp.put_data(model, start)
        self.muscles = self.module.MujocoMuscles(
            model, self.model, self.data, offsets=scenario.mechanism.spans, parameters=dict(scenario.parameters)
        )
        self._first = self.save()

    @property
    def position(self) -> float:
        """Position [m] or [rad]."""
        return float(self.data.qpos.numpy()[0, 0])

    @property
    def rate(self) -> float:
        """Rate of the position [m/s] or [rad/s]."""
        return float(self.data.qvel.numpy()[0, 0])

    def _put(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self.data.qpos.fill_(moment.position)
            self.data.qvel.fill_(moment.rate)
        commands = [[moment.commands[role.command] for role in self._roles if role.command]]
        self.data.ctrl.assign(np.array(commands, np.float32))
        self.data.qfrc_applied.fill_(self.scenario.mechanism.load + moment.force)

    def step(self, moment: HostMoment) -> PartReadings:
        """Go on by one step of MuJoCo Warp."""
        self._put(moment)
        self._warp.step(self.model, self.data)
        seen = dict(zip(self.module.OUTPUTS, self.muscles.outputs.numpy()[0].tolist(), strict=True))
        return PartReadings(
            {name: seen[f"tension.{name}"] for name in self.names},
            {name: seen[f"muscle.{name}.pressure"] for name in self.names},
            sum(seen[f"work.{name}"] for name in self.names),
            self.scenario.part.gas_mass(self.muscles.following.numpy()[0]),
        )

    def save(self) -> Any:
        """The arrays of the data and of the muscles."""
        arrays = [getattr(self.data, name) for name in KEPT]
        return [one.numpy().copy() for one in (*arrays, *self.muscles.arrays())]

    def restore(self, saved: Any) -> None:
        """Return to what `save` returned."""
        arrays = [getattr(self.data, name) for name in KEPT]
        for one, values in zip((*arrays, *self.muscles.arrays()), saved, strict=True):
            one.assign(values)

    def copy(self) -> HostedMechanism:
        """Another one at the same moment, with a model and data of its own."""
        twin = WarpMechanism(self.scenario, self.period)
        twin.restore(self.save())
        return twin

    def reset(self) -> None:
        """Return to the start."""
        self.restore(self._first)

    def look(self, moment: HostMoment) -> None:
        """Evaluate by ``forward``."""
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
        import importlib.metadata as metadata

        return f"MuJoCo Warp {metadata.version('mujoco-warp')}, Warp {metadata.version('warp-lang')}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        library("warp", "The host warp needs").set_device(DEVICE)
        return WarpMechanism(scenario, period)

    def close(self) -> None:
        """Nothing is left open."""
