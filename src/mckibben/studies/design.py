"""Design studies: sweeps over muscle, valve and tube, and their Pareto front."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources

import numpy as np

from ..analysis.steps import SETTLED
from ..batch import Output, VariantOutcome, Variants, grid
from ..batch.run_template import make_template, setting
from ..batch.sweep import Sweep, run_batch
from ..bench.rig_file import rig as rig_of
from ..components.gas import AIR
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.protocol import Protocol
from ..experiments.read import parse_protocol, with_values
from ..pneumatics.circuit import DeadState
from ..quantities import parse
from ..specimens import specimen


def dominated(costs: np.ndarray) -> np.ndarray:
    """Mask of the rows that another row beats: it is no worse in any column and better in one (n,).

    Rows with a number that is not finite are dominated; equal rows do not dominate each other.

    Args:
        costs: less is better (n, m).
    """
    finite = np.isfinite(costs).all(axis=1)
    mask: np.ndarray = ~finite
    for i in np.flatnonzero(finite):
        others = costs[finite]
        mask[i] = bool(np.any((others <= costs[i]).all(axis=1) & (others < costs[i]).any(axis=1)))
    return mask


FILE = "cycle-and-step.toml"
REACHED = 0.9  # of the tension's way after the step
LONGER = (4.0, 16.0)  # times the wait after the step, for designs whose tension has not settled by then
PLUMBING = "direct"
TUBE_LENGTH, TUBE_DIAMETER, VALVE_FLOW = (
    f"rig.plumbing.{PLUMBING}.{key}" for key in ("tube.length", "tube.diameter", "valve.flow_into_the_room")
)
OUTPUTS = (
    Output("response", "time_to", "muscle.load_tension", share=REACHED, step="step"),
    Output("drift", "drift", "muscle.load_tension", step="step"),
    Output("tension", "max", "muscle.load_tension", step="step"),
    Output("loop", "area", "muscle.load_tension", over="muscle.span", step="cycles"),
    Output("drawn", "integral", "valve.supply_to_outlet.mass_flow", step="cycles"),
)


@dataclass(frozen=True)
class Design:
    """A muscle behind one tube and one valve.

    Attributes:
        muscle: id of the specimen.
        tube_length: [m].
        tube_diameter: [m].
        valve_flow: into the room, from the pressure that the rig states [m^3/s].
        response: time to nine tenths of the tension's way [s]; NaN, as all below, where it could not be run.
        tension: largest after the step [N].
        air: drawn in a cycle [kg].
        work: work of a cycle [J].
        efficiency: work over the exergy of the air [1].
        best: whether no other design beats it in response, air and efficiency.
        settled: whether the tension was at rest after the step; where not, the response is to a value on the way.
        message: message about its run.
    """

    muscle: str
    tube_length: float
    tube_diameter: float
    valve_flow: float
    response: float
    tension: float
    air: float
    work: float
    efficiency: float
    best: bool
    settled: bool
    message: str


@dataclass(frozen=True)
class DesignStudy:
    """All designs in order, and their settings."""

    designs: tuple[Design, ...]
    protocol: Protocol
    rig: str

    @property
    def front(self) -> tuple[Design, ...]:
        """Pareto-optimal designs, the fastest first."""
        return tuple(sorted((d for d in self.designs if d.best), key=lambda d: d.response))


def protocol(**values: JsonValue) -> Protocol:
    """Cycles and step, with other values of parameters as text.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    text = (resources.files(__package__) / FILE).read_text(encoding="utf-8")
    return with_values(parse_protocol(text, where=FILE), values)


def design_sweep(
    muscles: Sequence[str],
    *,
    tube_lengths: Sequence[str],
    tube_diameters: Sequence[str],
    valve_flows: Sequence[str],
    rig: str = "modern",
    **values: JsonValue,
) -> Sweep:
    """Make the sweep over all combinations, which `drive.run_sweep` can run on many machines.

    Args:
        muscles: ids of specimens.
        tube_lengths: words such as ``"50 cm"``, as the next two.
        tube_diameters: tube diameters of the bore.
        valve_flows: into the room, from the pressure that the rig states.
        rig: whose plumbing ``direct`` they are built into.
        **values: of the protocol.

    Raises:
        InputError: names what is unknown or out of bounds.
    """
    if not muscles:
        raise InputError("muscles", None, "must be at least one specimen")
    base = make_template(protocol(**values), muscles[0], rig, outputs=OUTPUTS, plumbing=PLUMBING)
    base = dataclasses.replace(base, specimens={m: specimen(m) for m in muscles})
    words = {"muscle": muscles, TUBE_LENGTH: tube_lengths, TUBE_DIAMETER: tube_diameters, VALVE_FLOW: valve_flows}
    settings = {p: setting(p, base.protocol, base.first_rig, base.first_unit) for p in words}
    axes = {path: [settings[path].read(one) for one in axis] for path, axis in words.items()}
    return Sweep(dataclasses.replace(base, settings=settings), grid(axes), title="Muscles, tubes and valves")


