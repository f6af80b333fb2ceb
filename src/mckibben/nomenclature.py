"""The one table of names: what each is called, its symbol, SI unit, sign and meaning.

Module, column and channel names everywhere are taken from here; the documentation's nomenclature page is made from it.
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
