"""Draw the strips of `how-to/score-a-controller.md` and `how-to/identify-linearise-and-observe-a-bench.md`.

    python docs/control_pictures.py

They are kept in `assets/`: each is a quarter of a minute of simulation, which the build of the site need not repeat.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

import mckibben as mk
from mckibben.control import CONTROLLERS, REFERENCES, control_task
from mckibben.control.benches import MEAN, VARIED, find_bench
from mckibben.control.scores import run_controller
from mckibben.report.figures import style

ASSETS = Path(__file__).parent / "assets"
LIMB, ARM = 0.07, 0.02  # drawn [m]
FRAMES, FIRST, LAST = 9, 4.0, 6.0  # pictures of the joint, from and to [s]
NOTE = "; dashed: wanted, width of a muscle: its pressure"
STEP, CHANGE, ON = 1e-3, 30.0, 1.5  # period [s]; step of the load [N], and when [s]
MOMENTS = (1.4, 1.49, 1.505, 1.51, 1.52, 1.54, 1.58, 1.7, 2.0)  # pictures of the estimator [s]


def joint() -> Any:
    """The joint under PID and under the memory inverse, on a plant that neither was built on."""
    task, machine = control_task("J1"), find_bench("J1").simulation(VARIED["wrong"])
    times = np.linspace(FIRST, LAST, FRAMES)
    fig = style.drawing(style.WIDE, 4.6)
    for row, name in enumerate(("pid", "memory-inverse")):
        run = run_controller(CONTROLLERS[name](task), machine, task, REFERENCES["R3"])
        rms = 1e3 * run.score.tracking
        fig.text(
            0.01,
            0.93 - 0.46 * row,
            f"{name}, {rms:.1f} mrad rms" + NOTE * (not row),
            fontsize=style.NORMAL,
            color=style.INK,
        )
        for k, time in enumerate(times):
            at = round(time / task.period)
            ax = fig.add_axes((0.005 + k * 0.99 / FRAMES, 0.5 - 0.46 * row, 0.98 / FRAMES, 0.4))
            for angle, look in (
                (run.wanted[at], {"color": style.INK_3, "lw": 1.0, "linestyle": "--"}),
                (run.output[at], {"color": style.INK, "lw": 2.5}),
            ):
                ax.plot([0.0, LIMB * math.sin(angle)], [0.0, LIMB * math.cos(angle)], solid_capstyle="round", **look)
            for side, sign in ((-1.0, 1.0), (1.0, -1.0)):  # its width is the pressure that is asked for
                bar = (MEAN + sign * run.command[at]) / 1e5
                ax.plot([side * ARM] * 2, [-0.075, 0.0], color=style.colour("pressure"), lw=0.6 + 2.0 * bar)
            ax.add_patch(_circle(ARM))
            off = 1e3 * (run.output[at] - run.wanted[at])
            ax.text(0.0, -0.093, f"{time:.2f} s, {off:+.0f} mrad", ha="center", fontsize=style.SMALL, color=style.INK_2)
            ax.set_xlim(-0.045, 0.045)
            ax.set_ylim(-0.1, 0.08)
            ax.set_aspect("equal")
            ax.axis("off")
    return fig


def _circle(radius: float) -> Any:
    from matplotlib.patches import Circle

    return Circle((0.0, 0.0), radius, facecolor=style.PANEL, edgecolor=style.INK_2, lw=1.0, zorder=3)


def estimator() -> Any:
    """What the pressure alone says of length and load when the load steps: where the muscle ends, and how sure that is."""
    muscle = find_bench("B1").mechanism(VARIED["nominal"]).muscles["muscle"]
    load = mk.Weight(muscle, mass="5 kg", start="24.2 cm", damping=60.0)
    sim = mk.Simulation(load, mk.Air(valve="MPYE-5-1-8-LF"), period=STEP, noise={"pressure": 580.0})
    observer, frames = sim.estimator(("pressure",), {"force": "25 N"}, spread={"muscle.law.rest_diameter": "2.5 %"}), {}
    seen = sim.reset(seed=3)
    observer.reset(pressure=seen.pressure)
    for k in range(round(MOMENTS[-1] / STEP) + 1):
        command = min(max((3e5 - seen.pressure) / 1e5, -1.0), 1.0)
        force = CHANGE * (k * STEP > ON)
        seen = sim.step(muscle=command, force=force)
        known = observer.step(muscle=command, pressure=seen.pressure)
        frames[round((k + 1) * STEP, 6)] = (sim.truth.length, known, force)
    fig = style.drawing(style.WIDE, 3.6)
    for k, time in enumerate(MOMENTS):
        length, known, force = frames[time]
        ax = fig.add_axes((0.03 + k * 0.965 / len(MOMENTS), 0.2, 0.95 / len(MOMENTS), 0.66))
        top, low, high = 240.0, 1e3 * known.low.length, 1e3 * known.high.length
        ax.fill_between([-1.0, 1.0], [low] * 2, [high] * 2, color=style.colour("length"), alpha=0.25, lw=0)
        ax.plot([-1.0, 1.0], [1e3 * known.mean.length] * 2, color=style.colour("length"), lw=1.5)
        ax.plot([0.0, 0.0], [top - 45.0, 1e3 * length], color=style.INK, lw=6.0, solid_capstyle="butt")
        ax.plot([-0.35, 0.35], [1e3 * length] * 2, color=style.INK, lw=1.5)
        ax.set_ylim(242.0, 232.0)  # a longer muscle hangs lower
        ax.set_xlim(-1.2, 1.2)
        ax.set_xticks([])
        ax.tick_params(labelleft=k == 0, length=2)
        for edge in ("top", "right", "bottom"):
            ax.spines[edge].set_visible(False)
        ax.spines["left"].set_visible(k == 0)
        ax.set_title(f"{time:.3f} s", fontsize=style.SMALL, color=style.INK_2)
        e = known.unknown["force"]
        words = f"load {force:.0f} N\n{e.value:.0f} ({e.low:.0f} to {e.high:.0f})"
        ax.text(0.0, -0.05, words, transform=ax.get_xaxis_transform(), ha="center", va="top", fontsize=style.SMALL)
    fig.text(
        0.005, 0.95, "Length, mm: black as it is, line and band as estimated from the pressure", fontsize=style.NORMAL
    )
    return fig


if __name__ == "__main__":
    for name, draw in (("control-joint", joint), ("estimator-step", estimator)):
        style.save(style.styled()(draw)(), ASSETS / f"{name}.svg")
