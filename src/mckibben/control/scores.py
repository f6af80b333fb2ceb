"""The scored bench: a controller on plants that it was not built on, and, as a footnote, on the one that it was.

    settled   mean over holds of the rms error of their last 0.3 s          tracking  rms error after the first 2 s
    overshoot mean over holds of the largest excess beyond the new level    air  what fills the muscles, at 0 C and 1 atm,
                                                                                 of gas that has the room's temperature

Errors are of the true output, not of the measured one. Holds and their numbers are those of a staircase.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..answers import Answer, Caution, Column, Table, collect
from ..documents import JsonValue
from ..errors import InputError, each_once
from ..muscles.build import law_from_specimen
from ..muscles.evidence import interval_remarks, law_error
from ..quantities import whole_number
from ..registry import is_reference, load_reference, named_by_person
from ..simulation import Simulation
from ..specimens import muscle_specimen
from ..verbs import Count, Duration, ParameterType, Seed, verb
from .benches import NOMINAL, PUBLISHED, SPECIMEN, VARIED, VOLT, ControlBench, control_task, find_bench, unseen_plants
from .catalogue import CONTROLLERS
from .references import HOLD, REFERENCES, SKIPPED, Reference
from .task import Controller, ControlTask

ControllerName = Annotated[Sequence[str] | str, ParameterType("CONTROLLER", listed=True)]
BenchName = Annotated[str, ParameterType("BENCH")]
ReferenceName = Annotated[str, ParameterType("REFERENCE")]

LAST = 0.3  # of a hold, in which it is settled [s]
NORMAL = 273.15 / 293.15 / 101325.0  # normal volume of a volume at a pressure and room temperature [1/Pa]
TUNED_ON = "R2"


class ControlScore(NamedTuple):
    """What a controller did on a plant.

    Attributes:
        settled: settled error [unit of the output]; nan where nothing is held.
        tracking: rms error [unit of the output].
        overshoot: [unit of the output]; nan where nothing is held.
        saturated: share of the samples at a limit of the command [1].
        travel: way of the command [Pa].
        air: that filled the muscles [m^3], normal.
        effort: rms rate of the command [Pa/s].
    """

    settled: float
    tracking: float
    overshoot: float
    saturated: float
    travel: float
    air: float
    effort: float


@dataclass(frozen=True)
class ControlRun:
    """A run of a controller on a plant.

    Attributes:
        wanted: at the samples, shape (samples,) [unit of the output].
        output: the true output there.
        command: number u of the controller, held from there on [Pa].
        score: of it.
    """

    wanted: np.ndarray
    output: np.ndarray
    command: np.ndarray
    score: ControlScore


def run_controller(
    controller: Controller,
    plant: Simulation,
    task: ControlTask,
    reference: Reference,
    *,
    seed: int = 1,
    duration: float | None = None,
) -> ControlRun:
    """Let a controller drive a plant through a reference, as often as it repeats it; the last time counts.

    Args:
        controller: to be scored.
        plant: machine of a bench.
        task: by which the controller was made.
        reference: wanted output.
        seed: of the sensors' noise; each repeat has its own.
        duration: of the reference [s]; all of it by default.
    """  # fmt: skip
    ahead, repeats = int(controller.preview), int(getattr(controller, "repeats", 1))
    every = reference.samples(task.period, ahead, duration)
    count = len(every) - ahead
    # of a staircase nobody knows the next level
    windows = np.lib.stride_tricks.sliding_window_view(every, ahead + 1)
    windows = np.repeat(every[:count, None], ahead + 1, axis=1) if reference.hold else windows
    output, command, gas = np.empty(count), np.empty(count), list[tuple[float, ...]]()
    names = list(plant.units)
    fields = [f"{name}_{of}" if len(names) > 1 else of for name in names for of in ("pressure", "length")]
    for repeat in range(repeats):
        measured, errors = plant.reset(seed + 1000 * repeat), np.empty(count)
        controller.reset(measured, windows[0])
        gas.clear()
        for k, window in enumerate(windows):
            truth = plant.truth
            output[k], errors[k] = task.output(truth), window[0] - task.output(measured)
            gas.append(tuple(getattr(truth, name) for name in fields))
            number = float(controller.step(measured, window))
            if not math.isfinite(number):
                raise InputError("controller", None, f"must return a finite number, got {number} at {truth.time:g} s")
            command[k] = task.saturated(number)
            measured = plant.step(**task.commands(command[k]))
        if repeat < repeats - 1:
            controller.learn(errors)  # type: ignore[attr-defined]
    columns, ambient = np.array(gas).T, float(plant.machine.environment.pressure_abs)
    muscles = zip(plant.units.values(), columns[::2], columns[1::2], strict=True)
    air = sum((_filled(unit.law, pressures, lengths, ambient) for unit, pressures, lengths in muscles), start=0.0)
    wanted = every[:count]
    return ControlRun(wanted, output, command, _score(wanted, output, command, task, reference, air))


def _filled(law: Any, pressures: np.ndarray, lengths: np.ndarray, ambient: float) -> float:
    """Normal volume that flows into a muscle [m^3]; what leaves it is lost."""
    held = (pressures + ambient) * np.asarray(law.braid_volume(lengths, pressures)) * NORMAL
    return float(np.maximum(np.diff(held), 0.0).sum())


def _score(
    wanted: np.ndarray, output: np.ndarray, command: np.ndarray, task: ControlTask, reference: Reference, air: float
) -> ControlScore:
    errors, moves, (low, high) = wanted - output, np.diff(command), task.limits
    first = min(round(SKIPPED / task.period), len(errors) // 2)
    settled = overshoot = math.nan
    size = round(reference.hold / task.period)
    if size and len(errors) >= size:
        holds, goals = errors[: len(errors) // size * size].reshape(-1, size), wanted[::size]
        settled = float(np.sqrt((holds[:, -round(LAST / task.period) :] ** 2).mean(axis=1)).mean())
        ways = np.sign(np.diff(goals))[: len(holds) - 1, None]
        overshoot = float(np.maximum(-ways * holds[1:], 0.0).max(axis=1).mean()) if len(holds) > 1 else math.nan
    tiny = 1e-9 * (high - low)
    return ControlScore(
        settled,
        float(np.sqrt((errors[first:] ** 2).mean())),
        overshoot,
        float(((command <= low + tiny) | (command >= high - tiny)).mean()),
        float(np.abs(moves).sum()),
        air,
        float(np.sqrt((moves**2).mean()) / task.period),
    )


@dataclass(frozen=True)
class ControlScores(Answer):
    """Scores of controllers on a bench: what `score` computes.

    Attributes:
        bench: name of the bench.
        reference: name of the reference.
        unit: SI unit of the output.
        duration: of each run [s].
        unseen: by controller its scores on the plants that it was not built on, by plant.
        known: by controller its scores on the plant that it was built on, and on two that differ a little.
        runs: by controller the run on the unseen plant of median tracking error, or on the nominal one.
        cautions: about the runs.
    """

    bench: str
    reference: str
    unit: str
    duration: float
    unseen: Mapping[str, Mapping[str, ControlScore]]
    known: Mapping[str, Mapping[str, ControlScore]]
    runs: Mapping[str, ControlRun]
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """All scores by controller and plant [SI]; None for what a reference does not have."""
        return {
            "bench": self.bench,
            "reference": self.reference,
            "duration": self.duration,
            "unseen": {name: _plain(scores) for name, scores in self.unseen.items()},
            "known": {name: _plain(scores) for name, scores in self.known.items()},
            "law_error": self._law_errors(),
        }

    def rows(self) -> list[dict[str, Any]]:
        """A row per controller and plant [SI]."""
        both = [(name, plant, one, True) for name, scores in self.unseen.items() for plant, one in scores.items()]
        both += [(name, plant, one, False) for name, scores in self.known.items() for plant, one in scores.items()]
        return [{"controller": name, "plant": plant, "unseen": new, **one._asdict()} for name, plant, one, new in both]

    def tables(self) -> list[Table]:
        """Median and worst of the plants not seen, then the plants that controllers know, and what was published."""
        made = []
        if any(self.unseen.values()):
            rows = [row for name, scores in self.unseen.items() for row in _of_many(name, list(scores.values()))]
            count = len(next(iter(self.unseen.values())))
            made.append(Table(f"{count} plants not seen, {self.bench}, {self.reference}", self._columns("of"), rows))
        rows = [
            {"controller": name, "of": plant} | one._asdict()
            for name, scores in self.known.items()
            for plant, one in scores.items()
        ]
        if rows:
            title = f"Built on this plant (nominal), and on one much like it, {self.bench}, {self.reference}"
            made.append(Table(title, self._columns("of"), rows))
        if (self.bench, self.reference) == ("B1", "R1"):
            made.append(self._published())
        return made

    def _columns(self, second: str) -> tuple[Column, ...]:
        shown = {"m": "mm", "rad": "mrad"}[self.unit]
        error: dict[str, Any] = {
            "unit": self.unit,
            "shown": shown,
            "places": ".3f" if shown == "mm" else ".1f",
            "missing": "-",
        }
        return (
            Column("controller"), Column(second, ""), Column("settled", **error), Column("tracking", **error),
            Column("overshoot", **error), Column("saturated", unit="1", shown="%", places=".1f"),
            Column("travel", unit="Pa", shown="bar", places=".1f"), Column("air", unit="m^3", shown="l", places=".2f"),
            Column("effort", unit="Pa/s", shown="bar/s", places=".2f"),
        )  # fmt: skip

    def _published(self) -> Table:
        rows = [
            {
                "controller": name, "settled": settled * 1e-3, "tracking": tracking * 1e-3,
                "overshoot": overshoot * 1e-3, "saturated": saturated, "travel": travel * VOLT,
            }
            for name, (settled, tracking, overshoot, saturated, travel) in PUBLISHED.items()
        ]  # fmt: skip
        columns = tuple(c for c in self._columns("of") if c.key not in ("of", "air", "effort"))
        columns = tuple(dataclasses.replace(c, missing="-") for c in columns)
        note = "Printed by tbazina/pam_lqi_pid for the real muscle of a day, 450 holds; travel is of 120 s."
        return Table("Published, on the machine itself", columns, rows, (note,))

    def remarks(self) -> list[str]:
        """How long each run was, where the controllers were tuned, and the interval of the muscle's tension."""
        said = [f"Each run lasted {self.duration:g} s."]
        if self.reference == TUNED_ON:
            said.append(f"The controllers that ship were tuned on {TUNED_ON}: score them on another reference too.")
        return said + interval_remarks(self._law_errors())

    @staticmethod
    def _law_errors() -> dict[str, Any]:
        """What is known of the tension of the muscle that all benches have."""
        spec = muscle_specimen(SPECIMEN)
        return {SPECIMEN: law_error(spec, law_from_specimen(spec, NOMINAL.law))}


