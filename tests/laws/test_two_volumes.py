"""Volumes and an orifice against exact solutions, all with the classical Runge-Kutta method at 50 us.

With k = C rho0 R sqrt(T0 T)/V [1/s] of an upstream temperature T, and the ellipse's u = (r - b)/(1 - b) of r = p2/p1:

    choked discharge, isothermal      p = p0 exp(-k t)
    choked discharge, adiabatic       p = p0 (1 + (gamma - 1) k t/2)^(-2 gamma/(gamma - 1))
    filling from a reservoir          choked: r grows by n k t;  then u = sin(n k t/(1 - b));  n = 1 or gamma
    two volumes, isothermal           dr/dt = (k2 + k1 r) psi(r), whose integral is an arc tangent
"""

import numpy as np
import pytest

from mckibben.components.gas import AIR, REFERENCE_DENSITY
from mckibben.engine import held, integrate
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir, adiabatic

R, GAMMA, T0 = 287.05, 1.4, 293.15
C, B = 1.5e-8, 0.35
PERIOD, STEP = 1e-3, 50e-6
# 1 Pa is the narrowest linear zone that is allowed: the exact solutions know of none.
ORIFICE = Orifice(conductance=C, critical_ratio=B, linear_band=1.0)
HEATS = {"isothermal": Isothermal(), "adiabatic": adiabatic()}


def rate(volume, temperature=T0):
    return C * REFERENCE_DENSITY * R * np.sqrt(T0 * temperature) / volume


def run(nodes, start, duration, temperature=T0):
    system = Circuit.of(nodes, {"orifice": Branch(ORIFICE, ("a", "b"))})
    samples = round(duration / PERIOD) + 1
    none = {"none": held(np.zeros(samples))}
    # A rate bound at equal pressures is far above what these runs meet: they end before, and are compared with the truth.
    return integrate(
        system, system.initial(start, temperature=temperature), none,
        period=PERIOD, step_size=STEP, method="rk4", raises=False,
    )  # fmt: skip


@pytest.mark.parametrize("temperature", [T0, 350.0])
@pytest.mark.parametrize("heat", HEATS)
def test_choked_discharge(heat, temperature):
    vessel = FixedVolume(volume=1e-4, heat=HEATS[heat])
    found = run({"a": vessel, "b": Reservoir(pressure_abs=1e5)}, {"a": 11e5}, 0.2, temperature)
    k = rate(1e-4, temperature)
    exact = {
        "isothermal": 11e5 * np.exp(-k * found.time),
        "adiabatic": 11e5 * (1.0 + 0.5 * (GAMMA - 1.0) * k * found.time) ** (-2.0 * GAMMA / (GAMMA - 1.0)),
    }[heat]
    choked = exact > 1e5 / B
    assert 50 < choked.sum() < len(choked)  # most of the discharge, and it does leave that zone
    # Order 4 with k h = 7e-4 leaves (k h)^5/120 = 2e-18 a step: what is seen is the rounding of thousands of steps.
    np.testing.assert_allclose(found.outputs["a.pressure_abs"][choked], exact[choked], rtol=1e-12)
    cooled = (exact / 11e5) ** ((GAMMA - 1.0) / GAMMA if heat == "adiabatic" else 0.0)
    np.testing.assert_allclose(found.outputs["a.temperature"][choked], temperature * cooled[choked], rtol=1e-12)


@pytest.mark.parametrize("heat", HEATS)
def test_filling_from_a_reservoir_is_a_straight_line_and_then_a_sine(heat):
    vessel, supply = FixedVolume(volume=1e-4, heat=HEATS[heat]), 8e5
    found = run({"a": Reservoir(pressure_abs=supply, temperature=T0), "b": vessel}, {"b": 1e5}, 0.06)
    k = rate(1e-4) * (GAMMA if heat == "adiabatic" else 1.0)  # what enters is of the reservoir's temperature
    line = 1e5 / supply + k * found.time
    angle = (line - B) / (1.0 - B)
    exact = np.where(line < B, line, B + (1.0 - B) * np.sin(np.minimum(angle, 0.5 * np.pi)))
    before = angle < 0.5 * np.pi - 0.01  # the last 50 ppm of the pressure are left to the linear zone
    assert (line < B).sum() > 10 and before.sum() > 25
    straight = line < B - 2.0 * k * PERIOD
    pressure = found.outputs["b.pressure_abs"]
    np.testing.assert_allclose(pressure[straight], supply * exact[straight], rtol=1e-12)
    # At the edge of choking the slope of the rate jumps, which costs one step an error of the order (k h)^3 = 1e-9.
    np.testing.assert_allclose(pressure[before], supply * exact[before], rtol=1e-9)


