"""Valves, regulators, leaks and compressors: what each is for, and what all owe to the gas that passes them."""

import functools
import itertools
import re

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components.flow import GasState
from mckibben.components.gas import AIR, Gas
from mckibben.components.paths import get, parameters, put
from mckibben.engine import held, integrate, march, ramped
from mckibben.engine.integration import compile_march
from mckibben.errors import ConvergenceError, InputError
from mckibben.muscles import law_from_specimen
from mckibben.pneumatics.circuit import Branch, Circuit, balance
from mckibben.pneumatics.compressor import Compressor
from mckibben.pneumatics.orifice import Leak, Orifice
from mckibben.pneumatics.valves import (
    CheckValve,
    OnOffValve,
    PilotStage,
    PressureRegulator,
    QuickExhaust,
    Solenoid,
    SpoolValve,
    ThreeWayValve,
)
from mckibben.pneumatics.volume import FixedVolume, MovingVolume, Reservoir, WallHeat, adiabatic
from mckibben.specimens import specimen

T0, P0, BAR = 293.15, 101325.0, 1e5
PERIOD = 1e-3
WIDE, NARROW = Orifice(conductance=3e-8), Orifice(conductance=5e-9)
DRIVE = Solenoid(opening_dead_time=3e-3, closing_dead_time=2e-3, opening_time=2e-3, closing_time=1e-3)
WAVE = 0.5 + 0.5 * np.sin(2 * np.pi * 7.0 * PERIOD * np.arange(201))
# For a muscle of 6 to 20 cm3: its accounts close to 1e-6 where the flow has time to be resolved.
SMALL, TINY = Orifice(conductance=3e-9), Orifice(conductance=1e-9)
# Each element, and a command that takes it through all it does.
ELEMENTS = {
    "leak": (Leak.from_flow(2e-4, pressure=6e5), None),
    "check": (CheckValve(passage=SMALL), None),
    "on_off": (OnOffValve(passage=SMALL, drive=DRIVE), held((WAVE > 0.4).astype(float))),
    "three_way": (ThreeWayValve(fill=SMALL, vent=TINY, drive=DRIVE, overlap=-0.2), held((WAVE > 0.4).astype(float))),
    "spool": (
        SpoolValve(fill=SMALL, vent=TINY, lag=3e-3, overlap=0.05, leakage=0.01, speed_limit=100.0, dead_time=2.3e-3),
        ramped(3.0 * WAVE - 1.5),
    ),
    "regulator": (
        PressureRegulator(fill=SMALL, relief=TINY, band=5e4, hysteresis=5e3, lag=5e-3, dead_time=2e-3),
        held(4e5 * (WAVE > 0.4)),
    ),
    "quick": (QuickExhaust(feed=TINY, vent=SMALL, band=3e4), None),
    "compressor": (
        Compressor(displacement=2e-5, speed=300.0, start_pressure=1.5e5, stop_pressure=2e5, aftercooling=0.3),
        None,
    ),
}
MARCH = jax.jit(march, static_argnums=(6, 7))  # without the search for a step, which would be compiled too
EVERY = pytest.mark.parametrize("name", ELEMENTS)


def gas(*pressures):
    return tuple(GasState(jnp.asarray(p, float), jnp.asarray(T0)) for p in pressures)


def settled_state(element):
    """A state in the middle of what the element can be in."""
    return jax.tree.map(lambda x: jnp.full_like(x, 0.4), element.initial())


def circuit(element, heat, signal, *, size=1.5e-5):
    """Supply, vessel, the element, a moving muscle, and the room, to which both leak and the element's exhaust leads."""
    law = law_from_specimen(specimen("nylon"))
    nodes = {
        "supply": Reservoir(pressure_abs=7e5),
        "before": FixedVolume(volume=size, heat=heat),
        "muscle": MovingVolume(of=law.braid_volume, heat=heat),
        "room": Reservoir(),
    }
    ports = ("before", "muscle", "room")[: len(element.ports)]
    branches = {
        "inlet": Branch(Orifice(conductance=1e-8), ("supply", "before"), "inlet"),
        "element": Branch(element, ports, signal),
        "dump": Branch(Orifice(conductance=1e-8), ("before", "room")),
        "bleed": Branch(Orifice(conductance=5e-10), ("muscle", "room")),
    }
    return Circuit.of(nodes, branches)


