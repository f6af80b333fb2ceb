"""The estimate from measured channels against closed forms, what it must refuse, and the picture of an account."""

import dataclasses
import functools
import re

import numpy as np
import pytest

from mckibben.analysis._energy_samples import RecordedMachine
from mckibben.analysis.energy_accounts import energy_account
from mckibben.components.gas import AIR
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.muscles import law_from_specimen
from mckibben.muscles.law import stored_along, stored_change
from mckibben.muscles.laws import LAWS, law_type
from mckibben.quantities import declared
from mckibben.recordings import Channel, Recording
from mckibben.report.figures.energy_figures import energy_flow_figure, streams
from mckibben.specimens import specimen

ROOM, T0, SUPPLY = 101325.0, 293.15, 6.9e5
NYLON = law_from_specimen(specimen("nylon"))
META = {"environment": {"pressure_abs": ROOM, "temperature": T0}}


@functools.cache
def loops(lag=0.9, samples=4001):
    """Two cycles and a half of a muscle on its law: pressure and span are sines, one behind the other."""
    time = np.linspace(0.0, 2.5, samples)
    turn = 2.0 * np.pi * time
    pressure = 3.0e5 - 1.5e5 * np.cos(turn)
    span = 0.125 + 0.01 * np.cos(turn - lag)
    tension = np.asarray(NYLON.tension(span, pressure))
    channels = {
        "pressure": Channel(pressure, "Pa", "measured"),
        "span": Channel(span, "m", "measured"),
        "tension": Channel(tension, "N", "measured"),
    }
    return Recording(time, channels, META)


def test_a_muscle_on_its_law_leaves_no_remainder():
    """Isothermal gas and a law with one potential: what the gas does is what the shaft gets, over every closed cycle.

    Tolerance: trapezoids over 1600 samples of a cycle, 1e-5 of the supply.
    """
    account = energy_account(loops(), muscle=NYLON, supply=SUPPLY)
    assert len(account.cycles) == 2
    assert abs(account.value("shaft_work")) > 0.1  # it did work
    assert abs(account.remainder) < 1e-5 * account.value("supply")


def test_air_and_compressor_work_follow_from_the_law_in_closed_form():
    account = energy_account(loops(), muscle="nylon", supply=SUPPLY)
    record = loops()
    mass = (record["pressure"] + ROOM) * np.asarray(NYLON.volume(record["span"], record["pressure"]))
    mass = mass / (float(AIR.gas_constant) * T0)
    # between the turns the samples are 0.6 ms apart
    assert account.cycles[0].air == pytest.approx(np.ptp(mass), rel=1e-5)
    per_mass = float(AIR.gas_constant) * T0 * np.log((SUPPLY + ROOM) / ROOM)
    assert account.compressor["isothermal"] == pytest.approx(account.air * per_mass, rel=1e-12)
    gamma = float(AIR.heat_ratio)
    adiabatic = float(AIR.cp) * T0 * (((SUPPLY + ROOM) / ROOM) ** ((gamma - 1.0) / gamma) - 1.0)
    assert account.compressor["adiabatic"] == pytest.approx(account.air * adiabatic, rel=1e-12)


def test_a_muscle_that_turns_the_other_way_takes_work():
    forth, back = (energy_account(loops(lag), muscle=NYLON, supply=SUPPLY).value("shaft_work") for lag in (0.9, -0.9))
    # the same loop, the other way round; a cycle begins at the sample nearest to its turn, 0.6 ms or 1 % of a loop off
    assert forth == pytest.approx(-back, rel=2e-2)


def test_friction_stands_in_the_remainder():
    """A constant friction of 2 N over a stroke of 2 cm takes 2 x 2 N x 2 cm a cycle from the shaft."""
    record = loops()
    rubbed = record["tension"] + 2.0 * np.sign(np.gradient(record["span"]))
    given = record.with_channels({"tension": Channel(rubbed, "N", "measured")})
    clean, account = (energy_account(r, muscle=NYLON, supply=SUPPLY) for r in (record, given))
    taken = account.remainder - clean.remainder
    assert taken / len(account.cycles) == pytest.approx(2.0 * 2.0 * 0.02, rel=5e-3)  # a few samples at each turn


