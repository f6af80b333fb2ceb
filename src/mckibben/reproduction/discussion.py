"""The discussion's numbers on biological muscle, from Gordon's and Hill's curves."""

from __future__ import annotations

from ..analysis import biology
from ..muscles.biological import BiologicalMuscle
from .rows import reproduces

INTENSITY = 35e4  # maximum tension intensity that the paper takes from Guyton 1986 [N/m^2]
FASTEST = 20.0  # maximum shortening velocity of fast muscle that it takes from Gordon 1989 [L0/s]


def muscle() -> BiologicalMuscle:
    """The muscle that the paper's discussion computes with; its size cancels."""
    return BiologicalMuscle(
        rest_length=0.14, section_area=0.95e-4, maximum_tension_intensity=INTENSITY, maximum_velocity=FASTEST
    )


@reproduces("biology.stiffness_intensity", "N/m^2", "with the ends of the range as printed, 0.64 and 1.12")
def stiffness_intensity() -> float:
    """Maximum intensity over the dynamic range."""
    return biology.stiffness_intensity(INTENSITY, biology.dynamic_range(muscle().active_curve).rounded())


@reproduces(
    "biology.work_density",
    "J/m^3",
    "0.126 with Gordon's nodes; the ends rounded to 0.64 and 1.12 first would give 0.1245",
)
def work_density() -> float:
    """Integral of the active curve over the dynamic range."""
    return biology.work_density(muscle().active_curve, INTENSITY)


@reproduces("biology.dynamic_range", "1", "0.49 between Gordon's nodes, 0.48 between the rounded ends that are printed")
def dynamic_range() -> float:
    """Width of the part of the active curve whose slope is not negative."""
    return biology.dynamic_range(muscle().active_curve).rounded().width


@reproduces("biology.peak_power_density", "W/m^3")
def peak_power_density() -> float:
    """A tenth of maximum intensity times maximum velocity."""
    return biology.peak_power_density(muscle(), fraction=0.1)
