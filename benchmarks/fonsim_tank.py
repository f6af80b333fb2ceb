"""FONSim's case beside ours: a source at 0.9 bar, its standard tube of 2 mm x 0.6 m, a tank of 120 ml.

    python benchmarks/fonsim_tank.py [--json] [--repeats N]

Both run in this one process, each with the steps and methods it offers; an error is the largest deviation of the tank's
pressure from the same program's own converged result, over the step of 0.9 bar; a time is the median of repeated runs,
compilation apart. FONSim's tube has no inertia, no end losses, and none of the force that accelerates the gas: pressure drop
is Darcy and Weisbach's at the mean density. `DarcyTube` states that physics as an element of ours, with the friction law of
the library; `LumpedTube` and the distributed tube have all of it, and show what FONSim leaves out.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import statistics
import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mckibben.components import Scalar
from mckibben.components.flow import GasState, TwoPort
from mckibben.components.gas import AIR, Gas
from mckibben.engine import held, march
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.distributed import DistributedTube, ReservoirEnd, VesselEnd, simulate
from mckibben.pneumatics.tubes import LumpedTube, haaland, inertance, turbulence
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir
from mckibben.quantities import quantity

LENGTH, DIAMETER, ROUGHNESS, TANK = 0.6, 2e-3, 1.5e-6, 120e-6
# FONSim's state of its gas: 1.013 bar, 1.23 kg/m3, 1.82e-5 Pa s. With our gas constant that is a temperature.
AMBIENT, DENSITY, VISCOSITY, STEP = 1.013e5, 1.23, 1.82e-5, 0.9e5
TEMPERATURE = AMBIENT / (DENSITY * float(AIR.gas_constant))
GAS = Gas(viscosity_reference=float(AIR.viscosity_reference) * VISCOSITY / float(AIR.viscosity(TEMPERATURE)))
DURATION, SAMPLE = 1.0, 0.02
TIMES = SAMPLE * np.arange(round(DURATION / SAMPLE) + 1)
TARGETS = (1e-3, 1e-4, 1e-5)


class DarcyTube(TwoPort):
    """FONSim's physics of a tube as an element of ours; the inertance is added, a lag of half a millisecond."""

    length: Scalar = quantity("m", (1e-3, 100.0), "length", default=LENGTH)
    diameter: Scalar = quantity("m", (1e-4, 0.1), "inner diameter", default=DIAMETER)
    roughness: Scalar = quantity("m", (0.0, 1e-3), "height of the wall's roughness", default=ROUGHNESS)
    gas: Gas = GAS

    def initial(self) -> Any:
        return jnp.zeros(())

    def mass_flow(self, a: GasState, b: GasState, state: Any = (), command: Any = 0.0) -> Scalar:
        return state

    def rate(self, a: GasState, b: GasState, state: Any, command: Any) -> Any:
        area = 0.25 * jnp.pi * self.diameter**2
        mu = self.gas.viscosity(a.temperature)
        re = jnp.abs(state) * self.diameter / (area * mu)
        share = turbulence(re)
        volume = 1.0 / self.gas.density(0.5 * (a.pressure_abs + b.pressure_abs), a.temperature)
        laminar = (1.0 - share) * 32.0 * mu / self.diameter
        turbulent = 0.5 * share * haaland(re, self.roughness / self.diameter) * jnp.abs(state) / area
        loss = volume * (laminar + turbulent) * (state / area) * self.length / self.diameter
        return (a.pressure_abs - b.pressure_abs - loss) / inertance(length=self.length, area=area)


_compiled = jax.jit(march, static_argnums=(6, 7))


class Ours:
    """Our case with one tube, one step and one method, ready to run."""

    def __init__(self, tube: Any, step: float, stiff: bool = False, gauge: float = STEP) -> None:
        supply = Reservoir(pressure_abs=AMBIENT + gauge, temperature=TEMPERATURE)
        nodes = {"source": supply, "tank": FixedVolume(volume=TANK, heat=Isothermal())}
        circuit = Circuit.of(nodes, {"tube": Branch(tube, ("source", "tank"))}, gas=GAS)
        start = circuit.initial({"tank": AMBIENT}, temperature=TEMPERATURE)
        clock = {"clock": held(np.zeros(len(TIMES)))}
        self.arguments = (circuit, start, (), clock, SAMPLE, round(SAMPLE / step), len(TIMES) - 1, stiff)

    def run(self) -> np.ndarray:
        """Absolute pressure of the tank at `TIMES` [Pa]."""
        _, kept = _compiled(*self.arguments)
        return np.asarray(kept[2]["tank.pressure_abs"])


def lumped(ends: float = 1.0) -> LumpedTube:
    """Our own tube of the same dimensions; the bore's outlet loses its velocity head, the inlet is rounded."""
    return LumpedTube(length=LENGTH, diameter=DIAMETER, roughness=ROUGHNESS, ends=ends)


def distributed(gauge: float = STEP) -> np.ndarray:
    """The reference resolved along the tube, isothermal as FONSim's gas; pressure of the tank at `TIMES` [Pa]."""
    tube = DistributedTube(
        length=LENGTH, diameter=DIAMETER, roughness=ROUGHNESS, wall="isothermal", wall_temperature=TEMPERATURE, gas=GAS
    )
    vessel = VesselEnd(volume=TANK, pressure_abs=AMBIENT, temperature=TEMPERATURE, heat=Isothermal())
    supply = ReservoirEnd(pressure_abs=AMBIENT + gauge, temperature=TEMPERATURE)
    result = simulate(
        tube, supply, vessel, duration=DURATION, sample_period=SAMPLE, pressure_abs=AMBIENT, temperature=TEMPERATURE
    )
    return result.right.outside_pressure


