"""Inputs that the papers do not print, with their bounds, and the rows that tell them: one network for each experiment.

A bound is what the thing can be: geometry, the range that a specimen or a rig states, or a decade about what is usual.
Slopes of what is read from recordings are differences between recordings of machines that differ in one input.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from mckibben.analysis.characteristics import circle_area, static_characteristics
from mckibben.analysis.energy import Conditions, CycleMuscle, EnergyCycle, best_pressure, cycle_muscle, energy_cycle
from mckibben.muscles.build import law_from_specimen
from mckibben.quantities import to_si
from mckibben.specimens import specimen
from mckibben.studies.tube_models import ACCUMULATORS, LARGE, SMALL

from . import computed, measured, part4
from .inference import Inputs, Model, Network, predict
from .inference import make_parameter as of
from .rows import printed

THREAD, STRETCHED, FRICTION = "the thread length", "the length L2", "the friction"
KG, PA, LMIN, FA, DIAMETER = "Kg", "Pa", "Lmin", "Fa", "the diameter"
DEAD, WIDTH, BAND = "the valve's dead time", "the width of the threshold", "the regulator's band"
FILL, VENT = "the flow that fills", "the flow that vents"
GAIN, MOTOR, WINDOW = "the force loop's integral gain", "the motor's friction", "the velocity's window"
FLOW, PLAY, LEFT = "the regulator's flow", "the regulator's play", "the share that WD-40 leaves"
ROOM = "the temperature"
OF_ENERGY = "friction of Part IV"  # tells what the cell read, beside the rows of loops
VALVE, REGULATOR = "plumbing.direct.valve", "plumbing.accumulators.valve"
PATHS = {  # inputs of the rig: path, unit, and the rig's own number where both edges of the valve are one
    DEAD: (f"{VALVE}.dead_time", "ms", 2.4),
    FILL: (f"{VALVE}.fill_flow_into_the_room", "l/min", 85.0),
    VENT: (f"{VALVE}.relief_flow_into_the_room", "l/min", 85.0),
    BAND: (f"{VALVE}.band", "bar", 0.05),
    GAIN: ("control.force.ki", "1/s", 10.0),
    MOTOR: ("motor.coulomb", "N", 1.0),
    FLOW: (f"{REGULATOR}.flow_into_the_room", "l/min", 300.0),
    PLAY: (f"{REGULATOR}.hysteresis", "bar", 0.01),
}


def _changes(v: Inputs) -> tuple[tuple[str, str], ...]:
    """Changes of the rig by its paths, to inputs that are not its own."""
    on_rig = [(PATHS[name], value) for name, value in v.items() if name in PATHS]
    return tuple((path, f"{value:.6g} {unit}") for (path, unit, own), value in on_rig if value != own)


# ---- eq. 13 and Table 1


def line() -> Network:
    """The four coefficients of eq. 13: each is printed, and what follows from them is."""
    # name: value [SI], half a unit of its last digit, the unit in print in SI, and its name in the fit to ten points
    known = {
        KG: (computed.KG, 5e-6, 1e-2, "stiffness_per_pressure"),
        PA: (computed.PA, 50.0, to_si(1.0, "bar", "Pa", field=PA), "offset_pressure"),
        LMIN: (computed.LMIN, 5e-5, 1e-2, "shortest_length"),
        FA: (computed.FA, 0.05, 1.0, "offset_tension"),
    }

    def of_line(what: Callable[[Any], Any]) -> Model:
        return lambda v: float(what(computed.line(*(v[name] * known[name][2] for name in known))))

    def reading(name: str) -> float:
        return float(getattr(measured.fits().corrected, known[name][3]).value / known[name][0])

    def coefficient(name: str) -> Model:
        return lambda v: v[name] * known[name][2]

    return Network(
        {
            KG: of(0.466, 0.4, 0.55, "cm"),
            PA: of(0.062, -0.2, 0.5, "bar"),
            LMIN: of(9.91, 9.0, 10.5, "cm"),
            FA: of(-16.0, -40.0, 0.0, "N"),
        },
        {f"static.fit_{name}": coefficient(name) for name in known}
        | {
            "static.threshold_pressure": of_line(lambda law: law.threshold_pressure),
            "static.passive_stiffness": of_line(lambda law: law.passive_stiffness),
            "static.stiffness_5bar_per_length": of_line(lambda law: computed.stiffness(law) * law.rest_length),
            "static.max_tension": of_line(computed.max_tension),
            "static.work_per_cycle": of_line(computed.work_per_cycle),
            "static.zero_tension_length": of_line(computed.zero_tension_length),
        },
        targets={f"static.fit_{name}": functools.partial(lambda name: known[name][:2], name) for name in known},
        through={f"static.fit_{name}": functools.partial(reading, name) for name in known},
    )


def column(name: str) -> Network:
    """Line and diameter of a muscle of Table 1."""
    spec = specimen(name)
    law, rest, upper = law_from_specimen(spec), *(spec.property_si(f"{n}_length", "m") for n in ("rest", "upper"))
    size = spec.property_si("diameter_shortened", "m") * 1e2
    slope, shortest = float(law.stiffness_per_pressure) * 1e2, float(law.shortest_length) * 1e2  # type: ignore[attr-defined]

    @functools.cache
    def numbers(slope: float, shortest: float, diameter: float) -> Any:
        changed = law.replace(stiffness_per_pressure=slope * 1e-2, shortest_length=shortest * 1e-2)
        area = circle_area(diameter * 1e-2)
        return static_characteristics(
            changed, pressure=computed.PRESSURE, rest_length=rest, upper_length=upper, section_area=area
        )

    def model(what: str) -> Model:
        return lambda v: float(getattr(numbers(v[KG], v[LMIN], v[DIAMETER]), what))

    return Network(
        {
            KG: of(slope, 0.3 * slope, 3.0 * slope, "cm"),
            LMIN: of(shortest, 0.7 * shortest, 1.3 * shortest, "cm"),
            DIAMETER: of(size, size - 0.05, size + 0.05, "cm"),  # as it is rounded
        },
        {f"table1.{name}.{row}": model(what) for row, what, _ in computed.TABLE1},
        together=tuple(  # the same over the section
            frozenset(f"table1.{name}.{row}" for row in pair.split())
            for pair in ("max_tension tension_intensity", "stiffness stiffness_intensity", "work work_density")
        ),
    )


# ---- Part II and Part IV


def temperature() -> Network:
    """The temperature of both accumulators."""
    sizes = {"tube.capacitance_10in3": ACCUMULATORS[LARGE], "tube.capacitance_3in3": ACCUMULATORS[SMALL]}
    models = {
        name: functools.partial(lambda size, v: computed.capacitance(size, v[ROOM]), s) for name, s in sizes.items()
    }
    return Network({ROOM: of(300.0, 273.0, 323.0, "K")}, models)


def energy() -> Network:
    """Threads, stretched length and friction: the volume at rest follows from the threads, by eq. 9."""
    braid, line = law_from_specimen(specimen("nylon"), "thick_wall"), part4.muscle().law
    per_turn = float(braid.thread_length) / float(braid.turns)  # type: ignore[attr-defined]

    def threads(v: Inputs) -> Any:
        return braid.replace(thread_length=v[THREAD] * 1e-2, turns=v[THREAD] * 1e-2 / per_turn)

    def state(v: Inputs, *, accumulator: bool = False) -> tuple[CycleMuscle, str, Conditions]:
        rest = float(threads(v).braid_volume(line.rest_length, computed.PRESSURE))  # type: ignore[attr-defined]
        between = part4.conditions(accumulator=accumulator)
        changed = between._replace(stretched_length=v[STRETCHED] * 1e-2, friction=v[FRICTION])
        return cycle_muscle(line.replace(rest_volume=rest), "paper"), "maximal", changed

    @functools.cache
    def cycle(name: str, accumulator: bool, *values: float) -> EnergyCycle:
        muscle, _, between = state(dict(zip(inputs, values, strict=True)), accumulator=accumulator)
        return energy_cycle(muscle, name, between)

    def model(name: str, what: str, accumulator: bool = False) -> Model:
        return lambda v: float(getattr(cycle(name, accumulator, *v.values()), what))

    inputs = {
        THREAD: of(16.42, 15.6, 18.0, "cm"),  # longer than the muscle at its longest
        STRETCHED: of(15.5, 15.4, 15.6, "cm"),  # at least 1.1 L0, and shorter than its threads
        FRICTION: of(2.5, 0.5, 5.0, "N"),
    }
    models: dict[str, Model] = {
        f"energy.{name}.{what}" + "_accumulator" * accumulator: model(name, what, accumulator)
        for name in ("maximal", "isotonic", "valve")
        for what in ("input", "efficiency")
        for accumulator in (False, True)
        if (name, what, accumulator) != ("maximal", "efficiency", True)  # a misprint tells nothing
    }
    models |= {f"energy.{name}.output": model(name, "output") for name in ("maximal", "isotonic")}
    silent: dict[str, Model] = {
        "energy.maximal.best_pressure": lambda v: best_pressure(*state(v))[0],
        "energy.maximal.output_below_W12": lambda v: part4.largest_share(*state(v)[::2])[0],
    }
    models |= {
        "friction.nylon": lambda v: v[FRICTION],
        "static.stiffness_per_pressure": lambda v: computed.kg(threads(v)),
    }
    return Network(
        inputs,
        models | silent,
        silent=frozenset(silent),
        rounds=1,  # nothing moves by more than a thousandth
        targets={"friction.nylon": lambda: (printed("friction.nylon"), 0.05)},
    )


# ---- loops


def loops() -> Network:
    """The friction of the nylon muscle, which loops show through cell and gas, and which Part IV takes off the output."""
    of_row = {"friction.nylon": "friction", "loop.height": "height", "loop.width": "width", OF_ENERGY: "friction"}

    def model(what: str) -> Model:
        return lambda v: float(getattr(measured.rubbed_loop("nylon", v[FRICTION]), what))

    def of_energy() -> tuple[float, float]:
        told = predict(network("energy.maximal.output"), "friction.nylon")
        return told.value, told.spread

    inputs, models = {FRICTION: of(2.65, 0.5, 5.0, "N")}, {row: model(what) for row, what in of_row.items()}
    return Network(inputs, models, targets={OF_ENERGY: of_energy}, step=0.25, linear=True)


def alone(muscle: str) -> Network:
    """The friction of another muscle, which nothing else that is printed depends on."""
    model: Model = lambda v: float(measured.rubbed_loop(muscle, v[FRICTION]).friction)  # noqa: E731
    return Network({FRICTION: of(5.0, 1.0, 10.0, "N")}, {f"friction.{muscle}": model}, step=0.25, linear=True)


def lubricant() -> Network:
    """What a lubricant leaves of the friction."""
    models: dict[str, Model] = {"friction.lubricated": lambda v: measured.lubricated_share(v[LEFT])}
    return Network({LEFT: of(measured.OF_OILS, 0.5, 1.0, "1")}, models, step=0.1, linear=True)


def regulator() -> Network:
    """The regulator of the loops, set by hand; counts of the sensor hide what it changes, the true pressure tells it."""

    def model(v: Inputs) -> float:
        (read, true), changed = measured.worst_pressure_variation(), measured.worst_pressure_variation(_changes(v))
        return read + changed[1] - true

    inputs = {FLOW: of(300.0, 30.0, 1000.0, "l/min", log=True), PLAY: of(0.01, 0.0, 0.1, "bar")}
    return Network(inputs, {"loop.pressure_variation": model}, step=0.5, linear=True)


# ---- Part III


def delays() -> Network:
    """The valve's dead time, and the width of the threshold, by which tension follows the pressure."""

    def model(what: str) -> Model:
        def mean(v: Inputs) -> float:
            width = to_si(v[WIDTH], "bar", "Pa", field=WIDTH)
            law = () if v[WIDTH] == 0.85 else (("threshold_width", width),)
            return measured.mean_time(what, stroke="full", rising=True, changes=_changes(v), law=law)

        return mean

    models = {f"isometric.{what}": model(what) for what in ("valve_delay", "pressure_to_tension", "total_delay")}
    return Network({DEAD: of(2.4, 0.0, 5.0, "ms"), WIDTH: of(0.85, 0.4, 1.2, "bar")}, models, step=0.2, linear=True)


