"""Exergy accounts of whole machines: they close, nothing is destroyed less than never, and closed forms are met.

Those of pairs and of muscles on one supply are checked with their other accounts, in `test_machines`.
"""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import ADIABATIC, ROOM, SAMPLES, SUPPLY, WALL, body, exergy_closes, go, plate, switched

from mckibben.components import Environment
from mckibben.components.gas import AIR
from mckibben.engine import held, ramped
from mckibben.pneumatics.circuit import DeadState
from mckibben.pneumatics.volume import Isothermal, WallHeat

HEATS = {"adiabatic": ADIABATIC, "wall": WALL}
TIME = 1e-3 * np.arange(SAMPLES + 1)
NOTHING, STILL = held(np.zeros(SAMPLES + 1)), ramped(np.zeros(SAMPLES + 1))
DEAD = DeadState.of(AIR, Environment())


def filled(name="m"):
    return {f"{name}.fill": switched(1.0, 5, 100), f"{name}.vent": switched(1.0, 130, SAMPLES + 1)}


@pytest.mark.parametrize("heat", HEATS)
def test_the_exergy_of_an_isometric_muscle_closes(heat):
    _, account = go(plate(HEATS[heat]), ROOM, filled() | {"x": ramped(np.full(SAMPLES + 1, 0.14))})
    ledger = exergy_closes(account)
    assert ledger.into["supply"] > 5.0 and ledger.out["exhaust"] > 1.0 and ledger.out["dead_volume"] > 1.0
    assert (ledger.out["heat"] > 0.01) == (heat == "wall")  # where there is a wall, heat destroys some


@pytest.mark.parametrize("heat", HEATS)
def test_the_exergy_of_a_moved_muscle_closes_and_work_of_the_load_comes_in(heat):
    x = {"x": ramped(0.135 + 0.008 * np.sin(2.0 * np.pi * 8.0 * TIME))}
    _, account = go(plate(HEATS[heat]), ROOM, filled() | x)
    ledger = exergy_closes(account)
    assert abs(ledger.out["shaft_work"]) > 1e-2


def test_the_exergy_of_a_wrapped_muscle_that_lifts_a_weight_closes():
    load = {"mass": 2.0, "weight": 25.0, "start": 0.146, "wrap_angle": 1.5, "damping": 5.0}
    _, account = go(body(**load), ROOM, filled() | {"push": STILL})
    exergy_closes(account)


def test_the_exergy_account_can_fail():
    """Were mixing forgotten, or one ten-thousandth of the throttling, the account would show it."""
    _, account = go(plate(ADIABATIC), ROOM, filled() | {"x": ramped(np.full(SAMPLES + 1, 0.14))})
    ledger = account.energy_parts.exergy
    for wrong in ({"mixing": 0.0}, {"valve": ledger.out["valve"] * (1.0 - 1e-4)}):
        left = abs(ledger._replace(out=ledger.out | wrong).remainder)
        assert left > 1e-5 * ledger.throughput


def test_heat_to_a_wall_that_is_warmer_than_the_room_is_worth_something():
    warm = WallHeat(conductance=0.2, wall_temperature=320.0)
    _, account = go(plate(warm), ROOM, filled() | {"x": ramped(np.full(SAMPLES + 1, 0.14))})
    ledger = exergy_closes(account)
    assert abs(ledger.into["walls"]) > 1e-3 and ledger.out["heat"] > 0.0  # gas that is filled in gets warmer still


