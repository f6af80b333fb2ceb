"""Inputs that the papers do not print, with their bounds, and the rows that tell them: one network for each experiment.

A bound is what the thing can be: geometry, the range that a specimen or a rig states, or a decade about what is usual.
Slopes of what is read from recordings are differences between recordings of machines that differ in one input.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any

from mckibben.analysis.characteristics import circle_area, static_characteristics, stiffness_per_pressure
from mckibben.analysis.energy import EnergyCycle, best_pressure, cycle_muscle, energy_cycle
from mckibben.muscles.build import law_from_specimen
from mckibben.quantities import to_si
from mckibben.specimens import specimen
from mckibben.studies.tube_models import ACCUMULATORS, LARGE, SMALL

from . import computed, measured, part4
from .inference import Inputs, Model, Network, predict
from .inference import make_parameter as of
from .rows import printed

THREAD, STRETCHED, FRICTION = "the thread length", "the length L2", "the friction"
KG, LMIN, DIAMETER = "Kg", "Lmin", "the diameter"
DEAD, WIDTH, BAND = "the valve's dead time", "the width of the threshold", "the regulator's band"
FILL, VENT = "the flow that fills", "the flow that vents"
GAIN, MOTOR, WINDOW = "the force loop's integral gain", "the motor's friction", "the velocity's window"
FLOW, PLAY, LEFT = "the regulator's flow", "the regulator's play", "the share that WD-40 leaves"
ROOM = "the temperature"
OF_ENERGY = "friction of Part IV"  # tells what the cell read, beside the rows of loops
REST = specimen("nylon").property_si("rest_length", "m")
CYCLES = ("maximal", "isotonic", "valve")


# ---- eq. 13 and Table 1


def _line(v: Inputs) -> Any:
    return computed.line(v[KG] * 1e-2, to_si(v["Pa"], "bar", "Pa", field="Pa"), v[LMIN] * 1e-2, v["Fa"])


def _of_line(what: Callable[[Any], float]) -> Model:
    return lambda v: what(_line(v))


def line() -> Network:
    """The four coefficients of eq. 13: each is printed, and what follows from them is."""
    fitted = {
        "Kg": "stiffness_per_pressure",
        "Pa": "offset_pressure",
        "Lmin": "shortest_length",
        "Fa": "offset_tension",
    }
    units = {"Kg": ("cm", "m", 0.0005), "Pa": ("bar", "Pa", 0.0005), "Lmin": ("cm", "m", 0.005), "Fa": ("N", "N", 0.05)}
    stated = {"Kg": computed.KG, "Pa": computed.PA, "Lmin": computed.LMIN, "Fa": computed.FA}

    def coefficient(name: str) -> Model:
        shown, si, _ = units[name]
        return lambda v: to_si(v[name], shown, si, field=name)

    def reading(name: str) -> Callable[[], float]:
        return lambda: getattr(measured.fits().corrected, fitted[name]).value / stated[name]

    return Network(
        {
            KG: of(0.466, 0.4, 0.55, "cm"),
            "Pa": of(0.062, -0.2, 0.5, "bar"),
            LMIN: of(9.91, 9.0, 10.5, "cm"),
            "Fa": of(-16.0, -40.0, 0.0, "N"),
        },
        {f"static.fit_{n}": coefficient(n) for n in units}
        | {
            "static.threshold_pressure": _of_line(lambda law: float(law.threshold_pressure)),
            "static.passive_stiffness": _of_line(lambda law: float(law.passive_stiffness)),
            "static.stiffness_5bar_per_length": _of_line(lambda law: computed.stiffness(law) * float(law.rest_length)),
            "static.max_tension": _of_line(computed.max_tension),
            "static.work_per_cycle": _of_line(computed.work_per_cycle),
            "static.zero_tension_length": _of_line(computed.zero_tension_length),
        },
        targets={
            f"static.fit_{n}": functools.partial(
                lambda n, half, to: (stated[n], to_si(half, *to, field=n)), n, half, to[:2]
            )
            for n, (*to, half) in units.items()
        },
        through={f"static.fit_{n}": reading(n) for n in units},
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
            frozenset((f"table1.{name}.{one}", f"table1.{name}.{other}"))
            for one, other in (
                ("max_tension", "tension_intensity"),
                ("stiffness", "stiffness_intensity"),
                ("work", "work_density"),
            )
        ),
    )


# ---- Part II and Part IV


def temperature() -> Network:
    """The temperature of both accumulators."""
    sizes = {"tube.capacitance_10in3": ACCUMULATORS[LARGE], "tube.capacitance_3in3": ACCUMULATORS[SMALL]}

    def model(size: float) -> Model:
        return lambda v: computed.capacitance(size, v[ROOM])

    return Network({ROOM: of(300.0, 273.0, 323.0, "K")}, {name: model(size) for name, size in sizes.items()})


def energy() -> Network:
    """Threads, stretched length and friction: the volume at rest follows from the threads, by eq. 9."""
    braid = law_from_specimen(specimen("nylon"), "thick_wall")
    widest = float(braid.thread_length) / (math.pi * float(braid.turns))  # type: ignore[attr-defined]

    @functools.cache
    def threads(length: float) -> Any:
        return braid.replace(thread_length=length * 1e-2, turns=length * 1e-2 / (math.pi * widest))

    @functools.cache
    def muscle(length: float) -> Any:
        rest = float(threads(length).braid_volume(REST, computed.PRESSURE))
        return cycle_muscle(part4.muscle().law.replace(rest_volume=rest), "paper")

    @functools.cache
    def cycle(name: str, accumulator: bool, length: float, stretched: float, friction: float) -> EnergyCycle:
        between = part4.conditions(accumulator=accumulator)
        return energy_cycle(
            muscle(length), name, between._replace(stretched_length=stretched * 1e-2, friction=friction)
        )

    def model(name: str, what: str, accumulator: bool) -> Model:
        return lambda v: float(getattr(cycle(name, accumulator, v[THREAD], v[STRETCHED], v[FRICTION]), what))

    def best(v: Inputs) -> float:
        between = part4.conditions()._replace(stretched_length=v[STRETCHED] * 1e-2, friction=v[FRICTION])
        return float(best_pressure(muscle(v[THREAD]), "maximal", between)[0])

    models: dict[str, Model] = {
        f"energy.{name}.{what}" + "_accumulator" * accumulator: model(name, what, accumulator)
        for name in CYCLES
        for what in ("input", "efficiency")
        for accumulator in (False, True)
        if (name, what, accumulator) != ("maximal", "efficiency", True)  # a misprint tells nothing
    }
    models |= {f"energy.{name}.output": model(name, "output", False) for name in CYCLES[:2]}
    models |= {
        "energy.maximal.best_pressure": best,
        "energy.maximal.output_below_W12": lambda v: part4.largest_share(
            muscle(v[THREAD]), part4.conditions()._replace(stretched_length=v[STRETCHED] * 1e-2, friction=v[FRICTION])
        )[0],
        "static.stiffness_per_pressure": lambda v: stiffness_per_pressure(
            threads(v[THREAD]), lengths=computed.LENGTHS, pressure=computed.PRESSURE
        ),
        "friction.nylon": lambda v: v[FRICTION],
    }
    return Network(
        {
            THREAD: of(16.42, 15.6, 18.0, "cm"),  # longer than the muscle at its longest
            STRETCHED: of(15.5, 15.4, 15.6, "cm"),  # at least 1.1 L0, and shorter than its threads
            FRICTION: of(2.5, 0.5, 5.0, "N"),
        },
        models,
        silent=frozenset(("energy.maximal.best_pressure", "energy.maximal.output_below_W12")),
        rounds=1,  # nothing moves by more than a thousandth
        targets={"friction.nylon": lambda: (printed("friction.nylon"), 0.05)},
    )


# ---- loops


def loops() -> Network:
    """The friction of the nylon muscle, which loops show through cell and gas, and which Part IV takes off the output."""

    def model(what: str) -> Model:
        return lambda v: float(getattr(measured.rubbed_loop("nylon", v[FRICTION]), what))

    def of_energy() -> tuple[float, float]:
        told = predict(network("energy.maximal.output"), "friction.nylon")
        return told.value, told.spread

    return Network(
        {FRICTION: of(2.65, 0.5, 5.0, "N")},
        {
            "friction.nylon": model("friction"),
            "loop.height": model("height"),
            "loop.width": model("width"),
            OF_ENERGY: model("friction"),
        },
        targets={OF_ENERGY: of_energy},
        step=0.25,
        linear=True,
    )


def alone(muscle: str) -> Network:
    """The friction of another muscle, which nothing else that is printed depends on."""
    model: Model = lambda v: float(measured.rubbed_loop(muscle, v[FRICTION]).friction)  # noqa: E731
    return Network({FRICTION: of(5.0, 1.0, 10.0, "N")}, {f"friction.{muscle}": model}, step=0.25, linear=True)


def lubricant() -> Network:
    """What a lubricant leaves of the friction."""
    models: dict[str, Model] = {"friction.lubricated": lambda v: measured.lubricated_share(v[LEFT])}
    return Network({LEFT: of(measured.OF_OILS, 0.5, 1.0, "1")}, models, step=0.1, linear=True)


def regulator() -> Network:
    """The regulator of the loops, set by hand."""
    at = "plumbing.accumulators.valve"

    def model(v: Inputs) -> float:
        read, true = measured.worst_pressure_variation(())
        if (v[FLOW], v[PLAY]) == (300.0, 0.01):
            return read
        # a count of the sensor hides what an input changes: the true pressure tells it
        changes = (f"{at}.flow_into_the_room", f"{v[FLOW]:.6g} l/min"), (f"{at}.hysteresis", f"{v[PLAY]:.6g} bar")
        return read + measured.worst_pressure_variation(changes)[1] - true

    inputs = {FLOW: of(300.0, 30.0, 1000.0, "l/min", log=True), PLAY: of(0.01, 0.0, 0.1, "bar")}
    return Network(inputs, {"loop.pressure_variation": model}, step=0.5, linear=True)


# ---- Part III


VALVE = "plumbing.direct.valve"


def delays() -> Network:
    """The valve's dead time, and the width of the threshold, by which tension follows the pressure."""

    def model(what: str) -> Model:
        def mean(v: Inputs) -> float:
            changed: dict[str, Any] = {}
            if v[DEAD] != 2.4:
                changed["changes"] = ((f"{VALVE}.dead_time", f"{v[DEAD]:.6g} ms"),)
            if v[WIDTH] != 0.85:
                changed["law"] = (("threshold_width", to_si(v[WIDTH], "bar", "Pa", field=WIDTH)),)
            return measured.mean_time(what, stroke="full", rising=True, **changed)

        return mean

    return Network(
        {DEAD: of(2.4, 0.0, 5.0, "ms"), WIDTH: of(0.85, 0.4, 1.2, "bar")},
        {f"isometric.{what}": model(what) for what in ("valve_delay", "pressure_to_tension", "total_delay")},
        step=0.2,
        linear=True,
    )