def transitions() -> Network:
    """The electro-valve, which fills and vents through edges of its own: two of the four times tell them, two are told."""

    def model(way: str, stroke: str) -> Model:
        rising = way == "rise"
        return lambda v: measured.mean_time("transition", stroke=stroke, rising=rising, changes=_changes(v))

    pairs = {stroke: [(f"isometric.{way}_{stroke}", way) for way in ("rise", "fall")] for stroke in ("full", "half")}
    return Network(
        {
            FILL: of(75.0, 30.0, 600.0, "l/min", log=True),  # up to what is printed of the valve without load
            VENT: of(80.0, 30.0, 600.0, "l/min", log=True),
            BAND: of(0.05, 0.05, 0.5, "bar"),
        },
        {row: model(way, stroke) for stroke, pair in pairs.items() for row, way in pair},
        together=tuple(frozenset(row for row, _ in pair) for pair in pairs.values()),
        step=0.15,
        steps={BAND: 0.2},
        linear=True,
    )


def force_loop() -> Network:
    """Motor and force loop, which let the tension of an isotonic shortening lie above its set-point."""
    cases = {"isotonic.work_10N_1Hz": measured.LIGHT, "isotonic.work_50N_5Hz": measured.FAST}
    inputs = {GAIN: of(10.0, 1.0, 100.0, "1/s", log=True), MOTOR: of(1.0, 0.0, 3.0, "N")}

    def model(case: tuple[str, str]) -> Model:
        return lambda v: measured.power(case, changes=_changes(v)).work

    return Network(inputs, {row: model(case) for row, case in cases.items()}, step=0.5, linear=True)


