"""The benches of `score`: a machine that controllers drive, with the provenance of its numbers; unseen plants.

| number of B1 | value | source |
|---|---|---|
| law | DMSP-10-250 by Martens and Boblan | the specimen that ships |
| friction | Maxwell slip, 0.05, 0.3, 2, 12 mm; 4.7, 2.1, 3.9, 20.4 N at 5 bar, q/(1 + q) of it with P, q = 3.11 | fit |
| creep | 553 N/m at 1 s, 40 N/m at 30 s | fit |
| load | 440 N/m, 2.75 kg, 60 N s/m, 27 N | fit |
| spring relaxed at | 0.2248 m, where the published stroke ends | chosen: the given holds then have rms 0.48 mm |
| regulator | C 2.2e-10 and 4.5e-10 m^3/(s Pa), b 0.3, band 0.3 bar, dead time 30 ms, lag 5 ms | fit |
| command | 0.948 to 7.2 V at 0.592 bar/V | published |
| position | 0.02 mm counts, median of 3, noise 5.8 um; pressure 5.8 mbar | published; fit |

"fit" is one to the holds, the loop and the step of 59 pressures that the authors of `PUBLISHED` made public; the machine
misses them by 0.5 mm. The joint J1 has two such muscles, 2 cm of arm, 50 kg cm^2, spans of 0.241 m, and the noise of the
same sensors: that of the position at the arm.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..components import Hysteresis
from ..errors import InputError
from ..muscles import Muscle
from ..muscles.elements import MaxwellChain
from ..muscles.hysteresis import BoucWen, Dahl, FrictionLimit, MaxwellSlip
from ..muscles.muscle import muscle
from ..pneumatics.orifice import Orifice
from ..pneumatics.valves import PressureRegulator
from ..quantities import random_generator, whole_number
from ..simulation import Air, Joint, Simulation, Spring
from ..simulation.mechanisms import Mechanism, in_si
from ..simulation.readouts import Readout
from .task import ControlTask

SPECIMEN, RATE, GOES = "DMSP-10-250", 5e5, 3.11  # pressure at which friction is stated [Pa]; q
TRAVELS, FORCES = np.array([0.05, 0.3, 2.0, 12.0]) * 1e-3, np.array([4.7, 2.1, 3.9, 20.4])  # [m], [N]
VOLT = 0.592e5  # of the published regulator [Pa]
LIMITS = 0.948 * VOLT, 7.2 * VOLT
ARM = 0.02  # of the joint [m]
ONE_TRAVEL = 3e-3  # of a friction of one contact, between those of the four [m]
ZERO, START = 0.2515, 3.82e-3  # position at which the stroke is zero, and stroke at the start [m]
MEAN, HALF = 2.4e5, 1.8e5  # of the two pressures of the joint [Pa]
NOISE = {"position": 5.8e-6, "pressure": 580.0}
JOINT_NOISE = {"angle": NOISE["position"] / ARM, **dict.fromkeys(("flexor_pressure", "extensor_pressure"), 580.0)}
COUNTS = Readout(rounding=2e-5, median=3)
UNSEEN = 20
DRAWN = 90317  # seed of the plants not seen: drawn once all gains were chosen, and anew when one is chosen again
# tbazina/pam_lqi_pid: settled, tracking, overshoot [mm], share saturated, travel of the command [V in 120 s].
PUBLISHED = {
    "feedforward": (2.382, 3.425, 1.09, 0.0, 100.0),
    "PID": (0.333, 2.166, 0.50, 0.061, 330.0),
    "LQI": (0.235, 2.145, 0.56, 0.058, 386.0),
    "LQI with velocity": (0.276, 2.148, math.nan, math.nan, math.nan),
}

KINDS: dict[str, Callable[..., Hysteresis]] = {"maxwell": MaxwellSlip, "bouc-wen": BoucWen, "dahl": Dahl}


@dataclass(frozen=True)
class Plant:
    """A machine of a bench: how it differs from the one that controllers are built on; all factors are 1 there.

    Attributes:
        name: what it is, one phrase.
        law: of the specimen, by name.
        friction: kind: ``maxwell``, ``bouc-wen`` or ``dahl``.
        rest_diameter: factor [1], of laws that have it.
        friction_scale: factor of all friction [1].
        travel: factor of the yield travels [1].
        creep: factor of its stiffnesses [1].
        creep_time: factor of its times [1].
        load: factor of weight and spring [1].
        mass: factor [1].
        flow: factor of both conductances [1].
        band: factor of the regulator's band [1].
        dead_time: [s].
        supply: gauge pressure [Pa].
    """

    name: str = "nominal"
    law: str = "martens_boblan"
    friction: str = "maxwell"
    rest_diameter: float = 1.0
    friction_scale: float = 1.0
    travel: float = 1.0
    creep: float = 1.0
    creep_time: float = 1.0
    load: float = 1.0
    mass: float = 1.0
    flow: float = 1.0
    band: float = 1.0
    dead_time: float = 0.03
    supply: float = 7e5

    def __post_init__(self) -> None:
        if self.friction not in KINDS:
            raise InputError("friction", self.friction, known=KINDS)
        for one in dataclasses.fields(self):
            if one.name not in ("name", "law", "friction"):
                unit = {"dead_time": "s", "supply": "Pa"}.get(one.name, "1")
                number = in_si(getattr(self, one.name), unit, one.name)
                if number < 0.0:
                    raise InputError(one.name, number, f"must be zero or more [{unit}]")
                object.__setattr__(self, one.name, number)

    def muscle(self) -> Muscle:
        """The muscle with its friction and creep."""
        # a law that does not know its volume has that of the law which does
        law = muscle(SPECIMEN, law=self.law).law
        if not law.has_volume():
            volume = float(muscle(SPECIMEN).law.braid_volume(law.rest_length, 0.0))  # type: ignore[attr-defined]
            law = muscle(SPECIMEN, law=self.law, rest_volume=volume).law
        if self.rest_diameter != 1.0:
            law = law.replace(rest_diameter=self.rest_diameter * law.rest_diameter)  # type: ignore[attr-defined]
        stiffness, times = self.creep * np.array([553.0, 40.0]), self.creep_time * np.array([1.0, 30.0])
        return Muscle(law, friction=self._friction(), creep=MaxwellChain(stiffness=stiffness, time_constant=times))

    def _friction(self) -> Hysteresis:
        forces: np.ndarray = self.friction_scale * FORCES
        travels: np.ndarray = self.travel * TRAVELS
        if self.friction != "maxwell":  # one contact, of all the force
            forces, travels = np.asarray(np.sum(forces)), np.asarray(self.travel * ONE_TRAVEL)
        limit = FrictionLimit(constant=forces / (1.0 + GOES), per_pressure=forces * GOES / (1.0 + GOES) / RATE)
        return KINDS[self.friction](limit=limit, stiffness=forces / travels)

    def air(self) -> Air:
        """Supply and regulators, each on its muscle."""
        fill, relief = (Orifice(conductance=self.flow * c, critical_ratio=0.3) for c in (2.2e-10, 4.5e-10))
        valve = PressureRegulator(fill=fill, relief=relief, band=self.band * 0.3e5, dead_time=self.dead_time, lag=5e-3)
        return Air(supply=self.supply, valve=valve, tube="none", port_volume=1e-7)


NOMINAL = Plant()
# Robustness on the nominal kind of plant: a tenth more muscle with more friction, and a tenth less load.
VARIED = {
    "nominal": NOMINAL,
    "wrong": Plant("wrong", rest_diameter=math.sqrt(1.1), friction_scale=1.3),
    "load": Plant("load", load=0.9),
}


def unseen_plants(count: int = UNSEEN, seed: int = DRAWN) -> list[Plant]:
    """Plants on which no controller was built: another law and friction each, other creep, valve, load and supply.

    The laws are those that the specimen states as fitted to its map to better than 2 N; the friction is one contact of
    Bouc-Wen or Dahl. All numbers are drawn.

    Args:
        count: how many.
        seed: of the draws.
    """
    random = random_generator(seed)

    def spread(size: float) -> float:
        return math.exp(size * float(random.uniform(-1.0, 1.0)))

    made = []
    for k in range(whole_number(count, "count")):
        law, friction = (("sarosi", "hyperelastic_braid")[k % 2], ("bouc-wen", "dahl")[k // 2 % 2])
        made.append(
            Plant(
                f"{k + 1}: {law}, {friction}", law, friction, friction_scale=spread(0.3), travel=spread(0.5),
                creep=spread(0.7), creep_time=spread(0.4), load=spread(0.1), mass=spread(0.2), flow=spread(0.2),
                band=spread(0.2), dead_time=float(random.uniform(0.03, 0.038)), supply=float(random.uniform(6.5e5, 7.5e5)),
            )
        )  # fmt: skip
    return made


@dataclass(frozen=True)
class ControlBench:
    """A bench on which controllers are scored.

    Attributes:
        name: short name.
        about: what it is, one phrase.
        period: of the samples [s].
        unit: SI unit of the output.
        reference: usual one.
        mechanism: what the muscle of a plant moves.
        noise: of the sensors [SI].
        readouts: of the sensors.
    """

    name: str
    about: str
    period: float
    unit: str
    reference: str
    mechanism: Callable[[Plant], Mechanism]
    noise: dict[str, float] = dataclasses.field(default_factory=dict)
    readouts: dict[str, Readout] = dataclasses.field(default_factory=dict)

    def simulation(self, plant: Plant = NOMINAL, *, sensors: bool = True) -> Simulation:
        """A plant on the bench, with the bench's sensors or with none."""
        mechanism = self.mechanism(plant)
        read: dict[str, Any] = {"noise": self.noise, "readouts": self.readouts} if sensors else {}
        limits = dict.fromkeys(mechanism.muscles, LIMITS)
        return Simulation(mechanism, plant.air(), period=self.period, limits=limits, title=self.name, **read)