def test_dead_volume_is_unknown_and_not_zero_where_nothing_says_it():
    account = energy_account(loops(), muscle=NYLON, supply=SUPPLY)
    assert "dead_volume" in account.unknown and "dead_volume" not in [p.name for p in account.parts]
    known = energy_account(loops(), muscle=NYLON, supply=SUPPLY, dead_volume=1e-5)
    swing = 3e5 * 1e-5 / (float(AIR.gas_constant) * T0)
    pressure = loops()["pressure"]
    more = known.cycles[0].air - account.cycles[0].air
    assert 0.5 * swing < more <= 1e-5 * np.ptp(pressure) / (float(AIR.gas_constant) * T0) * (1.0 + 1e-9)
    assert known.value("dead_volume") > 0.0


def test_without_a_supply_its_exergy_is_unknown():
    account = energy_account(loops(), muscle=NYLON)
    assert "supply" in account.unknown and np.isnan(account.value("supply"))
    assert np.isnan(account.efficiencies()["supply"])
    assert account.value("exhaust") > 0.0


def test_work_out_is_what_the_muscle_does_while_it_shortens():
    record = loops()
    power = -record["tension"] * np.gradient(record["span"], record.time)
    for cycle in energy_account(record, muscle=NYLON, supply=SUPPLY).cycles:
        part = (record.time >= cycle.start) & (record.time <= cycle.end)
        done, taken = (np.trapezoid(np.maximum(sign * power[part], 0.0), record.time[part]) for sign in (1.0, -1.0))
        # left sums over 1600 samples of a cycle against trapezoids
        assert cycle.work_out == pytest.approx(done, rel=2e-3)
        assert cycle.work_out - cycle.shaft_work == pytest.approx(taken, rel=2e-3)


def test_an_accumulator_keeps_of_a_measured_cycle_what_leaves_above_its_pressure():
    """Pressures of the loops go from 1.5 to 4.5 bar; the volume is that of the law, so the mass at 3 bar is known."""
    account = energy_account(loops(), muscle=NYLON, supply=SUPPLY)
    below, between, above = (account.saved_by_accumulator(p) for p in (1e5, 3e5, 4.6e5))
    assert below.air == pytest.approx(account.air, rel=1e-5)  # the turns lie between samples
    assert above.air == above.exergy == above.share == 0.0
    record = loops()
    mass = (record["pressure"] + ROOM) * np.asarray(NYLON.volume(record["span"], record["pressure"]))
    mass = mass / (float(AIR.gas_constant) * T0)
    emptied = np.interp(0.75, record.time, mass)  # where it has fallen to 3 bar
    assert between.air == pytest.approx(2.0 * (mass.max() - emptied), rel=5e-3)  # to the sample
    per_mass = float(AIR.gas_constant) * T0 * np.log((3e5 + ROOM) / ROOM)
    assert between.exergy == pytest.approx(between.air * per_mass, rel=1e-12)
    assert between.share == pytest.approx(between.exergy / account.value("supply"), rel=1e-12)


