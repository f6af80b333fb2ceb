"""The systems that are timed: two machines of the library, and the yardstick S1, each with what its C kernel is called by.

    tube    supply of commanded pressure - tube with inertance - nylon muscle with friction - mass on a spring
    valve   supply - orifice (ISO 6358) - port - tube - the same muscle and mass, and an orifice from port to room
    s1      the yardstick of three states that other programs were measured with

Every lane of a batch is another muscle: `batch` varies the parameters by a few percent and the commands by their phase.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from kernel_names import COMMON, PATHS, VALVE_PATHS

from mckibben.assembly.build import AirLine, several, unit_from_specimen
from mckibben.assembly.loads import Body, JointLoad, MomentArm, PlateLoad
from mckibben.assembly.machine import Machine
from mckibben.assembly.muscle_unit import STOP_TRAVEL, MuscleUnit
from mckibben.components.gas import REFERENCE_DENSITY, REFERENCE_TEMPERATURE
from mckibben.components.paths import get, put
from mckibben.components.system import System
from mckibben.engine import held, march
from mckibben.engine.signals import Value, ramped
from mckibben.muscles.elements import Tendon
from mckibben.muscles.hysteresis import Dahl
from mckibben.muscles.hysteresis.slip import FrictionLimit
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import InertialTube
from mckibben.pneumatics.volume import FixedVolume, MovingVolume, Reservoir, WallHeat

PERIOD, INNER = 1e-3, 10  # outputs and commands at 1 kHz, steps of 100 us [s]
STEP = PERIOD / INNER
ROOM, TEMPERATURE = 101325.0, 293.15
SPREAD = 0.03  # of the parameters over a batch


@dataclasses.dataclass(frozen=True)
class Case:
    """A system that both the library and a C kernel integrate.

    Attributes:
        name: of the case and of its C kernel.
        system: as the library has it.
        start: continuous state and memory at rest.
        commands: names of its signals, in the order of the kernel.
        straight: whether the commands go straight from sample to sample.
        outputs: the two outputs that are kept.
        paths: the kernel's parameters in the system.
        constants: further parameters of the kernel.
        slots: the state and memory as the kernel's rows, for (state, memory) of any shape.
        wave: commands at times [s] for phases of the lanes, (commands, ...).
    """

    name: str
    system: System
    start: tuple[Any, Any]
    commands: tuple[str, ...]
    outputs: tuple[str, str]
    paths: Mapping[str, str]
    constants: Mapping[str, float]
    slots: Callable[[Any, Any], list[Any]]
    wave: Callable[[Any, Any], list[Any]]
    straight: bool = False

    def signals(self, values: Any) -> dict[str, Any]:
        """Signals from command values (samples + 1, commands)."""
        make = ramped if self.straight else held
        return {name: make(values[:, i]) for i, name in enumerate(self.commands)}

    def with_parameters(self, changes: Mapping[str, Any]) -> System:
        """The system with some parameters, by the kernel's names, replaced; they may be traced, or those of all lanes."""
        # what the kernel has once may stand in the system twice, as the heat of port and muscle
        values = {path: value for name, value in changes.items() for path in self.paths[name].split()}
        if not any(map(np.ndim, values.values())):
            return put(self.system, values)
        made = put(self.system, {path: np.ravel(value)[0] for path, value in values.items()})
        leaves, structure = jax.tree.flatten_with_path(made)
        found = {jax.tree_util.keystr(path, simple=True, separator="."): k for k, (path, _) in enumerate(leaves)}
        lanes = {found[path]: value for path, value in values.items()}  # a lane is no element: no module looks at them
        return jax.tree.unflatten(structure, [lanes.get(k, leaf) for k, (_, leaf) in enumerate(leaves)])

    def run(self, changes: Mapping[str, Any], state: Any, memory: Any, values: Any, samples: int, inner: int) -> Any:
        """One lane by the library's own `march`: the two outputs at the samples, (samples + 1,) each."""
        system = self.with_parameters(changes)
        _, kept = march(system, state, memory, self.signals(values), PERIOD, inner, samples, False)
        return tuple(kept[2][name] for name in self.outputs)


