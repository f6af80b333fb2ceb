"""Simulations that several tests share; every structure is compiled once."""

import functools
import math

import mckibben as mk

AIR = mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("1 m", "4 mm"))


@functools.cache
def joint(noisy=False, step=2e-4):
    """A joint with two nylon muscles, at 500 Hz."""
    noise = {"angle": 1e-3, "flexor_pressure": 100.0} if noisy else None
    return mk.Simulation(mk.Joint("nylon", arm="2 cm", inertia=2e-3), AIR, period=2e-3, step=step, noise=noise)


@functools.cache
def weight():
    """A weight on one muscle, at 500 Hz."""
    return mk.Simulation(mk.Weight("nylon", mass="3 kg"), AIR, period=2e-3)


def drive(k):
    """Gentle commands at a sample: both muscles stay taut."""
    return {"flexor": 0.2 * math.sin(0.05 * k), "extensor": 0.1 * math.sin(0.03 * k)}


def driven(simulation, samples, first=0):
    """The observations of some samples."""
    return [simulation.step(**drive(k)) for k in range(first, first + samples)]
