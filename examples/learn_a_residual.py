"""Learn what a law leaves of a record, beside the law, and predict a record that was not shown.

    python examples/learn_a_residual.py [--seconds 60] [--out FOLDER]

The record is of the bench B1 with a muscle of another law and another friction than those of the model. First the numbers of
the model are fitted to the record; then a potential of length and pressure is learned beside the law, from which tension and
gas follow, with the friction, which can only take. Both are judged on a record of another seed.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import mckibben as mk
from mckibben.control import BENCHES, Plant
from mckibben.muscles import LearnedResidual, Muscle
from mckibben.quantities import declared, values
from mckibben.specimens import SpecimenNumber, save_specimen

BENCH = BENCHES["B1"]
MODEL = Plant()
TRUTH = Plant("another muscle", "sarosi", "dahl", friction_scale=1.3, creep=1.5, creep_time=1.2)
FREE = {"law.rest_diameter": None, "law.rest_length": None, "friction.limit.*": None, "creep.stiffness": None}
LEARNED = {"law.weights": ("-0.1 J", "0.1 J"), "friction.limit.*": (0.3, 3.0), "friction.stiffness": (0.2, 5.0)}


def record(seed: int, seconds: float) -> mk.Recording:
    """Random holds and ramps of the commanded pressure."""
    bench, random = BENCH.simulation(TRUTH), np.random.default_rng(seed)
    bench.reset(seed=seed)
    commands, last = [], 1e5
    while len(commands) < seconds / BENCH.period:
        wanted, samples = random.uniform(0.7e5, 4.2e5), int(random.uniform(20, 150))
        commands += [wanted] * samples if random.random() < 0.5 else list(np.linspace(last, wanted, samples))
        last = wanted
    for command in commands[: round(seconds / BENCH.period)]:
        bench.step(muscle=command)
    return bench.recording()


def error(simulation: mk.Simulation, shown: mk.Recording) -> float:
    """Root mean square error of the position while it runs free under the commands of a record [mm]."""
    simulation.reset(pressure=float(shown["muscle.pressure"][0]))
    moved = [simulation.step(muscle=command).position for command in shown["muscle.command"][:-1]]
    return 1e3 * float(np.sqrt(np.mean((np.array(moved) - shown["load.position"][1:]) ** 2)))


def main(folder: Path, seconds: float = 60.0) -> dict[str, tuple[float, float]]:
    """Print the errors on the record and on the one not shown, draw what was learned, and save the specimen."""
    seen, unseen = record(11, seconds), record(12, 0.5 * seconds)
    model = BENCH.simulation(MODEL, sensors=False)
    refit = model.fit(seen, FREE, measured=["position"]).simulation
    unit = refit.machine.units["muscle"]
    length, pressure = seen["muscle.length"], seen["muscle.pressure"]
    law = LearnedResidual.beside(unit.law, lengths=length, pressures=pressure, order=(5, 3))
    muscle = Muscle(law, friction=unit.friction, creep=unit.creep)
    mechanism = dataclasses.replace(BENCH.mechanism(MODEL), muscle=muscle)
    limits = {d.command: d.limits for d in refit.drives if d.limits is not None}
    begin = mk.Simulation(mechanism, MODEL.air(), period=BENCH.period, limits=limits)
    learned = begin.fit(seen, LEARNED, measured=["position"], evaluations=20).simulation
    errors = {
        name: (error(one, seen), error(one, unseen))
        for name, one in (("model", model), ("refitted", refit), ("learned", learned))
    }
    for name, (on, off) in errors.items():
        print(f"{name}: {on:.3f} mm on the record, {off:.3f} mm on one that was not shown")
    law = learned.machine.units["muscle"].law
    yielded, moved = account(law)
    print(f"over a closed cycle what was learned yields {yielded:.1e} J, of {moved:.2g} J that go to and fro")
    save(folder / "learned.toml", law, f"a record of {seconds:g} s")
    draw(folder, law, length, pressure)
    return errors


def account(law: LearnedResidual) -> tuple[float, float]:
    """Work of the learned part over a closed cycle of lengths and pressures, and the tension's to and fro [J]."""
    turn, step = np.linspace(0.0, 2.0 * np.pi, 4096, endpoint=False, retstep=True)
    swing, way = 0.8 * law.length_reach * np.cos(turn), -0.8 * law.length_reach * np.sin(turn) * step
    length, pressure = law.middle_length + swing, law.middle_pressure + law.pressure_slope * swing
    pressure = pressure + 0.8 * law.pressure_reach * np.sin(turn)
    rise = law.pressure_slope * way + 0.8 * law.pressure_reach * np.cos(turn) * step
    tension, volume = (getattr(law, of)(length, pressure) - getattr(law.of, of)(length, pressure)
                       for of in ("braid_tension", "braid_volume"))  # fmt: skip
    return float(np.sum(tension * way - volume * rise)), float(np.sum(np.abs(tension * way)))


def save(path: Path, law: LearnedResidual, note: str) -> None:
    """Write the muscle as a specimen: the numbers of its law, and what was learned beside it."""
    make, units = mk.specimen("DMSP-10-250"), declared(law.of)
    numbers = {n: SpecimenNumber(value=v, unit=units[n].unit, note=note) for n, v in values(law.of).items()}
    laws = {make.law: {n: numbers[n] for n in make.laws[make.law]}}
    own = dataclasses.replace(make, id="learned", laws=laws, errors={}, between={}, residual=law.group(note))
    save_specimen(own, path, heading="fitted and learned on the bench B1")


def draw(folder: Path, law: LearnedResidual, length: np.ndarray, pressure: np.ndarray) -> None:
    """Draw the tension that was learned over length and pressure, with the places of the record."""
    x, y = np.meshgrid(np.linspace(length.min(), length.max(), 60), np.linspace(pressure.min(), pressure.max(), 60))
    added = np.asarray(law.braid_tension(x, y)) - np.asarray(law.of.braid_tension(x, y))
    most = np.abs(added).max()
    figure, axes = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
    shades = axes.pcolormesh(
        1e3 * x, y / 1e5, added, cmap="RdBu_r", vmin=-most, vmax=most, shading="nearest", rasterized=True
    )
    axes.plot(1e3 * length, pressure / 1e5, color="0.2", lw=0.3)
    axes.set(xlabel="length (mm)", ylabel="gauge pressure (bar)")
    axes.locator_params(nbins=5)
    figure.colorbar(shades, label="learned tension (N)")
    mk.save_figure(figure, folder / "learn-a-residual.svg")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Learn what a law leaves of a record.")
    parser.add_argument("--seconds", type=float, default=60.0, help="Length of the record")
    parser.add_argument("--out", type=Path, default=Path("out"), help="Folder of the figure and the specimen")
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    main(options.out, options.seconds)