def unit(**changes: Any) -> MuscleUnit:
    """The nylon muscle with Dahl's friction on a mass of 2 kg, and a spring to the plate behind it."""
    nylon = unit_from_specimen("nylon")
    limit = FrictionLimit(constant=0.5, per_pressure=4e-6)
    spring = Tendon(stiffness=1500.0, slack_length=0.0, toe_length=5e-3, loss=0.2)
    return nylon.replace(
        friction=Dahl(limit=limit, stiffness=2500.0), tendon=spring, end_mass=np.asarray(2.0),
        viscosity=np.asarray(5.0), **changes,
    )  # fmt: skip


def _tube() -> InertialTube:
    """Half a metre of 1/8 in tube; the coefficients are those of developed flow at 4 bar."""
    return InertialTube(viscous=30.0, turbulent=11.0, area=7.92e-6, length=0.5)


def _slots(state: Any, memory: Any) -> list[Any]:
    circuit, muscle = state["circuit"], state["muscles"]["m"]
    own = [
        muscle.length,
        muscle.velocity,
        circuit["pressure"]["m"],
        circuit["mass"]["m"],
        circuit["elements"]["m.tube"],
    ]
    port = [circuit["pressure"]["m.port"], circuit["mass"]["m.port"]] if "m.port" in circuit["mass"] else []
    return [*own, *port, memory["muscles"]["m"]["friction"].state[..., 0]]


def tube() -> Case:
    """The full muscle on a commanded supply."""
    muscle = unit()
    nodes = {
        "supply": Reservoir(temperature=TEMPERATURE, signal="supply"),
        "m": MovingVolume(
            of=muscle.law.braid_volume, ambient=ROOM, dead_volume=1e-6, signal="m.length",
            heat=WallHeat(conductance=0.2, wall_temperature=TEMPERATURE),
        ),
    }  # fmt: skip
    circuit = Circuit.of(nodes, {"m.tube": Branch(_tube(), ("supply", "m"))})
    machine = Machine.of(circuit, {"m": muscle}, PlateLoad(held=("m",), span=0.16))
    start = machine.initial({"m": ROOM}, {"supply": _still(ROOM)})

    def wave(time: Any, phase: Any) -> list[Any]:
        return [ROOM + 2.5e5 - 2e5 * np.cos(2.0 * np.pi * (2.0 * time + phase))]

    constants = {"stop_travel": STOP_TRAVEL}
    return Case("muscle", machine, start, ("supply",), OUTPUTS, PATHS, constants, _slots, wave)


OUTPUTS = ("m.length", "m.pressure_abs")


def valve() -> Case:
    """The same with a valve of two orifices and a port in the circuit."""
    fill, vent = Orifice(conductance=4e-9), Orifice(conductance=5e-9, critical_ratio=0.3)
    heat = WallHeat(conductance=0.2, wall_temperature=TEMPERATURE)
    line = AirLine(valve=(fill, vent), tube=_tube(), port_volume=5e-6, heat=heat, dead_volume=1e-6)
    machine = several({"m": unit()}, PlateLoad(held=("m",), span=0.16), supply=6e5, line=line)
    start = machine.initial({"m": ROOM, "m.port": ROOM}, {"m.fill": _still(0.0), "m.vent": _still(0.0)})

    def wave(time: Any, phase: Any) -> list[Any]:
        drive = np.sin(2.0 * np.pi * (2.0 * time + phase))
        return [np.maximum(drive, 0.0), np.maximum(-drive, 0.0)]

    constants = {
        "stop_travel": STOP_TRAVEL,
        "reference_density": REFERENCE_DENSITY,
        "reference_temperature": REFERENCE_TEMPERATURE,
    }
    paths = {**PATHS, **VALVE_PATHS}
    return Case("valve", machine, start, ("m.fill", "m.vent"), OUTPUTS, paths, constants, _slots, wave)


