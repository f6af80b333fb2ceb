"""Orifices, valves' restrictions and leaks by ISO 6358: a sonic conductance C and a critical pressure ratio b.

    w = C rho0 p1 sqrt(R0 T0/(R T1)) psi(p2/p1)
    psi = 1 where p2/p1 <= b (choked), else sqrt(1 - ((p2/p1 - b)/(1 - b))^2)

with p1, T1 upstream and rho0, R0, T0 of the reference atmosphere, which is air; C and b are those of air, another gas of
constant R flows by its density. Both directions; near equal pressures, over a difference
``linear_band``, the root is replaced by a parabola that meets it with value and slope, so that the slope stays finite: this
is what a laminar start looks like, and what an integrator needs. Range: 0 < b < 1, any pair of absolute pressures; for
b = 0.528 it agrees with the isentropic nozzle within 0.35 % outside the linear zone. Source: ISO 6358-1:2013.

A catalogue's number becomes a conductance here and nowhere else: `Orifice.from_flow`, `from_nominal_flow`, `from_kv`,
`from_cv` and `of_hole`; docs/explanation/catalogue-flows.md explains each.
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, TypedDict, Unpack

from .._jax import Tree, jnp
from ..components import Scalar
from ..components.flow import Gases, GasState, TwoPort
from ..components.gas import AIR, REFERENCE_DENSITY, REFERENCE_PRESSURE, REFERENCE_TEMPERATURE
from ..components.programs import evaluated
from ..errors import InputError
from ..quantities import quantity

# Where a standard nominal flow is measured: 6 and 5 bar above the reference atmosphere, as absolute pressures [Pa].
NOMINAL_INLET, NOMINAL_OUTLET = 6e5 + REFERENCE_PRESSURE, 5e5 + REFERENCE_PRESSURE
# Kv and Cv are flows of water at a pressure drop (IEC 60534-1; VDI/VDE 2173).
WATER_DENSITY = 1000.0  # [kg/m^3]
KV_DROP, CV_DROP = 1e5, 6894.757293168361  # 1 bar; 1 psi [Pa]
GALLON_PER_MINUTE = 3.785411784e-3 / 60.0  # US gallon [m^3/s]


def conductance_flow(
    p1: Scalar, cold1: Scalar, p2: Scalar, *, conductance: Scalar, critical_ratio: Scalar, linear_band: Scalar
) -> Scalar:
    """Mass flow from upstream to downstream [kg/s], zero or positive; p1 >= p2.

    Args:
        p1: upstream absolute pressure [Pa].
        cold1: density of the gas upstream over that of reference air at the same pressure, T0/T1 in air [1].
        p2: downstream absolute pressure [Pa].
        conductance: sonic conductance C [m^3/(s Pa)].
        critical_ratio: b [1].
        linear_band: pressure difference below which the root is rounded [Pa].
    """
    # With d the part of the difference that is felt and K = p1 (1 - b) that at choking, psi^2 = d (2 K - d)/K^2 needs no
    # ratio, p1 psi = sqrt(d (2 K - d))/(1 - b), and K itself cancels.
    # Choices, and in this order: one instruction each, where `minimum` asks of both sides whether they are numbers.
    choking, difference = p1 * (1.0 - critical_ratio), p1 - p2
    drop = jnp.where(choking < difference, choking, difference)
    band = jnp.where(0.5 * choking < linear_band, 0.5 * choking, linear_band)
    root = smooth_root(drop * (2.0 * choking - drop), band * (2.0 * choking - band), cold1)
    return conductance * REFERENCE_DENSITY / (1.0 - critical_ratio) * root


def smooth_root(square: Scalar, start: Scalar, factor: Scalar = 1.0) -> Scalar:
    """sqrt(factor square) from `start` on; below, the parabola in `square` that meets it with value and slope.

    Range: start > 0.
    """
    share = square / start
    share = jnp.where(share < 1.0, share, 1.0)
    return jnp.sqrt(factor * jnp.where(start > square, start, square)) * (share * (1.5 - 0.5 * share))


class OrificeOptions(TypedDict, total=False):
    """Fields of an `Orifice` beside conductance and critical ratio."""

    linear_band: Scalar


class Orifice(TwoPort):
    """A restriction between two ports: fully open, or by a command."""

    command_range: ClassVar[tuple[float, float]] = (0.0, 1.0)
    saturates: ClassVar[bool] = False

    symbol: ClassVar[str] = "restriction"
    undriven: ClassVar[float] = 1.0
    conductance: Scalar = quantity("m^3/(s*Pa)", (0.0, 1e-5), "sonic conductance", symbol="C", typical=(1e-10, 1e-7))
    critical_ratio: Scalar = quantity(
        "1", (0.01, 0.99), "critical pressure ratio", symbol="b", typical=(0.15, 0.6), default=0.35
    )
    linear_band: Scalar = quantity("Pa", (1.0, 1e5), "pressure difference of the linear zone", default=5e3)

    @classmethod
    def from_flow(
        cls,
        flow: float,
        *,
        pressure: float,
        ambient: float = 101325.0,
        critical_ratio: float = 0.35,
        **options: Unpack[OrificeOptions],
    ) -> Orifice:
        """Determine the conductance from a flow into the atmosphere, measured with the outlet open.

        Args:
            flow: volume flow of air in the reference atmosphere [m^3/s].
            pressure: gauge pressure at its inlet [Pa].
            ambient: absolute pressure behind it [Pa].
            critical_ratio: b [1].
            **options: as for the class.

        Raises:
            InputError: if the inlet is not above the outlet.
        """
        if not pressure > 0.0:
            raise InputError("pressure", pressure, "must be a gauge pressure above 0 Pa")
        return cls._through(flow, pressure + ambient, ambient, critical_ratio, options)

    @classmethod
    def from_nominal_flow(
        cls, flow: float, *, critical_ratio: float = 0.35, **options: Unpack[OrificeOptions]
    ) -> Orifice:
        """Convert a standard nominal flow, measured from 6 to 5 bar above the reference atmosphere at 20 degC.

        Args:
            flow: volume flow of air in the reference atmosphere of ISO 8778 (ANR) [m^3/s].
            critical_ratio: b [1].
            **options: as for the class.
        """
        return cls._through(flow, NOMINAL_INLET, NOMINAL_OUTLET, critical_ratio, options)

    @classmethod
    def _through(cls, flow: float, inlet: float, outlet: float, ratio: float, options: OrificeOptions) -> Orifice:
        """The orifice through which a volume of reference air [m^3/s] flows between two absolute pressures [Pa]."""
        one = cls(conductance=1e-8, critical_ratio=ratio, **options)
        unit = float(_flow_of(one, inlet, outlet)) / 1e-8
        return cls(conductance=flow * REFERENCE_DENSITY / unit, critical_ratio=ratio, **options)

    @classmethod
    def from_kv(cls, kv: float, *, critical_ratio: float = 0.35, **options: Unpack[OrificeOptions]) -> Orifice:
        """Convert a flow coefficient Kv.

        A gas whose pressure drop vanishes is as incompressible as water, and there both laws must give the same flow:

            C rho0 sqrt(2 p1 dp/(1 - b)) = Kv sqrt(1000 kg/m^3 rho1 dp/1 bar),   rho1 = p1/(R T0)

        Args:
            kv: flow of water at a pressure drop of 1 bar [m^3/s].
            critical_ratio: b [1].
            **options: as for the class.
        """
        per_density = 0.5 * (1.0 - critical_ratio) * WATER_DENSITY
        root = (per_density / (KV_DROP * float(AIR.gas_constant) * REFERENCE_TEMPERATURE)) ** 0.5
        return cls(conductance=kv * root / REFERENCE_DENSITY, critical_ratio=critical_ratio, **options)

    @classmethod
    def from_cv(cls, cv: float, *, critical_ratio: float = 0.35, **options: Unpack[OrificeOptions]) -> Orifice:
        """Convert a flow coefficient Cv: US gallons of water per minute at a pressure drop of 1 psi [1].

        In SI units Kv is 0.865 m^3/h for each Cv.
        """
        kv = cv * GALLON_PER_MINUTE * (KV_DROP / CV_DROP) ** 0.5
        return cls.from_kv(kv, critical_ratio=critical_ratio, **options)

    @classmethod
    def of_hole(cls, diameter: float, *, discharge: float = 0.8, **options: Unpack[OrificeOptions]) -> Orifice:
        """An orifice from the diameter of a hole [m] and its discharge coefficient, with the choked flow of a nozzle."""
        gamma, r = float(AIR.heat_ratio), float(AIR.gas_constant)
        area = 0.25 * jnp.pi * diameter**2 * discharge
        choked = (gamma / (r * REFERENCE_TEMPERATURE)) ** 0.5 * (2.0 / (gamma + 1.0)) ** (
            0.5 * (gamma + 1.0) / (gamma - 1.0)
        )
        return cls(conductance=float(area * choked / REFERENCE_DENSITY), **options)

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 1.0) -> Scalar:
        """Signed mass flow from a to b [kg/s]; the command is the share of the conductance that is open, 0 to 1."""
        return opening_flow(self, a, b, command)

    def steepest(self, gas: Gases, state: Tree, command: Scalar) -> tuple[Scalar, ...]:
        """Slope at equal pressures, where the flow is steepest [kg/(s Pa)]."""
        return (steepest_slope(self, gas[0], gas[1]) * command,)


@evaluated
def _flow_of(orifice: Orifice, inlet: Any, outlet: Any) -> Scalar:
    """Mass flow [kg/s] at the reference temperature between two absolute pressures [Pa]."""
    return orifice.mass_flow(GasState(inlet, REFERENCE_TEMPERATURE), GasState(outlet, REFERENCE_TEMPERATURE))


def opening_flow(
    orifice: Orifice, a: GasState, b: GasState, opening: Scalar = 1.0, *, conductance: Scalar | None = None
) -> Scalar:
    """Signed mass flow through any restriction by ISO 6358 [kg/s].

    Args:
        orifice: what has ``conductance``, ``critical_ratio`` and ``linear_band``.
        a: the gas before it.
        b: the gas behind it.
        opening: the share of the conductance that is open, 0 to 1.
        conductance: another sonic conductance instead of the orifice's own [m^3/(s Pa)].
    """
    forward = a.pressure_abs >= b.pressure_abs
    flow = conductance_flow(
        # a choice, not max and min: at equal pressures their derivatives would cancel
        jnp.where(forward, a.pressure_abs, b.pressure_abs),
        # of each node and then chosen: one division for all restrictions at a node, none where its temperature is given
        jnp.where(forward, density_over_air(a), density_over_air(b)),
        jnp.where(forward, b.pressure_abs, a.pressure_abs),
        conductance=(orifice.conductance if conductance is None else conductance) * opening,
        critical_ratio=orifice.critical_ratio,
        linear_band=orifice.linear_band,
    )
    return jnp.where(forward, flow, -flow)


def density_over_air(at: GasState) -> Scalar:
    """Density of a gas over that of the air of the reference atmosphere at the same pressure: T0/T in air [1]."""
    return REFERENCE_TEMPERATURE / at.temperature * (AIR.gas_constant / at.gas.gas_constant)


def steepest_slope(orifice: Orifice, a: GasState, b: GasState, *, conductance: Scalar | None = None) -> Scalar:
    """Largest dw/dp of a restriction between the pressures at its ends [kg/(s Pa)]: what makes a small volume stiff."""
    upstream = jnp.maximum(a.pressure_abs, b.pressure_abs)
    x = jnp.minimum(orifice.linear_band / (upstream * (1.0 - orifice.critical_ratio)), 0.5)
    c = orifice.conductance if conductance is None else conductance
    lighter = jnp.sqrt(AIR.gas_constant / a.gas.gas_constant)
    return 3.0 * c * REFERENCE_DENSITY * lighter / ((1.0 - orifice.critical_ratio) * jnp.sqrt(x * (2.0 - x)))


def flow_of_decay(decay: float, *, volume: float) -> float:
    """Volume flow of reference air out of a closed volume whose pressure falls [m^3/s].

    Args:
        decay: fall of pressure per time [Pa/s], positive, at the temperature of the reference atmosphere.
        volume: volume of the vessel [m^3].
    """
    mass_flow = decay * volume / float(AIR.gas_constant * REFERENCE_TEMPERATURE)
    return mass_flow / REFERENCE_DENSITY


class Leak(TwoPort):
    """A leak between two ports, or to the atmosphere, equal in both directions.

        w = G rho0 (Pa^2 - Pb^2)/(2 p0) * (R0 T0 mu0(T0))/(R T mu(T))

    G is the volume flow of air in the reference atmosphere (p0, T0, rho0 of ISO 6358-1) per pressure difference, at a
    mean pressure of p0; T is upstream, R0 and mu0 are air's. Range: isothermal laminar flow, a Reynolds number below
    2000, which all but the gross leaks of a pneumatic part have; no choking. Source: the law of Hagen and Poiseuille,
    integrated along the passage with the density of an ideal gas.
    """

    symbol: ClassVar[str] = "leak"
    conductance: Scalar = quantity(
        "m^3/(s*Pa)", (0.0, 1e-6), "reference air per pressure", symbol="G", typical=(1e-14, 1e-10)
    )

    @classmethod
    def from_flow(cls, flow: float, *, pressure: float, ambient: float = 101325.0) -> Leak:
        """A leak from what a flow meter shows.

        Args:
            flow: volume flow of reference air [m^3/s].
            pressure: gauge pressure before the leak [Pa].
            ambient: absolute pressure behind it [Pa].

        Raises:
            InputError: if the pressure is not above 0.
        """
        if not pressure > 0.0:
            raise InputError("pressure", pressure, "must be a gauge pressure above 0 Pa")
        squares = (pressure + ambient) ** 2 - ambient**2
        return cls(conductance=flow * 2.0 * REFERENCE_PRESSURE / squares)

    @classmethod
    def from_decay(cls, decay: float, *, volume: float, pressure: float, ambient: float = 101325.0) -> Leak:
        """A leak from a decay test: how fast the pressure in a closed volume falls.

        Args:
            decay: fall of pressure per time [Pa/s], positive, at the temperature of the reference atmosphere.
            volume: volume of the vessel [m^3].
            pressure: gauge pressure in it [Pa].
            ambient: absolute pressure outside [Pa].
        """
        return cls.from_flow(flow_of_decay(decay, volume=volume), pressure=pressure, ambient=ambient)

    @classmethod
    def of_capillary(cls, *, length: float, diameter: float) -> Leak:
        """A leak from the length and diameter of a round passage [m]."""
        viscosity = float(AIR.viscosity(REFERENCE_TEMPERATURE))
        # dw/d(Pa^2 - Pb^2) of an isothermal capillary
        per_squares = math.pi * diameter**4 / (256.0 * viscosity * length)
        per_squares /= float(AIR.gas_constant * REFERENCE_TEMPERATURE)
        return cls(conductance=per_squares * 2.0 * REFERENCE_PRESSURE / REFERENCE_DENSITY)

    def mass_flow(self, a: GasState, b: GasState, state: Tree = (), command: Scalar = 0.0) -> Scalar:
        """Mass flow from a to b [kg/s]."""
        upstream = jnp.where(a.pressure_abs >= b.pressure_abs, a.temperature, b.temperature)
        warm = REFERENCE_TEMPERATURE * AIR.viscosity(REFERENCE_TEMPERATURE) * (AIR.gas_constant / a.gas.gas_constant)
        warm = warm / (upstream * a.gas.viscosity(upstream))
        squares = (a.pressure_abs - b.pressure_abs) * (a.pressure_abs + b.pressure_abs)
        return self.conductance * REFERENCE_DENSITY * warm * squares / (2.0 * REFERENCE_PRESSURE)
