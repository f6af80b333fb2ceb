"""ISO 6358 with b = 0.528 against two formulations of the library `fluids`: API 520's valve and ISO 5167-3's nozzle.

API 520 writes choked flow with its coefficient C and subsonic flow with F2; ISO 5167-3 writes subsonic flow as that of a
liquid times an expansibility. Both start from the isentropic nozzle; the ellipse of ISO 6358 approximates it within 0.34 %.
"""

import numpy as np
import pytest

from mckibben.components.flow import GasState
from mckibben.components.gas import AIR
from mckibben.pneumatics.orifice import Orifice

fluids = pytest.importorskip("fluids")

HOLE, R, GAMMA = 1e-3, 287.05, 1.4
AREA = 0.25 * np.pi * HOLE**2
MOLAR = 8314.462618 / R  # [g/mol]
ORIFICE = Orifice.of_hole(HOLE, discharge=1.0, critical_ratio=0.528, linear_band=100.0)
RATIOS = np.concatenate([np.linspace(0.02, 0.52, 6), np.linspace(0.53, 0.99, 24), [0.995, 0.999]])
STATES = [(p, t) for p in (1.2e5, 3e5, 11e5) for t in (250.0, 293.15, 393.0)]
WITHIN = (
    0.005  # asked for; found are 0.39 % from API 520, of which 0.06 % its rounded constant, and 0.33 % from ISO 5167
)


def ours(upstream, temperature, ratio, *, backwards):
    high, low = GasState(upstream, temperature), GasState(upstream * ratio, temperature)
    return -float(ORIFICE.mass_flow(low, high)) if backwards else float(ORIFICE.mass_flow(high, low))


def subsonic(ratio):
    return ratio > fluids.P_critical_flow(1.0, GAMMA)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize(("upstream", "temperature"), STATES)
def test_against_api_520_choked_and_subsonic(upstream, temperature, backwards):
    for ratio in RATIOS[upstream * (1.0 - RATIOS) > 2.0 * float(ORIFICE.linear_band)]:
        per_area = fluids.API520_A_g(
            m=1.0, T=temperature, Z=1.0, MW=MOLAR, k=GAMMA, P1=upstream, P2=upstream * ratio, Kd=1.0
        )
        # Choked, both state the same formula; API's constant 0.03948 is rounded to 2e-5.
        within = WITHIN if subsonic(ratio) else 5e-5
        assert ours(upstream, temperature, ratio, backwards=backwards) == pytest.approx(AREA / per_area, rel=within)


@pytest.mark.parametrize(("upstream", "temperature"), STATES)
def test_against_the_nozzle_of_iso_5167(upstream, temperature):
    density = float(AIR.density(upstream, temperature))
    pipe = 1.0  # a thousand times the nozzle: the speed before it vanishes
    worst = 0.0
    for ratio in RATIOS[subsonic(RATIOS) & (upstream * (1.0 - RATIOS) > 2.0 * float(ORIFICE.linear_band))]:
        ends = dict(D=pipe, Do=HOLE, P1=upstream, P2=upstream * ratio)
        flow = fluids.flow_meter_discharge(
            **ends, rho=density, C=1.0, expansibility=fluids.nozzle_expansibility(**ends, k=GAMMA)
        )
        worst = max(worst, abs(ours(upstream, temperature, ratio, backwards=False) / flow - 1.0))
    assert 0.002 < worst < WITHIN  # it is an approximation: agreement to rounding would mean that one copies the other


def test_the_linear_zone_alone_departs_from_the_nozzle():
    """Below the band the flow is less than the nozzle's, and at the band it is the ellipse's again."""
    band = float(ORIFICE.linear_band)
    for share, low, high in ((1.001, 0.0, 0.005), (0.5, 0.05, 0.2), (0.1, 0.4, 0.7)):
        drop = share * band
        density = float(AIR.density(6e5, 293.15))
        nozzle = AREA * np.sqrt(2.0 * density * drop)  # incompressible: the drop is 2e-4 of the pressure
        missing = 1.0 - ours(6e5, 293.15, 1.0 - drop / 6e5, backwards=False) / nozzle
        assert low <= missing < high, (share, missing)


def test_the_edge_of_choking_is_the_nozzles():
    assert fluids.P_critical_flow(1.0, GAMMA) == pytest.approx(float(ORIFICE.critical_ratio), rel=1e-3)