SHARED = ("independent", "tank", "joint", "plate")  # what the muscles of a machine have in common


def rig(muscles: int, shared: str = "independent", spread: float = 0.0) -> tuple[Machine, tuple[Any, Any], str]:
    """Many muscles of `tube` in one machine, each on its own tube: system, start, signal.

    Args:
        muscles: how many.
        shared: ``independent``, each on one supply and held still; ``tank``, on a tank behind an orifice from that supply;
            ``joint``, around one joint, half of them on either side; ``plate``, all on one body that they lift.
        spread: relative spread of the muscles' end masses, viscosities and lengths of tube.
    """
    one = unit()
    heat = WallHeat(conductance=0.2, wall_temperature=TEMPERATURE)
    nodes: dict[str, Any] = {"supply": Reservoir(temperature=TEMPERATURE, signal="supply")}
    branches, units = {}, {}
    source = "supply"
    if shared == "tank":
        source = "tank"
        nodes["tank"] = FixedVolume(volume=1e-5 * muscles, heat=heat)
        branches["feed"] = Branch(Orifice(conductance=1e-9 * muscles), ("supply", "tank"))
    for i in range(muscles):
        name = f"m{i:04d}"
        more = 1.0 + spread * (i / muscles - 0.5)
        units[name] = one.replace(end_mass=one.end_mass * more, viscosity=one.viscosity * more) if spread else one
        tube_there = _tube()
        branches[f"{name}.tube"] = Branch(tube_there.replace(length=tube_there.length * more), (source, name))
        nodes[name] = MovingVolume(
            of=one.law.braid_volume, ambient=ROOM, dead_volume=1e-6, signal=f"{name}.length", heat=heat
        )
    load: Any = PlateLoad(held=tuple(units), span=0.16)
    if shared == "joint":
        arms = {
            n: MomentArm(coefficients=np.array([0.02, 0.001]) * (1 - 2 * (k % 2)), span=0.16)
            for k, n in enumerate(units)
        }
        load = JointLoad(arms=arms, inertia=2e-3 * muscles, damping=0.02 * muscles)
    elif shared == "plate":
        load = Body(held=tuple(units), start=0.16, mass=1.0 * muscles, weight=10.0 * muscles)
    machine = Machine.of(Circuit.of(nodes, branches), units, load)
    # one muscle at rest is all of them at rest
    alone = tube()
    state, memory = alone.start
    circuit, own = state["circuit"], memory["muscles"]["m"]
    start = {
        "circuit": {
            "mass": dict.fromkeys(units, circuit["mass"]["m"]),
            "pressure": dict.fromkeys(units, circuit["pressure"]["m"]),
            "elements": dict.fromkeys(branches, circuit["elements"]["m.tube"]),
        },
        "muscles": dict.fromkeys(units, state["muscles"]["m"]),
        "load": load.initial(),
    }
    if shared == "tank":
        size = float(machine.circuit.nodes["tank"].size + machine.circuit.inner_volume("tank"))
        start["circuit"]["pressure"]["tank"] = np.asarray(ROOM)
        start["circuit"]["mass"]["tank"] = np.asarray(machine.circuit.gas.mass(ROOM, size, TEMPERATURE))
        start["circuit"]["elements"]["feed"] = ()
    return machine, (start, {"circuit": memory["circuit"], "muscles": dict.fromkeys(units, own)}), "supply"


def _still(value: float) -> Value:
    return Value(np.asarray(value), np.zeros(()))


