"""Compute friction loops of the nylon muscle: halving the range from above leaves the rising branch unchanged.

    python examples/friction_loop.py [FOLDER]

The loop is a `scan` over pieces of the path, as in a simulation.
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import mckibben
from mckibben.muscles import from_specimen
from mckibben.report.figures import DrawnLoop, loop_figure, style

SHORTEST, PRESSURE, PIECES = 0.115, 5e5, 200


def main(folder: Path) -> None:
    muscle = from_specimen(mckibben.specimen("nylon"), friction="maxwell_slip")
    corners = np.array([0.0, 0.02, 0.0, 0.02, 0.0, 0.01, 0.0])
    path = np.interp(np.linspace(0, len(corners) - 1, PIECES * (len(corners) - 1) + 1), range(len(corners)), corners)

    def piece(state: jax.Array, dx: jax.Array) -> tuple[jax.Array, tuple[jax.Array, jax.Array, jax.Array]]:
        step = muscle.friction.advance(state, dx, start_pressure=PRESSURE, end_pressure=PRESSURE, duration=0.0)
        return step.state, (muscle.friction.force(step.state), step.work, step.dissipated)

    @jax.jit
    def follow(steps: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
        state, (force, work, heat) = jax.lax.scan(piece, muscle.friction.initial(), steps)
        return force, work.sum(), heat.sum(), muscle.friction.stored_energy(state)

    friction, work, heat, stored = follow(jnp.diff(path))
    force = np.asarray(muscle.law.tension(SHORTEST + path[1:], PRESSURE) + friction)
    whole, half = slice(2 * PIECES, 4 * PIECES), slice(4 * PIECES, 6 * PIECES)
    rise = [np.interp(5e-3, path[1:][s][:PIECES], force[s][:PIECES]) for s in (whole, half)]
    print(f"rising branch at 5 mm: {rise[0]:.6f} N for the whole range, {rise[1]:.6f} N for half of it")
    print(f"work done {1e3 * work:.3f} mJ = heat {1e3 * heat:.3f} mJ + stored {1e3 * stored:.3f} mJ")

    loops = (DrawnLoop(path[1:][part], force[part]) for part in (whole, half))
    figure = loop_figure(*loops, title="Nylon muscle at 5 bar", note="dashed: half the range", zero=False)
    style.save(figure, folder / "friction-loop.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