@pytest.mark.parametrize("heat", [adiabatic(), WallHeat(conductance=0.2)], ids=["adiabatic", "wall"])
@EVERY
def test_mass_and_energy_close_with_every_element(name, heat):
    element, command = ELEMENTS[name]
    system = circuit(element, heat, None if command is None else "command")
    length = 0.14 + 0.005 * np.sin(2 * np.pi * 5.0 * PERIOD * np.arange(len(WAVE)))
    # the supply comes and goes, so that two-port elements see both signs and the quick exhaust shuttles
    signals = {"length": ramped(length), "inlet": held((WAVE[::-1] > 0.3).astype(float))}
    signals |= {} if command is None else {"command": command}
    signals = system.commands(signals)
    start = system.initial({"before": 3 * BAR, "muscle": 2 * BAR}, {"length": length[0]})
    at = lambda i, share: {k: s.at(i, share, PERIOD) for k, s in signals.items()}  # noqa: E731
    memory = system.initial_memory(start, at(0, 0.0))
    (end, _, integrals), (_, _, outputs) = MARCH(system, start, memory, signals, PERIOD, 20, len(WAVE) - 1, False)
    found = balance(system, start, end, at(0, 0.0), at(len(WAVE) - 2, 1.0), integrals)
    assert found.mass < 1e-10  # linear in the flows, so only rounding is left
    assert found.energy < 1e-6  # quadrature at 50 us, of second order at corners and switches
    flow = [v for k, v in outputs.items() if k.startswith("element.") and k.endswith("mass_flow")]
    assert all(np.abs(f).max() > 1e-7 for f in flow)  # gas did pass, or the accounts would say nothing
    assert (float(integrals["shaft"]) > 0.0) == (name == "compressor")


PRESSURES = np.array([1.0, 1e3, P0 - 5e3, P0, P0 + 1.0, P0 + 1.2e4, 3e5, 6e5, 1e6])


@EVERY
def test_gas_flows_down_the_pressure_only(name):
    element, _ = ELEMENTS[name]
    memory = jnp.asarray(1.0 if name == "compressor" else 2e5)
    for p in itertools.product(PRESSURES, repeat=len(element.ports)):
        at = gas(*p)
        for (i, j), flow in zip(element.paths, element.flows(at, settled_state(element), memory, 1.0), strict=True):
            if name == "compressor":
                assert float(flow) >= 0.0
            else:
                assert float(flow) * (p[i] - p[j]) >= 0.0
                assert p[i] != p[j] or float(flow) == 0.0


@EVERY
def test_derivatives_are_finite_everywhere_and_below_the_stated_bound(name):
    element, _ = ELEMENTS[name]
    grid = jnp.asarray(list(itertools.product(PRESSURES, repeat=len(element.ports))))
    memory = jnp.asarray(1.0 if name == "compressor" else 2e5)

    def flows(e, p, state, command):
        at = tuple(GasState(x, jnp.asarray(T0)) for x in p)
        return jnp.stack(e.flows(at, state, memory, command)), e.rates(at, state, memory, command)

    state = settled_state(element)
    slopes = jax.jit(jax.vmap(lambda p: jax.jacrev(flows, argnums=(0, 1, 2, 3))(element, p, state, jnp.asarray(0.3))))
    found = slopes(grid)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(found))
    bound = jax.vmap(lambda p: jnp.stack(element.steepest(gas(*p), state, 1.0)))(grid)
    per_pressure = np.abs(np.asarray(found[0][1]))  # points, paths, ports
    for k, (i, j) in enumerate(element.paths):
        if np.all(bound[:, k] == 0.0):
            assert name in ("leak", "compressor")  # smooth: the slope at a sample tells enough
            continue
        assert np.all(per_pressure[:, k, [i, j]] <= np.asarray(bound)[:, k, None] * (1 + 1e-12))


STIFF = {
    "on_off": (OnOffValve(passage=Orifice.from_flow(0.01, pressure=6.9e5), drive=DRIVE), 1.0),
    "check": (CheckValve(passage=Orifice.from_flow(0.01, pressure=6.9e5)), None),
    "regulator": (
        PressureRegulator(
            fill=Orifice.from_flow(0.01, pressure=6.9e5),
            relief=Orifice.from_flow(0.01, pressure=6.9e5),
            band=1e4,
            hysteresis=2e3,
        ),
        3e5,
    ),
}


@pytest.mark.parametrize("name", STIFF)
def test_a_large_valve_on_a_small_volume_says_which_step_it_needs(name):
    element, command = STIFF[name]
    ports = ("supply", "small", "room")[: len(element.ports)]
    system = Circuit.of(
        {"supply": Reservoir(pressure_abs=7e5), "small": FixedVolume(volume=1e-6), "room": Reservoir()},
        {
            "valve": Branch(element, ports, None if command is None else "command"),
            "load": Branch(Orifice(conductance=1e-9), ("small", "room")),
        },
    )
    start = system.initial({"small": P0})
    signals = {"command": held(np.full(21, 0.0 if command is None else command))}
    memory = system.initial_memory(start)
    with pytest.raises(ConvergenceError, match=r"needs .* s or less") as refused:
        integrate(system, start, signals, period=PERIOD, memory=memory, method="rk4")
    need = float(re.search(r"needs (\S+) s", str(refused.value)).group(1))
    assert need < 50e-6
    fine = integrate(system, start, signals, period=PERIOD, memory=memory, method="rk4", step_size=0.98 * need)
    chosen = integrate(system, start, signals, period=PERIOD, memory=memory)
    assert chosen.stiff
    finest = integrate(system, start, signals, period=PERIOD, memory=memory, method="rk4", step_size=0.3 * need)
    # settled: what it is, whatever the way there
    assert fine.outputs["small.pressure_abs"][-1] == pytest.approx(finest.outputs["small.pressure_abs"][-1], rel=1e-6)
    assert chosen.outputs["small.pressure_abs"][-1] == pytest.approx(finest.outputs["small.pressure_abs"][-1], rel=1e-6)
    # on the way: of first order where a regulator's play is taken up, at the step that is only just stable
    away = np.abs(fine.outputs["small.pressure_abs"] - finest.outputs["small.pressure_abs"]).max()
    assert away < 0.01 * 6e5


