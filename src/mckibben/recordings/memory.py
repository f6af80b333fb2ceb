"""The memory that a run will need, estimated before it begins."""

from __future__ import annotations

import os
from pathlib import Path

from ..errors import InputError
from ..quantities import with_unit

SHARE = 0.5  # of the free memory that a run may take
UNKNOWN = 4e9  # free memory where the system does not say [B]
# Bytes per sample of a simulation that is stepped, and of a run in one piece, with copies.
STEPPED, INTEGRATED = 8e3, 2e3


def free_memory() -> float:
    """Memory that is free [B]."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        return 1024.0 * float(next(line.split()[1] for line in lines if line.startswith("MemAvailable")))
    except (OSError, StopIteration, ValueError):
        pass
    try:
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, OSError, ValueError):
        return UNKNOWN


def check_memory(
    duration: float, period: float, *, bytes_per_sample: float, runs: int = 1, field: str = "duration", where: str = ""
) -> None:
    """Refuse a run whose samples would not fit into the memory.

    Args:
        duration: of the run [s].
        period: of its samples [s].
        bytes_per_sample: `STEPPED`, `INTEGRATED`, or another estimate.
        runs: how many are in memory at once.
        field: by which the duration is asked for.
        where: file in which it stands.

    Raises:
        InputError: states the need, what is free, and which duration would do.
    """
    need, free = runs * duration / period * bytes_per_sample, free_memory()
    if need <= SHARE * free:
        return
    longest = float(f"{SHARE * free * period / (bytes_per_sample * runs):.2g}")
    each = f" for each of {runs} runs" if runs > 1 else ""
    problem = (
        f"must be at most {longest:g} s{each} at a period of {with_unit(period, 's')}; it would need {1e-9 * need:.4g} GB "
        f"of memory, of which {1e-9 * free:.3g} GB are free: a shorter run or a longer period would do"
    )
    raise InputError(field, with_unit(duration, "s"), problem, where=where or None)