def test_isothermal_filling_loses_what_the_closed_form_says():
    """A volume filled from a supply loses m R T0 ln(Ps/P0) - V (P ln(P/P0) - P + P0), and none of that to heat or mixing.

    The volume of the muscle follows its pressure, so that m is drawn while V changes: the form holds for the difference of
    the end states all the same. Tolerance: quadrature at 50 us, 1e-6 of the supply.
    """
    still = {"x": ramped(np.full(SAMPLES + 1, 0.14))}
    run, account = go(plate(Isothermal()), ROOM, filled() | still | {"m.vent": NOTHING})
    # mass and pressure of isothermal gas are integrated apart, so that its temperature is off by some 1e-9
    ledger, out = exergy_closes(account, least=-1e-7), run.outputs
    drawn = account.energy_parts.air * AIR.gas_constant * 293.15 * np.log((SUPPLY + ROOM) / ROOM)
    assert ledger.into["supply"] == pytest.approx(float(drawn), rel=1e-12)
    gained = 0.0
    for node in ("m", "m.port"):
        for i, sign in ((0, -1.0), (-1, 1.0)):
            p, mass = out[f"{node}.pressure_abs"][i], out[f"{node}.mass"][i]
            volume = mass * AIR.gas_constant * 293.15 / p
            gained += sign * float(volume * (p * np.log(p / ROOM) - p + ROOM))
    assert ledger.stored["gas"] == pytest.approx(gained, rel=1e-7)
    # no sum of entropies but those of the path: heat at the room's temperature is free
    assert ledger.out["heat"] == pytest.approx(0.0, abs=1e-6) and ledger.out["mixing"] == pytest.approx(0.0, abs=1e-6)
    lost = ledger.out["valve"] + ledger.out["tube"]
    rest = sum(ledger.stored[n] for n in ("muscle", "friction", "tendon"))
    rest += sum(ledger.out[n] for n in ("friction", "viscous", "shaft_work"))
    assert lost == pytest.approx(float(drawn) - gained - rest, abs=1e-6 * float(drawn))


def test_the_parts_of_two_runs_together_are_their_sum():
    _, account = go(plate(ADIABATIC), ROOM, filled() | {"x": ramped(np.full(SAMPLES + 1, 0.14))})
    parts = account.energy_parts
    both = parts.plus(parts)
    assert both.exergy.remainder == pytest.approx(2.0 * parts.exergy.remainder, abs=1e-12)  # rounding of joules
    assert both.air == 2.0 * parts.air and both.compressor["adiabatic"] == 2.0 * parts.compressor["adiabatic"]
    assert dataclasses.replace(both).exergy.into["supply"] == 2.0 * parts.exergy.into["supply"]


@given(p=st.floats(2e4, 1.2e6), t=st.floats(220.0, 400.0))
@settings(max_examples=40, deadline=None)
def test_stored_gas_is_worth_something_unless_it_is_the_rooms_air(p, t):
    volume = 1e-5
    mass = float(AIR.mass(p, volume, t))
    assert float(DEAD.stored(p, volume, mass)) >= -1e-12  # [J], of some joules: rounding
    same = float(AIR.mass(101325.0, volume, 293.15))
    assert float(DEAD.stored(101325.0, volume, same)) == pytest.approx(0.0, abs=1e-12)
    assert float(DEAD.flowing(DEAD.see(101325.0, 293.15))) == 0.0
    # without cooling a compressor needs more than with it
    assert float(DEAD.compression(7e5, cooled=False)) > float(DEAD.compression(7e5, cooled=True)) > 0.0


@pytest.mark.parametrize("pressure", [101325.0, 101425.0, 3e5, 7e5])
def test_the_least_work_of_compression_is_its_closed_form_and_none_for_the_rooms_air(pressure):
    """R T ln r with cooling; with none of it, the rise of the enthalpy along the isentrope."""
    ratio, room = pressure / 101325.0, 293.15
    gas, heat_ratio = float(AIR.gas_constant), float(AIR.heat_ratio)
    cooled, share = gas * room * np.log(ratio), (heat_ratio - 1.0) / heat_ratio
    hot = gas / share * room * (ratio**share - 1.0)
    # rounding of r - 1 against enthalpies of 300 kJ/kg
    assert float(DEAD.compression(pressure, cooled=True)) == pytest.approx(cooled, rel=1e-10, abs=1e-9)
    assert float(DEAD.compression(pressure, cooled=False)) == pytest.approx(hot, rel=1e-10, abs=1e-9)
