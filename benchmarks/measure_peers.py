"""Other programs, each in an environment of its own, with the error of each against its own converged result."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

sys.path.append(str(Path(__file__).parent / "peers"))

import peer_programs  # noqa: E402
import yardstick  # noqa: E402


def measure(quick: bool, reference: str) -> dict[str, Any]:
    """All that can be had; of the others a row with the error, and the error by name."""
    numbers = {
        **yardstick.NUMBERS,
        "conductance": yardstick.CONDUCTANCE,
        "ratio": yardstick.RATIO,
        "density": yardstick.DENSITY,
    }
    repeats = 3 if quick else 11
    s1 = json.dumps(
        {"repeats": repeats, "numbers": numbers, "reference": reference, "tolerances": yardstick.TOLERANCES}
    )
    arguments = {"diffrax": [s1], "CVODE": [s1], "FONSim": ["--json", "--repeats", str(repeats)]}
    rows: list[Any] = []
    left_out: dict[str, str] = {}
    extra: dict[str, Any] = {}
    for name in peer_programs.PEERS:
        try:
            found = peer_programs.run(name, *arguments.get(name, [str(repeats)]))
        except peer_programs.LeftOutError as reason:
            left_out[name] = str(reason)
            rows.append({"group": "peers", "program": name, "case": "error", "setting": str(reason)})
            continue
        if name == "FONSim":
            extra["fonsim"] = found
            rows += tank(found)
        else:
            rows += [{"group": "peers", **row} for row in found["rows"]]
    return {"rows": rows, "left_out": left_out, **extra}


def tank(found: dict[str, Any]) -> list[Any]:
    """The fastest of FONSim and of ours at each error."""
    rows = []
    for at in found["best"]:
        for program, name in (("fonsim", "FONSim"), ("mckibben", "mckibben")):
            best = at[program]
            if best:
                rows.append(
                    {
                        "group": "tank",
                        "program": name,
                        "case": f"tube and tank, error below {at['target']:g}",
                        "states": 2,
                        "setting": best["setting"],
                        "dtype": "float64",
                        "real_time": found["duration"] / best["time"],
                        "error": best["error"],
                    }
                )
    return rows