def _plain(scores: Mapping[str, ControlScore]) -> dict[str, JsonValue]:
    """Scores by plant, with None for what is not a number."""
    return {
        plant: {key: None if math.isnan(value) else value for key, value in one._asdict().items()}
        for plant, one in scores.items()
    }


def _of_many(name: str, scores: Sequence[ControlScore]) -> list[dict[str, Any]]:
    """Median and worst of scores, as rows."""
    columns = np.array(scores)
    ends = {"median": np.median(columns, axis=0), "worst": columns.max(axis=0)}
    return [
        {"controller": name, "of": of} | dict(zip(ControlScore._fields, map(float, row), strict=True))
        for of, row in ends.items()
    ]


@verb
def score(
    controller: ControllerName = "memory-inverse",
    *,
    bench: BenchName = "B1",
    reference: ReferenceName | None = None,
    plants: Count = 20,
    duration: Duration | None = None,
    seed: Seed = 1,
    progress: Callable[[float, float], None] | None = None,
) -> ControlScores:
    """Score controllers on a bench: median and worst on plants that they were not built on.

    A controller is made for the nominal plant and then drives others: of another law and friction, with other creep, valve,
    load and supply. The one that it was built on is a footnote.

    Args:
        controller: name of a controller that ships, or FILE.py:Class of one's own; several with commas between.
        bench: name of the bench: B1 a muscle on spring and weight, J1 two muscles on a joint.
        reference: name of the reference, R1 to R4; that of the bench by default.
        plants: number of plants that the controller was not built on; 0 for the known ones alone.
        duration: duration of each run [s], such as '20 s'; that of the reference by default.
        seed: random seed of the sensors' noise.
        progress: told how many runs are done, and how many there are.

    Raises:
        InputError: names what does not fit.

    Examples:
        >>> import mckibben as mk
        >>> answer = mk.control.score("memory-inverse", plants=0, duration="4 s")
        >>> answer.known["memory-inverse"]["nominal"].tracking < 1e-3
        True
    """
    stand = find_bench(bench)
    course = _reference(stand, reference)
    plants = whole_number(plants, "plants")
    seconds = course.duration if duration is None else float(duration)
    if not SKIPPED < seconds <= course.duration:
        problem = f"must be above {SKIPPED:g} s, in which nothing is scored, and {course.duration:g} s at most"
        raise InputError("duration", seconds, problem)
    makers = _makers(controller)
    task = control_task(bench)
    known = VARIED | {one.name: one for one in (unseen_plants(plants) if plants else [])}
    total, done = len(makers) * len(known), 0
    results: dict[str, dict[str, ControlRun]] = {name: {} for name in makers}
    said: list[Caution] = []
    for plant in known.values():
        machine = stand.simulation(plant)
        for name, make in makers.items():
            if progress is not None:
                progress(done, total)
            made = make(task)
            if not isinstance(made, Controller):
                raise InputError(
                    "controller", name, "must have reset(measured, window), step(measured, window) and preview"
                )
            said += getattr(made, "cautions", ())  # of those that ship, perhaps with one's own numbers
            results[name][plant.name] = run_controller(made, machine, task, course, seed=seed, duration=seconds)
            done += 1
    scores = {name: {plant: run.score for plant, run in runs.items()} for name, runs in results.items()}
    few = f"{seconds:g} s of {course.name} are few holds; the printed numbers are of 450"
    return ControlScores(
        bench,
        course.name,
        stand.unit,
        seconds,
        {name: {p: s for p, s in one.items() if p not in VARIED} for name, one in scores.items()},
        {name: {p: s for p, s in one.items() if p in VARIED} for name, one in scores.items()},
        {name: _median_run(runs) for name, runs in results.items()},
        collect(Caution(few, "duration") if course.hold and seconds < 10 * HOLD else None, *said),
    )


