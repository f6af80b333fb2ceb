"""Control angle and stiffness of a joint with two muscles independently, and test the stiffness by an external moment.

    python examples/antagonist_joint.py [FOLDER]

Prints the settling of the steps and the deflection of a compliant and a stiff joint, and saves a figure of the run in the
folder.
"""

import sys
from pathlib import Path

import numpy as np

from mckibben.bench import joint_stand, run_joint
from mckibben.report.figures import joint_figure, style

STEP, STIFFEN, BACK, LOOP_OFF, AGAIN = 0.3, 1.1, 1.9, 2.5, 3.6  # times of the changes [s]
PUSHES = {2.6: 0.7, 4.1: 1.4}  # start of each push [s], and the stiffness set-point at that time [N m/rad]
PUSH, PUSHED = 0.1, 0.8  # moment [N m] and duration [s] of a push


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
    print(
        f"it overshoots by {1e3 * beyond:.1f} mrad, and ends {1e3 * abs(step['joint.angle'][-1] - 0.3):.1f} mrad away"
    )
    moved = np.ptp(run.select(STIFFEN, BACK - 0.01)["joint.angle"])
    print(f"from 0.7 to 1.2 N m/rad the angle moves by {1e3 * moved:.1f} mrad")
    for begins, stiffness in PUSHES.items():
        before, after = (
            run.select(begins + a, begins + b)["joint.angle"].mean() for a, b in ((-0.05, 0.0), (0.4, 0.8))
        )
        free = 1e3 * PUSH / stiffness
        print(
            f"{PUSH} N m deflect {stiffness} N m/rad by {1e3 * (after - before):.0f} mrad; without friction {free:.0f}"
        )
    balance = ", ".join(f"{name} {share:.0e}" for name, share in run.meta["balance"].items())
    print(f"relative errors of the balances: {balance}")
    style.save(joint_figure(run), folder / "antagonist-joint.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
