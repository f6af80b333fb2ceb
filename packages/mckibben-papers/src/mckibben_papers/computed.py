"""Parts I and II of the papers: static numbers and Table 1; accumulators, tube and its models, and power of the valves.

All are computed from laws, never from printed values.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from mckibben.analysis import characteristics
from mckibben.components import Environment
from mckibben.muscles import braid
from mckibben.muscles.biological import BiologicalMuscle
from mckibben.muscles.build import law_from_specimen
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws.ideal import Ideal
from mckibben.muscles.laws.linear_threshold import LinearThreshold
from mckibben.pneumatics import AIR
from mckibben.pneumatics.tubes import inertance
from mckibben.specimens import specimen
from mckibben.studies.tube_models import ACCUMULATORS, DIAMETER, LARGE, LENGTH, SMALL, TubeModelResult, capacity
from mckibben.studies.tube_study import PAPERS, QUICK_THERMALS, TubeStudy, tube_study

from .rows import reproduces

PRESSURE = 5e5  # the paper's characteristic gauge pressure [Pa]
LENGTHS = (0.10, 0.11, 0.12, 0.13, 0.14)  # where the paper calls Kg approximately constant [m]
# Eq. 13 as fitted to ten sampled points: what the paper derives its other numbers from [m, Pa, m, N].
KG, PA, LMIN, FA = 0.466e-2, 0.062e5, 9.91e-2, -16.0


@functools.cache
def _nylon() -> LinearThreshold:
    law = law_from_specimen(specimen("nylon"))
    assert isinstance(law, LinearThreshold)
    return law


def line(kg: float, pa: float, lmin: float, fa: float) -> LinearThreshold:
    """Nylon muscle with other coefficients of eq. 13 [m, Pa, m, N]."""
    stiffness = fa / (lmin - float(_nylon().rest_length))
    return _nylon().replace(
        stiffness_per_pressure=kg,
        shortest_length=lmin,
        passive_stiffness=stiffness,
        threshold_pressure=pa + stiffness / kg,
    )


@functools.cache
def table1(name: str) -> characteristics.StaticCharacteristics:
    """Compute the column of Table 1 for one of the three muscles, from its law and its measured diameter."""
    spec = specimen(name)
    return characteristics.static_characteristics(
        law_from_specimen(spec),
        pressure=PRESSURE,
        rest_length=spec.property_si("rest_length", "m"),
        upper_length=spec.property_si("upper_length", "m"),
        section_area=characteristics.circle_area(spec.property_si("diameter_shortened", "m")),
    )


@reproduces("static.zero_force_angle", "rad")
def zero_force_angle() -> float:
    """Braid angle at which the ideal muscle is free."""
    law = law_from_specimen(specimen("nylon"), "ideal")
    assert isinstance(law, Ideal)
    return float(braid.angle(law.free_length(PRESSURE), thread_length=law.thread_length))


def kg(law: TensionLaw) -> float:
    """Kg of a law [m]."""
    return characteristics.stiffness_per_pressure(law, lengths=LENGTHS, pressure=PRESSURE)


reproduces("static.stiffness_per_pressure", "m")(lambda: kg(law_from_specimen(specimen("nylon"), "thick_wall")))


@reproduces("static.threshold_pressure", "Pa", "from eq. 13 and L0, as the paper does")
def threshold_pressure() -> float:
    """Pth = Pa + Kp/Kg."""
    return PA + passive_stiffness() / KG


@reproduces("static.passive_stiffness", "N/m", "from eq. 13 and L0, as the paper does")
def passive_stiffness() -> float:
    """Kp = Fa/(Lmin - L0)."""
    return FA / (LMIN - float(_nylon().rest_length))


def stiffness(law: LinearThreshold) -> float:
    """Stiffness of the nylon muscle in the middle of its range [N/m]."""
    return float(law.stiffness(0.13, PRESSURE))


def work_per_cycle(law: LinearThreshold) -> float:
    """Work from 1.1 to 0.75 L0 over L0 [N]; none below the free length, where the muscle is slack."""
    rest = float(law.rest_length)
    shortest = float(np.maximum(0.75 * rest, law.free_length(PRESSURE)))
    return characteristics.work_of_shortening(law, pressure=PRESSURE, longest=1.1 * rest, shortest=shortest) / rest


def max_tension(law: LinearThreshold) -> float:
    """Tension at 1.1 L0 [N]."""
    return float(law.tension(1.1 * law.rest_length, PRESSURE))


def zero_tension_length(law: LinearThreshold) -> float:
    """Length without tension over L0 [1]."""
    return float(law.free_length(PRESSURE) / law.rest_length)


reproduces("static.stiffness_5bar", "N/m")(lambda: stiffness(_nylon()))
reproduces("static.work_per_cycle", "N")(lambda: work_per_cycle(_nylon()))
reproduces("static.stiffness_5bar_per_length", "N")(lambda: stiffness(_nylon()) * float(_nylon().rest_length))
reproduces("static.max_tension", "N")(lambda: max_tension(_nylon()))
reproduces("static.zero_tension_length", "1")(lambda: zero_tension_length(_nylon()))


def _table1_entry(name: str, field: str) -> float:
    value: float = getattr(table1(name), field)
    return value


TABLE1 = (  # end of a row's identifier, field, unit
    ("section_area", "section_area", "m^2"),
    ("dynamic_range", "dynamic_range", "1"),
    ("max_tension", "maximum_tension", "N"),
    ("stiffness", "stiffness", "N"),
    ("work", "work", "N"),
    ("tension_intensity", "tension_intensity", "N/m^2"),
    ("stiffness_intensity", "stiffness_intensity", "N/m^2"),
    ("work_density", "work_density", "J/m^3"),
)
for _name in ("nylon", "fiberglass", "bridgestone"):
    for _row, _field, _unit in TABLE1:
        reproduces(f"table1.{_name}.{_row}", _unit)(functools.partial(_table1_entry, _name, _field))


INTENSITY = 35e4  # maximum tension intensity that the paper takes from Guyton 1986 [N/m^2]
FASTEST = 20.0  # maximum shortening velocity of fast muscle that it takes from Gordon 1989 [L0/s]


def biological() -> BiologicalMuscle:
    """Muscle of the paper's discussion; its size cancels."""
    return BiologicalMuscle(
        rest_length=0.14, section_area=0.95e-4, maximum_tension_intensity=INTENSITY, maximum_velocity=FASTEST
    )