def _median_run(runs: Mapping[str, ControlRun]) -> ControlRun:
    new = [run for plant, run in runs.items() if plant not in VARIED] or [runs["nominal"]]
    return sorted(new, key=lambda run: run.score.tracking)[len(new) // 2]


def _reference(stand: ControlBench, name: str | None) -> Reference:
    name = stand.reference if name is None else name
    fitting = [one.name for one in REFERENCES.values() if one.unit == stand.unit]
    if name not in REFERENCES:
        raise InputError("reference", name, known=REFERENCES)
    if name not in fitting:
        raise InputError("reference", name, f"must be one of {', '.join(fitting)}, which {stand.name} can follow")
    return REFERENCES[name]


def _makers(controller: Any) -> dict[str, Callable[[ControlTask], Controller]]:
    """What makes each controller, by its name."""
    several = controller if isinstance(controller, list | tuple) else [controller]
    split = [part for one in several for part in (map(str.strip, one.split(",")) if isinstance(one, str) else [one])]
    makers: dict[str, Callable[[ControlTask], Controller]] = {}
    for one in split:
        name = one if isinstance(one, str) else getattr(one, "__name__", repr(one))
        each_once("controller", [*makers, name])
        if callable(one):
            makers[name] = one
        elif is_reference(name):
            named_by_person(name)
            makers[name] = load_reference(name, field="controller")
        elif name in CONTROLLERS:
            makers[name] = CONTROLLERS[name]
        else:
            raise InputError("controller", name, known=CONTROLLERS)
    if not makers:
        raise InputError("controller", None, f"must be one name or more of {', '.join(CONTROLLERS)}")
    return makers
