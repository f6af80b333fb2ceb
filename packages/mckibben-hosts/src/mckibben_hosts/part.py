"""A part of another program from Python: muscles and their air, stepped by spans and commands.

    part = Part("nylon", Air(supply="6 bar"))
    state = part.rest(span=0.14)
    state, seen = part.step(state, span=0.139, rate=-0.5, muscle=0.3, period=1e-3)
    seen.tension                                  # [N], the mean over the step

States are vectors that may be kept, copied, pickled and brought back; a part itself never changes.
"""

from __future__ import annotations

import functools
import hashlib
import json
import keyword
import os
import threading
from collections import namedtuple
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben._jax import jax
from mckibben.answers import Caution, collect, warn
from mckibben.assembly.build import Assumption, unit_assumptions, unit_from_specimen
from mckibben.assembly.circuit_file import CircuitPlan, read_circuit
from mckibben.assembly.loads import HostLoad
from mckibben.assembly.machine import Machine
from mckibben.assembly.muscle_unit import MuscleUnit
from mckibben.components import paths
from mckibben.documents import parse_toml, read_text
from mckibben.engine.native import EngineFunction, compile_function
from mckibben.engine.packed import Layout
from mckibben.engine.soundness import SENTENCE, Soundness, meaning_of, overloaded_parts
from mckibben.errors import ConvergenceError, InputError
from mckibben.muscles.build import at_rest_length
from mckibben.muscles.elements import Tendon
from mckibben.muscles.evidence import law_error
from mckibben.muscles.law import law_name
from mckibben.muscles.plausible import span_limits, start_pressure_caution
from mckibben.quantities import Quantity, named_values, with_unit
from mckibben.simulation.air import Air, air_circuit
from mckibben.simulation.mechanisms import (
    USUAL_SPAN,
    Amount,
    AnyMuscle,
    TendonOption,
    default_span,
    in_si,
    mounted_cautions,
    muscle_unit,
    published,
)
from mckibben.simulation.stepping import CommandInput, SaidCommands
from mckibben.slips import size_caution
from mckibben.specimens import specimen

from .coupling import OF_MUSCLES, HostedMuscles, HostInputs, HostStep, PartOutputs, advance, observe, rest

# Words of C, C++ and Python, which no name in an exported source can be.
RESERVED = frozenset((*keyword.kwlist, *"""
    alignas alignof and_eq asm auto bitand bitor bool case catch char compl const constexpr decltype default delete do double
    dynamic_cast enum explicit export extern false float friend goto inline int long mutable namespace new noexcept not_eq
    nullptr operator or_eq private protected public register reinterpret_cast restrict short signed sizeof static
    static_assert static_cast struct switch template this thread_local throw true typedef typeid typename union unsigned
    using virtual void volatile wchar_t xor xor_eq
""".split()))  # fmt: skip
MODE = "default"  # of the compiler: the same bits in every host
SUBSTEP = 5e-5  # [s]
USUAL_SUBSTEPS = (1e-6, 2e-3)  # [s]
LONGEST_STEP = 1.0  # of a host [s]; a longer one is a frequency or milliseconds
FASTEST = 50.0  # [m/s] that a span can be meant to change
SLOPE_STRETCH = 1e-5  # by which the slope of the mean tension is measured [m]
STEPS_OF_HOSTS = (5e-4, 1e-3, 2e-3, 5e-3)  # for which the smallest mass is stated [s]


class PartLayouts(NamedTuple):
    """How parameters, state and inputs of one structure of parts lie in vectors."""

    part: Layout
    state: Layout
    inputs: Layout


def _advance(layouts: Any, part: Any, state: Any, inputs: Any, timing: Any) -> tuple[Any, Any]:
    of_part, of_state, of_inputs = layouts
    new, out = advance(
        of_part.unpack(part), of_state.unpack(state), of_inputs.unpack(inputs), HostStep(timing[0], timing[1])
    )
    return of_state.packed(new), Layout.of(out).packed(out)