# ---- leak ----


def test_a_leak_is_what_its_test_states():
    a, b = gas(6e5 + P0, P0)
    leak = Leak.from_flow(1e-6, pressure=6e5)
    assert float(leak.mass_flow(a, b)) == pytest.approx(1e-6 * 1.185, rel=1e-12)
    assert float(leak.mass_flow(b, a)) == -float(leak.mass_flow(a, b))
    # laminar and compressible: from 2 to 1 is to from 3 to 1 as 3 to 8
    ratio = float(leak.mass_flow(*gas(3e5, 1e5)) / leak.mass_flow(*gas(2e5, 1e5)))
    assert ratio == pytest.approx(8.0 / 3.0, rel=1e-12)
    bore, long = 5e-5, 0.01
    exact = np.pi * bore**4 * (a.pressure_abs**2 - b.pressure_abs**2) / (256 * AIR.viscosity(T0) * 287.05 * T0 * long)
    assert float(Leak.of_capillary(length=long, diameter=bore).mass_flow(a, b)) == pytest.approx(
        float(exact), rel=1e-12
    )
    with pytest.raises(InputError, match="pressure"):
        Leak.from_flow(1e-6, pressure=0.0)


def test_a_decay_test_decays_as_stated():
    leak = Leak.from_decay(200.0, volume=1e-4, pressure=6e5)
    system = Circuit.of(
        {"vessel": FixedVolume(volume=1e-4), "room": Reservoir()}, {"leak": Branch(leak, ("vessel", "room"))}
    )
    run = integrate(
        system, system.initial({"vessel": 6e5 + P0}, temperature=T0), {"none": held(np.zeros(11))}, period=0.01
    )
    fallen = 6e5 + P0 - run.outputs["vessel.pressure_abs"][-1]
    assert fallen == pytest.approx(200.0 * 0.1, rel=1e-4)  # the pressure that drives it falls by 3e-5 meanwhile


# ---- check valve ----


def test_a_check_valve_cracks_opens_and_lets_nothing_back():
    valve = CheckValve(passage=WIDE, cracking_pressure=5e3, band=1e4)
    above = P0 + np.array([-5e5, -1.0, 0.0, 4.99e3, 5e3, 6e3, 1e4, 1.5e4, 3e5])
    a, b = GasState(jnp.asarray(above), jnp.asarray(T0)), GasState(jnp.asarray(P0), jnp.asarray(T0))
    flow, free = np.asarray(valve.mass_flow(a, b)), np.asarray(WIDE.mass_flow(a, b))
    np.testing.assert_array_equal(flow[:5], 0.0)
    assert 0.0 < flow[5] < flow[6] < free[6]
    np.testing.assert_allclose(flow[7:], free[7:], rtol=1e-15)  # the factor 1 is multiplied in another order


# ---- switching valves ----


def at_rest(count):
    """Several drives at rest."""
    return jax.tree.map(lambda x: jnp.zeros(count), DRIVE.initial())


def opening_after(command, *, rates=DRIVE.rates, start=None, step=2e-5):
    """Opening at every step, from rest."""

    def one(state, u):
        k1 = rates(state, u)
        k2 = rates(jax.tree.map(lambda s, k: s + 0.5 * step * k, state, k1), u)
        return jax.tree.map(lambda s, k: s + step * k, state, k2), DRIVE.opening(state)

    return np.asarray(jax.jit(lambda u: jax.lax.scan(one, start or DRIVE.initial(), u))(jnp.asarray(command))[1])


def test_a_switching_valve_takes_its_dead_and_switching_times():
    step, on, total = 2e-5, 2500, 5000
    opening = opening_after((np.arange(total) < on).astype(float))
    moving, full = np.argmax(opening > 0.0) * step, np.argmax(opening >= 1.0) * step
    # the seat is left after a ninth of the opening time; the flux passes its ramp in about 0.5 ms
    assert 3e-3 < moving < 3e-3 + 2e-3 / 9.0 + 1e-4
    assert full == pytest.approx(3e-3 + 2e-3, abs=1e-4)
    leaving = (np.argmax(opening[on:] < 1.0)) * step
    shut = (np.argmax(opening[on:] <= 0.0)) * step
    assert 2e-3 < leaving < 2e-3 + 1e-3 / 9.0 + 1e-4
    assert shut == pytest.approx(2e-3 + 1e-3, abs=1e-4)


INLETS = np.array(
    [2.9e5, 3.2e5, 4e5, 6e5, 9e5]
)  # of a pilot-operated valve that is rated at 6 bar, with a spring of 3 bar


