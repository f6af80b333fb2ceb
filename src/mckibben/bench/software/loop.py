"""Software of the sample loop: reading of channels, set-points, feedback, and interlocks.

It is a pure step, so a simulation scans it and a loop by the wall clock calls it. When an interlock trips, or a test did
not come true in its time, the valve vents and the motor only brakes; that stays so.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..._jax import Tree, jnp
from ...components import Scalar, field
from ...components.system import Software
from ...quantities import quantity
from .controllers import ForceControl, MotionEstimate, PositionControl, PressureControl
from .interlocks import Interlocks
from .sequencer import SPAN, TENSION, VELOCITY, Manual, SampleSetpoints, Sequencer


class BenchSoftware(Software):
    """Sequencer, controllers and interlocks of one run, or of manual operation.

    A `start_motor` that is NaN begins at the measured span.
    """

    sequencer: Sequencer | Manual
    motion: MotionEstimate
    pressure: PressureControl
    position: PositionControl
    force: ForceControl
    interlocks: Interlocks
    start_pressure: Any = 0.0
    start_motor: Any = 0.0
    has_motor: bool = field(static=True, kw_only=True, default=True)
    brake: Scalar = quantity("N*s/m", (0.0, 1e4), "damping by the motor once it is stopped", default=50.0)

    def initial(self, measured: Mapping[str, Scalar]) -> Tree:
        """State at the first sample of the protocol."""
        span = measured.get("span", jnp.zeros(()))
        motor = jnp.where(jnp.isnan(self.start_motor), span, self.start_motor)
        states = {n: getattr(self, n).initial() for n in ("pressure", "position", "force", "interlocks")}
        states |= {"place": self.sequencer.initial(self.start_pressure, motor), "motion": self.motion.initial(span)}
        return states | {"driven": jnp.asarray(span, float), "stopped": jnp.asarray(False)}

    def step(
        self, state: Tree, measured: Mapping[str, Scalar], row: Tree, dt: Scalar
    ) -> tuple[Tree, dict[str, Scalar], dict[str, Scalar]]:
        """Compute one sample: commands ``valve`` [Pa], ``motor`` [N], ``open``; set-points, place and code are reported.

        A row may have ``stop``, 1 while the emergency stop is pressed, and has what `sequencer.ROW` names in manual mode.
        """
        read = {name: value for name, value in measured.items() if not name.endswith(".code")}
        nothing = jnp.zeros(())
        tension, span = read.get("tension", nothing), read.get("span", nothing)
        motion, velocity = self.motion.step(state["motion"], span, dt)
        at = state["place"]
        if isinstance(self.sequencer, Manual):
            at = self.sequencer.heard(at, row)
        asked = self.sequencer.set_points(at, dt)
        running = ~state["stopped"]
        pressure, valve = self.pressure.step(
            state["pressure"], asked.pressure, read.get("pressure", asked.pressure), dt, jnp.where(running, 1.0, 0.0)
        )
        # a set velocity is a set-point of the span that grows
        driven = jnp.where(asked.mode == SPAN, asked.motor, state["driven"])
        driven = jnp.where(asked.mode == TENSION, span, driven)
        driven = jnp.where(asked.mode == VELOCITY, driven + asked.motor * dt, driven)
        set_points = driven, jnp.where(asked.mode == VELOCITY, asked.motor, asked.velocity), asked.acceleration
        active = jnp.where(running & (asked.mode != TENSION), 1.0, 0.0)
        position, holding = self.position.step(state["position"], *set_points, span, velocity, tension, dt, active)
        force, pulling = self.force.step(
            state["force"], asked.motor, tension, velocity, dt, jnp.where(running & (asked.mode == TENSION), 1.0, 0.0)
        )
        motor = jnp.where(asked.mode == TENSION, pulling, holding)
        commands = {"valve": valve, "motor": motor if self.has_motor else nothing}
        # a muscle that is shut off need not have the pressure that the valve is asked for
        watched = {**commands, "valve": jnp.where(asked.open > 0.5, valve, 0.0)}
        if self.has_motor:
            watched["span"] = driven
        pressed = row.get("stop", 0.0)
        watching, code = self.interlocks.step(state["interlocks"], read, watched, velocity, dt, pressed)
        stopped = state["stopped"] | (code > 0) | at.missed
        place: Any = self.sequencer.advance(at, asked, {**read, "velocity": velocity}, (span, velocity, tension), dt)
        place = place._replace(step=jnp.where(stopped, at.step, place.step))
        commands = {
            "valve": jnp.where(stopped, 0.0, commands["valve"]),
            "motor": jnp.where(stopped, -self.brake * velocity, commands["motor"]) if self.has_motor else nothing,
            "open": jnp.where(stopped, 1.0, asked.open),
        }
        states = {"pressure": pressure, "position": position, "force": force, "interlocks": watching}
        new = states | {"place": place, "motion": motion, "driven": driven, "stopped": stopped}
        return new, commands, self._shown(asked, velocity, code, at.missed, stopped)

    def _shown(
        self, asked: SampleSetpoints, velocity: Scalar, code: Scalar, missed: Any, stopped: Any
    ) -> dict[str, Scalar]:
        mode = asked.mode
        return {
            "command.pressure": asked.pressure,
            "command.span": jnp.where(mode == SPAN, asked.motor, jnp.nan),
            "command.velocity": jnp.where(mode == VELOCITY, asked.motor, jnp.nan),
            "command.tension": jnp.where(mode == TENSION, asked.motor, jnp.nan),
            "velocity": velocity,
            "step": asked.step,
            "record": asked.record,
            "running": asked.running & ~stopped,
            "code": code,
            "missed": missed,
        }
