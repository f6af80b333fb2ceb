"""A weight on a muscle in a host: two kinds of host loops, and the same system integrated as one."""

from typing import Any, NamedTuple

import numpy as np

from mckibben.assembly.loads import Body
from mckibben.assembly.machine import Machine
from mckibben.engine import held, integrate
from mckibben.engine.signals import Value
from mckibben_hosts import Part

MASS, GRAVITY = 4.0, 9.80665
START, GRID = 0.14, 1e-2  # span [m]; commands change on this grid, which every step divides [s]


class HostRun(NamedTuple):
    """Spans at the steps [m], work of the host by its own kicks and by the part's account [J], tensions [N]."""

    spans: np.ndarray
    host_work: float
    part_work: float
    tensions: np.ndarray


def hanging_part(air: object = None, muscle: Any = "nylon", **options: object) -> Part:
    """The nylon muscle, or another one, with a pressure that carries the weight at the start."""
    made = Part(muscle, air, span=START, **options)
    carries = float(made.hosted.muscles["muscle"].law.pressure_for(MASS * GRAVITY, START))
    return Part(muscle, air, span=START, pressure=carries, **options)


def run_in_host(part: Part, step: float, commands: np.ndarray, *, staggered: bool, start: float = START) -> HostRun:
    """A weight that the host integrates, semi-implicitly (staggered) or by the mean acceleration (synchronous)."""
    (command,) = part.commands
    per, count = round(GRID / step), round(len(commands) * GRID / step)
    state = part.rest(start, **{command: commands[0]})
    span, rate, work, spans, tensions = start, 0.0, 0.0, [start], []
    for k in range(count):
        state, seen = part.step(
            state, period=step, span=span, rate=rate, staggered=staggered, **{command: commands[k // per]}
        )
        acceleration, before = GRAVITY - seen.tension / MASS, rate
        rate += step * acceleration
        span += step * rate if staggered else step * 0.5 * (before + rate)
        work += seen.tension * step * 0.5 * (before + rate)
        spans.append(span)
        tensions.append(seen.tension)
    return HostRun(np.array(spans), work, float(seen.work), np.array(tensions))


def run_as_one(part: Part, commands: np.ndarray, step: float = 2.5e-5) -> np.ndarray:
    """Spans of the same system integrated as one, every half millisecond [m]."""
    parts = part.hosted
    body = Body(held=("muscle",), start=START, mass=MASS, weight=MASS * GRAVITY, damping=0.0, signal="force")
    machine = Machine.of(parts.circuit, parts.muscles, body, parts.environment)
    values = np.repeat(commands, round(GRID / 5e-4))
    values = np.append(values, values[-1])
    (drive,) = parts.drives
    signals = {drive.signal: held(values), "force": held(np.zeros_like(values))}
    room = float(parts.environment.pressure_abs)
    state, memory = machine.initial(
        {name: gauge + room for name, gauge in parts.start.items()},
        {name: Value(np.asarray(s.values[0]), np.zeros(())) for name, s in signals.items()},
    )
    run = integrate(machine, state, signals, period=5e-4, memory=memory, step_size=step)
    return np.asarray(run.outputs["muscle.span"])