@functools.cache
def piloted_motion():
    """When a pilot-operated valve begins to open and to close, at each of the inlet pressures [s]; never: nan."""
    pilot = PilotStage(pilot_rated_pressure_abs=6e5, pilot_spring_pressure_abs=3e5)
    valve, step, on = OnOffValve(passage=WIDE, drive=DRIVE, pilot=pilot), 2e-5, 1000
    command = (np.arange(2 * on) < on).astype(float)
    opening = opening_after(
        command, rates=lambda s, u: valve.rates(gas(INLETS, P0), s, (), u), start=at_rest(len(INLETS))
    ).T
    return (
        np.array([[np.argmax(o > 0.0), np.argmax(o[on:] < 1.0)] if o.any() else [np.nan] * 2 for o in opening]).T * step
    )


def test_a_pilot_operated_valve_opens_the_later_and_closes_the_sooner_the_lower_its_inlet_pressure():
    inlets, (opened, closed) = INLETS[2:], piloted_motion()[:, 2:]
    # At its rated pressure it has the stated times: the seat is left after a ninth of the opening and closing time.
    seats = 2e-3 / 9.0, 1e-3 / 9.0
    assert opened[1] == pytest.approx(3e-3 + seats[0], abs=1e-4)
    assert closed[1] == pytest.approx(2e-3 + seats[1], abs=1e-4)
    # Filled through a choked orifice, emptied through one; the piston's ramp, 0.3 ms wide at 6 bar, varies with both.
    np.testing.assert_allclose(opened - seats[0], 3e-3 * 6e5 / inlets, atol=2e-4)
    np.testing.assert_allclose(closed - seats[1], 2e-3 * np.log(inlets / 2.7e5) / np.log(6.0 / 2.7), atol=2e-4)


def test_a_pilot_operated_valve_stays_closed_below_the_pressure_of_its_spring():
    opened, _ = piloted_motion()
    assert np.isnan(opened[0])
    assert 3e-3 * 6.0 / 3.2 < opened[1] < 20e-3


def test_short_pulses_are_ballistic():
    pulses = np.array([1.0, 2.5, 3.4, 3.8, 4.2, 6.0]) * 1e-3  # dead time 3 ms, opening time 2 ms
    commands = (2e-5 * np.arange(1000)[:, None] < pulses).astype(float)
    peaks = opening_after(commands, start=at_rest(len(pulses))).max(axis=0)
    np.testing.assert_array_equal(peaks[:2], 0.0)  # the flux never came to one half
    assert np.all(np.diff(peaks[1:5]) > 0.0) and np.all(peaks[2:4] < 1.0)  # opens a little, and turns back
    assert peaks[-1] == 1.0


def test_mean_flow_under_pulse_width_modulation_has_a_dead_zone_and_saturates():
    valve = OnOffValve(passage=NARROW, drive=DRIVE)
    system = Circuit.of(
        {"supply": Reservoir(pressure_abs=7e5), "large": FixedVolume(volume=10.0)},
        {"valve": Branch(valve, ("supply", "large"), "pwm")},
    )
    start = system.initial({"large": P0})
    cycle, cycles = 200, 6  # 50 Hz at samples of 0.1 ms
    duties = np.array([0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0])

    def mean(duty):
        on = (np.arange(cycle * cycles + 1) % cycle) < round(duty * cycle)
        run = integrate(system, start, {"pwm": held(on.astype(float))}, period=1e-4, step_size=1e-4, method="rk4")
        return np.mean(run.outputs["valve.mass_flow"][3 * cycle :])

    flow = np.array([mean(duty) for duty in duties])
    full = float(NARROW.mass_flow(*gas(7e5, P0)))
    share = flow / full
    # On for 1 and 2 ms of 20 ms: within the dead time of 3 ms. Off for 1 and 2 ms: within that of 2 ms.
    np.testing.assert_array_equal(share[:2], 0.0)
    np.testing.assert_allclose(share[-2:], 1.0, rtol=1e-6)  # choked all along
    assert 0.99 < share[-3] < 1.0  # off for as long as the dead time: the plunger just stirs
    assert np.all(np.diff(share[1:7]) > 0.0)
    # Between, pulses come out shorter by the difference of the two delays, ms: on 3 + 1, off 2 + 0.5 to half flow; what is
    # left is the flux, which 8 ms after a switch is within 15 % of its end.
    line = duties - (4.0 - 2.5) / 20.0
    np.testing.assert_allclose(share[3:5], line[3:5], atol=0.02)
    assert share[2] < line[2] and share[5] > line[5]  # short pulses and short gaps are shortened further