def _observe(layouts: Any, part: Any, state: Any, inputs: Any) -> Any:
    of_part, of_state, of_inputs = layouts
    out = observe(of_part.unpack(part), of_state.unpack(state), of_inputs.unpack(inputs))
    return Layout.of(out).packed(out)


def _rest(layouts: Any, part: Any, inputs: Any) -> Any:
    of_part, of_state, of_inputs = layouts
    return of_state.packed(rest(of_part.unpack(part), of_inputs.unpack(inputs)))


class Part:
    """Muscles and their air as a part of another program's mechanism; immutable.

    Args:
        muscles: id or file of a specimen, or a `Muscle`; or several by name. A single one is called ``muscle``.
        air: an `Air`, or the path of a circuit file with the muscles by name; `Air()` by default.
        span: span of each muscle at the start [m], one for all or by muscle; where left out as
            `muscles.plausible.working_span` says: nine tenths of its rest length, or more where it contracts little.
        pressure: gauge pressure at the start [Pa], one for all or by muscle; none by default.
        substep: largest step of the physics [s].
        title: of what is made of it; names the muscles by default.
        tendon: between each muscle and the mechanism, one for all or by muscle: a `Tendon` or its stiffness [N/m]; none by
            default, so that the muscles are tied to their anchors.

    Attributes:
        muscles: names of the muscles.
        commands: names of the commands.
        hosted: parameters and equations.
        span: span of each muscle at the start [m].
        span_limits: by muscle, spans that it can take, and the longest length that its law is made for [m].
        cautions: what can hardly be meant of what the part is made of; an export says it.
        law_error: of each muscle, see `muscles.evidence.law_error`; None of one without a specimen.
        mounting: how the muscles are held, one phrase.
        assumptions: numbers that nobody stated, each with where it comes from.

    Raises:
        InputError: names what does not fit.
    """

    def __init__(
        self,
        muscles: AnyMuscle | Mapping[str, AnyMuscle],
        air: Any = None,
        *,
        span: Amount | Mapping[str, Amount] | None = None,
        pressure: Amount | Mapping[str, Amount] | None = None,
        substep: Amount = SUBSTEP,
        title: str = "",
        tendon: TendonOption | Mapping[str, TendonOption] = None,
    ) -> None:
        named = dict(muscles) if isinstance(muscles, Mapping) else {"muscle": muscles}
        if not isinstance(title, str):
            raise InputError("title", None, f"must be text, got {title!r}")
        for name in named:
            if not isinstance(name, str):
                raise InputError("muscles", None, f"must be by name, got {name!r} for one")
        tendons = dict(tendon) if isinstance(tendon, Mapping) else dict.fromkeys(named, tendon)
        for name in tendons:
            if name not in named:
                raise InputError("tendon", name, known=tuple(named))
        units = {name: muscle_unit(muscle, name, tendons.get(name)) for name, muscle in named.items()}
        for name in units:
            if not name.isidentifier() or name in RESERVED:
                raise InputError("muscles", name, "must be a name of letters, digits and _ that no language reserves")
        self.air = air_circuit(air, units)
        load = HostLoad(held=tuple(units))
        machine = Machine.of(self.air.circuit, units, load, self.air.environment)
        starts = dict.fromkeys(units, 0.0) | {n: p for n, p in self.air.starts.items() if n in units}
        starts |= _by_muscle(pressure, "Pa", "pressure", units)
        chambers = {
            node: starts.get(self.air.feeding.get(node, node), self.air.starts.get(node, 0.0))
            for node in machine.circuit.chambers
        }
        stated = _by_muscle(span, "m", "span", units)
        self.span: dict[str, float] = {
            name: stated[name] if name in stated else default_span(muscle, units[name])
            for name, muscle in named.items()
        }
        self.span_limits = {name: span_limits(unit.law) for name, unit in units.items()}
        # of each command the specimen whose pressure it is, and what its supply lets it reach
        specs = {d.command: published(named[d.command]) if d.command in named else None for d in self.air.drives}
        self._judged = {
            d.command: (specs[d.command], d.reach(machine.circuit, machine.environment)) for d in self.air.drives
        }
        self._silent = {
            d.command: d.silent(spec, reach=reach)
            for d, (spec, reach) in zip(self.air.drives, self._judged.values(), strict=True)
        }
        self._said = SaidCommands()
        said = [*self.air.cautions, size_caution(substep, "s", name="substep", usual=USUAL_SUBSTEPS)]
        for name, muscle in named.items():
            of, spec, start = "" if len(units) == 1 else f" of {name}", published(muscle), starts[name]
            said += mounted_cautions(muscle, units[name], self.span[name], f"span{of}")
            ambient = float(self.air.environment.pressure_abs)
            said.append(start_pressure_caution(start, ambient, spec, text=f"{start:g}", name=f"start pressure{of}"))
        self.cautions: tuple[Caution, ...] = collect(*said)
        warn(self.cautions)
        self.hosted: HostedMuscles = HostedMuscles.of(
            machine, drives=self.air.drives, start=chambers, substep=in_si(substep, "s", "substep")
        )
        self.law_error = {name: law_error(published(one), units[name].law) for name, one in named.items()}
        self.muscles, self.commands = tuple(units), self.hosted.commands
        settled = {command: starts[muscle] for command, muscle in self.air.settles.items()}
        self.command: dict[str, float] = {**dict.fromkeys(self.commands, 0.0), **self.air.begins, **settled}
        self.title = title or f"{' and '.join(units)} with air"
        ways = {name: unit.mounting for name, unit in units.items()}
        self.mounting = "; ".join(f"{n} {way}" for n, way in ways.items())
        if len(set(ways.values())) == 1:
            self.mounting = f"{' and '.join(ways)} {next(iter(ways.values()))}"
            if len(ways) > 1:
                self.mounting = self.mounting.replace("its anchors", "their anchors")
        made = list(self.air.assumptions)
        for name, muscle in named.items():
            if not isinstance(muscle, MuscleUnit):
                cord = tendons.get(name)
                made += unit_assumptions(
                    name, units[name], muscle, usual_tendon=cord is not None and not isinstance(cord, Tendon)
                )
            if name not in stated:
                made.append(Assumption(f"span of {name}", self.span[name], "m", USUAL_SPAN))
        self.assumptions = tuple(made)
        self._prepare()

    @classmethod
    def from_circuit(
        cls,
        path: str | os.PathLike[str] | CircuitPlan,
        *,
        span: Amount | Mapping[str, Amount] | None = None,
        substep: Amount = SUBSTEP,
        tendon: TendonOption | Mapping[str, TendonOption] = None,
    ) -> Part:
        """The part that a circuit file describes: each node of the kind ``muscle`` gets the friction of its specimen.

        Args:
            path: the file; the lengths that it states or moves are spans of the start, which the other program then gives.
            span: as for a part.
            substep: as for a part.
            tendon: as for a part.

        Raises:
            InputError: the file is no circuit, or has no muscle.
        """
        plan = path if isinstance(path, CircuitPlan) else read_circuit(Path(path))
        units, usual, specs = {}, {}, {}
        values = plan.values()
        for name, node in plan.nodes.items():
            if node.law is None:
                continue
            stated = plan.document["nodes"][name]["specimen"]
            name_of_law, rest = law_name(node.law), getattr(node.law, "rest_length", None)
            spec = specimen(stated)
            if rest is not None:  # friction and creep go with the length that the file states
                spec, _ = at_rest_length(spec, name_of_law, {"rest_length": float(rest)})
            specs[name], units[name] = spec, unit_from_specimen(spec).replace(law=node.law)
            moved = node.length is None and node.signal
            usual[name] = float(values[str(node.signal)][0]) if moved else float(node.length or 0)
        if not units:
            raise InputError("nodes", None, "must have at least one node of the kind muscle", where=plan.where)
        spans = usual | _by_muscle(span, "m", "span", units)
        part = cls(units, plan, span=spans, substep=substep, title=plan.title, tendon=tendon)
        part.law_error = {n: law_error(spec, units[n].law) for n, spec in specs.items()}
        return part

    def _prepare(self) -> None:
        inputs = self.inputs(self.span, dict.fromkeys(self.muscles, 0.0), self.command)
        as_shapes = jax.eval_shape(rest, self.hosted, inputs)
        example = jax.tree.map(lambda s: np.zeros(s.shape, s.dtype), as_shapes)
        self.layouts = PartLayouts(*map(Layout.of, (self.hosted, example, inputs)))
        self.parameters = self.layouts.part.pack(self.hosted)
        self._size = self.layouts.state.size
        self.example_state, self.example_inputs = example, inputs
        self._calls: dict[str, Any] = {}
        self._lock = threading.Lock()  # the places in memory of a call are shared by all threads
        self._places = {name: 2 * len(self.muscles) + k for k, name in enumerate(sorted(self.commands))}
        numbered = self.layouts.state.unpack(np.arange(float(self.layouts.state.size)))
        self._commands_in_state = np.array([int(numbered.command[n]) for n in sorted(self.commands)], int)
        self._reach_in_state = np.array([int(numbered.reach[n]) for n in sorted(self.muscles)], int)
        self._masses_in_state = np.array([int(at) for at in numbered.physics["circuit"]["mass"].values()], int)
        names = _output_names(self.muscles)
        self.outputs = tuple(names)
        fields: Any = namedtuple  # noqa: PYI024 - the fields are those of the muscles
        self._Outputs: Any = fields("PartObservation", names)

    def __repr__(self) -> str:
        spans = ", ".join(f"{name} {with_unit(span, 'm')}" for name, span in self.span.items())
        return f"Part({spans}; commands {', '.join(self.commands)}; {self.statement})"

    @property
    def statement(self) -> str:
        """How the muscles are held, what was assumed, and how far a tension may be off, for sources and descriptions."""
        assumed = ", ".join(map(str, self.assumptions)) or "nothing"
        intervals = (f"; tension of {name}: {said['interval']}" for name, said in self.law_error.items() if said)
        return f"{self.mounting}; assumed: {assumed}{''.join(intervals)}"

    def inputs(self, span: Mapping[str, Any], rate: Mapping[str, Any], command: Mapping[str, Any]) -> HostInputs:
        """The inputs of a moment as a tree."""
        return HostInputs(
            {name: np.float64(span[name]) for name in self.muscles},
            {name: np.float64(rate[name]) for name in self.muscles},
            {name: np.float64(command[name]) for name in self.commands},
        )

    # ---- stepping

    def rest(self, span: Any = None, **commands: float) -> np.ndarray:
        """The state at rest, friction relaxed.

        Args:
            span: of each muscle [m], one for all or by muscle; those of the part by default.
            **commands: as they have lasted [SI].
        """
        spans = self.span | self._spans(span)
        return self.rest_vector(self._vector(spans, {}, self.command | self._checked(commands)))

    def rest_vector(self, inputs: np.ndarray) -> np.ndarray:
        """The state at rest at the spans and commands of inputs, as `step_vector` takes them."""
        (state,) = self._call("rest", _rest, [inputs], [self._size])
        return state

    def step(
        self,
        state: np.ndarray,
        *,
        period: float,
        span: Any,
        rate: Any = 0.0,
        staggered: bool = False,
        **commands: float,
    ) -> tuple[np.ndarray, Any]:
        """Go on by one step of the host.

        Args:
            state: at its start; it is not changed.
            period: of the step [s].
            span: span of each muscle at its start [m], one for all or by muscle.
            rate: rates of the spans [m/s]; in a staggered host half a step older.
            staggered: whether the host is one of the semi-implicit kind; see `mckibben_hosts.coupling`.
            **commands: by name [SI]; those that are left out stay as they were.

        Returns:
            The state at the end, and a named tuple of outputs, see `outputs`; of a single muscle ``tension`` first.

        Raises:
            InputError: names an unknown command or muscle.
            ConvergenceError: the state is not finite or not possible any more, or a balance does not close.
        """
        if not 0.0 < period <= LONGEST_STEP:
            raise InputError("period", f"{period:g} s", f"must be above 0 s and up to {LONGEST_STEP:g} s")
        vector = self._moment(state, span, rate, commands)
        new, out = self.step_vector(state, vector, period, staggered=staggered)
        seen = self._Outputs._make(out.tolist())
        if seen.sound != Soundness.SOUND:
            raise ConvergenceError(self.unsound_sentence(period, out))
        return new, seen

    def observe(self, state: np.ndarray, *, span: Any, rate: Any = 0.0, **commands: float) -> Any:
        """Outputs at a moment, as `step` returns them, without going on."""
        return self.observe_vector(state, self._moment(state, span, rate, commands))

    def unsound_sentence(self, period: float, out: np.ndarray) -> str:
        """Why a step of a host [s] is not sound, from its outputs in the order of `outputs`."""
        seen = dict(zip(self.outputs, out.tolist(), strict=True))
        alone = len(self.muscles) == 1
        lengths = {f"{name}.length": seen["length" if alone else f"{name}_length"] for name in self.muscles}
        parts = overloaded_parts(self.hosted.machine, lengths)
        return SENTENCE.format(f"{period:g}", meaning_of(seen["sound"], parts))

    def step_vector(
        self, state: np.ndarray, inputs: np.ndarray, period: float, *, staggered: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Go on by one step without names, for hosts that look them up once.

        Args:
            state: at its start; it is not changed.
            inputs: spans [m] by the sorted names of the muscles, their rates [m/s], and commands by their sorted names [SI].
            period: of the step [s].
            staggered: as for `step`.

        Returns:
            The state at the end, and outputs in the order of `outputs`. Whether they are sound is one of them.
        """
        timing = np.array([period, 1.0 if staggered else 0.0])
        new, out = self._call("advance", _advance, [state, inputs, timing], [self._size, len(self.outputs)])
        return new, out

    def reach(self, state: np.ndarray) -> np.ndarray:
        """Spans at which the last step ended, by the sorted names of the muscles [m]."""
        spans: np.ndarray = state[self._reach_in_state]
        return spans

    def gas_mass(self, state: np.ndarray) -> float:
        """Mass of the gas in all volumes of the part [kg]."""
        return float(state[self._masses_in_state].sum())

    def observe_vector(self, state: np.ndarray, inputs: np.ndarray) -> Any:
        """Outputs at a moment as a named tuple, without going on; inputs as for `step_vector`."""
        (out,) = self._call("observe", _observe, [state, inputs], [len(self.outputs)])
        return self._Outputs._make(out.tolist())

    def _call(self, key: str, function: Any, arrays: list[np.ndarray], sizes: list[int]) -> list[np.ndarray]:
        with self._lock:
            if key not in self._calls:
                places = [np.zeros_like(vector) for vector in arrays]
                bound = functools.partial(function, tuple(self.layouts))
                compiled = compile_function(bound, self.parameters, *places, title="a part")
                wanted = [np.zeros(size) for size in sizes]
                self._calls[key] = places, wanted, _bind(compiled, [self.parameters, *places], wanted)
            places, wanted, run = self._calls[key]
            for place, vector in zip(places, arrays, strict=True):
                place[:] = vector
            run()
            return [vector.copy() for vector in wanted]

    def _moment(self, state: np.ndarray, span: Any, rate: Any, commands: Mapping[str, Any]) -> np.ndarray:
        spans = self._spans(span)
        rates = _by_muscle(rate, "m/s", "rate", self.muscles)
        for name, value in rates.items():
            if abs(value) > FASTEST:
                raise InputError(f"rate of {name}", f"{value:g} m/s", f"must be from -{FASTEST:g} to {FASTEST:g} m/s")
        vector = self._vector(spans, rates, {})
        vector[2 * len(self.muscles) :] = state[self._commands_in_state]
        for name, value in self._checked(commands).items():
            vector[self._places[name]] = value
        return vector

    def _spans(self, span: Any) -> dict[str, float]:
        spans = _by_muscle(span, "m", "span", self.muscles)
        for name, value in spans.items():
            low, high, _ = self.span_limits[name]
            if not low <= value <= high:
                said = f"must be from {with_unit(low, 'm')} to {with_unit(high, 'm')}, which the muscle can take"
                raise InputError(f"span of {name}", with_unit(value, "m"), said)
        return spans

    def _vector(self, span: Mapping[str, Any], rate: Mapping[str, Any], command: Mapping[str, Any]) -> np.ndarray:
        count = len(self.muscles)
        vector = np.zeros(2 * count + len(self.commands))
        for k, name in enumerate(sorted(self.muscles)):
            if name not in span:
                raise InputError("span", None, f"is missing for the muscle {name}")
            vector[k], vector[count + k] = span[name], rate.get(name, 0.0)
        for name, value in command.items():
            vector[self._places[name]] = value
        return vector

    def _checked(self, commands: Mapping[str, Any]) -> dict[str, float]:
        drives, numbers = {drive.command: drive for drive in self.hosted.drives}, {}
        for name, value in commands.items():
            if name not in drives:
                raise InputError("command", name, known=self.commands)
            numbers[name] = in_si(value, drives[name].unit, name)
            low, high = self._silent[name]
            if numbers[name] != 0.0 and not low <= numbers[name] <= high:
                self.command_caution(drives[name], numbers[name])
        return numbers

    def command_limits(self, command: str) -> tuple[float, float]:
        """Commands from and to which there is nothing to say [SI]: beyond, a valve saturates, or hardly is meant so."""
        return self._silent[command]

    def command_caution(self, drive: CommandInput, value: float) -> None:
        """Say of a command what `SaidCommands` has not; raises `InputError` where it cannot be carried out."""
        spec, reach = self._judged[drive.command]
        said = drive.check(value, spec, reach=reach)
        high = self._silent[drive.command][1]
        if said is not None and self._said.farther(drive.command, value, high):
            self._said.keep(drive.command, value, high)
            warn([said], stacklevel=5)

    # ---- what hosts need to know

    def declared(self) -> dict[str, Quantity]:
        """The declared parameters by dotted path."""
        return dict(paths.parameters(self.hosted))

    @property
    def fingerprint(self) -> str:
        """Hash of structure and parameters: which part it is."""
        about = json.dumps([self.title, self.muscles, self.commands])
        names = ",".join(self.declared())
        return hashlib.sha256(f"{about}{names}".encode() + self.parameters.tobytes()).hexdigest()[:32]

    def slope(self, period: float, *, span: Any = None, pressure: float = 3e5) -> float:
        """Slope of the mean tension by the end of a step's ramp [N/m], the largest of the muscles at a pressure.

        The smallest mass that an explicit host can move with a step h is about slope times h squared.

        Args:
            period: step of the host [s].
            span: as for `rest`.
            pressure: gauge pressure in all chambers [Pa].
        """
        filled = self._with_hosted(self.hosted.replace(start=dict.fromkeys(self.hosted.start, float(pressure))))
        spans = filled.span | _by_muscle(span, "m", "span", filled.muscles)
        state = filled.rest(spans)
        held, stretched = (
            filled.step(state, period=period, span=spans, rate=dict.fromkeys(filled.muscles, stretch / period))[1]
            for stretch in (0.0, SLOPE_STRETCH)
        )
        differences = [stretched[k] - held[k] for k in range(len(filled.muscles))]
        steepest: float = max(differences) / SLOPE_STRETCH
        return steepest

    def with_parameters(self, changes: Mapping[str, float]) -> Part:
        """The part with some parameters changed.

        Args:
            changes: values by dotted path, as `declared` names them [SI].

        Raises:
            InputError: names an unknown path, or a value out of its bounds.
        """
        if not changes:
            return self
        numbers = {}
        for path, value in named_values(changes, "changes").items():
            stated = paths.declaration(self.hosted, path)
            numbers[path] = in_si(value, stated.unit, path)
            stated.check(path, numbers[path])
        return self._with_hosted(paths.put(self.hosted, numbers))

    def _with_hosted(self, hosted: HostedMuscles) -> Part:
        other = object.__new__(Part)
        other.__dict__.update(self.__dict__)
        other.hosted = hosted
        other.parameters = self.layouts.part.pack(hosted)
        other._calls, other._lock = {}, threading.Lock()
        return other

    def smallest_masses(self) -> dict[float, float]:
        """Estimate of the smallest mass [kg] felt at the end of a muscle that hosts can move, by their step [s].

        Conformance tests of hosts found up to 1.45 times as much, at 1 ms.
        """
        return {h: self.slope(h) * h * h for h in STEPS_OF_HOSTS}


def _bind(compiled: EngineFunction, arrays: list[np.ndarray], wanted: list[np.ndarray]) -> Callable[[], None]:
    """A call without arguments, from and to fixed places in memory."""
    if compiled.engine == "native":
        return compiled.program.bind(arrays, wanted, lanes=None, mode=MODE)

    def run() -> None:
        results = compiled(*arrays)
        for target, value in zip(wanted, results if isinstance(results, tuple) else (results,), strict=True):
            target[...] = value

    return run


def part_of(
    source: str | os.PathLike[str],
    *,
    supply: Amount | None = None,
    valve: str | None = None,
    span: Amount | None = None,
    substep: Amount = SUBSTEP,
    tendon: TendonOption = None,
) -> Part:
    """The part that a word names: a circuit file with muscles, or a specimen with usual air.

    Args:
        source: path of a circuit file, or id or path of a specimen.
        supply: gauge pressure of the supply of a specimen [Pa]; that of `Air` by default.
        valve: valve of a specimen; that of `Air` by default.
        span: span of every muscle at the start [m].
        substep: largest step of the physics [s].
        tendon: between each muscle and the mechanism; none by default.

    Raises:
        InputError: it is neither, or a circuit file, which states its own air, has more stated for it.
    """
    stated: dict[str, Any] = {"supply": supply, "valve": valve}
    stated = {name: value for name, value in stated.items() if value is not None}
    path = Path(source)
    if path.suffix == ".toml" and path.is_file() and "nodes" in parse_toml(read_text(path), where=str(path)):
        for name, value in stated.items():
            raise InputError(name, str(value), "must be left out for a circuit file, which states its own air")
        return Part.from_circuit(path, span=span, substep=substep, tendon=tendon)
    title = f"{specimen(os.fspath(source)).id} with air"
    return Part(os.fspath(source), Air(**stated), span=span, substep=substep, title=title, tendon=tendon)


def _by_muscle(value: Any, unit: str, field: str, muscles: Any) -> dict[str, float]:
    """One value for all muscles, or values by muscle, as SI numbers; empty for None."""
    if value is None:
        return {}
    values = value if isinstance(value, Mapping) else dict.fromkeys(muscles, value)
    for name in values:
        if name not in muscles:
            raise InputError(field, name, known=tuple(muscles))
    return {name: in_si(one, unit, f"{field} of {name}") for name, one in values.items()}


def _output_names(muscles: tuple[str, ...]) -> list[str]:
    """Names of the outputs in the order of `PartOutputs`, as JAX flattens it; a single muscle needs no name."""
    zero = dict.fromkeys(muscles, 0.0)
    tree = PartOutputs(zero, {m: dict.fromkeys(OF_MUSCLES, 0.0) for m in muscles}, zero, 0.0, 0.0)
    names = []
    for path, _ in jax.tree_util.tree_flatten_with_path(tree)[0]:
        words = [str(getattr(p, "key", getattr(p, "name", p))).strip(".") for p in path]
        if words[0] == "muscle":
            words = [words[1], words[2]]
        elif len(words) == 2:
            words = [words[1], words[0]]
        names.append("_".join(words if len(muscles) > 1 else words[-1:]))
    return names
