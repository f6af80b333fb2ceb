"""The one table of names: what each is called, its symbol, SI unit, sign and meaning.

Module, column and channel names everywhere are taken from here; the documentation's nomenclature page is made from it.
Words of the field are told in `GLOSSARY`, from which the documentation's glossary and the words on the screen are made.
"""

from __future__ import annotations

from typing import NamedTuple


class Term(NamedTuple):
    """A physical term: printed symbol, SI unit, sign convention if there is one, and meaning."""

    symbol: str
    unit: str
    meaning: str
    sign: str = ""


TERMS: dict[str, Term] = {
    "length": Term("L", "m", "length of the braid between its fittings"),
    "span": Term("X", "m", "distance between the muscle's anchors; the braid may be longer when slack"),
    "rest_length": Term("L0", "m", "length of the unpressurised, unloaded muscle"),
    "contraction": Term("eps", "1", "(L0 - L)/L0", "positive when shorter than at rest"),
    "pressure": Term("P'", "Pa", "gauge pressure of the gas in the muscle", "positive above the environment"),
    "pressure_abs": Term("P", "Pa", "absolute pressure"),
    "tension": Term("F", "N", "axial force of the muscle on its anchors", "positive when pulling, never negative"),
    "active_tension": Term("Fa", "N", "the part of the braid's force due to the gas", "positive when pulling"),
    "passive_tension": Term("Fp", "N", "the part of the braid's force without gas", "positive when pulling"),
    "volume": Term("V", "m^3", "volume of the gas in the muscle"),
    "stiffness": Term("K", "N/m", "dF/dL at constant pressure"),
    "stiffness_per_pressure": Term("Kg", "m", "d2F/dL dP', the gas spring's constant"),
    "thread_length": Term("b", "m", "length of one thread of the braid"),
    "turns": Term("n", "1", "turns of one thread around the braid"),
    "braid_angle": Term("theta", "rad", "angle of the thread", "measured from the long axis"),
    "diameter": Term("D", "m", "diameter of the braid"),
    "wall_thickness": Term("tk", "m", "thickness of bladder and braid together"),
    "threshold_pressure": Term("Pth", "Pa", "gauge pressure at which the bladder reaches the braid"),
    "friction": Term("Fc", "N", "friction force", "positive while lengthening"),
    "velocity": Term("v", "m/s", "dL/dt", "positive while lengthening"),
    "work": Term("W", "J", "-(integral of F dL) over a cycle", "positive where the muscle does work on its load"),
    "activation": Term("a", "1", "activation of a biological muscle, 0 to 1"),
    "free_length": Term("Lf", "m", "length at which the unloaded muscle settles at a pressure"),
}


class GlossaryEntry(NamedTuple):
    """A word of the field: what it means in one sentence, and the page of the documentation that explains it."""

    sentence: str
    page: str