class Fonsim:
    """FONSim's case with its own components, one step and one method, ready to run once."""

    def __init__(self, step: Any, discretization: str, tolerance: float, gauge: float = STEP) -> None:
        with contextlib.redirect_stdout(io.StringIO()):  # it greets
            import fonsim

        stated = (fonsim.pressure_atmospheric, fonsim.air.rho_stp, fonsim.air.mu)
        if not np.allclose(stated, (AMBIENT, DENSITY, VISCOSITY), rtol=1e-9, atol=0.0):
            raise ValueError(f"this release of FONSim has another air: {stated}")
        system = fonsim.System()
        system.add(fonsim.PressureSource("source", fluid=fonsim.air, pressure=AMBIENT + gauge))
        system.add(fonsim.CircularTube("tube", fluid=fonsim.air, length=LENGTH, diameter=DIAMETER, roughness=ROUGHNESS))
        system.add(fonsim.Container("tank", fluid=fonsim.air, volume=TANK))
        system.connect("source", "tube")
        system.connect("tube", "tank")
        self.tank = system.get("tank")
        self.simulation = fonsim.Simulation(
            system, duration=DURATION, step=step, discretization=discretization,
            relative_solving_tolerance=tolerance, verbose=0,
        )  # fmt: skip

    def run(self) -> np.ndarray:
        """Absolute pressure of the tank at `TIMES` [Pa], straight between FONSim's own steps."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.simulation.run()
        return np.interp(TIMES, self.simulation.times, self.tank.get("pressure"))


def error(pressure: np.ndarray, reference: np.ndarray) -> float:
    """Largest deviation over the step of 0.9 bar."""
    return float(np.abs(pressure - reference).max() / STEP)


def timed(make: Any, repeats: int) -> tuple[np.ndarray, float]:
    """The result, and the median time of `run` alone [s]; the first run compiles and does not count."""
    result, spent = make().run(), []
    for _ in range(repeats):
        case = make()
        begin = time.perf_counter()
        result = case.run()
        spent.append(time.perf_counter() - begin)
    return result, statistics.median(spent)


def ours_at(step: float, stiff: bool) -> Any:
    """Makes our case once: it can run again."""
    case = Ours(DarcyTube(), step, stiff)
    return lambda: case


def measure(repeats: int) -> dict[str, Any]:
    """Every setting of both, and the fastest of each at every target."""
    rows = []
    reference = Ours(DarcyTube(), 2e-5).run()
    for stiff, steps in ((False, [1e-3, 5e-4, 2.5e-4, 1e-4]), (True, [1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4])):
        for step in steps:
            found, spent = timed(ours_at(step, stiff), repeats)
            name = f"{'ROS2' if stiff else 'RK4'}, {1e3 * step:g} ms"
            rows.append({"program": "mckibben", "setting": name, "error": error(found, reference), "time": spent})
    theirs = Fonsim(1e-4, "tustin", 1e-8).run()
    settings = [(h, d, 1e-4) for d in ("backward", "tustin") for h in (2e-2, 1e-2, 5e-3, 2e-3, 1e-3, 5e-4)]
    settings += [((1e-4, 0.1), d, tolerance) for d in ("backward", "tustin") for tolerance in (1e-2, 1e-3, 1e-4)]
    for step, method, tolerance in settings:
        found, spent = timed(lambda h=step, d=method, t=tolerance: Fonsim(h, d, t), min(repeats, 5))
        name = f"{method}, " + (f"adaptive, {tolerance:g}" if isinstance(step, tuple) else f"{1e3 * step:g} ms")
        rows.append({"program": "fonsim", "setting": name, "error": error(found, theirs), "time": spent})
    best = []
    for target in TARGETS:
        at = {"target": target}
        for program in ("mckibben", "fonsim"):
            good = [r for r in rows if r["program"] == program and r["error"] <= target]
            at[program] = min(good, key=lambda r: r["time"]) if good else None
        best.append(at)
    reality = distributed()
    physics = {
        "DarcyTube against FONSim": error(reference, theirs),
        "LumpedTube against the distributed tube": error(Ours(lumped(), 1e-4).run(), reality),
        "FONSim against the distributed tube": error(theirs, reality),
    }
    return {"rows": rows, "best": best, "physics": physics, "duration": DURATION, "repeats": repeats}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a table")
    parser.add_argument("--repeats", type=int, default=11, help="runs whose median counts")
    options = parser.parse_args()
    found = measure(options.repeats)
    if options.json:
        print(json.dumps(found))
        return
    print(f"{'program':10}{'setting':28}{'error':>10}{'time':>12}{'x real time':>14}")
    for r in found["rows"]:
        print(
            f"{r['program']:10}{r['setting']:28}{r['error']:10.1e}{1e3 * r['time']:9.2f} ms{DURATION / r['time']:14.0f}"
        )
    for at in found["best"]:
        ours, theirs = at["mckibben"], at["fonsim"]
        if ours and theirs:
            ratio = theirs["time"] / ours["time"]
            print(
                f"error below {at['target']:g}: {ours['setting']} against {theirs['setting']}: {ratio:.0f} times as fast"
            )
        else:
            print(f"error below {at['target']:g}: not reached by {'mckibben' if theirs else 'fonsim'}")
    for name, value in found["physics"].items():
        print(f"{name}: {100.0 * value:.2f} % of the step")


if __name__ == "__main__":
    main()