def transitions() -> Network:
    """The electro-valve, which fills and vents through edges of its own: two of the four times tell them, two are told."""

    def model(way: str, stroke: str) -> Model:
        def mean(v: Inputs) -> float:
            edges = {"fill": v[FILL], "relief": v[VENT]}
            changes = [(f"{VALVE}.{edge}_flow_into_the_room", f"{flow:.6g} l/min") for edge, flow in edges.items()]
            changes += [(f"{VALVE}.{edge}_flow_pressure", "6.9 bar") for edge in edges]
            changes += [(f"{VALVE}.band", f"{v[BAND]:.6g} bar")]
            return measured.mean_time("transition", stroke=stroke, rising=way == "rise", changes=tuple(changes))

        return mean

    return Network(
        {
            FILL: of(75.0, 30.0, 600.0, "l/min", log=True),  # up to what is printed of the valve without load
            VENT: of(80.0, 30.0, 600.0, "l/min", log=True),
            BAND: of(0.05, 0.05, 0.5, "bar"),
        },
        {f"isometric.{way}_{stroke}": model(way, stroke) for way in ("rise", "fall") for stroke in ("full", "half")},
        together=tuple(
            frozenset(f"isometric.{way}_{stroke}" for way in ("rise", "fall")) for stroke in ("full", "half")
        ),
        step=0.15,
        steps={BAND: 0.2},
        linear=True,
    )


def force_loop() -> Network:
    """Motor and force loop, which let the tension of an isotonic shortening lie above its set-point."""

    def model(case: tuple[str, str]) -> Model:
        def work(v: Inputs) -> float:
            changes = (("control.force.ki", f"{v[GAIN]:.6g} 1/s"), ("motor.coulomb", f"{v[MOTOR]:.6g} N"))
            return measured.power(case, changes=() if (v[GAIN], v[MOTOR]) == (10.0, 1.0) else changes).work

        return work

    return Network(
        {GAIN: of(10.0, 1.0, 100.0, "1/s", log=True), MOTOR: of(1.0, 0.0, 3.0, "N")},
        {"isotonic.work_10N_1Hz": model(measured.LIGHT), "isotonic.work_50N_5Hz": model(measured.FAST)},
        step=0.5,
        linear=True,
    )


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
