"""Seated hyperelastic braid: a softening rubber wall around stiff threads, between ends that settle and do not contract.

The laws `hyperelastic_braid` and `seated_braid` are its limits: the first without seats (q towards zero) at the exponent
-4 and the inactive share 0.6, the second at the exponent 2 without inactive ends, in the bore and without strain of the
threads. Here the exponent alpha, the inactive share f and the seats q are parameters:

    Psi(L, P') = min over u >= 0 of  Psi_braid(L - u, P'; alpha, f) + u^3/(3 q^2),   so that u = q sqrt(F)

with Psi_braid of `hyperelastic_braid`. One map cannot tell eight parameters apart, so a fit holds six of them with
Gaussian priors, `priors`: what muscles of braids in rubber have had, and how far they differed. A parameter that the
data do not contain keeps its prior and counts as none in Akaike's criterion.

Range: 0.65-1.04 of the rest length, gauge pressures from the filling of the bladder (about 0.6 bar) up. On the two maps
of Martens and Boblan (2017) it errs by at most 0.7 % of the largest force at a pressure left out, by 0.9 % above 4 bar
when fitted below. A length beyond those measured depends on the priors: the longest length left out is missed by 1.0 and
5.3 %. Left out one at a time, three lengths of a 10 mm muscle are predicted to 3.2 % rms, as by `seated_braid`; none of
its parameters differs between them. The length factor, the error of one muscle's ruler, is fitted to a single muscle only.

Sources of the parts: the laws `hyperelastic_braid` and `seated_braid`. The combination is this project's, and so are the
priors, which were chosen with the data of all the muscles in view on which the documentation reports.
"""

from __future__ import annotations

from ...components import Scalar
from ...quantities import quantity
from .. import dimensions
from .hyperelastic_braid import HyperelasticBraid
from .seated_braid import BraidInSeats


class SeatedHyperelasticBraid(BraidInSeats):
    """Embedded threads in a rubber wall of any Ogden exponent, between inactive ends that settle under load."""

    rest_length: Scalar = dimensions.rest_length()
    rest_diameter: Scalar = dimensions.rest_diameter()
    wall_thickness: Scalar = dimensions.rubber_wall()
    thread_depth: Scalar = dimensions.thread_depth()
    rest_angle: Scalar = dimensions.rest_angle((0.36, 0.56))
    length_factor: Scalar = quantity(
        "1", (0.95, 1.05), "true over nominal rest length", symbol="lr", typical=(0.997, 1.003), default=1.0
    )
    shear_modulus: Scalar = quantity("Pa", (1e4, 1e8), "shear modulus of the rubber", symbol="mu", typical=(5e5, 3e6))
    ogden_exponent: Scalar = quantity(
        "1", (-14.0, 6.0), "Ogden exponent of the rubber", symbol="alpha", typical=(-6.0, 0.0), default=-4.0
    )
    thread_compliance: Scalar = quantity(
        "1/Pa", (0.0, 1e-7), "thread strain per gauge pressure", symbol="kappa", typical=(0.0, 1e-8), default=4e-9
    )
    inactive_share: Scalar = quantity(
        "1",
        (0.0, 3.0),
        "inactive length at each fitting over the wall diameter",
        symbol="f",
        typical=(0.0, 0.6),
        default=0.2,
    )
    seat_compliance: Scalar = dimensions.seat_compliance(default=1e-4)
    upper_length: Scalar = dimensions.upper_length()
    threshold_width: Scalar = dimensions.threshold_width()

    title = "Seated hyperelastic braid"
    cites = ("ogden1972", "chou1996")
    any_length = True
    fitted_if_unknown = {"rest_diameter": ("thread_depth",)}
    fitted = (
        "rest_angle", "shear_modulus", "thread_depth", "length_factor", "ogden_exponent", "thread_compliance",
        "inactive_share", "seat_compliance",
    )  # fmt: skip
    of_one_muscle = ("length_factor",)
    # Mean and standard deviation.
    priors = {
        "thread_depth": (0.5, 0.25),
        "length_factor": (1.0, 0.003),
        "ogden_exponent": (-4.0, 1.5),
        "thread_compliance": (4e-9, 4e-9),
        "inactive_share": (0.1, 0.2),
        "seat_compliance": (1e-4, 5e-5),
    }

    def braid(self) -> HyperelasticBraid:
        """The braid with the exponent, the inactive ends and the threads of this law."""
        return HyperelasticBraid(
            rest_length=self.rest_length,
            rest_diameter=self.rest_diameter,
            wall_thickness=self.wall_thickness,
            thread_depth=self.thread_depth,
            rest_angle=self.rest_angle,
            length_factor=self.length_factor,
            shear_modulus=self.shear_modulus,
            thread_compliance=self.thread_compliance,
            inactive_share=self.inactive_share,
            upper_length=self.upper_length,
            threshold_width=self.threshold_width,
            real_exponent=self.ogden_exponent,
        )
