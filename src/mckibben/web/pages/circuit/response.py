"""Response of a circuit by a native kernel, compiled once per topology, and the numbers read from it.

A kernel takes the circuit's values, signals and start pressures, and makes state and memory itself. It is the engine's own
march, so that it gives what the command line gives, and keeps the integrals that its accounts are balanced with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...._jax import Scalar, Tree, jax
from ....analysis.steps import LAST, settling, step_responses
from ....assembly.circuit_file import CircuitPlan
from ....components import paths
from ....components.flow import GasState
from ....components.gas import REFERENCE_DENSITY
from ....components.system import Moment, System, Value
from ....documents import JsonValue
from ....engine.integration import ATTEMPTS, MOST_PARTS, ROS2_LIMIT, march
from ....engine.native import EngineFunction, compile_function
from ....engine.rates import RK4_LIMIT
from ....errors import ConvergenceError, InputError, MckibbenError
from ....pneumatics.build import known_keys, with_usual_unit
from ....pneumatics.circuit import Circuit, RunBalance, balance, path_name
from ....pneumatics.tubes import LinearTube, inertance
from ....quantities import declared, from_si, parse, with_unit
from ....recordings import Channel, Recording
from ...shelf import SharedResults
from .document import GIVEN, Document, planned, top, worded

_kernels = SharedResults(24)
RATE = "steepest rate"  # beside the outputs of a circuit [1/s]


class IntegrationMethod(NamedTuple):
    """Integration method of a circuit: stiff or explicit, and the number of parts of its step."""

    stiff: bool = False
    split: int = 1


def method_of(rate: float, step: float, stiff: bool = False) -> IntegrationMethod:
    """Method that the engine chooses at a rate [1/s] and a step [s]."""
    if not stiff and rate * step <= RK4_LIMIT:
        return IntegrationMethod()
    split = int(np.ceil(rate * step / ROS2_LIMIT)) if np.isfinite(rate) else 1
    return IntegrationMethod(True, min(MOST_PARTS, max(1, split)))


class WatchedCircuit(System):
    """A circuit with its fastest rate as an output, by which the method is chosen."""

    circuit: Circuit

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of change of the circuit."""
        return self.circuit.rate(state, memory, inputs)

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Integrands of the circuit."""
        return self.circuit.integrands(state, memory, inputs)

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the memory of the circuit."""
        return self.circuit.advance_memory(memory, start, end, duration)

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, JsonValue]:
        """Commands of the circuit."""
        return self.circuit.commands(signals)

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, JsonValue]:
        """Outputs of the circuit, and `RATE`."""
        steepest = self.circuit.max_rate_bound(state, memory, inputs)
        return {**self.circuit.outputs(state, memory, inputs), RATE: steepest}


class CircuitResponse(NamedTuple):
    """Outputs of a circuit by name, each (samples + 1,), pressures absolute; the method, and data of the accounts."""

    outputs: dict[str, np.ndarray]
    method: IntegrationMethod
    start: Any
    end: Any
    integrals: Any


def respond(plan: CircuitPlan, method: IntegrationMethod | None = None) -> CircuitResponse:
    """Compute the response of a circuit."""
    arguments, method = _given(plan), method or IntegrationMethod()
    for _ in range(ATTEMPTS):
        samples, start, end, integrals = _kernel(plan, arguments, method)(*arguments)
        outputs: dict[str, np.ndarray] = dict(samples)
        rate = float(np.max(outputs.pop(RATE)))
        sound = all(np.isfinite(values).all() for values in outputs.values())
        needed = method_of(rate if np.isfinite(rate) and sound else float("inf"), plan.inner_step, method.stiff)
        if sound and needed.stiff <= method.stiff and needed.split <= method.split:
            return CircuitResponse(outputs, method, start, end, integrals)
        if needed == method:
            break
        method = needed
    if sound:
        return CircuitResponse(outputs, method, start, end, integrals)
    raise ConvergenceError("the state is not finite any more: a value is far out of range, or the step is too long")


def ready(plan: CircuitPlan, method: IntegrationMethod | None = None) -> bool:
    """Whether the kernel of a topology is compiled."""
    return _kernels.known(_key(plan, _given(plan), method or IntegrationMethod())) is not None