def _range() -> characteristics.DynamicRange:
    """The part of the active curve whose slope is not negative."""
    return characteristics.dynamic_range(biological().active_curve)


GORDON = "0.126 with Gordon's nodes; the ends rounded to 0.64 and 1.12 first would give 0.1245"
NODES = "0.49 between Gordon's nodes, 0.48 between the rounded ends that are printed"
reproduces("biology.stiffness_intensity", "N/m^2", "with the ends of the range as printed, 0.64 and 1.12")(
    lambda: characteristics.stiffness_intensity(INTENSITY, _range().rounded())
)
reproduces("biology.work_density", "J/m^3", GORDON)(
    lambda: characteristics.work_density(biological().active_curve, INTENSITY)
)
reproduces("biology.dynamic_range", "1", NODES)(lambda: _range().rounded().width)
# A tenth of the largest intensity times the largest velocity.
reproduces("biology.peak_power_density", "W/m^3")(
    lambda: characteristics.peak_power_density(biological(), fraction=0.1)
)


SYNTHETIC = "seed 1 and wall heat of `mckibben study tube`, which has the rest"


def capacitance(volume: float, temperature: float | None = None) -> float:
    """Mass per pressure of an isothermal vessel, V/(R T) [kg/Pa] (eq. 24); volume [m^3], temperature [K], else 300 K."""
    return float(AIR.mass(1.0, volume, temperature or Environment.of_the_papers().temperature))


def tube_inertance() -> float:
    """Inertance l/A of the tube [1/m], which is Pa s2/kg."""
    return float(inertance(length=LENGTH, area=characteristics.circle_area(DIAMETER)))


@functools.cache
def tube_fits() -> TubeStudy:
    """Fit the paper's three models to synthetic records, since its pressures are not published."""
    return tube_study(quick=True, keys=PAPERS)


def _fit(model: str, accumulator: str = LARGE, *, refitted: bool = False) -> TubeModelResult:
    return tube_fits().result(QUICK_THERMALS[0], model, accumulator, refitted=refitted)


def electrical_power(valve: str) -> float:
    """Electrical power of a valve [W]."""
    spec = specimen(valve)
    return spec.property_si("current", "A") * spec.property_si("voltage", "V")


AT_300_K = "at 300 K, which both printed values imply"
LACKS_TEN = "l/A is 1260 1/cm: a factor of ten is missing in print"
HARDLY = f"the data hardly determine it, and it stays near the first guess, the printed value; {SYNTHETIC}"
reproduces("tube.capacitance_10in3", "kg/Pa", AT_300_K)(lambda: capacitance(ACCUMULATORS[LARGE]))
reproduces("tube.capacitance_3in3", "kg/Pa", AT_300_K)(lambda: capacitance(ACCUMULATORS[SMALL]))
reproduces("tube.inertance", "1/m")(tube_inertance)
reproduces("tube.inertance_per_cm", "1/m", LACKS_TEN)(tube_inertance)
# The sign of div(Pv): gas carries cp T into a vessel that keeps cv T of it, the difference is the work of the flow.
reproduces("tube.flow_work_sign", "1")(lambda: -math.copysign(1.0, float(AIR.cp - AIR.cv)))
reproduces("tube.linear_cutoff", "rad/s", SYNTHETIC)(
    lambda: 1.0 / (_fit("linear").value("resistance") * capacity(ACCUMULATORS[LARGE]))
)
reproduces("tube.linear_rms", "Pa", SYNTHETIC)(lambda: _fit("linear").rms)
reproduces("tube.quadratic_rms_10in3", "Pa", SYNTHETIC)(lambda: _fit("quadratic").rms)
# On the small accumulator the paper refits the quadratic model, and keeps the parameters of the inertial one.
reproduces("tube.quadratic_rms_3in3", "Pa", SYNTHETIC)(lambda: _fit("quadratic", SMALL, refitted=True).rms)
reproduces("tube.inertial_rms_10in3", "Pa", SYNTHETIC)(lambda: _fit("inertial").rms)
reproduces("tube.inertial_rms_3in3", "Pa", SYNTHETIC)(lambda: _fit("inertial", SMALL).rms)
reproduces("tube.quadratic_lead", "s", SYNTHETIC)(lambda: _fit("quadratic").lead)
reproduces("tube.R1", "Pa*s/m", HARDLY)(lambda: _fit("quadratic").value("viscous"))
reproduces("tube.R2", "Pa*s^2/m^2", SYNTHETIC)(lambda: _fit("quadratic").value("turbulent"))
reproduces("valve.festo_power", "W")(lambda: electrical_power("MPP-3-1-8"))
reproduces("valve.sarcos_power", "W")(lambda: electrical_power("C100P-80"))
