"""Two muscles on a joint: angle and stiffness are set apart from each other, and a push shows that the stiffness is real.

    python examples/antagonist_joint.py [FOLDER]

Prints how the steps settle and how far a push turns a soft and a stiff joint, and draws the run into the folder.
"""

import sys
from pathlib import Path

import numpy as np

from mckibben.bench.joint_run import joint_stand, run_joint
from mckibben.report.figures import style
from mckibben.report.figures.joint_figures import joint_figure

STEP, STIFFEN, BACK, LOOP_OFF, AGAIN = 0.3, 1.1, 1.9, 2.5, 3.6  # when something changes [s]
PUSHES = {2.6: 0.7, 4.1: 1.4}  # when a push begins [s], and on which stiffness [N m/rad]
PUSH, PUSHED = 0.1, 0.8  # [N m], [s]


def main(folder: Path) -> None:
    stand = joint_stand("nylon", rig="modern")
    low, high = (float(k) for k in stand.control.pair.stiffness_range(0.3))
    print(f"stiffness at 0.3 rad: {low:.2f} to {high:.2f} N m/rad")
    run = run_joint(
        stand,
        duration=5.2,
        title="A joint with two nylon muscles",
        angle=lambda t: np.select([t < STEP, t < BACK], [0.0, 0.3], 0.1),
        stiffness=lambda t: np.select([t < STIFFEN, t < BACK, t < AGAIN], [0.7, 1.2, 0.7], 1.4),
        moment=lambda t: PUSH * sum((t >= begins) & (t < begins + PUSHED) for begins in PUSHES),
        active=lambda t: t < LOOP_OFF,
    )

    step = run.select(STEP, STIFFEN)
    away = np.flatnonzero(np.abs(step["joint.angle"] - 0.3) > 0.02 * 0.3)
    beyond = max(0.0, float(step["joint.angle"].max()) - 0.3)
    print(f"a step of 0.3 rad stays within 2 % after {1e3 * (step.time[away[-1] + 1] - STEP):.0f} ms")
    print(f"it goes {1e3 * beyond:.1f} mrad beyond, and ends {1e3 * abs(step['joint.angle'][-1] - 0.3):.1f} mrad away")
    moved = np.ptp(run.select(STIFFEN, BACK - 0.01)["joint.angle"])
    print(f"from 0.7 to 1.2 N m/rad the angle moves by {1e3 * moved:.1f} mrad")
    for begins, stiffness in PUSHES.items():
        before, after = (
            run.select(begins + a, begins + b)["joint.angle"].mean() for a, b in ((-0.05, 0.0), (0.4, 0.8))
        )
        free = 1e3 * PUSH / stiffness
        print(f"{PUSH} N m turn {stiffness} N m/rad by {1e3 * (after - before):.0f} mrad; without friction {free:.0f}")
    print("accounts not closed by " + ", ".join(f"{name} {share:.0e}" for name, share in run.meta["balance"].items()))
    style.save(joint_figure(run), folder / "antagonist-joint.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