GLOSSARY: dict[str, GlossaryEntry] = {
    "braid": GlossaryEntry(
        "The sleeve of helical threads around the bladder: it cannot get longer, so that a muscle that swells must shorten.",
        "explanation/muscle-and-mckibben",
    ),
    "bladder": GlossaryEntry(
        "The tube of rubber inside the braid that holds the gas.", "explanation/muscle-and-mckibben"
    ),
    "rest length": GlossaryEntry(
        "Length of the muscle without pressure and load, L0; contraction and many set-points are counted from it.",
        "explanation/muscle-and-mckibben",
    ),
    "free length": GlossaryEntry("Length at which the unloaded muscle settles at a pressure.", "explanation/laws"),
    "contraction": GlossaryEntry(
        "Shortening from the rest length as a share of it, (L0 - L)/L0.", "explanation/muscle-and-mckibben"
    ),
    "stroke": GlossaryEntry("Distance by which the muscle shortens while it works.", "how-to/size-a-muscle"),
    "span": GlossaryEntry(
        "Distance between the two anchors; a slack muscle is longer than it.", "explanation/the-test-machine"
    ),
    "braid angle": GlossaryEntry(
        "Angle of the threads to the long axis; near 54.7 degrees a muscle pulls no more.", "explanation/laws"
    ),
    "turns": GlossaryEntry(
        "How often one thread winds around the braid; with the length of a thread it decides the volume.",
        "explanation/laws",
    ),
    "tension": GlossaryEntry(
        "Force with which the muscle pulls its anchors together; it never pushes.", "explanation/one-potential"
    ),
    "gauge pressure": GlossaryEntry(
        "Pressure above that of the room; all pressures are gauge unless they are called absolute.",
        "explanation/gas-and-heat",
    ),
    "set-point": GlossaryEntry(
        "Value that a controller is asked for; the measured one follows with a delay.", "explanation/the-test-machine"
    ),
    "stiffness": GlossaryEntry(
        "Change of the tension per change of the length at constant pressure.", "explanation/laws"
    ),
    "slack": GlossaryEntry(
        "State in which the muscle is longer than the distance of its anchors and pulls nothing.",
        "explanation/the-test-machine",
    ),
    "law": GlossaryEntry("Formula for the tension from length and pressure, without friction.", "explanation/laws"),
    "threshold": GlossaryEntry(
        "Pressure below which the bladder does not yet fill the braid, so that the muscle hardly pulls.",
        "explanation/laws",
    ),
    "friction": GlossaryEntry(
        "Force that threads and rubber oppose to a motion: more tension while lengthening, less while shortening.",
        "explanation/friction",
    ),
    "hysteresis": GlossaryEntry(
        "Difference of the tension between lengthening and shortening at the same length, seen as the width of a loop.",
        "explanation/friction",
    ),
    "creep": GlossaryEntry(
        "Slow change of length or tension that goes on while pressure and load stay.", "explanation/friction"
    ),
    "work loop": GlossaryEntry(
        "Closed curve of tension over length in a cycle, whose area is the work of the cycle.",
        "explanation/energy-of-cycles",
    ),
    "work per cycle": GlossaryEntry(
        "Area of the loop, positive where the muscle does work on its load.", "explanation/energy-of-cycles"
    ),
    "efficiency": GlossaryEntry(
        "Work that came out over the energy that the gas brought in.", "explanation/energy-of-cycles"
    ),
    "exergy": GlossaryEntry(
        "Work that a gas could do at most until it is like the air of the room.", "explanation/where-the-energy-goes"
    ),
    "accumulator": GlossaryEntry(
        "Vessel that takes the exhaust of a muscle and gives it back to the next filling.",
        "explanation/energy-of-cycles",
    ),
    "isobaric": GlossaryEntry("At constant pressure.", "how-to/write-a-protocol"),
    "isometric": GlossaryEntry("At constant length.", "how-to/write-a-protocol"),
    "isotonic": GlossaryEntry("At constant tension.", "how-to/write-a-protocol"),
    "isokinetic": GlossaryEntry("At constant speed.", "how-to/write-a-protocol"),
    "protocol": GlossaryEntry(
        "Steps of pressure and length in time that a run plays, with the numbers that may be changed.",
        "how-to/write-a-protocol",
    ),
    "dry run": GlossaryEntry(
        "Check of a protocol against the limits of rig and muscle before anything moves.",
        "explanation/the-test-machine",
    ),
    "interlock": GlossaryEntry(
        "Limit that stops a run and vents by itself when it is passed.", "explanation/the-test-machine"
    ),
    "rig": GlossaryEntry(
        "Test machine with its valve, tube, sensors, motor and limits.", "how-to/describe-your-own-rig"
    ),
    "specimen": GlossaryEntry(
        "Muscle with its published or fitted numbers, each with a source.", "how-to/add-a-specimen"
    ),
    "recording": GlossaryEntry(
        "Samples of one run with protocol, rig, specimen and all that is needed to make it again.",
        "explanation/recordings",
    ),
    "supply": GlossaryEntry(
        "Gas at constant pressure from which a valve fills the muscle.", "explanation/orifices-and-valves"
    ),
    "exhaust": GlossaryEntry(
        "Way on which a valve lets the gas of the muscle out into the room.", "explanation/orifices-and-valves"
    ),
    "regulator": GlossaryEntry(
        "Valve that keeps its outlet at the pressure that it is asked for.", "explanation/orifices-and-valves"
    ),
    "proportional valve": GlossaryEntry(
        "Valve whose opening follows its command continuously.", "explanation/orifices-and-valves"
    ),
    "orifice": GlossaryEntry(
        "Narrow passage that decides the flow by the pressures on its two sides.", "explanation/orifices-and-valves"
    ),
    "tube": GlossaryEntry(
        "Line between valve and muscle, which delays the pressure by friction, volume and inertia of its gas.",
        "explanation/tubes",
    ),
    "inertance": GlossaryEntry("Inertia of the gas in a tube against a change of its flow.", "explanation/tubes"),
    "dead volume": GlossaryEntry(
        "Volume of fittings and tube that must be filled and does no work.", "explanation/energy-of-cycles"
    ),
    "flow": GlossaryEntry(
        "Gas per time into the muscle, as volume of air of the room.", "explanation/orifices-and-valves"
    ),
    "leak": GlossaryEntry("Gas that is lost although all valves are shut.", "explanation/orifices-and-valves"),
    "rise": GlossaryEntry(
        "Time in which a response goes from one share of its change to another, such as 10 to 90 %.",
        "explanation/tubes",
    ),
    "residual": GlossaryEntry("Measured less computed value.", "explanation/uncertainty"),
    "RMS error": GlossaryEntry("Root of the mean square of the residuals.", "explanation/uncertainty"),
    "left out": GlossaryEntry(
        "Error at points that the fit was not shown, which tells how it predicts.", "explanation/uncertainty"
    ),
    "AICc": GlossaryEntry(
        "Criterion that weighs the error of a fit against its number of parameters; only differences count.",
        "explanation/uncertainty",
    ),
    "95 % intervals": GlossaryEntry(
        "Ranges that contain the value in 95 of 100 repetitions if law and noise are as supposed.",
        "explanation/uncertainty",
    ),
}