def test_what_an_account_says_and_shows_are_its_own_numbers():
    alone = energy_account(loops(), muscle=NYLON, supply=SUPPLY)
    account = dataclasses.replace(alone, saving=alone.saved_by_accumulator(3e5))

    def numbers(words):
        return [float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", words)]

    air, *others, saved = account.remarks()
    assert alone.remarks() == [air, *others]
    saving, printed = account.saving, 5e-3  # three digits
    assert numbers(saved) == pytest.approx([300.0, saving.exergy, 100.0 * saving.share, 1e3 * saving.air], rel=printed)
    shares = [100.0 * v for v in account.efficiencies().values()]
    assert len(shares) == 3 and numbers(air) == pytest.approx([1e3 * account.air, *shares], rel=printed)
    assert others[0] == f"Unknown, and not zero: {', '.join(account.unknown)}."
    parts, cycles = account.tables()
    supply = account.value("supply")
    assert {row["name"]: row["share"] for row in parts.rows} == {
        p.name: pytest.approx(p.value / supply, rel=1e-12) for p in account.parts if p.value
    }
    assert [row["remainder"] for row in cycles.rows] == [c.parts[-1].value for c in account.cycles]
    for row, cycle in zip(cycles.rows, account.cycles, strict=True):
        assert row["efficiency"] == cycle.efficiency == pytest.approx(cycle.shaft_work / cycle.supply, rel=1e-12)
    written, bare = account.to_dict(), alone.to_dict()
    assert written["saving"] == saving._asdict() and bare == {**written, "saving": None}
    assert [c["parts"]["remainder.remainder"] for c in written["cycles"]] == [c.parts[-1].value for c in account.cycles]
    with pytest.raises(InputError, match="gauge pressure above 0 Pa"):
        account.saved_by_accumulator(0.0)
    with pytest.raises(InputError, match="annot be known from this recording"):
        account.value("dead_volume")


def test_cycles_at_different_mean_pressures_are_not_summed_without_a_word():
    record = loops()
    drift = Channel(record["pressure"] + 0.15e5 * record.time, "Pa", "measured")
    assert energy_account(record, muscle=NYLON).cautions == ()
    with pytest.warns(PlausibilityWarning, match="cycles at different mean pressures"):
        apart = energy_account(record.with_channels({"pressure": drift}), muscle=NYLON)
    assert "(3.078 bar to 3.228 bar)" in str(apart.cautions[0])  # 0.15 bar a cycle


@pytest.mark.parametrize("name", ["pressure", "tension", "span"])
def test_a_missing_channel_is_named(name):
    record = loops().pick([n for n in ("pressure", "tension", "span") if n != name])
    with pytest.raises(InputError, match=f"channel {name}"):
        energy_account(record, muscle=NYLON)


def test_a_recording_that_does_not_say_its_muscle_or_has_no_cycle_is_refused():
    with pytest.raises(InputError, match="muscle"):
        energy_account(loops())
    still = loops().with_channels(
        {n: Channel(np.full(len(loops()), v)) for n, v in (("pressure", 3e5), ("span", 0.12))}
    )
    with pytest.raises(InputError, match="cycle"):
        energy_account(still, muscle=NYLON)


def test_a_law_is_rebuilt_from_the_parameters_of_a_file():
    names = declared(law_type("linear_threshold"))
    stated = {f"units.m.law.{n}": {"value": float(getattr(NYLON, n)), "unit": q.unit} for n, q in names.items()}
    machine = RecordedMachine(loops().with_meta(parameters=stated))
    assert machine.muscles() == ["m"]
    span, pressure = loops()["span"], loops()["pressure"]
    np.testing.assert_array_equal(machine.law("m").tension(span, pressure), NYLON.tension(span, pressure))
    # by its parameters alone, a law of this package can be told from every other; tests register laws of their own
    own = [law for law in LAWS.values() if law.__module__.startswith("mckibben.")]
    assert len({frozenset(declared(law)) for law in own}) == len(own) > 10
    wrong = {k: v for k, v in stated.items() if "rest_volume" not in k}
    with pytest.raises(InputError, match="law of m"):
        RecordedMachine(loops().with_meta(parameters=wrong)).law("m")


def test_the_energy_along_a_path_is_that_between_its_ends():
    span, pressure = loops()["span"], loops()["pressure"]
    along = stored_along(NYLON, span, pressure)
    for i in (0, 700, 1999):
        between = stored_change(NYLON, (span[0], pressure[0]), (span[i], pressure[i]))
        assert along[i] == pytest.approx(between, abs=1e-6 * np.ptp(along))  # linear between 1024 edges


def test_what_enters_a_picture_leaves_it():
    for lag in (0.9, -0.9):  # the second takes work from the load
        account = energy_account(loops(lag), muscle=NYLON, supply=SUPPLY, dead_volume=1e-5)
        for found in streams(account):
            into, out = (sum(s.value for s in side) for side in found)
            assert into == pytest.approx(out, rel=1e-12)
            assert all(s.value > 0.0 for side in found for s in side)
        texts = [t.get_text() for ax in energy_flow_figure(account).axes for t in ax.texts]
        assert any(t.startswith("exhaust") for t in texts) and any("work of the load" in t for t in texts) == (
            lag < 0.0
        )