def test_a_three_way_valve_has_the_overlap_it_states():
    stroke = jnp.linspace(0.0, 1.0, 1001)
    for overlap in (0.0, 0.2, -0.3):
        fill, vent = ThreeWayValve(fill=WIDE, vent=WIDE, drive=DRIVE, overlap=overlap).openings(stroke)
        both = np.mean((np.asarray(fill) > 1e-9) & (np.asarray(vent) > 1e-9))
        neither = np.mean((np.asarray(fill) <= 1e-9) & (np.asarray(vent) <= 1e-9))
        assert both == pytest.approx(max(-overlap, 0.0), abs=3e-3)  # the grid
        assert neither == pytest.approx(max(overlap, 0.0), abs=3e-3)
        assert (fill[0], vent[0], fill[-1], vent[-1]) == (0.0, 1.0, 1.0, 0.0)


# ---- spool valve ----


def test_a_spool_valve_has_dead_band_leakage_and_saturation():
    valve = SpoolValve(fill=WIDE, vent=NARROW, lag=5e-3, overlap=0.1, leakage=0.02)
    at = gas(7e5, 3e5, P0)
    fill, vent = valve.flows(at, jnp.asarray([-1.0, -0.1, 0.0, 0.1, 1.0]), (), 0.0)
    full = float(WIDE.mass_flow(*at[:2])), float(NARROW.mass_flow(*at[1:]))
    np.testing.assert_allclose(np.asarray(fill) / full[0], [0.0, 0.018, 0.02, 0.018, 1.0], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(np.asarray(vent) / full[1], [1.0, 0.018, 0.02, 0.018, 0.0], rtol=1e-12, atol=1e-15)
    under = SpoolValve(fill=WIDE, vent=NARROW, lag=5e-3, overlap=-0.1)
    assert all(float(flow) > 0.0 for flow in under.flows(at, jnp.asarray(0.0), (), 0.0))
    for command in (1.0, 7.0):  # saturated: the same rate
        assert float(valve.rates(at, jnp.asarray(0.0), (), command)) == pytest.approx(1.0 / 5e-3)


def test_a_spool_follows_late_with_its_lag_and_no_faster_than_its_limit():
    samples = np.arange(101)
    for limit, exact in (
        (1e5, lambda t: 1.0 - np.exp(-t / 5e-3)),
        # at 100 1/s until the lag alone is slower, at s = 1 - 100 x 5 ms
        (100.0, lambda t: np.where(t < 5e-3, 100.0 * t, 1.0 - 0.5 * np.exp(-(t - 5e-3) / 5e-3))),
    ):
        valve = SpoolValve(fill=WIDE, vent=WIDE, lag=5e-3, speed_limit=limit, dead_time=2e-3)
        system = Circuit.of(
            {"supply": Reservoir(pressure_abs=7e5), "work": FixedVolume(volume=1e-3), "room": Reservoir()},
            {"valve": Branch(valve, ("supply", "work", "room"), "u")},
        )
        signals = {"u": held((samples >= 10).astype(float))}
        run = integrate(system, system.initial({"work": P0}), signals, period=PERIOD)
        since = np.maximum(run.time - 10e-3 - 2e-3, 0.0)
        # fourth order, and the corner of the limit within one step of 50 us
        np.testing.assert_allclose(run.outputs["valve.position"], exact(since), atol=1e-5 if limit == 1e5 else 3e-3)


def late_spool():
    """A spool valve with a dead time of 2 ms on a vessel, and the command that opens it at sample 10."""
    valve = SpoolValve(fill=WIDE, vent=WIDE, lag=5e-3, dead_time=2e-3)
    nodes = {"supply": Reservoir(pressure_abs=7e5), "work": FixedVolume(volume=1e-3), "room": Reservoir()}
    return Circuit.of(nodes, {"valve": Branch(valve, ("supply", "work", "room"), "u")}), held(np.arange(31.0) >= 10)


@pytest.mark.parametrize("way", ["integrate", "march", "compile_march"])
def test_a_dead_time_is_there_whichever_way_a_signal_comes_in(way):
    system, command = late_spool()
    start, raw = system.initial({"work": P0}), {"u": command}

    def pressure(signals):
        if way == "integrate":
            return integrate(system, start, signals, period=PERIOD, method="rk4").outputs["work.pressure_abs"]
        if way == "march":
            return MARCH(system, start, (), signals, PERIOD, 20, 30, False)[1][2]["work.pressure_abs"]
        run = compile_march(system, start, (), signals, period=PERIOD, inner=20, outputs=["work.pressure_abs"])
        return run(system, start, (), signals)["work.pressure_abs"]

    found = np.asarray(pressure(raw))
    rising = np.flatnonzero(found > found[0])
    assert rising[0] == 13  # the first sample after 10 ms + 2 ms
    np.testing.assert_array_equal(found, np.asarray(pressure(system.commands(raw))))  # and it is not late twice


def test_no_signal_has_the_name_that_a_late_one_gets():
    system, _ = late_spool()
    branch = Branch(system.elements["valve"], ("supply", "work", "room"), "valve.command")
    with pytest.raises(InputError, match=r"this one is kept for the signal as it is after the dead time"):
        Circuit.of(system.nodes, {"valve": branch})


# ---- regulator ----


LONGEST = 1201  # samples to which all commands are drawn out, so that one run is compiled for them


def regulated(command, load=0.0, *, start=P0, supply=7e5, size=2e-4, **options):
    """Outlet of a regulator on a vessel with a load to the room, at the end of a run."""
    options = {"fill": WIDE, "relief": WIDE, "band": 2e4} | options
    system = Circuit.of(
        {"supply": Reservoir(pressure_abs=supply), "outlet": FixedVolume(volume=size), "room": Reservoir()},
        {
            "regulator": Branch(PressureRegulator(**options), ("supply", "outlet", "room"), "set"),
            "load": Branch(Orifice(conductance=load), ("outlet", "room")),
        },
    )
    begin = system.initial({"outlet": start})
    command = np.pad(np.asarray(command, float), (0, LONGEST - len(command)), mode="edge")
    run = integrate(system, begin, {"set": held(command)}, period=PERIOD, memory=system.initial_memory(begin))
    return run


def test_the_outlet_droops_with_the_flow_by_the_share_of_the_band():
    flows, droops = [], []
    for load in np.array([0.0, 1e-9, 5e-9, 2e-8]):
        run = regulated(np.full(801, 4e5), load)
        outlet, flow = run.outputs["outlet.pressure_abs"][-1], run.outputs["load.mass_flow"][-1]
        ratio = outlet / 7e5
        # full flow of the regulator by ISO 6358, written out
        full = 3e-8 * 1.185 * 7e5 * np.sqrt(1 - (max(ratio - 0.35, 0) / 0.65) ** 2)
        flows.append(flow)
        droops.append(4e5 - (outlet - P0))
        assert droops[-1] == pytest.approx(2e4 * flow / full, rel=1e-6, abs=1.0)  # settled; Pa
    assert np.all(np.diff(flows) > 0.0) and np.all(np.diff(droops) > 0.0)


def test_beyond_its_band_a_regulator_gives_what_its_passage_lets_through():
    run = regulated(np.full(801, 5.5e5), 1e-7)
    assert run.outputs["regulator.fill_opening"][-1] == 1.0
    outlet = run.outputs["outlet.pressure_abs"][-1]
    assert run.outputs["load.mass_flow"][-1] == pytest.approx(float(WIDE.mass_flow(*gas(7e5, outlet))), rel=1e-6)


def test_from_above_and_from_below_the_outlet_differs_by_the_hysteresis():
    steps = lambda first: np.r_[np.full(400, first), np.full(801, 4e5)]  # noqa: E731
    for width in (0.0, 5e3, 2e4):
        options = {"hysteresis": width, "lag": 5e-3, "dead_time": 3e-3}
        up = regulated(steps(2e5), **options).outputs["outlet.pressure_abs"][-1]
        down = regulated(steps(5e5), **options).outputs["outlet.pressure_abs"][-1]
        assert up - P0 == pytest.approx(4e5 + 0.5 * width, abs=1.0)  # settled exponentially, to 1 Pa
        assert up - down == pytest.approx(width, abs=1.0)


def test_the_play_does_not_depend_on_the_rate():
    regulator = PressureRegulator(fill=WIDE, relief=WIDE, band=2e4, hysteresis=1e4)
    way = np.concatenate([np.linspace(3e5, 4e5, 51), np.linspace(4e5, 3.2e5, 77), np.linspace(3.2e5, 3.25e5, 3)])
    slow = fast = regulator.initial_memory(gas(7e5, 3e5, P0))
    for a, b in itertools.pairwise(way):
        slow = regulator.advance_memory(slow, gas(7e5, a, P0), gas(7e5, b, P0))
    for a, b in itertools.pairwise([3e5, 4e5, 3.2e5, 3.25e5]):
        fast = regulator.advance_memory(fast, gas(7e5, a, P0), gas(7e5, b, P0))
    assert float(slow) == float(fast) == 3.25e5  # 3.2 bar + h/2, and within the play since
    assert float(regulator.advance_memory(fast, gas(7e5, 3.25e5, P0), gas(7e5, 3.29e5, P0))) == 3.25e5


def test_a_poppet_that_is_not_balanced_feels_the_supply():
    options = {"supply_effect": 0.02, "supply_reference": 6e5}
    at = {
        s: regulated(np.full(601, 3e5), supply=P0 + s, **options).outputs["outlet.pressure_abs"][-1] for s in (6e5, 8e5)
    }
    assert at[6e5] - P0 == pytest.approx(3e5, abs=1.0)
    assert at[6e5] - at[8e5] == pytest.approx(0.02 * 2e5, abs=1.0)


def test_set_by_hand_and_without_relief_it_only_fills():
    closed = {"relief": Orifice(conductance=0.0), "set_pressure": 2e5}
    assert regulated(np.zeros(601), **closed).outputs["outlet.pressure_abs"][-1] == pytest.approx(P0 + 2e5, abs=1.0)
    assert regulated(np.zeros(601), start=5e5, **closed).outputs["outlet.pressure_abs"][-1] == pytest.approx(
        5e5, abs=1e-6
    )
    relieving = regulated(np.zeros(1201), start=5e5, set_pressure=2e5, relief_offset=1e4)
    assert relieving.outputs["outlet.pressure_abs"][-1] == pytest.approx(P0 + 2.1e5, abs=1.0)


def test_a_regulator_whose_memory_was_left_out_says_so():
    regulator = PressureRegulator(fill=WIDE, relief=WIDE, band=2e4)
    with pytest.raises(InputError, match="initial_memory"):
        regulator.flows(gas(7e5, 3e5, P0), jnp.asarray(3e5), (), 0.0)


# ---- quick exhaust ----


def test_a_quick_exhaust_feeds_and_then_lets_out_at_once():
    valve = QuickExhaust(feed=NARROW, vent=WIDE)
    feeding, venting = gas(5e5, 5e5 - 1e3, P0), gas(P0, 5e5, P0)
    assert float(valve.flows(feeding, (), (), 0.0)[0]) == float(NARROW.mass_flow(*feeding[:2]))
    assert float(valve.flows(feeding, (), (), 0.0)[1]) == 0.0  # nothing from the inlet to the exhaust
    assert float(valve.flows(venting, (), (), 0.0)[0]) == 0.0
    assert float(valve.flows(venting, (), (), 0.0)[1]) == float(WIDE.mass_flow(*venting[1:]))


# ---- compressor ----


def tank(compressor, samples, *, load=0.0, size=1e-3, period=0.01):
    system = Circuit.of(
        {"room": Reservoir(temperature=T0), "tank": FixedVolume(volume=size)},
        {
            "compressor": Branch(compressor, ("room", "tank")),
            "load": Branch(Orifice(conductance=load), ("tank", "room")),
        },
    )
    start = system.initial({"tank": P0})
    memory = system.initial_memory(start)
    return integrate(system, start, {"none": held(np.zeros(samples + 1))}, period=period, memory=memory, step_size=1e-3)


def test_a_compressor_fills_a_tank_as_theory_says():
    swept = 2e-5 * 150.0 / (2 * np.pi)  # [m3/s]
    options = {"displacement": 2e-5, "speed": 150.0, "aftercooling": 1.0}
    run = tank(Compressor(**options, clearance=0.0), 3000)
    # no clearance, isothermal tank: dp/dt = swept p1/V, straight
    np.testing.assert_allclose(run.outputs["tank.pressure_abs"], P0 * (1 + swept / 1e-3 * run.time), rtol=1e-10)
    # with clearance and n = 1: dr/dt = (swept/V)(1 + c - c r), towards the dead head 1 + 1/c
    run = tank(Compressor(**options, clearance=0.2, exponent=1.0), 3000)
    exact = 6.0 - 5.0 * np.exp(-0.2 * swept / 1e-3 * run.time)
    np.testing.assert_allclose(run.outputs["tank.pressure_abs"] / P0, exact, rtol=1e-8)
    beyond = gas(P0, 7 * P0)
    assert float(Compressor(**options, clearance=0.2, exponent=1.0).flows(beyond, (), jnp.ones(()), 1.0)[0]) == 0.0


def test_without_losses_a_compressor_delivers_at_the_isentropic_temperature():
    ideal = Compressor(displacement=2e-5, speed=150.0, efficiency=1.0)
    at = gas(P0, 5 * P0)
    flow, power = ideal.flows(at, (), jnp.ones(()), 1.0)[0], ideal.heating(at, (), jnp.ones(()), 1.0)[0]
    assert float(T0 + power / (flow * AIR.cp)) == pytest.approx(T0 * 5.0 ** (0.4 / 1.4), rel=1e-12)
    cooled = ideal.replace(efficiency=0.7, aftercooling=0.8)
    assert float(cooled.shaft_power(at, (), jnp.ones(()), 1.0)) == pytest.approx(float(power) / 0.7, rel=1e-12)
    assert float(cooled.heating(at, (), jnp.ones(()), 1.0)[0]) == pytest.approx(0.2 * float(power) / 0.7, rel=1e-12)


def test_the_pressure_switch_keeps_the_tank_between_its_thresholds():
    compressor = Compressor(displacement=2e-5, speed=150.0, start_pressure=2e5, stop_pressure=3e5)
    run = tank(compressor, 3000, load=5e-10, size=2e-4)
    gauge, running = run.outputs["tank.pressure_abs"] - P0, run.outputs["compressor.running"]
    settled = gauge > 2e5
    first = np.argmax(settled)
    step = 0.01 * np.abs(np.diff(gauge) / 0.01).max()  # between two samples
    assert gauge[first:].min() > 2e5 - step and gauge.max() < 3e5 + step
    starts, stops = np.flatnonzero(np.diff(running) > 0), np.flatnonzero(np.diff(running) < 0)
    assert len(starts) >= 3 and len(stops) >= 3
    np.testing.assert_allclose(gauge[starts + 1], 2e5, atol=step)
    np.testing.assert_allclose(gauge[stops + 1], 3e5, atol=step)
    with pytest.raises(InputError, match="start_pressure"):
        Compressor(displacement=2e-5, speed=150.0, start_pressure=4e5, stop_pressure=3e5)


SHARES = (0.0, 0.4, 1.0, 0.03, -0.5, 4e5)  # of what a state of an element may be


@jax.jit
def everything(element):
    """What an element does between a few pressures, at a few commands, states and memories: rows of numbers."""
    levels = jnp.array(list(itertools.product((P0, 2.6e5, 4e5, 4.03e5, 4.1e5, 5e5, 7e5), repeat=len(element.ports))))
    warm = (300.0, 280.0, 310.0)

    def one(pressures, command, first):
        # after a fall of all pressures by 2 %, and after a rise from the atmosphere's
        *pasts, at = (
            tuple(GasState(p, jnp.asarray(t)) for p, t in zip(each, warm, strict=False))
            for each in (1.02 * pressures, jnp.full_like(pressures, P0), pressures)
        )
        kept, risen = (element.advance_memory(element.initial_memory(past), past, at) for past in pasts)
        places = itertools.count()  # so that the parts of a state differ
        shares = jnp.array(SHARES)
        state = jax.tree.map(
            lambda x: jnp.full_like(x, shares[(first + next(places)) % len(SHARES)]), element.initial()
        )
        shown = (
            kept, risen, element.flows(at, state, kept, command), element.rates(at, state, kept, command),
            element.steepest(at, state, command), element.heating(at, state, kept, command),
            element.settled(command), element.outputs(at, state, kept, command),
            element.inner_volumes(), element.delay(),
        )  # fmt: skip
        return jnp.stack([jnp.asarray(v, float) for v in jax.tree.leaves(shown)])

    asked = itertools.product((-0.7, 0.0, 0.4, 1.0, 3e5), range(len(SHARES)))
    commands, firsts = (jnp.array(column) for column in zip(*asked, strict=True))
    every = jax.vmap(jax.vmap(one, (None, 0, 0)), (0, None, None))
    return every(levels, commands, firsts)


@EVERY
def test_no_number_of_an_element_does_nothing(name):
    # A number that its user can set, that a header or an FMU shows, and that moves nothing, is a wrong answer.
    element, _ = ELEMENTS[name]
    bounds = {path: declared.bounds for path, declared in parameters(element)}
    zero = [path for path in bounds if not float(get(element, path))]  # beside which another may do nothing
    element = put(element, {path: 1e-2 * max(bounds[path]) for path in zero})
    before = everything(element)
    for path, (low, high) in bounds.items():
        value = float(get(element, path))
        changed = 1.25 * value if low < 1.25 * value < high else 0.5 * (value + low)
        assert bool(jnp.any(everything(put(element, {path: changed})) != before)), path


@EVERY
def test_every_element_lets_another_gas_pass_by_its_own_density(name):
    # Of a gas with four times R a quarter is in a volume: a restriction lets half of the mass pass, which goes with the root
    # of the density; a leak, and a machine that moves a volume, a quarter. The bound of the slope goes with the flow.
    element, _ = ELEMENTS[name]
    helium, factor = Gas(gas_constant=4.0 * float(AIR.gas_constant)), 0.25 if name in ("leak", "compressor") else 0.5
    levels = jnp.array(list(itertools.permutations((P0, 3e5, 3.02e5, 7e5), len(element.ports))))

    @jax.vmap
    def shown(pressures, of):
        at, state = tuple(GasState(p, jnp.asarray(T0), of) for p in pressures), settled_state(element)
        flows = element.flows(at, state, element.initial_memory(at), 0.7)
        return jnp.stack([*flows, *element.steepest(at, state, 0.7)])

    before, after = (
        np.asarray(shown(levels, jax.tree.map(lambda x: jnp.full(len(levels), x), of))) for of in (AIR, helium)
    )
    np.testing.assert_allclose(after, factor * before, rtol=1e-12)  # rounding


def test_a_circuit_filled_with_another_gas_is_filled_with_it_everywhere():
    # Without inertia and heat the mass drops out: where R is n times as large, an orifice fills sqrt(n) times as fast, and
    # a leak, whose flow goes with the density, as fast as before. Both are exact; what is left is the integration.
    helium = Gas(gas_constant=4.0 * float(AIR.gas_constant))
    for element, faster in ((SMALL, 2.0), (Leak.from_flow(2e-4, pressure=6e5), 1.0)):
        ends = {}
        for of, period in ((AIR, 2e-3), (helium, 2e-3 / faster)):
            nodes = {"supply": Reservoir(pressure_abs=7e5, temperature=T0), "tank": FixedVolume(volume=1e-4)}
            filling = Circuit.of(nodes, {"way": Branch(element, ("supply", "tank"))}, gas=of)
            still = {"none": held(np.zeros(101))}
            run = integrate(filling, filling.initial({"tank": P0}), still, period=period, step_size=period / 20.0)
            ends[float(of.gas_constant)] = np.asarray(run.outputs["tank.pressure_abs"])
        slow, fast = ends.values()
        assert np.ptp(slow) > 1e4
        np.testing.assert_allclose(fast, slow, rtol=1e-6)
