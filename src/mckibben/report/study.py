"""What a fit of several laws to one table found, as one value for tables, figures and reports."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..identification import Fit
from ..recordings import ForceMap
from ..specimens import Specimen


@dataclass(frozen=True)
class Study:
    """One force map and everything that was fitted to it, best law first.

    `published` holds laws with printed coefficients as (title, error at the taut points [N]); `skipped` says why a law
    could not be fitted.
    """

    title: str
    specimen: Specimen | None
    points: ForceMap
    fits: list[Fit]
    published: list[tuple[str, np.ndarray]] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)