def _given(plan: CircuitPlan) -> tuple[Tree, ...]:
    room = plan.environment
    pressures = {n: np.asarray(p + float(room.pressure_abs)) for n, p in plan.starts.items()}
    return plan.circuit, plan.inputs(), pressures, np.asarray(float(room.temperature))


def _key(plan: CircuitPlan, given: Any, method: IntegrationMethod) -> Any:
    shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(given))
    return jax.tree.structure(given), shapes, plan.period, plan.inner_step, plan.samples, method


def _kernel(plan: CircuitPlan, given: Any, method: IntegrationMethod) -> EngineFunction:
    period, samples, stiff = plan.period, plan.samples, method.stiff
    inner = max(1, round(period / plan.inner_step)) * method.split

    def outputs(circuit: Any, signals: Any, pressures: Scalar, temperature: Any) -> Any:
        first = {n: s.at(0, 0.0, period) for n, s in signals.items()}
        state = circuit.at_rest(pressures, first, temperature)
        memory = circuit.initial_memory(state, first)
        carry, kept = march(WatchedCircuit(circuit=circuit), state, memory, signals, period, inner, samples, stiff)
        return kept[2], state, carry[0], carry[2]

    def make() -> EngineFunction:
        made = compile_function(outputs, *given, title="circuit")
        made(*given)  # machine code is made at the first call
        return made

    return _kernels.get(_key(plan, given, method), make)


def accounts(plan: CircuitPlan, done: CircuitResponse) -> RunBalance:
    """Errors of the mass and energy balances of a response, relative to the throughput."""
    signals, count = plan.inputs(), plan.samples
    first = {n: s.at(0, 0.0, plan.period) for n, s in signals.items()}
    last = {n: s.at(count - 1, 1.0, plan.period) for n, s in signals.items()}
    sums = jax.tree.map(float, done.integrals)
    return balance(plan.circuit, done.start, done.end, first, last, sums)


TUBES = ("linear_tube", "quadratic_tube", "inertial_tube", "lumped_tube")
MODELS = {"linear_tube": "linear", "quadratic_tube": "quadratic", "inertial_tube": "inertial"}
GROWS = {
    "length": "m", "volume": "m^3", "hole_diameter": "m", "nominal_flow": "m^3/s", "flow_into_the_room": "m^3/s",
    "conductance": "m^3/(s*Pa)", "C": "m^3/(s*Pa)", "Kv": "m^3/s", "Cv": "1",
}  # fmt: skip
LONGER = (8, 64)  # times the duration, for which a response that has not settled runs again
MOST_SAMPLES, QUICK_SAMPLES = 20_000, 4_000  # of such a run, and of one that is answered at once
SHARES = (0.1, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)


class ResponseNumbers(NamedTuple):
    """Numbers of a response; None if the command does not step or nothing follows it [SI].

    Where `settled` is False, the level after the step and the times are of a step still under way: over the last fifth of
    the time after it the channel still changes by `drift` of the step. `ends` says whether another step came before.
    """

    channel: str
    delay: float | None
    transition: float | None
    rising: bool
    command_time: float
    before: float
    after: float
    flow: float  # largest of an element, as a volume of reference air [m^3/s]
    flow_of: str
    drift: float
    settled: bool
    ends: bool
    duration: float  # of the run that the numbers were read from [s]


def recording(plan: CircuitPlan, outputs: dict[str, np.ndarray]) -> Recording:
    """Channels of a quick response: gauge pressures, mass flows and signals, named as in `bench.circuit_run`."""
    room = float(plan.environment.pressure_abs)
    channels = {}
    for node in plan.nodes:
        gauge = outputs[f"{node}.pressure_abs"] - room
        channels[f"{node}.pressure"] = Channel(gauge, "Pa", "true", f"gauge pressure of {node}")
    for name, values in outputs.items():
        if name.endswith(".mass_flow"):
            channels[name] = Channel(values, "kg/s", "true", f"mass flow, {name}")
    channels |= {n: Channel(v, plan.signals[n].unit, "command", n) for n, v in plan.values().items()}
    return Recording(plan.times, channels, {"title": plan.title})


