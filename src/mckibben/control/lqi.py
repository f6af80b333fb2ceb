"""Linear quadratic control with an integral and a Kalman filter, from the simulation's own linear model about the middle.

    x+ = A x + B u,   (P, y) = C x;   u = -K x - k_i sum(r - y) T

The state is of deviations from the feed-forward, which is an inverse of the muscle. A, B and C are those of
`Simulation.linearise`, dead time included, with friction held: it is the feed-forward's. What the plant does otherwise is
taken for noise at its command.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, jnp
from ..simulation.mechanisms import Amount
from .controllers import USUAL, FeedForward
from .inverse import Inverse
from .steps import Outputs, RestingIntegral, Sample, StepControl, clip
from .task import SETTINGS, ControlTask, Setting

AMPLITUDE = 1e4  # of the commands of the linear model [Pa]
MIDDLE, SETTLES = 0.4, 2.0  # where it is linearised, in the range of the command, and after which time [s]
COMMAND, POSITION = 2e3, 1e-5  # noise that is assumed: of a sample's command [Pa], and of its position [m]
READ = 600.0, 2e-5  # of the measured pressure [Pa] and position [m]


class LQIState(NamedTuple):
    """What the controller remembers: the feed-forward and its last pressures, the estimated state, the last command."""

    ahead: FeedForward
    pressures: Any
    state: Scalar
    told: Scalar
    integral: RestingIntegral


class LQI(StepControl):
    """Linear quadratic control with an integral and a Kalman filter, on an inverse of the muscle.

    Args:
        task: of one muscle, with pressure and position measured.
        memory: whether the inverse knows friction and creep.
        effort: weight of the number u against the error [m/Pa].
        integral: weight of the integral against the error [1/s].
        lead: of the feed-forward [s].
        ahead: by which the reference is looked up [s].
        rate: of the shaped reference [m/s].

    Raises:
        InputError: another task.
    """

    settings = SETTINGS | {"integral": Setting("1/s", (0.5, 1e3), zero=False)}

    def __init__(
        self,
        task: ControlTask,
        *,
        memory: bool = False,
        effort: Amount = 2e-8,
        integral: Amount = 20.0,
        lead: Amount | None = None,
        ahead: Amount = 0.04,
        rate: Amount | None = None,
    ) -> None:
        from scipy.linalg import solve_discrete_are

        numbers = self._take(
            task, USUAL, memory=memory, effort=effort, integral=integral, lead=lead, ahead=ahead, rate=rate
        )
        penalty, weight = numbers["effort"] ** 2, numbers["integral"] ** 2
        self.preview, sim = round(numbers["ahead"] / task.period), task.of_one_muscle().model
        self._inverse = Inverse(task, memory=memory)
        sim.reset()
        for _ in range(round(SETTLES / task.period)):
            sim.step(**task.commands((1.0 - MIDDLE) * task.limits[0] + MIDDLE * task.limits[1]))
        self.model = sim.linearise([*task.actuators], ("pressure", task.field), amplitude=AMPLITUDE, friction="held")
        A, B, C = self.model.A, self.model.B, self.model.C * np.array([[1.0], [task.sign]])
        size = len(A)
        # with the integral of the error behind the state
        whole = np.block([[A, np.zeros((size, 1))], [-task.period * C[1], np.ones((1, 1))]])
        seen, command = np.append(C[1], 0.0), np.append(B[:, 0], 0.0)[:, None]
        weights = np.outer(seen, seen)
        weights[-1, -1] = weight
        cost = solve_discrete_are(whole, command, weights, np.array([[penalty]]))
        gain = np.linalg.solve(penalty + command.T @ cost @ command, command.T @ cost @ whole)[0]
        drawn, noise = COMMAND**2 * B @ B.T, np.diag(READ) ** 2
        place = self.model.states.index("load.position")
        drawn[place, place] += POSITION**2
        spread = solve_discrete_are(A.T, C.T, drawn, noise)
        parameters = FeedForward.parameters(task, self._inverse, numbers["lead"], numbers["rate"]) | {
            "A": A, "B": B[:, 0], "C": C, "gain": gain[:-1], "integral": float(gain[-1]),
            "filter": spread @ C.T @ np.linalg.inv(C @ spread @ C.T + noise),
        }  # fmt: skip
        self._compile(_lqi_step, (self._inverse.actuators,), parameters)

    def begin(self, output: float) -> LQIState:
        """The state at rest."""
        ahead, size = FeedForward.begin(self._inverse, output, self.preview), len(self.model.A)
        return LQIState(ahead, np.full(self.preview + 1, ahead.number), np.zeros(size), 0.0, RestingIntegral(0.0, 0.0))


def _lqi_step(actuators: Any, p: Any, state: LQIState, sample: Sample) -> tuple[LQIState, Outputs]:
    ahead, wanted, moving = state.ahead.advance(actuators, p, sample.wanted)
    pressures = jnp.append(state.pressures[1:], ahead.number)
    error = ahead.past[0] - sample.output
    foretold = p["A"] @ state.state + p["B"] * state.told
    seen = jnp.stack([sample.pressure - pressures[0], -error])
    estimate = foretold + p["filter"] @ (seen - p["C"] @ foretold)
    number = wanted - (p["gain"] @ estimate + p["integral"] * state.integral.value)
    acting = clip(number, p["low"], p["high"])
    rests = jnp.where(moving, p["rests"], jnp.where(acting != number, p["filling"], 0.0))
    integral = state.integral.add(error, rests, p["period"])
    return LQIState(ahead, pressures, estimate, acting - wanted, integral), Outputs(acting)
