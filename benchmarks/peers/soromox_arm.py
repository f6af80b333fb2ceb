"""SoRoMoX's articulated arm with 24 McKibben muscles, a batch of 256, Runge-Kutta at 1 ms.

Three segments of two universal joints with four muscles around each; the muscle is the ideal static law under a given
pressure, without gas or friction. Its parameter files are not part of the package, so an arm of plain numbers stands in. The
error is that against an eighth of the step.
"""

import json
import statistics
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import soromox  # noqa: E402
from soromox.actuation.mckibben import (  # noqa: E402
    ArticulatedMcKibbenActuator,
    ArticulatedMcKibbenActuatorParams,
    ArticulatedMcKibbenTransmissionParams,
)
from soromox.systems.articulated import McKibbenActuatedUMArm  # noqa: E402
from soromox.systems.articulated.params import McKibbenActuatedUMArmParams  # noqa: E402

GROUPS, EACH, LANES = 6, 4, 256
JOINTS, MUSCLES = 2 * GROUPS, GROUPS * EACH
LINK, RADIUS, MASS = 0.1, 0.03, 0.2  # [m], [m], [kg]
DURATION, STEP = 0.05, 1e-3


def arm() -> McKibbenActuatedUMArm:
    """Links of 10 cm along z, joints about x and y in turn, muscles of 9 cm on a circle of 3 cm."""
    screw = np.zeros((JOINTS, 6))
    screw[0::2, 0], screw[1::2, 1] = 1.0, 1.0
    frame = np.tile(np.eye(4), (JOINTS, 1, 1))
    frame[2::2, 2, 3] = LINK
    tip, centre = np.zeros((JOINTS, 3)), np.zeros((JOINTS, 3))
    tip[1::2, 2], centre[1::2, 2] = LINK, 0.5 * LINK
    mass = np.where(np.arange(JOINTS) % 2 == 1, MASS, 0.01)
    inertia = mass[:, None, None] * np.eye(3) * (RADIUS**2 / 2.0)
    body = McKibbenActuatedUMArmParams(
        joint_screw=screw, parent_to_joint_transform=frame, tip_position=tip, center_of_mass_position=centre, mass=mass,
        center_of_mass_inertia=inertia, gravity=np.array([0.0, 0.0, -9.81]), joint_stiffness=3.0 * np.eye(JOINTS),
        joint_damping=0.05 * np.eye(JOINTS), joint_rest_configuration=np.zeros(JOINTS), radius=np.full(JOINTS, RADIUS),
        joint_armature=np.full(JOINTS, 1e-3),
    )  # fmt: skip
    around = 2.0 * np.pi * np.arange(EACH) / EACH
    circle = RADIUS * np.stack([np.cos(around), np.sin(around), np.zeros(EACH)], axis=-1)
    fixed = np.tile(circle + [0.0, 0.0, -0.5 * LINK], (GROUPS, 1, 1))
    moving = np.tile(circle + [0.0, 0.0, 0.5 * LINK], (GROUPS, 1, 1))
    shape = (GROUPS, EACH)
    muscles = ArticulatedMcKibbenTransmissionParams(
        moving_base_transform=np.tile(np.eye(4), (GROUPS, 1, 1)), moving_points=moving, fixed_points=fixed,
        reference_length=np.full(shape, LINK), length_offset=np.full(shape, 0.09), thread_length=np.full(shape, 0.11),
        num_turns=np.full(shape, 2.0), joint_pair_indices=np.arange(JOINTS).reshape(GROUPS, 2),
    )  # fmt: skip
    bounds = ArticulatedMcKibbenActuatorParams(
        transmission=muscles, lower_bounds=jnp.zeros(MUSCLES), upper_bounds=jnp.full(MUSCLES, jnp.inf)
    )
    return McKibbenActuatedUMArm(body, actuator=ArticulatedMcKibbenActuator(params=bounds))


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    robot = arm()

    def run(pressure: jax.Array, step: float, steps: int) -> jax.Array:
        rate = lambda y: robot.forward_dynamics(0.0, y, (pressure,))  # noqa: E731

        def one(y: jax.Array, _: None) -> tuple[jax.Array, jax.Array]:
            k1 = rate(y)
            k2 = rate(y + 0.5 * step * k1)
            k3 = rate(y + 0.5 * step * k2)
            k4 = rate(y + step * k3)
            new = y + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            return new, new

        return jax.lax.scan(one, jnp.zeros(2 * JOINTS), None, steps)[1]

    pressures = 1e5 * (1.0 + 0.5 * np.sin(np.arange(LANES)[:, None] + np.arange(MUSCLES)[None, :]))
    steps = round(DURATION / STEP)
    many = jax.jit(jax.vmap(lambda p: run(p, STEP, steps)))
    found = np.asarray(many(pressures))
    exact = np.asarray(jax.jit(lambda p: run(p, STEP / 8, 8 * steps))(pressures[0]))[7::8]
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        many(pressures).block_until_ready()
        spent.append(time.process_time() - begin)
    rate = LANES * MUSCLES * steps / statistics.median(spent)
    print(json.dumps({"rows": [{
        "program": f"SoRoMoX {getattr(soromox, '__version__', '')}".strip(), "case": "arm of 24 muscles, batch of 256",
        "setting": "RK4, 1 ms", "states": 2 * JOINTS, "dtype": "float64", "rate": rate,
        "error": float(np.abs(found[0] - exact).max() / np.ptp(exact)), "finite": bool(np.isfinite(found).all()),
    }]}))  # fmt: skip


if __name__ == "__main__":
    main()