@dataclasses.dataclass(frozen=True)
class Batch:
    """Lanes of a case: what differs, with the lanes last in the kernel's arrays and first in the library's.

    Attributes:
        case: what they are lanes of.
        changes: varied parameters by name, (lanes,) each.
        commands: (samples + 1, commands, lanes).
    """

    case: Case
    changes: dict[str, np.ndarray]
    commands: np.ndarray

    @property
    def lanes(self) -> int:
        """How many."""
        return self.commands.shape[2]

    @property
    def samples(self) -> int:
        """How many intervals of 1 ms."""
        return self.commands.shape[0] - 1

    def parameters(self, names: list[str]) -> np.ndarray:
        """The kernel's parameters, (names, lanes)."""
        rows = []
        for name in names:
            base = self.changes.get(name)
            if base is None:
                known = self.case.constants
                base = known[name] if name in known else get(self.case.system, self.case.paths[name].split()[0])
            rows.append(np.broadcast_to(np.asarray(base, float).reshape(-1), (self.lanes,)))
        return np.array(rows)

    def state(self) -> np.ndarray:
        """The kernel's state at rest, (states, lanes)."""
        rows = [np.broadcast_to(np.asarray(x, float), (self.lanes,)) for x in self.case.slots(*self.case.start)]
        return np.array(rows)

    def cast(self, dtype: Any) -> Batch:
        """The same with every number of the system and its state in another precision."""
        single = lambda tree: jax.tree.map(lambda x: np.asarray(x, dtype), tree)  # noqa: E731
        case = dataclasses.replace(self.case, system=single(self.case.system), start=single(self.case.start))
        return dataclasses.replace(self, case=case)

    def first(self, lanes: int) -> Batch:
        """Its first lanes only."""
        return self.part(0, lanes)

    def part(self, begin: int, end: int) -> Batch:
        """Some of its lanes."""
        changes = {name: value[begin:end] for name, value in self.changes.items()}
        return Batch(self.case, changes, self.commands[:, :, begin:end])

    def one(self, inner: int = INNER) -> Callable[[Any, Any], Any]:
        """The library's run of one lane: a function of (changes, command values (samples + 1, commands))."""
        return lambda changes, values: self.case.run(changes, *self.case.start, values, self.samples, inner)

    def mapped(self, inner: int = INNER) -> Callable[[Any, Any], Any]:
        """The same over all lanes, which come first, to be compiled."""
        return jax.vmap(self.one(inner))

    def arguments(self, dtype: Any = float) -> tuple[Any, Any]:
        """What `mapped` is called with."""
        changes = {name: jnp.asarray(value, dtype) for name, value in self.changes.items()}
        return changes, jnp.asarray(np.moveaxis(self.commands, 2, 0), dtype)


def batch(case: Case, lanes: int, samples: int, *, spread: float = SPREAD) -> Batch:
    """Lanes whose parameters lie within +-spread of the case's, and whose commands differ in phase."""
    # additive recurrence: the same lanes whatever the size of the batch, without a generator
    number = np.arange(1, lanes + 1, dtype=float)
    changes = {}
    for i, (name, path) in enumerate(sorted(case.paths.items())):
        share = np.modf(number * np.modf(np.sqrt(2.0 + i) * 0.6180339887498949)[0])[0]
        if name not in COMMON:
            value = np.asarray(get(case.system, path.split()[0]), float).reshape(-1)[0]
            changes[name] = value * (1.0 + spread * (2.0 * share - 1.0)) if lanes > 1 else np.full(1, value)
    time = PERIOD * np.arange(samples + 1)[:, None]
    phase = 0.2 * np.modf(number * 0.7548776662466927)[0] if lanes > 1 else np.zeros(1)
    values = [np.broadcast_to(row, (samples + 1, lanes)) for row in case.wave(time, phase[None, :])]
    return Batch(case, changes, np.stack(values, axis=1))


def s1() -> Case:
    """The yardstick S1."""
    from yardstick import DENSITY, NUMBERS, START, yardstick

    names = {"conductance": "valve.conductance", "ratio": "valve.critical_ratio", "band": "valve.linear_band"}
    start = tuple(jnp.asarray(x) for x in START), ()

    def wave(time: Any, phase: Any) -> list[Any]:
        return [np.sin(2.0 * np.pi * (time + phase))]

    return Case("s1", yardstick(), start, ("valve",), ("contraction", "pressure_abs"), {**{n: n for n in NUMBERS}, **names},
                {"density": DENSITY}, lambda state, memory: list(state), wave, straight=True)  # fmt: skip
