"""Questions to the file of a circuit: what it is, how it runs and answers to small sines, and what records tell of it."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import components, identification, recordings, verbs
from ..analysis import description, frequency
from ..answers import Answer, Caution, Column, Table, collect
from ..assembly import circuit_file
from ..assembly import linearise as linearisation
from ..assembly import sentence as sentences
from ..bench import circuit_run
from ..documents import JsonValue
from ..errors import InputError
from ..formats.store import is_recording_csv
from ..pneumatics import volume
from ..quantities import parse, with_unit
from ..recordings import Recording

if TYPE_CHECKING:
    from ..analysis.frequency import FrequencyResponse
    from ..assembly.circuit_file import CircuitPlan
    from ..assembly.linearise import Mode

FREQUENCIES = 200  # at which a response is given
ROWS = 10  # of them that a person is shown
UNITS = {"pressure_abs": "Pa", "pressure": "Pa", "mass_flow": "kg/s", "mass": "kg", "temperature": "K", "length": "m"}


def _planned(circuit: Any, changes: verbs.Changes | None) -> CircuitPlan:
    """A circuit with replaced values."""
    plan = circuit if isinstance(circuit, circuit_file.CircuitPlan) else circuit_file.read_circuit(circuit)
    return plan.change({path: str(value) for path, value in changes.items()}) if changes else plan


@dataclass(frozen=True)
class CircuitDescription(Answer):
    """A circuit in words: what `describe_circuit` finds.

    Attributes:
        plan: the circuit with its signals and its run.
        fastest: rate of its fastest mode at the start [1/s].
        method: with which a run begins.
        cautions: about parameters and starts.
    """

    plan: CircuitPlan
    fastest: float
    method: str
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Nodes, elements and signals with their numbers [SI], and both sentences."""
        plan = self.plan
        signals = {
            name: {
                "kind": s.waveform.kind,
                "unit": s.unit,
                "straight": s.straight,
                "drives": list(s.drives),
                "sentence": s.waveform.sentence(s.unit),
            }
            for name, s in plan.signals.items()
        }
        return {
            "title": plan.title,
            "nodes": self._nodes(),
            "elements": self._elements(),
            "signals": signals,
            "sentence": sentences.sentence(plan),
            "run": sentences.run_sentence(plan),
            "rates": {"fastest": self.fastest, "method": self.method, "step": plan.inner_step},
        }

    def _nodes(self) -> dict[str, JsonValue]:
        nodes = {}
        for name, n in self.plan.nodes.items():
            entry: dict[str, Any] = {"kind": n.kind, "words": n.words, "signal": n.signal}
            if not isinstance(n.node, volume.Reservoir):
                entry |= {"start_pressure": n.start, "heat": type(n.node.heat).__name__}
            elif n.signal is None:
                node: Any = self.plan.circuit.nodes[name]
                entry["pressure"] = float(node.pressure_abs) - float(self.plan.environment.pressure_abs)
            nodes[name] = entry
        return nodes

    def _elements(self) -> dict[str, Any]:
        elements = {}
        for name, element in self.plan.circuit.elements.items():
            ends, command = self.plan.circuit.ends[name]
            elements[name] = {
                "kind": self.plan.document["elements"][name]["kind"],
                "ports": dict(zip(element.ports, ends, strict=True)),
                "command": command,
                "parameters": {
                    path: {"value": components.paths.get(element, path), "unit": q.unit}
                    for path, q in components.paths.parameters(element)
                    if "gas." not in path
                },
            }
        return elements

    def tables(self) -> list[Table]:
        """Nodes, elements and signals."""
        nodes = [{"node": name, "kind": n.kind, "words": n.words} for name, n in self.plan.nodes.items()]
        elements = [
            {"element": name, "kind": e["kind"], "leads": ", ".join(f"{p} {at}" for p, at in e["ports"].items())}
            for name, e in self._elements().items()
        ]
        signals = [
            {"signal": name, "words": s.waveform.sentence(s.unit), "drives": ", ".join(s.drives)}
            for name, s in self.plan.signals.items()
        ]
        kind, words = Column("kind"), Column("words", "")
        tables = [
            Table(self.plan.title, (Column("node"), kind, words), nodes),
            Table("", (Column("element"), kind, Column("leads", "leads to")), elements),
        ]
        return tables + [Table("", (Column("signal"), words, Column("drives")), signals)] * bool(signals)

    def remarks(self) -> list[str]:
        """The circuit and its run as sentences, and the method with which a run begins."""
        method = f"Fastest mode at the start {self.fastest:.3g} 1/s: a run begins with {self.method}."
        return [sentences.sentence(self.plan), sentences.run_sentence(self.plan), method]