def time_of(ratio, k1, k2):
    """Time from u = 0 to a ratio: the integral of dr/((k2 + k1 r) psi(r)), closed where k2 + k1 b > k1 (1 - b)."""
    a = (k2 + k1 * B) / (1.0 - B)
    root = np.sqrt(a * a - k1 * k1)
    half = 0.5 * np.arcsin((ratio - B) / (1.0 - B))
    return 2.0 / root * (np.arctan((a * np.tan(half) + k1) / root) - np.arctan(k1 / root))


@pytest.mark.parametrize("sizes", [(3e-4, 1e-4), (1e-4, 1e-4)], ids=["large to small", "equal"])
def test_two_isothermal_volumes_and_an_orifice(sizes):
    nodes = {name: FixedVolume(volume=size) for name, size in zip("ab", sizes, strict=True)}
    found = run(nodes, {"a": 9e5, "b": 1e5}, 0.05)
    k1, k2 = rate(sizes[0]), rate(sizes[1])
    first, second = found.outputs["a.pressure_abs"], found.outputs["b.pressure_abs"]
    ratio = second / first
    # choked: k2 + k1 r grows exponentially, until r = b
    edge = np.log((k2 + k1 * B) / (k2 + k1 / 9.0)) / k1
    choked = found.time < edge
    assert choked.sum() > 5
    grown = ((k2 + k1 / 9.0) * np.exp(k1 * found.time) - k2) / k1
    np.testing.assert_allclose(ratio[choked], grown[choked], rtol=1e-12)
    below = ~choked & (ratio < 0.9999)
    assert below.sum() > 10
    # The error of the one step over the edge, as a time: (k h)^2 = 1e-6 of a step.
    np.testing.assert_allclose(edge + time_of(ratio[below], k1, k2), found.time[below], rtol=0.0, atol=1e-6 * STEP)


@pytest.mark.parametrize("heat", HEATS)
def test_two_volumes_keep_their_mean_pressure_and_meet_there(heat):
    sizes = {"a": 2e-4, "b": 1e-4}
    nodes = {name: FixedVolume(volume=size, heat=HEATS[heat]) for name, size in sizes.items()}
    wide = Orifice(conductance=C, critical_ratio=B)
    system = Circuit.of(nodes, {"orifice": Branch(wide, ("a", "b"))})
    start = system.initial({"a": 9e5, "b": 1e5})
    run = integrate(system, start, {"none": held(np.zeros(301))}, period=PERIOD, step_size=STEP, method="rk4")
    # isothermal: mass is conserved; adiabatic: energy is, P V/(gamma - 1) of both; either way the mean by volume
    mean = (2.0 * run.outputs["a.pressure_abs"] + run.outputs["b.pressure_abs"]) / 3.0
    np.testing.assert_allclose(mean, (2.0 * 9e5 + 1e5) / 3.0, rtol=1e-12)
    assert float(run.state["pressure"]["a"]) == pytest.approx(float(run.state["pressure"]["b"]), rel=1e-9)
    if heat == "adiabatic":
        # What stayed in `a` expanded by itself, from 9 bar to the mean; the rest of the energy went along to `b`.
        left = T0 * (mean[-1] / 9e5) ** ((GAMMA - 1.0) / GAMMA)
        assert run.outputs["a.temperature"][-1] == pytest.approx(left, rel=1e-6)
        total = float(AIR.mass(9e5, 2e-4, T0) + AIR.mass(1e5, 1e-4, T0))
        assert run.outputs["a.mass"][-1] + run.outputs["b.mass"][-1] == pytest.approx(total, rel=1e-12)
        assert run.outputs["b.temperature"][-1] > T0 + 50.0  # the gas that was compressed there
