"""The order in which circuits converge: 4 where all is smooth, 2 where flow reverses or chokes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.engine import held, march, ramped
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.pneumatics.volume import FixedVolume, Reservoir, WallHeat, adiabatic

PERIOD = 4e-3
STEPS = [1e-3 / 2**k for k in range(5)]
SUPPLY = 7e5
compiled = jax.jit(march, static_argnums=(6, 7))  # the number of steps is an argument: one compilation for all


def network(conductance):
    return Circuit.of(
        {
            "supply": Reservoir(pressure_abs=SUPPLY, temperature=310.0),
            "block": FixedVolume(volume=1e-4, heat=adiabatic()),
            "tank": FixedVolume(volume=3e-4, heat=WallHeat(conductance=0.5)),
            "room": Reservoir(),
        },
        {
            "fill": Branch(Orifice(conductance=conductance), ("supply", "block"), "fill"),
            "vent": Branch(Orifice(conductance=conductance), ("block", "room"), "vent"),
            "tube": Branch(LumpedTube(length=1.0, diameter=5e-3), ("block", "tank")),
        },
    )


def final(system, pressures, signals, step, method, flow=0.0):
    start = system.initial(pressures)
    start["elements"]["tube"] = jnp.asarray(flow)
    samples = len(signals["fill"].values) - 1
    arguments = (system, start, (), signals, PERIOD, round(PERIOD / step), samples, method == "ros2")
    (state, _, _), (_, _, outputs) = compiled(*arguments)
    return np.array([float(state["pressure"][n]) for n in ("block", "tank")]), outputs


def slope(values, steps):
    """Order from the decrease of the error against the finest step."""
    errors = np.array([np.abs(v / values[-1] - 1.0).max() for v in values[:-1]])
    assert errors[-1] > 1e-14  # not yet rounding
    return np.polyfit(np.log2(steps[:-1]), np.log2(errors), 1)[0], errors


def smooth_signals(samples=11):
    return {"fill": ramped(np.linspace(0.5, 0.6, samples)), "vent": ramped(np.full(samples, 0.02))}


def test_order_4_where_all_is_smooth():
    """Subsonic throughout, always in one direction, above the linear zone, the tube turbulent."""
    values, runs = zip(
        *(final(network(8e-9), {"block": 3.7e5, "tank": 3.3e5}, smooth_signals(), h, "rk4", 2e-3) for h in STEPS),
        strict=True,
    )
    out = runs[-1]
    ratio = out["block.pressure_abs"] / SUPPLY
    assert ratio.min() > 0.4 and ratio.max() < 0.95 and out["fill.mass_flow"].min() > 0.0
    # Re above 4000, where the friction of the tube has no corner
    assert out["tube.mass_flow"].min() > 4000.0 * 0.25 * np.pi * 5e-3 * 1.9e-5
    order, errors = slope(values, STEPS)
    assert order > 3.7, (order, errors)


@pytest.mark.slow  # a stiff solver in Python
def test_order_2_of_the_stiff_method_on_the_same():
    values, _ = zip(
        *(final(network(8e-9), {"block": 3.7e5, "tank": 3.3e5}, smooth_signals(), h, "ros2", 2e-3) for h in STEPS),
        strict=True,
    )
    order, errors = slope(values, STEPS)
    assert order == pytest.approx(2.0, abs=0.3), errors


def test_order_2_over_reversals_and_the_edges_of_choking():
    """Valves that switch on the samples; the tube's flow reverses, and the room is reached through the linear zone."""
    samples = 51
    fill = (np.arange(samples) // 10) % 2 == 0
    signals = {"fill": held(fill), "vent": held(~fill)}
    steps = [5e-4 / 2**k for k in range(7)]
    values, runs = zip(
        *(final(network(3e-8), {"block": 1.5e5, "tank": 1.2e5}, signals, h, "rk4") for h in steps), strict=True
    )
    flow = runs[-1]["tube.mass_flow"]
    assert flow.min() < -1e-4 and flow.max() > 1e-4
    order, errors = slope(values, steps)
    assert 1.5 < order < 4.5, (order, errors)  # 2 in the worst case; where few corners are met, better
    assert errors[steps.index(6.25e-5)] < 1e-5
