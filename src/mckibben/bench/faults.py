"""Faults of a rig and wear of its muscle, each a parameter of the part that it belongs to.

Zero is sound; of the clamp's grip it is `SOUND_GRIP`, which no muscle reaches.

    [faults]                        # of a rig's file
    leak = "0.2 l/min/bar"
    clamp_slack = "0.5 mm"

| fault | physics |
|---|---|
| leak | `pneumatics.leak` from the muscle's fitting to the room |
| valve_blockage, valve_sticking | `PressureRegulator.worn`: orifices, and play of the sensed pressure |
| ..._drift | zero of a sensor, or of the encoder's zero, that moves at a constant rate from the start of the run |
| clamp_slack | slack length of the tendon between muscle and load |
| clamp_grip | `assembly.clamp`: slips and loses span where the tension passes it |
| lost_threads, rubber_warming | `muscles.worn_braid` |
"""

from __future__ import annotations

from ..assembly.clamp import Clamp
from ..assembly.muscle_unit import MuscleUnit
from ..components import Module, Scalar
from ..errors import InputError
from ..muscles.elements import Tendon
from ..muscles.worn_braid import WornBraid
from ..pneumatics.leak import Leak
from ..pneumatics.valves import PressureRegulator
from ..quantities import declared, quantity
from .hardware.pneumatics import Plumbing

SOUND_GRIP = 1e9  # tension that a clamp holds which does not slip [N]
DRIFT = "_drift"  # how the names of drifts end, after the channel


class RigFaults(Module):
    """Faults of a rig, none by default."""

    leak: Scalar = quantity(
        "m^3/(s*Pa)", (0.0, 1e-6), "leak of the muscle's fitting, reference air per pressure", symbol="G",
        typical=(1e-12, 1e-9), default=0.0,
    )  # fmt: skip
    valve_blockage: Scalar = quantity("1", (0.0, 0.99), "share of the valve's flow that is blocked", default=0.0)
    valve_sticking: Scalar = quantity("Pa", (0.0, 1e6), "further hysteresis of the valve", default=0.0)
    pressure_drift: Scalar = quantity("Pa/s", (-1e5, 1e5), "drift of the pressure sensor at the muscle", default=0.0)
    valve_pressure_drift: Scalar = quantity(
        "Pa/s", (-1e5, 1e5), "drift of the pressure sensor at the valve", default=0.0
    )
    tension_drift: Scalar = quantity("N/s", (-1e3, 1e3), "drift of the load cell", default=0.0)
    span_drift: Scalar = quantity("m/s", (-0.1, 0.1), "drift of the measured span", default=0.0)
    clamp_slack: Scalar = quantity("m", (0.0, 0.1), "slack of the clamp that holds the muscle", default=0.0)
    clamp_grip: Scalar = quantity(
        "N", (1e-3, SOUND_GRIP), "tension from which on the clamp slips", typical=(10.0, 1e4), default=SOUND_GRIP
    )
    lost_threads: Scalar = quantity("1", (0.0, 0.9), "share of the braid's threads that are lost", default=0.0)
    rubber_warming: Scalar = quantity("K", (0.0, 100.0), "rubber's temperature above room temperature", default=0.0)

    @property
    def present(self) -> dict[str, float]:
        """Faults that there are, by name [SI]."""
        values = {name: float(getattr(self, name)) for name in declared(RigFaults)}
        return {name: value for name, value in values.items() if value != SOUND.get(name, 0.0)}

    def drifts(self) -> dict[str, Scalar]:
        """Rates of the measured channels that drift [unit of the channel/s]."""
        return {n.removesuffix(DRIFT): getattr(self, n) for n in self.present if n.endswith(DRIFT)}

    def on_every_part(self, plumbing: Plumbing, unit: MuscleUnit) -> tuple[Plumbing, MuscleUnit]:
        """Return plumbing and muscle with all faults but the drifts, zero or not, so that values may be traced."""
        valve = self.valve(plumbing) if isinstance(plumbing.valve, PressureRegulator) else plumbing.valve
        return plumbing.replace(valve=valve, leak=self.leaking(plumbing)), unit.replace(
            tendon=self.slack(unit), law=self.worn(unit), clamp=self.slipping()
        )

    def plumbing(self, sound: Plumbing) -> Plumbing:
        """Return plumbing with the faults of valve and fitting; the same object where it has none."""
        present = self.present
        if "valve_blockage" in present or "valve_sticking" in present:
            sound = sound.replace(valve=self.valve(sound))
        return sound.replace(leak=self.leaking(sound)) if "leak" in present else sound

    def valve(self, sound: Plumbing) -> PressureRegulator:
        """Return the valve with its faults.

        Raises:
            InputError: the valve is no pressure regulator, of which these faults are known.
        """
        if not isinstance(sound.valve, PressureRegulator):
            name = "faults.valve_blockage" if "valve_blockage" in self.present else "faults.valve_sticking"
            raise InputError(name, None, "is known of pressure regulators only; the rig has another valve")
        return sound.valve.worn(blockage=self.valve_blockage, sticking=self.valve_sticking)

    def leaking(self, sound: Plumbing) -> Leak:
        """Return the leak of the fitting beside that which the plumbing has: their conductances add."""
        before = 0.0 if sound.leak is None else sound.leak.conductance
        return Leak(conductance=before + self.leak)

    def unit(self, sound: MuscleUnit) -> MuscleUnit:
        """Return the muscle with slack and wear; the same object where it has none."""
        present = self.present
        if "clamp_slack" in present:
            sound = sound.replace(tendon=self.slack(sound))
        if "clamp_grip" in present:
            sound = sound.replace(clamp=self.slipping())
        if "lost_threads" in present or "rubber_warming" in present:
            sound = sound.replace(law=self.worn(sound))
        return sound

    def slack(self, sound: MuscleUnit) -> Tendon:
        """Return the tendon with the slack of the clamp.

        Raises:
            InputError: the muscle has no tendon that a clamp could hold.
        """
        if sound.tendon is None:
            raise InputError(
                "clamp_slack", None, "needs a tendon that the clamp holds, and the muscle has none", where="faults"
            )
        slack: Tendon = sound.tendon.replace(slack_length=sound.tendon.slack_length + self.clamp_slack)
        return slack

    def slipping(self) -> Clamp:
        """Return the clamp with its grip."""
        return Clamp(grip=self.clamp_grip)

    def worn(self, sound: MuscleUnit) -> WornBraid:
        """Return the law of the worn braid."""
        wear = {"lost_threads": self.lost_threads, "warming": self.rubber_warming}
        return WornBraid(sound=sound.law, thread_strain=sound.law.thread_strain, **wear)


SOUND = {"clamp_grip": SOUND_GRIP}  # values that are sound, where it is not zero
NAMES = tuple(declared(RigFaults))
