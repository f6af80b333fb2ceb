"""MuJoCo's muscle: one on a slide, and two around a hinge; steps of one thread, its own loop in C.

No gas, no memory: MuJoCo's state is position, velocity and activation. Errors are those of the same model at steps of 20 us.
"""

import json
import statistics
import sys
import time

import mujoco
import numpy as np

SLIDE = """<mujoco><option timestep="{step}" integrator="{method}" gravity="0 0 0"><flag contact="disable"/></option>
<worldbody><body name="mass" pos="0 0 0"><joint name="slide" type="slide" axis="1 0 0" stiffness="1500" damping="5"
springref="0.02"/><geom type="sphere" size="0.02" mass="2" contype="0" conaffinity="0"/>
<site name="end" pos="0 0 0"/></body><site name="anchor" pos="-0.14 0 0"/></worldbody>
<tendon><spatial name="cord"><site site="anchor"/><site site="end"/></spatial></tendon>
<actuator><muscle name="muscle" tendon="cord" force="100" lengthrange="0.10 0.17"/></actuator></mujoco>"""
HINGE = """<mujoco><option timestep="{step}" integrator="{method}" gravity="0 0 0"><flag contact="disable"/></option>
<worldbody><body pos="0 0 0"><joint name="hinge" type="hinge" axis="0 0 1" damping="0.05"/><geom type="capsule" size="0.01"
fromto="0 0 0 0.1 0 0" mass="0.5" contype="0" conaffinity="0"/></body></worldbody>
<tendon><fixed name="flexor"><joint joint="hinge" coef="0.02"/></fixed>
<fixed name="extensor"><joint joint="hinge" coef="-0.02"/></fixed></tendon>
<actuator><muscle tendon="flexor" force="100" lengthrange="-0.04 0.04"/>
<muscle tendon="extensor" force="100" lengthrange="-0.04 0.04"/></actuator></mujoco>"""
DURATION, SAMPLE = 1.0, 0.02


def run(text: str, step: float) -> np.ndarray:
    """Position at the samples."""
    model = mujoco.MjModel.from_xml_string(text.format(step=step, method="implicitfast"))
    data = mujoco.MjData(model)
    inner, places = round(SAMPLE / step), []
    for i in range(round(DURATION / SAMPLE)):
        data.ctrl[:] = [0.5 + 0.4 * np.sin(2.0 * np.pi * 2.0 * i * SAMPLE + np.pi * k) for k in range(model.nu)]
        mujoco.mj_step(model, data, nstep=inner)
        places.append(data.qpos[0])
    return np.array(places)


def seconds_per_step(text: str, step: float, steps: int = 20_000) -> float:
    """Of MuJoCo's own loop, at constant controls, without a return to Python."""
    model = mujoco.MjModel.from_xml_string(text.format(step=step, method="implicitfast"))
    data = mujoco.MjData(model)
    data.ctrl[:] = 0.5
    begin = time.process_time()
    mujoco.mj_step(model, data, nstep=steps)
    return (time.process_time() - begin) / steps


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 11
    rows = []
    for name, text, muscles in (("slide", SLIDE, 1), ("hinge", HINGE, 2)):
        exact = run(text, 2e-5)
        for step in (2e-3, 5e-4, 1e-4):
            found = run(text, step)
            error = float(np.abs(found - exact).max() / np.ptp(exact))
            spent = statistics.median(seconds_per_step(text, step) for _ in range(repeats))
            rows.append({
                "program": f"MuJoCo {mujoco.__version__}", "case": f"muscle on a {name}", "setting": f"{1e3 * step:g} ms",
                "states": 2 * 1 + muscles, "dtype": "float64", "rate": muscles / spent, "real_time": step / spent,
                "error": error,
            })  # fmt: skip
    print(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()
