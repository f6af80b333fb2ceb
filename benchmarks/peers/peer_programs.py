"""An environment of its own for each program that is compared with, made on first use, or a reason why not."""

from __future__ import annotations

import json
import subprocess
import sys
import venv
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
# package, and the script that runs it; a script of `benchmarks/` needs the library in that environment as well
PEERS: dict[str, tuple[list[str], Path]] = {
    "MuJoCo": (["mujoco"], HERE / "mujoco_muscle.py"),
    "OpenSim": (["opensim"], HERE / "opensim_mckibben.py"),
    "SoRoMoX": (["soromox"], HERE / "soromox_arm.py"),
    "diffrax": (["diffrax"], HERE / "diffrax_s1.py"),
    "CVODE": (["casadi"], HERE / "cvode_s1.py"),
    "FONSim": (["fonsim", str(ROOT / "packages" / "lanewise"), str(ROOT)], ROOT / "benchmarks" / "fonsim_tank.py"),
}
# the same for programs that are not measured for their speed
DESIGNERS: dict[str, tuple[list[str], Path]] = {
    "pydex": (["pydex"], HERE / "pydex_design.py"),
    "Pyomo.DoE": (["pyomo", "pyomo-ripopt", "numpy", "scipy", "pandas", "packaging"], HERE / "pyomo_design.py"),
}
PROGRAMS = PEERS | DESIGNERS
PATIENCE = 900.0  # [s] for an installation, and for a run


class LeftOutError(Exception):
    """A peer that cannot be had or run; says why."""


def python_of(name: str) -> Path:
    """The interpreter of a peer's environment, which is made if need be."""
    folder = ROOT / f".venv-bench-{name.lower()}"
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    ready = folder / "ready"
    if not ready.exists():
        try:
            venv.create(folder, with_pip=True, clear=True)
        except (OSError, subprocess.CalledProcessError) as problem:
            raise LeftOutError(f"could not make an environment for {name}: {problem}") from None
        _called(
            [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PROGRAMS[name][0]],
            f"install {name}",
        )
        ready.touch()
    return python


def run(name: str, *arguments: str) -> dict[str, Any]:
    """What a peer's script prints, as the table that it is.

    Raises:
        LeftOutError: if it cannot be installed or run.
    """
    done = _called([str(python_of(name)), str(PROGRAMS[name][1]), *arguments], f"run {name}")
    try:
        found: dict[str, Any] = json.loads(done.splitlines()[-1])
    except (ValueError, IndexError):
        raise LeftOutError(f"{name} printed no table") from None
    return found


def _called(command: list[str], what: str) -> str:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise LeftOutError(f"could not {what}: {problem}") from None
    if done.returncode:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:] or ["no message"]
        raise LeftOutError(f"could not {what}: {last[0]}")
    return done.stdout