def flow_channel(plan: CircuitPlan, element: str) -> str:
    """Name of the channel of an element's first path."""
    one = plan.circuit.elements[element]
    return f"{path_name(one, element, one.paths[0])}.mass_flow"


def litres(mass_flow: Scalar) -> np.ndarray:
    """Convert a mass flow [kg/s] to that of reference air [L/min]."""
    return from_si(1.0, "m^3/s", "l/min") * np.asarray(mass_flow) / REFERENCE_DENSITY


def measured(plan: CircuitPlan, record: Recording, node: str, element: str) -> ResponseNumbers:
    """Determine delay and rise of a node's pressure by `analysis.steps`, and the largest flow of an element."""
    channel = f"{node}.pressure"
    stepping = [n for n, s in plan.signals.items() if s.unit != "m" and s.waveform.kind == "steps"]
    flow = record[flow_channel(plan, element)] if element else np.zeros(1)
    largest = float(np.abs(flow).max()) / REFERENCE_DENSITY
    before, after = float(record[channel][0]), float(record[channel][-1])
    try:
        one = step_responses(record, command=stepping[0], channel=channel, median=1)[0] if stepping else None
    except InputError:
        one = None
    duration = float(record.time[-1])
    if one is not None:
        step = one.delay, one.transition, one.rising, one.command_time, one.before, one.after
        ends = one.until < duration
        return ResponseNumbers(channel, *step, largest, element, one.drift, one.settled, ends, duration)
    drift, settled, late = 0.0, True, record.time >= (1.0 - LAST) * duration
    if (stepping or not plan.signals) and after != before and np.count_nonzero(late) > 2:  # it only fills or empties
        drift, settled = settling(record.time[late], record[channel][late], after - before)
    ends = False
    return ResponseNumbers(
        channel, None, None, True, 0.0, before, after, largest, element, drift, settled, ends, duration
    )


def settled(
    plan: CircuitPlan, outputs: ResponseNumbers, node: str, method: IntegrationMethod | None, wait: bool = True
) -> tuple[ResponseNumbers, bool]:
    """Numbers of a settled response, from a longer run if the plan's own is too short."""
    for times in LONGER:
        if outputs.settled or outputs.ends or plan.samples * times > MOST_SAMPLES:
            break
        try:
            longer = plan.change({"run.duration": f"{times * plan.duration!r} s"})
        except InputError:  # a signal that ends
            break
        if not wait and (longer.samples > QUICK_SAMPLES or not ready(longer, method)):
            return outputs, True
        done = measured(longer, recording(longer, respond(longer, method).outputs), node, outputs.flow_of)
        outputs = done._replace(flow=outputs.flow)
    return outputs, False


def last_chamber(plan: CircuitPlan) -> str:
    """Node whose pressure is evaluated: the last muscle, or the last volume."""
    inner = [n for n, p in plan.nodes.items() if p.kind not in GIVEN]
    muscles = [n for n in inner if plan.nodes[n].law is not None]
    return (muscles or [n for n in inner if plan.nodes[n].kind != "junction"] or inner)[-1]


def first_tube(plan: CircuitPlan, chosen: str = "") -> str:
    """Name of the chosen tube, or the first; else of the first element."""
    elements = plan.document["elements"]
    tubes = [n for n, words in elements.items() if words["kind"] in TUBES]
    return chosen if chosen in tubes else (tubes or list(elements))[0]


def with_model(document: Document, plan: CircuitPlan, name: str, kind: str) -> Document:
    """Replace the model of a tube; common parameters are kept.

    A linear tube gets the resistance that the tube has between full pressure and the room, which no size tells it.

    Raises:
        InputError: the tube states no size that the other model could be made of.
    """
    words = document["elements"][name]
    if words["kind"] == kind:
        return document
    new = {k: v for k, v in words.items() if k in ("kind", "from", "to")}
    new["kind"] = kind
    known = known_keys(kind)
    if kind == "linear_tube":
        new["resistance"] = worded(_resistance(plan, name), declared(LinearTube)["resistance"])
    else:
        new |= {k: words[k] for k in ("length", "diameter", "ends") if k in words and k in known}
        if "diameter" not in new:
            raise InputError(f"elements.{name}.kind", kind, f"{words['kind']} states no diameter to make it of")
    return {**document, "elements": {**document["elements"], name: new}}


