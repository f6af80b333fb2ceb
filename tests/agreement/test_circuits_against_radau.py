"""Circuits against SciPy's Radau on equations written a second time, by hand and in NumPy."""

import re

import jax
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mckibben.components.flow import GasState
from mckibben.engine import Result, held, integrate, ramped
from mckibben.errors import ConvergenceError
from mckibben.muscles import law_from_specimen
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import InertialTube, LumpedTube
from mckibben.pneumatics.volume import FixedVolume, MovingVolume, Reservoir, WallHeat, adiabatic
from mckibben.specimens import specimen

R, GAMMA, T0, ROOM, SUPPLY = 287.05, 1.4, 293.15, 101325.0, 7e5
CP = GAMMA * R / (GAMMA - 1.0)
PERIOD, STEP = 1e-3, 50e-6
C, B, BAND = 1.2e-8, 0.35, 5e3
LENGTH, BORE = 0.8, 4e-3
DEAD, TANK, WALL = 1.5e-5, 1e-4, 0.4  # volumes of valve and tank [m^3], heat conductance of the tank [W/K]
MUSCLE = law_from_specimen(specimen("nylon"))
VALVE = Orifice(conductance=C, critical_ratio=B, linear_band=BAND)


def flow(p1, t1, p2, t2, opening):
    """ISO 6358 and the parabola of the linear zone, from a to b [kg/s]."""
    if p2 > p1:
        return -flow(p2, t2, p1, t1, opening)
    ratio = p2 / p1
    square = 1.0 - (max(ratio - B, 0.0) / (1.0 - B)) ** 2
    edge = 1.0 - ((1.0 - BAND / p1 - B) / (1.0 - B)) ** 2
    share = square / edge
    psi = np.sqrt(square) if share >= 1.0 else np.sqrt(edge) * share * (1.5 - 0.5 * share)
    return C * opening * 1.185 * np.sqrt(T0 / t1) * p1 * psi


def inertial(p1, t1, p2, t2, w):
    """Chou and Hannaford's third tube, by hand [kg/s^2]."""
    v = w * R * (t1 if w >= 0.0 else t2) / (0.5 * (p1 + p2) * AREA)
    return (p1 - p2 - 200.0 * v - 12.0 * v * abs(v)) * AREA / LENGTH


LUMPED = LumpedTube(length=LENGTH, diameter=BORE)
RATE = jax.jit(lambda p1, t1, p2, t2, w: LUMPED.rate(GasState(p1, t1), GasState(p2, t2), w, 0.0))
AREA = 0.25 * np.pi * BORE**2
# The tube, its rate and its own volume; the lumped one gives its rate itself, all around it is written by hand.
TUBES = {
    "inertial": (InertialTube(viscous=200.0, turbulent=12.0, area=AREA, length=LENGTH), inertial, 0.0),
    "lumped": (LUMPED, lambda *x: float(RATE(*x)), AREA * LENGTH),
}


def equations(tube, state, fill, vent):
    """Adiabatic valve chamber (mass, pressure), tube (flow), wall-heat tank (mass, pressure)."""
    m1, p1, w, m2, p2 = state
    _, tube_rate, own = TUBES[tube]
    v1, v2 = DEAD + 0.5 * own, TANK + 0.5 * own
    t1, t2 = p1 * v1 / (m1 * R), p2 * v2 / (m2 * R)
    filling, venting = flow(SUPPLY, 310.0, p1, t1, fill), flow(p1, t1, ROOM, T0, vent)
    h_fill = CP * filling * (310.0 if filling >= 0.0 else t1)
    h_vent = CP * venting * (t1 if venting >= 0.0 else T0)
    h_tube = CP * w * (t1 if w >= 0.0 else t2)
    heat = WALL * (T0 - t2)
    return np.array([
        filling - venting - w, (GAMMA - 1.0) * (h_fill - h_vent - h_tube) / v1,
        tube_rate(p1, t1, p2, t2, w), w, (GAMMA - 1.0) * (h_tube + heat) / v2,
    ])  # fmt: skip


