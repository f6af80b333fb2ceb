"""The distributed tube against the library `fluids`: isothermal pipe flow, its choking, and friction factors."""

import numpy as np
import pytest

from mckibben.components.gas import AIR
from mckibben.pneumatics.distributed import DistributedTube, ReservoirEnd, simulate
from mckibben.pneumatics.tubes import friction_factor, haaland

fluids = pytest.importorskip("fluids")

LENGTH, DIAMETER, ROUGHNESS, TEMPERATURE = 2.0, 4e-3, 1.5e-6, 293.15


@pytest.fixture(scope="module")
def flows():
    """Steady flow at three pressures upstream of 1.5 bar; the highest chokes the tube."""
    tube = DistributedTube(length=LENGTH, diameter=DIAMETER, roughness=ROUGHNESS, cells=50, wall="isothermal")

    def steady(upstream):
        ends = (ReservoirEnd(pressure_abs=p) for p in (upstream, 1.5e5))
        start = np.linspace(upstream, 1.5e5, 50)
        return simulate(tube, *ends, duration=0.6, sample_period=0.06, pressure_abs=start)

    return {upstream: steady(upstream) for upstream in (1.6e5, 4e5, 9e5)}


def factor(result):
    reynolds = result.left.mass_flow[-1] * DIAMETER / (0.25 * np.pi * DIAMETER**2 * float(AIR.viscosity(TEMPERATURE)))
    return float(friction_factor(reynolds, ROUGHNESS / DIAMETER))


# 0.1 % is asked; second order in the cell gives 1e-5, and 1e-4 where the flow is nearly sonic at the end.
@pytest.mark.parametrize(("upstream", "within"), [(1.6e5, 5e-5), (4e5, 1e-4)])
def test_isothermal_flow(flows, upstream, within):
    result = flows[upstream]
    p1, p2 = result.left.pressure[-1], result.right.pressure[-1]
    # `fluids` asks for a mean density, but divides by P1: the exact relation needs rho = P1/(R T).
    flow = fluids.isothermal_gas(rho=p1 / (287.05 * TEMPERATURE), fd=factor(result), P1=p1, P2=p2, L=LENGTH, D=DIAMETER)
    assert result.left.mass_flow[-1] == pytest.approx(flow, rel=within)


def test_choked_isothermal_flow(flows):
    result = flows[9e5]
    critical = fluids.P_isothermal_critical_flow(P=result.left.pressure[-1], fd=factor(result), D=DIAMETER, L=LENGTH)
    assert critical > 1.5e5
    # dP/dx is infinite at the choked end, where the scheme is of first order: 0.02 % of this pressure at 50 cells.
    assert result.right.pressure[-1] == pytest.approx(critical, rel=1e-3)


@pytest.mark.parametrize("reynolds", [4e3, 2e4, 1e6])
@pytest.mark.parametrize("roughness", [0.0, 1e-4, 2e-2])
def test_friction_factors(reynolds, roughness):
    assert float(haaland(reynolds, roughness)) == pytest.approx(fluids.friction.Haaland(reynolds, roughness), rel=1e-12)
    exact = fluids.friction_factor(Re=reynolds, eD=roughness)  # Colebrook; Haaland states 2 %
    assert float(friction_factor(reynolds, roughness)) == pytest.approx(exact, rel=0.025)
