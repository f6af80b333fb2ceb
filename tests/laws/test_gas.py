"""Specific heats of the gas, outside any tube: Mayer's relation, and what heat and compression do to a chamber."""

import jax
import pytest

from mckibben.components.gas import AIR


def test_the_specific_heats_differ_by_the_gas_constant_and_are_in_its_ratio():
    """cp - cv = R and cp/cv = gamma (Mayer); dry air has 717.6 and 1004.7 J/(kg K)."""
    assert float(AIR.cp - AIR.cv) == pytest.approx(float(AIR.gas_constant), rel=1e-15)
    assert float(AIR.cp / AIR.cv) == pytest.approx(float(AIR.heat_ratio), rel=1e-15)
    assert (float(AIR.cv), float(AIR.cp)) == pytest.approx((717.6, 1004.7), abs=0.1)


def test_a_gas_that_is_heated_or_compressed_obeys_its_adiabatic_index():
    """Along p V^gamma = const the energy m cv T changes by the work -p dV, and nothing else."""
    mass, volume, pressure = 1e-3, 1e-3, 2e5
    gamma = float(AIR.heat_ratio)

    def energy(v):
        p = pressure * (volume / v) ** gamma
        return mass * AIR.cv * AIR.temperature(p, v, mass)

    assert float(jax.grad(energy)(volume)) == pytest.approx(-pressure, rel=1e-9)  # float64, two powers
