"""Machines that several tests share: every structure is compiled once, whatever its parameters and signals."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from mckibben.assembly.accounts import accounts
from mckibben.assembly.build import AirLine, antagonist_pair, several, single_muscle, unit_from_specimen
from mckibben.assembly.loads import Body, MomentArm, PlateLoad
from mckibben.assembly.muscle_unit import Wrap
from mckibben.engine import Result, Run, held, march
from mckibben.engine.signals import Value
from mckibben.muscles.elements import Tendon
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.volume import FixedVolume, WallHeat

PERIOD, SAMPLES, STEP = 1e-3, 250, 50e-6
ROOM, SUPPLY = 101325.0, 6e5
ADIABATIC = WallHeat(conductance=0.0)
WALL = WallHeat(conductance=0.2)
compiled = jax.jit(march, static_argnums=(6, 7))  # the number of steps is an argument: one compilation for all


@functools.cache
def unit(rubs=True, wrapped=False, corded=False):
    wrap = Wrap(angle=0.0, friction=0.3) if wrapped else None
    tendon = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2) if corded else None
    # Stated, so that no better guess of what is usual moves these tests.
    return unit_from_specimen("nylon", rubs=rubs, wrap=wrap, tendon=tendon).replace(viscosity=jnp.asarray(1.0))


def plate(heat=ADIABATIC, corded=False):
    """One nylon muscle with friction, whose other end moves as the signal x says."""
    return single_muscle(unit(corded=corded), PlateLoad(held=("m",), signal="x"), supply=SUPPLY, heat=heat)


def body(heat=ADIABATIC, wrap_angle=0.0, corded=False, **load):
    """One nylon muscle with friction, over a bone, on a body."""
    wrapped = unit(wrapped=True, corded=corded)
    wrapped = wrapped.replace(wrap=wrapped.wrap.replace(angle=jnp.asarray(wrap_angle, float)))
    return single_muscle(wrapped, Body(held=("m",), signal="push", **load), supply=SUPPLY, heat=heat)


def pair(heat=ADIABATIC, corded=False, **joint):
    """Two nylon muscles on a joint, with moment arms that depend on the angle."""
    return antagonist_pair(
        unit(corded=corded), unit(corded=corded), supply=SUPPLY, heat=heat, inertia=2e-3, joint={"signal": "push", **joint},
        flexor_arm=MomentArm(coefficients=jnp.array([0.02, -0.004, -0.003]), span=0.14),
        extensor_arm=MomentArm(coefficients=jnp.array([-0.02, -0.004, 0.003]), span=0.14),
    )  # fmt: skip


def shared(heat=ADIABATIC):
    """Three muscles behind one tank, two with lines of their own, on one plate; without friction."""
    names = ("a", "b", "c")
    lines = {
        "a": AirLine(heat=heat),
        "b": AirLine(heat=heat, port_volume=4e-6),
        "c": AirLine(heat=heat, dead_volume=1e-6),
    }
    return several(
        {n: unit(rubs=False) for n in names}, PlateLoad(held=names, signal="x"), supply=SUPPLY, line=lines,
        tank=FixedVolume(volume=1e-4, heat=heat), feed=Orifice(conductance=4e-9),
    )  # fmt: skip


def smooth(corded=False):
    """One muscle without friction on a body; its gas flows one way through restrictions, so nothing has a kink."""
    valve = Orifice(conductance=4e-9)
    load = Body(
        held=("m",), signal="push", start=0.14, mass=3.0, weight=22.0, stiffness=500.0, spring_rest=0.14, damping=8.0
    )
    return single_muscle(
        unit(rubs=False, corded=corded), load, supply=5e5, valve=(valve, valve), tube=Orifice(conductance=5e-10),
        port_volume=2e-5, heat=WALL,
    )  # fmt: skip


def constant(**values):
    return {name: Value(jnp.asarray(float(v)), jnp.zeros(())) for name, v in values.items()}


def at(signals, index, share=0.0):
    return {name: s.at(index, share, PERIOD) for name, s in signals.items()}


def go(machine, pressure, signals, *, step=STEP, samples=SAMPLES, start=None):
    """A run from rest at one absolute pressure [Pa] in all volumes, with its accounts."""
    first = at(signals, 0)
    pressures = pressure if isinstance(pressure, dict) else dict.fromkeys(machine.circuit.chambers, pressure)
    begin = machine.initial(pressures, first) if start is None else start
    carry, kept = compiled(machine, *begin, signals, PERIOD, round(PERIOD / step), samples, False)
    carry, kept = jax.tree.map(np.asarray, (carry, kept))
    assert all(np.isfinite(leaf).all() for leaf in jax.tree.leaves((carry, kept)))
    known = {
        "time": PERIOD * np.arange(samples + 1), "outputs": kept[2], "state": carry[0], "memory": carry[1],
        "integrals": carry[2], "result": Result.DONE, "stiff": False, "step": step,
    }  # fmt: skip
    run = Run(*(known.get(name) for name in Run._fields))
    return run, accounts(machine, begin, run, first, at(signals, samples - 1, 1.0))


def switched(opening, begin, end, samples=SAMPLES):
    """A held command that is open between two samples."""
    index = np.arange(samples + 1)
    return held(np.where((index >= begin) & (index < end), opening, 0.0))


DESTROYED = ("valve", "tube", "dead_volume", "exhaust", "leak", "machine", "mixing", "heat", "friction", "viscous")


def exergy_closes(account, least=-1e-9):
    """1e-6 of what crossed the border is promised; RK4 at 50 us meets 1e-7, less where a valve jumps near equal pressure."""
    ledger = account.energy_parts.exergy
    assert account.exergy < 1e-6, ledger
    for name in DESTROYED:  # the second law, to the rounding of sums of joules
        assert ledger.out[name] >= least * ledger.throughput, (name, ledger)
    energy, load = account.energy_parts.energy, account.energy_parts.load
    assert abs(energy.remainder) < 1e-6 * energy.throughput
    # a load's work is some thousandths of what the gas carries, and rounding of the contact is in it
    assert abs(load.remainder) < 2e-6 * load.throughput
    return ledger
