"""Part II of the paper: what its accumulators and its tube are, and what its valves take."""

from __future__ import annotations

from ..analysis.characteristics import circle_area
from ..components import Environment
from ..pneumatics import AIR
from ..pneumatics.tubes.inertial import inertance
from ..specimens import specimen
from .rows import reproduces

TUBE_LENGTH, TUBE_DIAMETER = 1.0, 3.175e-3  # 100 cm of 1/8 in tube [m]
ACCUMULATORS = {"10in3": 164e-6, "3in3": 49e-6}  # [m^3]


def capacitance(volume: float) -> float:
    """Mass per pressure of an isothermal vessel, V/(R T) [kg/Pa] (eq. 24); volume [m^3]."""
    return float(AIR.mass(1.0, volume, Environment.of_the_papers().temperature))


@reproduces("tube.capacitance_10in3", "kg/Pa", "at 300 K, which both printed values imply")
def capacitance_10in3() -> float:
    """The large accumulator."""
    return capacitance(ACCUMULATORS["10in3"])


@reproduces("tube.capacitance_3in3", "kg/Pa", "at 300 K, which both printed values imply")
def capacitance_3in3() -> float:
    """The small accumulator."""
    return capacitance(ACCUMULATORS["3in3"])


@reproduces("tube.inertance", "1/m")
def tube_inertance() -> float:
    """l/A of the tube; 1/m is Pa s2/kg."""
    return float(inertance(length=TUBE_LENGTH, area=circle_area(TUBE_DIAMETER)))


@reproduces("tube.inertance_per_cm", "1/m", "l/A is 1260 1/cm: a factor of ten is missing in print")
def tube_inertance_per_cm() -> float:
    """The same number in 1/cm."""
    return tube_inertance()


def electrical_power(valve: str) -> float:
    """Power that a valve takes [W]."""
    spec = specimen(valve)
    return spec.property_si("current", "A") * spec.property_si("voltage", "V")


@reproduces("valve.festo_power", "W")
def festo_power() -> float:
    """Festo MPP-3-1/8."""
    return electrical_power("MPP-3-1-8")


@reproduces("valve.sarcos_power", "W")
def sarcos_power() -> float:
    """SARCOS C100P/80."""
    return electrical_power("C100P-80")
