"""Kernels of the package's own systems against XLA, over states that no run visits: slack, choked, reversed, at stops."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from rubbing_systems import PERIOD, per_lane, rubbing

from mckibben.assembly.build import rig_unit, single_muscle
from mckibben.assembly.loads import PlateLoad
from mckibben.components.system import System
from mckibben.engine import held, march
from mckibben.engine.integration import compile_march
from mckibben.engine.native import compile_function
from mckibben.engine.signals import Value
from mckibben.engine.step import step
from mckibben.errors import InputError
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.pneumatics.volume import FixedVolume, Reservoir, WallHeat

STEP, LANES = 50e-6, 256


class WithoutAccounts(System):
    """A system of whose balances nobody asks: a third of the compilation."""

    inner: System

    def rate(self, *given):
        return self.inner.rate(*given)

    def integrands(self, *given):
        return {}

    def advance_memory(self, *given):
        return self.inner.advance_memory(*given)

    def outputs(self, *given):
        return self.inner.outputs(*given)


def machine():
    """The nylon muscle with friction behind a tube and ISO 6358 valves; its other end is moved."""
    return single_muscle(rig_unit("nylon"), PlateLoad(held=("m",), signal="x"), supply=6e5)


def anywhere(example, chance):
    """States far apart: vacuum to 15 bar, flow both ways, lengths from below the shortest to beyond the stop."""
    state, memory, inputs = example
    spread = jax.tree.map(lambda leaf: np.repeat(np.asarray(leaf)[..., None], LANES, -1), state)
    gas = spread["circuit"]
    gas["pressure"] = {k: 10.0 ** chance.uniform(4.7, 6.2, LANES) for k in gas["pressure"]}
    gas["elements"] = jax.tree.map(lambda leaf: 1e-3 * chance.normal(size=leaf.shape), gas["elements"])
    one = spread["muscles"]["m"]
    length, velocity = chance.uniform(0.09, 0.17, LANES), chance.normal(size=LANES)
    spread["muscles"]["m"] = one._replace(length=length, velocity=velocity)
    slipped = jax.tree.map(lambda leaf: 1e-3 * chance.normal(size=(*np.shape(leaf), LANES)), memory)
    near = {k: Value(chance.uniform(0.0, 1.0, LANES), chance.normal(size=LANES)) for k in inputs}
    near["x"] = Value(length + chance.uniform(-3e-3, 3e-3, LANES), chance.normal(size=LANES))
    return spread, slipped, near


def one_step(system, state, memory, inputs, h):
    state, memory, _ = step(WithoutAccounts(system), (state, memory, {}), lambda share: inputs, h, False)
    return state, memory


def test_one_strict_step_is_that_of_xla_within_three_units_in_the_last_place():
    system = machine()
    inputs = {n: Value(jnp.asarray(0.14 if n == "x" else 0.5), jnp.zeros(())) for n in system.signals()}
    example = (*system.initial(dict.fromkeys(system.circuit.chambers, 2e5), inputs), inputs)
    far = anywhere(example, np.random.default_rng(10))
    found, want = (
        jax.tree.leaves(
            compile_function(one_step, system, *example, STEP, engine=e)(system, *far, STEP, lanes=LANES, **mode)
        )
        for e, mode in (("native", {"mode": "strict"}), ("xla", {}))
    )
    names = [jax.tree_util.keystr(p) for p, _ in jax.tree.leaves_with_path(far[:2])]
    assert 0.2 < np.mean(far[0]["muscles"]["m"].length < 0.14) < 0.8  # slack and taut
    for name, a, b, old in zip(names, found, want, jax.tree.leaves(far[:2]), strict=True):
        assert np.isfinite(b).all(), name
        size = np.maximum(np.abs(old), np.abs(b))
        if name.endswith(".work"):  # a ledger: the energies of eight springs, whose sum nearly vanishes
            size = np.maximum(size, np.abs(b).max())
        unit = np.spacing(np.maximum(size, np.abs(b - old)))
        assert (np.abs(a - b) <= 3.0 * unit).all(), (name, (np.abs(a - b) / unit).max())


def circuit():
    """Two tanks, a tube with its inertia, and two valves that choke and are crossed both ways."""
    nodes = {
        "supply": Reservoir(pressure_abs=7e5), "room": Reservoir(pressure_abs=101325.0),
        "near": FixedVolume(volume=2e-5, heat=WallHeat(conductance=0.1)), "far": FixedVolume(volume=8e-5),
    }  # fmt: skip
    valve = Orifice(conductance=4e-9)
    branches = {
        "fill": Branch(valve, ("supply", "near"), "fill"), "vent": Branch(valve, ("near", "room"), "vent"),
        "tube": Branch(LumpedTube(length=0.5, diameter=3e-3), ("near", "far")),
    }  # fmt: skip
    return Circuit.of(nodes, branches)


def test_two_thousand_steps_of_a_circuit_stay_with_xla():
    net, time = circuit(), np.arange(101)
    signals = {"fill": held(np.where(time % 40 < 15, 1.0, 0.0)), "vent": held(np.where(time % 40 > 22, 1.0, 0.0))}
    start = net.initial({"near": 101325.0, "far": 3e5})
    arguments = (net, start, (), signals)
    chance = np.random.default_rng(11)
    many = (*per_lane(arguments[:2], 12, chance, 0.02), (), signals)
    options = {"period": 1e-3, "inner": 20, "outputs": ["near.pressure_abs", "far.pressure_abs", "tube.mass_flow"]}
    found, want = (compile_march(*arguments, **options, engine=e)(*many, lanes=12) for e in ("native", "xla"))
    assert np.ptp(want["far.pressure_abs"]) > 5e4 and want["tube.mass_flow"].min() < 0.0 < want["tube.mass_flow"].max()
    for name, b in want.items():
        # of each channel's largest value: 2,000 steps, whose roundings neither grow nor are amplified
        np.testing.assert_allclose(found[name], b, rtol=0.0, atol=1e-12 * np.abs(b).max(), err_msg=name)


def test_a_stiff_run_with_its_linear_systems_stays_with_xla():
    arguments = rubbing()
    found, want = (
        compile_march(*arguments, period=PERIOD, inner=3, stiff=True, engine=e)(*arguments) for e in ("native", "xla")
    )
    for name, b in want.items():
        np.testing.assert_allclose(found[name], b, rtol=0.0, atol=1e-12 * np.abs(b).max(), err_msg=name)


@pytest.mark.slow
def test_two_thousand_steps_of_a_machine_stay_with_xla():
    system, time = machine(), np.arange(101)
    signals = {
        "m.fill": held(np.where((time > 5) & (time < 40), 1.0, 0.0)), "m.vent": held(np.where(time > 60, 1.0, 0.0)),
        "x": held(np.full(101, 0.14)),
    }  # fmt: skip
    first = {n: s.at(0, 0.0, 1e-3) for n, s in signals.items()}
    start = system.initial(dict.fromkeys(system.circuit.chambers, 1.2e5), first)
    chance = np.random.default_rng(12)
    many = (*per_lane((system, *start), 12, chance, 0.005), signals)
    names = ["m.length", "m.tension", "m.pressure", "m.friction"]

    def run(*given):
        return {n: march(*given, 1e-3, 20, 100, False)[1][2][n] for n in names}

    found, want = (compile_function(run, system, *start, signals, engine=e)(*many, lanes=12) for e in ("native", "xla"))
    assert want["m.tension"].min() == 0.0 < want["m.tension"].max() / 20.0  # slack, and above 20 N
    for name, b in want.items():
        np.testing.assert_allclose(found[name], b, rtol=0.0, atol=1e-12 * np.abs(b).max(), err_msg=name)


@pytest.mark.slow
def test_the_whole_bench_with_its_software_stays_with_xla():
    """Sensors, controllers, interlocks, the latency of commands, and the machine: a kernel of one sampled run."""
    from mckibben.bench.prepare import prepare
    from mckibben.bench.segment import SegmentMachine, software_of, timing_of
    from mckibben.engine import sampled
    from mckibben.experiments.read import protocol

    bench = prepare(protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=2), muscle="nylon", rig="paper")
    part, timing = next(iter(bench.segments())), timing_of(bench)
    software, own = software_of(bench, part, timing), SegmentMachine(bench, 0, part, timing)
    carry = own.carry(software)
    clock = timing.period, timing.inner, timing.latency

    def run(plant, software, carry, rows):
        return sampled.march(plant, software, carry, rows, *clock, False)

    rows = own.rows.next()
    by_kernel, by_xla = (compile_function(run, own.plant, software, carry, rows, engine=e) for e in ("native", "xla"))
    moved = 0.0
    for _ in range(4):
        (carry, seen), (after, other) = (
            by_xla(own.plant, software, carry, rows),
            by_kernel(own.plant, software, carry, rows),
        )
        moved = max(moved, float(np.ptp(seen.outputs["muscle.pressure"])))
        sums = jax.tree.map(lambda a, b: np.abs(a - b).max(), after.integrals, carry.integrals)
        # kg and J; some are sums of flows that cancel, or of motion at rest, of which 60 J turn over: 5e-14 of them
        assert max(jax.tree.leaves(sums)) < 3e-12
        # A number that is carried may be what remains of larger ones, a velocity of forces; a channel has its whole range.
        # Converters and encoders pass a rounding on as a step only where it falls on one of their borders.
        for share, (mine, theirs) in {1e-8: (after, carry), 1e-10: (other, seen)}.items():
            for a, b in zip(*(jax.tree.leaves(t) for t in (mine, theirs)), strict=True):
                known = np.isfinite(b)
                np.testing.assert_array_equal(np.isfinite(a), known)
                scale = np.abs(b[known]).max(initial=0.0)
                np.testing.assert_allclose(a[known], b[known], rtol=0.0, atol=share * scale + 1e-12 * (share == 1e-8))
        rows = own.rows.next()
    assert moved > 1e4


def test_an_output_that_a_system_does_not_have_is_refused():
    with pytest.raises(InputError, match="speed"):
        compile_march(*rubbing(), period=PERIOD, inner=2, outputs=["speed"])