def system(tube):
    return Circuit.of(
        {
            "supply": Reservoir(pressure_abs=SUPPLY, temperature=310.0),
            "valve": FixedVolume(volume=DEAD, heat=adiabatic()),
            "tank": FixedVolume(volume=TANK, heat=WallHeat(conductance=WALL)),
            "room": Reservoir(),
        },
        {
            "fill": Branch(VALVE, ("supply", "valve"), "fill"),
            "vent": Branch(VALVE, ("valve", "room"), "vent"),
            "tube": Branch(TUBES[tube][0], ("valve", "tank")),
        },
    )


def start_of(circuit):
    start = circuit.initial({"valve": 2e5, "tank": 2e5})
    flat = [start["mass"]["valve"], 2e5, 0.0, start["mass"]["tank"], 2e5]
    return start, np.array([float(x) for x in flat])


def truth(tube, start, times, commands, corners):
    """Radau at the sample times, anew at every corner of the input.

    Args:
        commands: the two openings as functions of a time and a time within the same piece.
        corners: where pieces begin.
    """
    y, now, found = start, 0.0, [start]
    pieces = np.unique(np.concatenate([times, corners]))
    scale = np.array([1e-4, 1e5, 1e-3, 1e-4, 1e5])
    for a, b in zip(pieces[:-1], pieces[1:], strict=True):
        middle = 0.5 * (a + b)
        rate = lambda t, z, m=middle: equations(tube, z * scale, *commands(t, m)) / scale  # noqa: E731
        y = solve_ivp(rate, (a, b), y / scale, method="Radau", rtol=1e-10, atol=1e-13).y[:, -1] * scale
        now = b
        if np.any(np.isclose(times, now, atol=1e-12, rtol=0.0)):
            found.append(y)
    return np.array(found)


NAMES = ("valve.mass", "valve.pressure_abs", "tube.mass_flow", "tank.mass", "tank.pressure_abs")


def errors(run, exact):
    """Largest deviation of each state over its largest value."""
    return {
        name: np.abs(run.outputs[name] - exact[:, i]).max() / np.abs(exact[:, i]).max() for i, name in enumerate(NAMES)
    }


@pytest.mark.parametrize("tube", TUBES)
def test_smooth_inputs(tube):
    circuit = system(tube)
    time = PERIOD * np.arange(61)
    # Filling throughout: where flow or pressures change sign the gas comes from the other side, and that is a corner.
    fill, vent = 0.2 + 0.05 * np.sin(2.0 * np.pi * 15.0 * time), 0.02 + 0.01 * np.cos(2.0 * np.pi * 15.0 * time)
    start, flat = start_of(circuit)
    run = integrate(circuit, start, {"fill": ramped(fill), "vent": ramped(vent)}, period=PERIOD, step_size=STEP)
    assert not run.stiff
    straight = lambda t, _: (np.interp(t, time, fill), np.interp(t, time, vent))  # noqa: E731
    for name, error in errors(run, truth(tube, flat, time, straight, time)).items():
        assert error < 1e-6, (name, error)  # asked for at 50 us
    assert np.all(np.diff(run.outputs["valve.pressure_abs"] > run.outputs["tank.pressure_abs"])[1:] == 0)