def window() -> Network:
    """The time over which the velocity of a peak power is taken."""

    def model(case: tuple[str, str]) -> Model:
        return lambda v: measured.power(case, window=v[WINDOW] * 1e-3).peak_power

    return Network(
        {WINDOW: of(50.0, 4.0, 250.0, "ms", log=True)},
        {"isotonic.peak_power_10N_1Hz": model(measured.LIGHT), "isotonic.peak_power_50N_5Hz": model(measured.FAST)},
        step=0.1,
        rounds=6,
    )


_NETWORKS: dict[str, Callable[[], Network]] = {  # by how a row begins; the first that fits
    "static.stiffness_per_pressure": energy,
    "static.": line,
    "energy.": energy,
    "tube.capacitance": temperature,
    "isometric.rise": transitions,
    "isometric.fall": transitions,
    "isometric.": delays,
    "isotonic.work": force_loop,
    "isotonic.peak_power": window,
    "friction.nylon": loops,
    "friction.lubricated": lubricant,
    "loop.pressure_variation": regulator,
    "loop.": loops,
}
for _name in ("fiberglass", "bridgestone"):
    _NETWORKS[f"table1.{_name}."] = functools.partial(column, _name)
    _NETWORKS[f"friction.{_name}"] = functools.partial(alone, _name)
_made: dict[Any, Network] = {}


def network(row: str) -> Network:
    """The network that predicts a row; made at the first question, so that all its rows share what was computed."""
    make = next(make for begins, make in _NETWORKS.items() if row.startswith(begins))
    if make not in _made:
        _made[make] = make()
    return _made[make]