def design_study(
    muscles: Sequence[str],
    *,
    tube_lengths: Sequence[str],
    tube_diameters: Sequence[str],
    valve_flows: Sequence[str],
    rig: str = "modern",
    progress: Callable[[float], None] = lambda _: None,
    **values: JsonValue,
) -> DesignStudy:
    """Run every combination in this process and evaluate it; see `design_sweep`.

    Designs whose tension has not settled after the step run again, with four and sixteen times the wait.
    """
    axes = {"tube_lengths": tube_lengths, "tube_diameters": tube_diameters, "valve_flows": valve_flows}
    sweep = design_sweep(muscles, **axes, rig=rig, **values)
    results = run_batch(sweep, progress=progress)
    words = next(str(p.values[0]) for p in sweep.template.protocol.parameters if p.name == "wait")
    wait = parse(words, "s", field="wait")
    outputs, message = {n: v.copy() for n, v in results.outputs.items()}, list(results.message)
    for times in LONGER:
        late = np.flatnonzero((results.code == VariantOutcome.DONE) & (np.abs(outputs["drift"]) > SETTLED))
        if not late.size:
            break
        longer = design_sweep(muscles, **axes, rig=rig, **{**values, "wait": f"{times * wait!r} s"})
        longer = dataclasses.replace(longer, variants=Variants({p: c[late] for p, c in sweep.variants.columns.items()}))
        again = run_batch(longer)
        for i, row in enumerate(late):
            if again.code[i] == VariantOutcome.DONE:
                message[row] = again.message[i]
                for name in ("response", "drift", "tension"):
                    outputs[name][row] = again.outputs[name][i]
    return judged(sweep, sweep.variants, results.code, message, outputs)


def judged(
    sweep: Sweep, variants: Variants, code: np.ndarray, message: Sequence[str], outputs: Mapping[str, np.ndarray]
) -> DesignStudy:
    """Evaluate results in memory, or those of a store (`store.read_results`).

    Args:
        sweep: sweep of `design_sweep`.
        variants: that were run.
        code: result codes (n,).
        message: a sentence for each.
        outputs: by name (n,).
    """
    rig = rig_of(sweep.template.rig)
    done = np.asarray(code) == VariantOutcome.DONE
    cycles = float(next(p.values[0] for p in sweep.template.protocol.parameters if p.name == "cycles"))
    dead = DeadState.of(AIR, rig.environment)
    supply = rig.plumbing[PLUMBING].supply_pressure + rig.environment.pressure_abs
    worth = float(dead.flowing(dead.see(supply, rig.environment.temperature)))
    work, air, response = -outputs["loop"] / cycles, outputs["drawn"] / cycles, outputs["response"]
    work, air, response = (np.where(done, x, np.nan) for x in (work, air, response))
    efficiency = work / (air * worth)
    worse = dominated(np.stack([response, air, -efficiency], axis=1))
    designs = [
        Design(
            muscle=str(row["muscle"]),
            tube_length=row[TUBE_LENGTH],
            tube_diameter=row[TUBE_DIAMETER],
            valve_flow=row[VALVE_FLOW],
            response=float(response[i]),
            tension=float(outputs["tension"][i]) if done[i] else float("nan"),
            air=float(air[i]),
            work=float(work[i]),
            efficiency=float(efficiency[i]),
            best=not worse[i],
            settled=not (done[i] and abs(outputs["drift"][i]) > SETTLED),
            message=message[i],
        )
        for i, row in enumerate(variants.rows())
    ]
    return DesignStudy(tuple(designs), sweep.template.protocol, sweep.template.rig)
