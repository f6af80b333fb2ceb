"""A muscle that has learned what its law leaves, as a specimen's file states it: one more case for every host."""

import dataclasses
from pathlib import Path

import numpy as np

import mckibben as mk
from mckibben.muscles import LearnedResidual
from mckibben.specimens import save_specimen

LENGTHS, PRESSURES = (0.12, 0.15), (0.0, 7e5)  # where the muscle of the host tests moves


def learned_muscle(folder: Path) -> Path:
    """The nylon muscle with drawn weights: some newtons at 3 bar, and the gas volume that belongs to them."""
    law = LearnedResidual.beside(mk.muscle("nylon").law, lengths=LENGTHS, pressures=PRESSURES)
    law = law.replace(weights=0.01 * np.random.default_rng(5).standard_normal((4, 4)))
    spec = dataclasses.replace(mk.specimen("nylon"), id="learned", residual=law.group("drawn for a test"))
    save_specimen(spec, folder / "learned.toml")
    return folder / "learned.toml"
