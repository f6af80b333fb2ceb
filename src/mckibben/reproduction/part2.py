"""Part II of the paper: accumulators, tube and its models, and power of the valves."""

from __future__ import annotations

import functools
import math

from ..analysis.characteristics import circle_area
from ..components import Environment
from ..pneumatics import AIR
from ..pneumatics.tubes.inertial import inertance
from ..specimens import specimen
from ..studies.tube_models import ACCUMULATORS, DIAMETER, LARGE, LENGTH, SMALL, TubeModelResult, capacity
from ..studies.tube_study import PAPERS, QUICK_SEEDS, QUICK_THERMALS, TubeStudy, tube_study
from .rows import reproduces

SYNTHETIC = "seed 1 and wall heat of `mckibben study tube`, which has the rest"


def capacitance(volume: float) -> float:
    """Mass per pressure of an isothermal vessel, V/(R T) [kg/Pa] (eq. 24); volume [m^3]."""
    return float(AIR.mass(1.0, volume, Environment.of_the_papers().temperature))


def tube_inertance() -> float:
    """Inertance l/A of the tube [1/m], which is Pa s2/kg."""
    return float(inertance(length=LENGTH, area=circle_area(DIAMETER)))


@functools.cache
def tube_fits() -> TubeStudy:
    """Fit the paper's three models to synthetic records, since its pressures are not published."""
    return tube_study(seeds=QUICK_SEEDS, thermals=QUICK_THERMALS, keys=PAPERS)


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