def _resistance(plan: CircuitPlan, name: str) -> float:
    room, warm = float(plan.environment.pressure_abs), float(plan.environment.temperature)
    driven = [float(np.abs(v).max()) for n, v in plan.values().items() if plan.signals[n].unit == "Pa"]
    full = room + max([*map(abs, plan.starts.values()), *driven, 1e5])
    element: Any = plan.circuit.elements[name]
    low, high = (GasState(p, warm, plan.circuit.gas) for p in (room, full))
    if isinstance(element.initial(), tuple):
        return (full - room) / float(element.mass_flow(high, low))
    # one with inertia is asked where it no longer accelerates
    flows = np.geomspace(1e-9, 1.0, 2001)
    rates = np.broadcast_to(np.asarray(element.rate(high, low, flows, 0.0)), flows.shape)
    return (full - room) / float(np.interp(0.0, -rates, flows))


class ValueSweep(NamedTuple):
    """The rise over a value of a part: its path, the values [SI], the rises [s], NaN if nothing rises or settles."""

    key: str
    unit: str
    values: np.ndarray
    rises: np.ndarray
    now: float


def sweep(
    document: Document, plan: CircuitPlan, name: str, node: str, method: IntegrationMethod | None
) -> ValueSweep | None:
    """Rise time of a node's pressure over sizes of a part."""
    section = "nodes" if name in plan.nodes else "elements"
    words = document[section].get(name, {})
    key = next((k for k in GROWS if k in words), "")
    if not key or section == "nodes" and words["kind"] != "volume":
        return None
    unit = GROWS[key]
    now = parse(with_usual_unit(key, document[section][name][key]), unit, field=key)
    values, rises = [], []
    for share in SHARES:
        part = {**document[section][name], key: f"{share * now!r} {unit}"}
        try:
            other = planned({**document, section: {**document[section], name: part}})
            numbers = measured(other, recording(other, respond(other, method).outputs), node, "")
            numbers, _ = settled(other, numbers, node, method)
        except MckibbenError:
            continue
        values.append(share * now)
        steps = numbers.transition is not None and numbers.delay is not None and numbers.settled
        rises.append(numbers.delay + numbers.transition if steps else float("nan"))  # type: ignore[operator]
    return ValueSweep(key, unit, np.array(values), np.array(rises), now)


def facts(plan: CircuitPlan, name: str) -> list[tuple[str, str]]:
    """Derived properties of a part: title and text."""
    rows: list[tuple[str, str]] = []
    if name in plan.circuit.elements:
        element: Any = plan.circuit.elements[name]
        volumes = [float(v) for v in element.inner_volumes()]
        if any(volumes):
            rows.append(("Its own volume", with_unit(sum(volumes), "m^3", 3).replace("^3", "\u00b3")))
        if "length" in dict(paths.parameters(element)):
            speed = float(plan.circuit.gas.sound_speed(float(plan.environment.temperature)))
            across = from_si(float(inertance(length=element.length, area=float(element.area))), "1/m", "1/cm")
            rows.append(("Sound passes in", f"{from_si(float(element.length) / speed, 's', 'ms'):.3g} ms"))
            rows.append(("Inertance l/A", f"{across:.4g} cm\u207b\u00b9"))
    elif name in plan.nodes and plan.nodes[name].law is not None:
        law: Any = plan.nodes[name].law
        length = plan.nodes[name].length
        if length is not None:
            full = parse(top(plan.document, plan), "Pa", field="pressure")
            tension = with_unit(float(law.tension(length, full)), "N")
            rows.append((f"Static tension at {with_unit(full, 'Pa')}", tension))
            rows.append(("Volume there", with_unit(float(law.volume(length, full)), "m^3").replace("^3", "\u00b3")))
    return rows


def shown_nodes(plan: CircuitPlan, wanted: Sequence[str]) -> list[str]:
    """Requested nodes that the circuit has; its chambers if none was requested."""
    inner = [n for n, p in plan.nodes.items() if p.kind not in GIVEN]
    return [n for n in wanted if n in inner] or inner[:4]