def switched(tube, late):
    """A run with valves that switch late, and the truth."""
    circuit = system(tube)
    time = PERIOD * np.arange(121)
    fill = 1.0 * ((np.arange(121) // 25) % 2 == 0)
    signals = {"fill": held(fill).delayed(late), "vent": held(1.0 - fill).delayed(late)}
    start, flat = start_of(circuit)
    run = integrate(circuit, start, signals, period=PERIOD, step_size=STEP, method="rk4")

    def opened(_, middle):
        opening = fill[max(int((middle - late) / PERIOD), 0)]
        return opening, 1.0 - opening

    exact = truth(tube, flat, time, opened, time + late)
    assert np.ptp(exact[:, 4]) > 2e5  # it did fill and empty
    return run, exact


def test_valves_that_switch_on_the_samples():
    run, exact = switched("inertial", 0.0)
    assert max(errors(run, exact).values()) < 2e-4


# 0.3250 ms is 6.5 steps, where the stages of a step see a switch worst.
LATE = [0.3137e-3, 0.3250e-3, pytest.param(0.3499e-3, marks=pytest.mark.slow)]


@pytest.mark.parametrize("late", LATE)
def test_valves_that_switch_off_the_grid(late):
    """120 l/min at 7 bar into a tank of 100 ml, adiabatic; and out again."""
    circuit = Circuit.of(
        {
            "supply": Reservoir(pressure_abs=SUPPLY),
            "tank": FixedVolume(volume=TANK, heat=adiabatic()),
            "room": Reservoir(),
        },
        {
            "fill": Branch(VALVE, ("supply", "tank"), "fill"),
            "vent": Branch(VALVE, ("tank", "room"), "vent"),
        },
    )
    time = PERIOD * np.arange(401)
    fill = 0.25 * ((np.arange(401) // 100) % 2 == 0)
    signals = {"fill": held(fill).delayed(late), "vent": held(0.25 - fill).delayed(late)}
    start = circuit.initial({"tank": ROOM})
    run = integrate(circuit, start, signals, period=PERIOD, step_size=STEP)

    def rate(z, opening):
        mass, p = 1e-4 * z[0], 1e5 * z[1]
        t = p * TANK / (mass * R)
        into, out = flow(SUPPLY, T0, p, t, opening), flow(p, t, ROOM, T0, 0.25 - opening)
        carried = CP * (into * (T0 if into > 0.0 else t) - out * (t if out > 0.0 else T0))
        return [1e4 * (into - out), 1e-5 * (GAMMA - 1.0) * carried / TANK]

    y, exact = [1e4 * float(start["mass"]["tank"]), ROOM / 1e5], [ROOM]
    for a in range(400):
        for begin, end, k in ((time[a], time[a] + late, max(a - 1, 0)), (time[a] + late, time[a + 1], a)):
            solution = solve_ivp(
                lambda _, z, k=k: rate(z, fill[k]), (begin, end), y, method="Radau", rtol=1e-9, atol=1e-11
            )
            y = solution.y[:, -1]
        exact.append(1e5 * y[1])
    assert np.ptp(exact) > 3e5
    # 2e-4 is asked for at 50 us
    assert np.abs(run.outputs["tank.pressure_abs"] - exact).max() / max(exact) < 2e-4


@pytest.mark.parametrize("late", LATE)
def test_a_valve_block_that_fills_in_a_hundred_steps(late):
    """480 l/min into 15 ml, where a step is 1 % of the filling; the switch falls anywhere in a step."""
    run, exact = switched("inertial", late)
    assert max(errors(run, exact).values()) < 2e-4


def muscle_rate(p, length, velocity, fill):
    """V = V0 - Kg ((L - Lmin)^2 - (L0 - Lmin)^2)/2, eq. 38b, above the threshold; isothermal."""
    kg, shortest, rest, volume = (
        float(getattr(MUSCLE, name))
        for name in ("stiffness_per_pressure", "shortest_length", "rest_length", "rest_volume")
    )
    value = volume - 0.5 * kg * ((length - shortest) ** 2 - (rest - shortest) ** 2) + 1e-6
    slope = -kg * (length - shortest)
    return (R * T0 * flow(SUPPLY, T0, p, T0, fill) - p * slope * velocity) / value


def test_an_isothermal_moving_muscle():
    circuit = Circuit.of(
        {"supply": Reservoir(pressure_abs=SUPPLY), "muscle": MovingVolume(of=MUSCLE.braid_volume, dead_volume=1e-6)},
        {"fill": Branch(VALVE, ("supply", "muscle"), "fill")},
    )
    time = PERIOD * np.arange(61)
    length, fill = 0.14 - 0.3 * time, 0.02 + 0.05 * np.sin(2.0 * np.pi * 10.0 * time) ** 2
    start = circuit.initial({"muscle": 3e5}, {"length": length[0]})
    run = integrate(circuit, start, {"length": ramped(length), "fill": ramped(fill)}, period=PERIOD, step_size=STEP)
    rate = lambda t, y: [muscle_rate(1e5 * y[0], 0.14 - 0.3 * t, -0.3, np.interp(t, time, fill)) / 1e5]  # noqa: E731
    y, exact = [3.0], [3e5]
    for a, b in zip(time[:-1], time[1:], strict=True):
        y = solve_ivp(rate, (a, b), y, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
        exact.append(1e5 * y[0])
    np.testing.assert_allclose(run.outputs["muscle.pressure_abs"], exact, rtol=1e-6)  # asked for at 50 us


def small_volume(h, method, *, raises=True):
    """600 l/min into 1 cm3, full in a few milliseconds, and emptied again by the valve to the room."""
    valve = Orifice.from_flow(600e-3 / 60, pressure=6.9e5)
    circuit = Circuit.of(
        {"supply": Reservoir(pressure_abs=7.9e5), "small": FixedVolume(volume=1e-6), "room": Reservoir()},
        {
            "fill": Branch(valve, ("supply", "small"), "fill"),
            "vent": Branch(valve, ("small", "room"), "vent"),
        },
    )
    fill = (np.arange(41) // 10) % 2 == 0
    signals = {"fill": held(fill), "vent": held(~fill)}
    run = integrate(
        circuit, circuit.initial({"small": ROOM}), signals, period=PERIOD, step_size=h, method=method, raises=raises
    )
    return run, valve, fill


def small_truth(valve, fill, times):
    """The same by Radau, isothermal."""
    c, b = float(valve.conductance), float(valve.critical_ratio)
    y, found = [ROOM / 1e5], [ROOM]
    for k in range(len(times) - 1):

        def rate(_, z, opening=fill[k]):
            p = 1e5 * z[0]
            w = flow(7.9e5, T0, p, T0, 1.0) if opening else -flow(p, T0, ROOM, T0, 1.0)
            return [R * T0 * w * (c / C) / 1e-6 / 1e5]

        assert b == B  # what `flow` is written for
        y = solve_ivp(rate, (times[k], times[k + 1]), y, method="Radau", rtol=1e-10, atol=1e-12).y[:, -1]
        found.append(1e5 * y[0])
    return np.array(found)


@pytest.mark.parametrize("h", [50e-6, pytest.param(100e-6, marks=pytest.mark.slow)])
def test_a_circuit_too_stiff_says_which_step_it_needs_and_is_right_with_it(h):
    with pytest.raises(ConvergenceError, match="too fast for this step") as told:
        small_volume(h, "rk4")
    need = float(re.search(r"needs ([\d.e-]+) s or less", str(told.value)).group(1))
    assert 1e-6 < need < h
    run, valve, fill = small_volume(need, "rk4")
    exact = small_truth(valve, fill, run.time)
    # At the very edge of stability the error is a few 1e-4 of the pressure in the millisecond of the fall, and dies out.
    np.testing.assert_allclose(run.outputs["small.pressure_abs"], exact, rtol=1e-3)
    np.testing.assert_allclose(run.outputs["small.pressure_abs"][10::10], exact[10::10], rtol=1e-6)


def test_auto_takes_the_stiff_method_and_agrees():
    run, valve, fill = small_volume(50e-6, "auto")
    assert run.stiff
    exact = small_truth(valve, fill, run.time)
    assert np.abs(run.outputs["small.pressure_abs"] - exact).max() < 0.01 * 6.9e5  # of the stroke; order 2 in 1 ms
    np.testing.assert_allclose(run.outputs["small.pressure_abs"][10::10], exact[10::10], rtol=1e-6)


def test_a_limit_cycle_that_the_samples_do_not_show_is_reported():
    """Too long a step jumps over the steep zone again and again, so that no sample need lie in it."""
    run, *_ = small_volume(100e-6, "rk4", raises=False)
    calm, *_ = small_volume(100e-6, "ros2")
    swing = np.abs(run.outputs["small.pressure_abs"] - calm.outputs["small.pressure_abs"])[5:10]
    assert swing.max() > 1e3  # it does not rest where the pressures are equal [Pa]
    assert run.result is Result.TOO_STIFF and not calm.message.startswith("A mode")