@verbs.verb
def describe_circuit(circuit: verbs.CircuitFile, *, changes: verbs.Changes | None = None) -> CircuitDescription:
    """Describe a circuit, its fastest mode, and the method with which a run begins.

    Args:
        circuit: circuit file with its signals and its run.
        changes: replace a value, such as elements.tube.length='2 m'.

    Raises:
        InputError: names the file, the place and what is wrong with it.
    """
    plan = _planned(circuit, changes)
    return CircuitDescription(plan, *plan.rates(), plan.cautions)


@dataclass(frozen=True)
class CircuitRecording(Answer):
    """A run of a circuit: what `record_circuit` computes.

    Attributes:
        recording: pressures, temperatures, masses, flows and commands.
        cautions: about the circuit, and what the run found.
    """

    recording: Recording
    cautions: tuple[Caution, ...] = ()

    def _channels(self) -> dict[str, dict[str, Any]]:
        return {
            name: {
                **{k: s[k] for k in ("min", "max", "mean")},
                "final": float(self.recording[name][-1]),
                "unit": s["unit"],
            }
            for name, s in self.recording.summary().items()
        }

    def to_dict(self) -> dict[str, JsonValue]:
        """How the run ended, its channels in numbers [SI], and shares that its balances leave open."""
        meta = self.recording.meta
        content = {name: meta[name] for name in ("result", "message", "stiff", "step")}
        return content | {
            "summary": self._channels(),
            "balance": dict(meta["balance"]),
            "warnings": list(meta.get("warnings", ())),
        }

    def tables(self) -> list[Table]:
        """Channels but absolute pressures and masses, which others say as well."""
        rows = []
        for name, s in self._channels().items():
            owner, _, last = name.rpartition(".")
            if last in ("pressure_abs", "mass") or (last == "temperature" and f"{owner}.mass" not in self.recording):
                continue
            numbers, span = ("min", "max", "mean", "final"), max(abs(s["min"]), abs(s["max"]))
            # what is nothing but rounding is shown as nothing
            s |= {key: 0.0 for key in numbers if abs(s[key]) < 1e-9 * span}
            rows.append({"channel": name} | description.shown_numbers(s, numbers, description.FLOWS.get(s["unit"])))
        shown = (Column(key, right=True) for key in ("min", "max", "mean", "final"))
        return [Table(str(self.recording.meta["title"]), (Column("channel"), *shown, Column("unit")), rows)]

    def remarks(self) -> list[str]:
        """What was run, how it ended, and its balances."""
        meta = self.recording.meta
        closed = (
            f"Balance: mass {meta['balance']['mass']:.1e}, energy {meta['balance']['energy']:.1e} of what went through."
        )
        method = f"Method {'ros2' if meta['stiff'] else 'rk4'}, step {meta['step'] * 1e6:g} us."
        return [meta["run"], f"{meta['message']} {closed} {method}"]

    def failure(self) -> str | None:
        """Empty where the run was interrupted, which its message says."""
        return None if self.recording.meta["result"] == "done" else ""


@verbs.verb
def record_circuit(
    circuit: verbs.CircuitFile,
    *,
    changes: verbs.Changes | None = None,
    progress: Callable[[float, float], None] | None = None,
) -> CircuitRecording:
    """Run a circuit, close its balances of mass and energy, and save the recording.

    Args:
        circuit: circuit file with its signals and its run.
        changes: replace a value, such as elements.tube.length='2 m'.
        progress: told how far the run is, and how long it is [s].

    Raises:
        InputError: names the file, the place and what is wrong with it.
        ConvergenceError: the run failed; says when and why.
    """
    plan = _planned(circuit, changes)
    parts, done = circuit_run.chunks(plan), itertools.count(1)

    def tell(_: str) -> None:
        if progress is not None:
            progress(plan.duration * next(done) / parts, plan.duration)

    recording = circuit_run.run_circuit(plan, progress=tell)
    said = {one.text for one in plan.cautions}
    found = (Caution(one) for one in recording.meta.get("warnings", ()) if one not in said)
    return CircuitRecording(recording, collect(*plan.cautions, *found))


