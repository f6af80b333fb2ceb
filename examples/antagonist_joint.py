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

STEP, RETURN, STIFFEN = 0.3, 1.9, 1.1  # when the set-points change [s]
PUSHES = ((2.6, 0.7), (4.1, 1.4))  # when a push of 0.1 N m begins, and on which stiffness [s], [N m/rad]
LOOP_OFF, PUSH = 2.5, 0.1


def main(folder: Path) -> None:
    def angle(t: np.ndarray) -> np.ndarray:
        return np.select([t < STEP, t < RETURN], [0.0, 0.3], 0.1)

    def stiffness(t: np.ndarray) -> np.ndarray:
        return np.select([t < STIFFEN, t < RETURN, t < 3.6], [0.7, 1.2, 0.7], 1.4)

    def push(t: np.ndarray) -> np.ndarray:
        return PUSH * sum((t >= begins) & (t < begins + 0.8) for begins, _ in PUSHES)

    stand = joint_stand("nylon", rig="modern")
    low, high = (float(k) for k in stand.control.pair.stiffness_range(0.3))
    print(f"stiffness at 0.3 rad: {low:.2f} to {high:.2f} N m/rad")
    run = run_joint(
        stand, duration=5.2, angle=angle, stiffness=stiffness, moment=push, active=lambda t: t < LOOP_OFF,
        title="A joint with two nylon muscles",
    )  # fmt: skip

    step = run.select(STEP, STIFFEN)
    away = np.abs(step["joint.angle"] - 0.3) > 0.02 * 0.3
    settled = step.time[np.flatnonzero(away)[-1] + 1] - STEP
    print(f"a step of 0.3 rad is within 2 % after {1e3 * settled:.0f} ms, "
          f"{1e3 * (step['joint.angle'].max() - 0.3):.1f} mrad beyond it at most")  # fmt: skip
    held = run.select(STIFFEN, RETURN - 0.01)
    print(f"from 0.7 to 1.2 N m/rad the angle moves by {1e3 * np.ptp(held['joint.angle']):.1f} mrad")
    for begins, stiff in PUSHES:
        before, after = (run.select(a, b)["joint.angle"].mean() for a, b in ((begins - 0.05, begins), (begins + 0.4, begins + 0.8)))
        print(f"a push of {PUSH} N m turns {stiff} N m/rad by {1e3 * (after - before):.0f} mrad; "
              f"{1e3 * PUSH / stiff:.0f} mrad without friction")  # fmt: skip
    print("accounts not closed by: " + ", ".join(f"{name} {share:.0e}" for name, share in run.meta["balance"].items()))
    style.save(joint_figure(run), folder / "antagonist-joint.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