def _stroke(plant: Plant) -> Mechanism:
    return Spring(
        plant.muscle(), stiffness=plant.load * 440.0, mass=plant.mass * 2.75, damping=60.0, weight=plant.load * 27.0,
        relaxed=0.2248, start=ZERO - START,
    )  # fmt: skip


def _joint(plant: Plant) -> Mechanism:
    return Joint(plant.muscle(), arm=ARM, inertia=plant.load * 5e-3, span=0.241)


BENCHES = {
    one.name: one
    for one in (
        ControlBench("B1", "a DMSP-10-250 on spring and weight behind a regulator", 10e-3, "m", "R2", _stroke,
                     NOISE, {"position": COUNTS}),
        ControlBench("J1", "two DMSP-10-250 on a joint behind regulators", 5e-3, "rad", "R3", _joint, JOINT_NOISE),
    )
}  # fmt: skip


def find_bench(name: str) -> ControlBench:
    """The bench of a name.

    Raises:
        InputError: there is none; names the nearest.
    """
    if name not in BENCHES:
        raise InputError("bench", name, known=BENCHES)
    return BENCHES[name]


def control_task(bench: str = "B1", plant: Plant = NOMINAL) -> ControlTask:
    """What a controller of a bench is told: the nominal plant without noise, and how its output follows.

    Args:
        bench: name of the bench.
        plant: on which the controller is built.

    Examples:
        >>> from mckibben.control import control_task
        >>> control_task("B1").period
        0.01
    """
    stand = find_bench(bench)
    model = stand.simulation(plant, sensors=False)
    if stand.unit == "rad":
        return ControlTask(
            model, "angle", 0.0, 1.0, {"flexor": (MEAN, 1.0), "extensor": (MEAN, -1.0)}, (-HALF, HALF), "rad"
        )
    return ControlTask(model, "position", ZERO, -1.0, {"muscle": (0.0, 1.0)}, LIMITS)