@dataclass(frozen=True)
class CircuitResponse(Answer):
    """Frequency response of a circuit about rest: what `circuit_response` computes.

    Attributes:
        title: of the circuit.
        source: signal that is varied.
        target: channel that answers.
        unit: of the target over that of the source; empty if both are the same.
        level: of the target at rest [SI].
        about: time of the operating point, in words; empty without signals.
        response: magnitude and phase.
        modes: of the circuit about rest.
        cautions: about parameters and starts.
    """

    title: str
    source: str
    target: str
    unit: str
    level: float
    about: str
    response: FrequencyResponse
    modes: Sequence[Mode]
    cautions: tuple[Caution, ...] = ()

    def data(self) -> dict[str, Any]:
        """Frequency [Hz], magnitude and phase [rad]."""
        return {name: getattr(self.response, name) for name in ("frequency", "magnitude", "phase")}

    def column_units(self) -> Mapping[str, str]:
        """SI units of the columns."""
        return {"frequency": "Hz", "magnitude": self.unit or "1", "phase": "rad"}

    def to_dict(self) -> dict[str, JsonValue]:
        """The response, its cutoff [Hz], the level at rest, and the modes."""
        return {
            "title": self.title,
            "input": self.source,
            "output": self.target,
            "unit": self.unit,
            "level": self.level,
            "cutoff": self.response.cutoff(),
            "modes": [m._asdict() | {"eigenvalue": [m.eigenvalue.real, m.eigenvalue.imag]} for m in self.modes],
            **self.data(),
        }

    def tables(self) -> list[Table]:
        """Some of the response, and the modes."""
        data, units = self.data(), self.column_units()
        rows = [
            {name: float(values[i]) for name, values in data.items()}
            for i in (*range(0, FREQUENCIES, FREQUENCIES // ROWS), FREQUENCIES - 1)
        ]
        columns = (
            Column("frequency", unit="Hz", shown="Hz", places=".3g"),
            Column("magnitude", unit=units["magnitude"], shown=units["magnitude"]),
            Column("phase", unit="rad", shown="deg", places=".1f"),
        )
        modes = [{"frequency": m.frequency, "damping": m.damping} for m in self.modes]
        natural = Column("frequency", "natural frequency", "Hz", shown="Hz")
        damping = Column("damping", "damping ratio", "1", places=".3g")
        title = f"{self.title}: {self.target} over {self.source}, about rest at {self.about or 'any time'}"
        return [Table(title, columns, rows), Table("Modes", (natural, damping), modes)]

    def remarks(self) -> list[str]:
        """The level at rest, and where the response falls."""
        cutoff, highest = self.response.cutoff(), float(self.response.frequency[-1])
        fallen = (
            f"falls by 3 dB at {cutoff:.4g} Hz"
            if np.isfinite(cutoff)
            else f"does not fall by 3 dB up to {highest:g} Hz"
        )
        return [f"{self.target} is {self.level:.6g} at the operating point; its response {fallen}."]


@verbs.verb
def circuit_response(
    circuit: verbs.CircuitFile,
    *,
    source: verbs.SignalName,
    target: verbs.ChannelName,
    at: verbs.Duration = "0 s",
    lowest: verbs.Frequency = "0.1 Hz",
    highest: verbs.Frequency = "100 Hz",
    changes: verbs.Changes | None = None,
    progress: Callable[[str], None] | None = None,
) -> CircuitResponse:
    """Compute the frequency response of a circuit that is linearised at rest.

    The circuit settles under the values that its signals have at one time; about this operating point it answers to
    small sines of one signal. Friction with memory is held.

    Args:
        circuit: circuit file with its signals and its run.
        source: signal that is varied, such as valve.command.
        target: channel that answers, such as muscle.pressure_abs.
        at: time at which all signals have the values of the operating point [s].
        lowest: lowest frequency [1/s].
        highest: highest frequency [1/s].
        changes: replace a value, such as elements.tube.length='2 m'.
        progress: called with a few words before the circuit settles.

    Raises:
        InputError: a name is unknown, or a frequency or the time is out of range.
    """
    low, high, time = float(lowest), float(highest), float(at)
    if not 0.0 < low < high:
        raise InputError(
            "lowest", verbs.typed(lowest), f"must be above 0 Hz and below {{highest}}, {verbs.typed(highest)}"
        )
    plan = _planned(circuit, changes)
    if not 0.0 <= time <= plan.duration:
        end = with_unit(plan.duration, "s")
        raise InputError("at", verbs.typed(at), f"must be between 0 s and {end}, the duration of the run")
    inputs = {name: s.at(round(time / plan.period), 0.0, plan.period) for name, s in plan.inputs().items()}
    driven = plan.inputs_of(source)
    if len(driven) > 1:
        raise InputError("source", source, f"it drives {' and '.join(driven)}; name one of them")
    (source,) = driven
    state, memory = plan.initial()
    if progress is not None:
        progress("")
    rest = linearisation.settle(plan.circuit, state, memory, inputs).state
    model = linearisation.linearise(plan.circuit, rest, memory, inputs, inputs_by_name=(source,), outputs=(target,))
    response = frequency.linear_response(model, source, target, np.geomspace(low, high, FREQUENCIES))
    above, below = (UNITS.get(name.rpartition(".")[2], "1") for name in (target, source))
    unit = "" if above == below else above if below == "1" else f"{above} per {below}"
    level = float(plan.circuit.outputs(rest, memory, inputs)[target])
    about = (verbs.typed(at) or "") if inputs else ""
    return CircuitResponse(
        plan.title, source, target, unit, level, about, response, tuple(model.modes()), plan.cautions
    )


@dataclass(frozen=True)
class FittedCircuit(Answer):
    """Parameters of a circuit that were fitted to records of its pressures: what `fit_circuit_file` computes.

    Attributes:
        fit: parameters with their intervals, and the errors of every record.
        trials: records that were fitted, then those that were predicted.
        title: of the circuit.
        samples: of the posterior; None where none were asked for.
        cautions: about the circuit and the records.
    """

    fit: identification.CircuitFit
    trials: tuple[identification.Trial, ...]
    title: str
    samples: Any = None
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Parameters with their intervals, errors of every record [Pa], and samples."""
        return self.fit.to_dict() | ({} if self.samples is None else {"posterior": self.samples.to_dict()})

    def rows(self) -> list[dict[str, JsonValue]]:
        """One row per parameter."""
        return [{"parameter": name} | e._asdict() for name, e in self.fit.parameters.items()]

    def tables(self) -> list[Table]:
        """Parameters, errors of every record, and samples."""
        return [*self.fit.tables(self.title), *(() if self.samples is None else self.samples.tables("the circuit"))]


@verbs.verb
def fit_circuit_file(
    circuit: verbs.CircuitFile,
    records: verbs.RecordFiles,
    *,
    free: Sequence[verbs.ParameterPath] | None = None,
    predict: verbs.RecordFiles | None = None,
    start: verbs.Changes | None = None,
    columns: verbs.FileColumns | None = None,
    units: verbs.FileUnits | None = None,
    changes: verbs.Changes | None = None,
    posterior: bool = False,
    draws: verbs.Count = 1000,
    progress: Callable[[str], None] | None = None,
) -> FittedCircuit:
    """Fit a circuit's parameters to records of its pressures, and predict other records.

    Args:
        circuit: circuit file with its signals and its run.
        records: recordings, or measured CSV tables, to fit to.
        free: parameter to fit, such as elements.tube.friction_scale; * matches several.
        predict: record to predict with the fitted parameters.
        start: initial value of a free parameter.
        columns: column that holds tank.pressure, time, .., such as tank.pressure=2.
        units: unit of a column whose header has none, such as tank.pressure=kPa.
        changes: replace a value, such as elements.tube.length='2 m'.
        posterior: draw from the posterior of the parameters, with a discrepancy of the circuit.
        draws: number of samples of the posterior.
        progress: called with a sentence after every evaluation.

    Raises:
        InputError: a path is unknown, a record cannot be read, or no record depends on a parameter.
        ConvergenceError: the fit ended where it began, or the circuit cannot be run with the first guesses.
        MissingLibraryError: samples need NumPyro, which the extra ``posterior`` brings.
    """
    if posterior:
        identification.posterior.check_draws(draws)
    plan = _planned(circuit, changes)
    fitted, predicted = _listed(records), _listed(predict)
    wanted = _listed(free) or list(plan.fit.free)
    if not wanted:
        missing = "is missing: give a dotted path, here or as free = [..] in [fit]"
        raise InputError("{free}", None, missing, where=str(circuit))
    for option, stated in (("columns", columns), ("units", units)):
        own = next(filter(_states_units, (*fitted, *predicted)), None)
        if stated and own is not None:
            name, value = next(iter(stated.items()))
            allowed = "a recording of mckibben says these itself; they are for files of others"
            raise InputError(f"{{{option}}}", f"{name}={value}", allowed, where=str(own))
    reading = {
        "columns": {**plan.fit.columns, **(columns or {})} or None,
        "units": {**plan.fit.units, **(units or {})} or None,
        "pressure_zero": plan.fit.pressure_zero,
    }
    loaded = [_trial(plan, one, reading) for one in (*fitted, *predicted)]
    trials = tuple(trial for trial, _ in loaded)
    first = trials[: len(fitted)]
    result = identification.fit_circuit(
        first,
        wanted,
        predict=trials[len(fitted) :],
        start=_starts(plan, wanted, start or {}),
        step=plan.step,
        progress=progress,
    )
    samples = result.posterior(first, step=plan.step, draws=draws) if posterior else None
    missed = (Caution(one) for one in result.warnings if one.startswith("the model does not describe"))
    said = collect(*plan.cautions, *(one for _, cautions in loaded for one in cautions), *missed)
    return FittedCircuit(result, trials, plan.title, samples, said)


def _listed(value: Any) -> list[Any]:
    """Several of a kind, as one names them: none, one, or a list."""
    one = isinstance(value, str | os.PathLike | Recording)
    return [] if value is None else [value] if one else list(value)


def _trial(
    plan: CircuitPlan, source: Any, reading: Mapping[str, Any]
) -> tuple[identification.Trial, tuple[Caution, ...]]:
    """A record as a trial of a circuit, and what is to be said of it."""
    if isinstance(source, Recording):
        record, said = source, []
    else:
        record = recordings.read_record(source, ambient=float(plan.environment.pressure_abs), **reading)
        said = [Caution(f"{source}: {one.text}", one.parameter) for one in record.cautions if one.parameter == "source"]
    name = str(record.meta.get("title", "recording")) if isinstance(source, Recording) else str(source)
    trial = identification.trial.trial_from_record(plan, record, name=name)
    return trial, collect(*said, *trial.cautions)


def _states_units(source: Any) -> bool:
    """Whether something is a recording, or a file that this package saved, which states its units."""
    if isinstance(source, Recording):
        return True
    path = Path(source)
    return path.suffix == ".nc" or (path.is_file() and is_recording_csv(path))


def _starts(plan: CircuitPlan, wanted: Sequence[str], start: Mapping[str, float | str]) -> dict[str, float]:
    """Initial values of free parameters [SI], those of the file where no others are stated."""
    starts = {}
    for name, value in {**plan.fit.start, **start}.items():
        if name not in wanted:
            if name in plan.fit.start and name not in start:
                continue  # the file's guess for a parameter that is not asked for this time
            raise InputError("start", name, f"it is not free; free are {', '.join(wanted)}")
        path = identification.trial.matching(name, plan.circuit, tuple(plan.signals))[0]
        delay = identification.circuit_fit.DELAY
        unit = delay.unit if path.startswith("signals.") else components.paths.declaration(plan.circuit, path).unit
        starts[name] = parse(str(value), unit, field=f"start of {name}", bare=True)
    return starts
