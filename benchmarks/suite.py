"""Run all benchmarks: `make bench`, or

    python benchmarks/suite.py [--quick] [--only PART ..] [--out FOLDER]

Writes results.json, whose `ratios` are medians of the run, and a page results.md with its figures. A program or a part
that cannot be measured is an error, which stands in the tables and in the exit code. Use an idle machine: one core is
reserved for measurements on one core. `--quick` is a smoke test of two minutes without other programs; its numbers are not
representative.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from timing import CORES, pin  # noqa: E402

PARTS = ("batches", "single", "scaling", "gradients", "startup", "peers", "work")
# Target values: minimum or maximum.
WANTED: dict[str, tuple[str, float, str]] = {
    "c_share_of_peak": (
        ">=",
        0.35,
        "algebraic operations per second of the C kernel relative to the measured peak, 1,024 muscles, float64",
    ),
    "batch1024_f64_vs_c": (">=", 0.75, "native kernel relative to the C kernel, 1,024 muscles, float64, one core"),
    "batch1024_f64_fast_vs_c": (">=", 0.85, 'the same with `mode="fast"`'),
    "batch1024_f64_vs_mujoco": (">=", 15.0, "muscle-steps per second relative to MuJoCo's fastest, one core each"),
    "valve1024_f64_vs_c": (">=", 0.75, "native kernel relative to the C kernel, with an ISO 6358 valve in the circuit"),
    "two_cores_vs_one": (">=", 1.8, "two cores relative to one: native kernel, 16,384 muscles"),
    "two_cores_vs_one_peak": (">=", 1.8, "two cores relative to one: multiply and add only, the limit of this machine"),
    "single_vs_lsoda": (">=", 70.0, "one muscle for 2 s, errors below 1e-3: speed relative to LSODA with plain Python"),
    "s1_vs_c": (">=", 0.70, "S1, one muscle: speed relative to the C kernel at the same step"),
    "s1_off": ("<=", 1e-6, "S1: error of the contraction [m]"),
    "tangents4_vs_primal": ("<=", 3.5, "time of four tangents relative to the simulation"),
    "adjoint8_vs_primal": ("<=", 4.0, "time of the adjoint for eight parameters relative to the simulation"),
    "tangents4_vs_jax": (">=", 10.0, "speed of four tangents relative to JAX's derivatives"),
    "adjoint8_vs_jax": (">=", 20.0, "speed of the adjoint relative to JAX's derivatives"),
    "tangents4_vs_lowered": (">=", 1.25, "speed of four tangents relative to kernels of jax.jvp"),
    "adjoint8_vs_lowered": (">=", 1.25, "speed of the adjoint relative to a kernel of jax.value_and_grad"),
    "rig1000_compile_s": ("<=", 10.0, "1,000 muscles in one machine: time to the first step [s]"),
    "rig1000_vs_batch": ("<=", 1.3, "1,000 muscles in one machine: time per muscle relative to a batch"),
    "tank1000_compile_s": ("<=", 10.0, "1,000 muscles on one tank: time to the first step [s]"),
    "tank1000_vs_batch": ("<=", 1.3, "1,000 muscles on one tank: time per muscle relative to a batch"),
    "joint1000_compile_s": ("<=", 10.0, "1,000 muscles around one joint: time to the first step [s]"),
    "joint1000_vs_batch": ("<=", 1.3, "1,000 muscles around one joint: time per muscle relative to a batch"),
    "first_result_cached_s": ("<=", 0.2, "first result of a fresh process after importing JAX, kernels cached [s]"),
    "first_result_cold_s": ("<=", 0.5, "the same, nothing cached [s]"),
    "saved_program_s": ("<=", 0.3, "whole process with a saved program, without JAX [s]"),
}


def machine() -> dict[str, Any]:
    """Describe the machine of this run."""
    import importlib.metadata as known

    versions = {}
    for name in ("mckibben", "lanewise", "jax", "jaxlib", "llvmlite", "numpy", "scipy"):
        try:
            versions[name] = known.version(name)
        except known.PackageNotFoundError:
            versions[name] = None
    import compiled_c

    cc = compiled_c.compiler()
    said = subprocess.run([cc, "--version"], capture_output=True, text=True).stdout.splitlines()[:1] if cc else ["none"]
    return {
        "processor": processor(), "cores": len(CORES), "system": platform.platform(), "python": platform.python_version(),
        "compiler": said[0], "versions": versions, "load": list(os.getloadavg()) if hasattr(os, "getloadavg") else None,
    }  # fmt: skip


def processor() -> str:
    """Its name."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), platform.machine())


def measured(parts: list[str], quick: bool, say: Any) -> dict[str, Any]:
    """Run the parts; what they found by part."""
    import measure_batches
    import measure_gradients
    import measure_peers
    import measure_scaling
    import measure_single
    import measure_startup
    import measure_work

    found: dict[str, Any] = {}
    calls: dict[str, Any] = {
        "batches": lambda: measure_batches.measure(quick),
        "single": lambda: measure_single.measure(quick),
        "scaling": lambda: measure_scaling.measure(quick, found.get("batches", {}).get("rows", [])),
        "gradients": lambda: measure_gradients.measure(quick),
        "startup": lambda: measure_startup.measure(quick),
        "peers": lambda: measure_peers.measure(
            quick, found.get("single", {}).get("reference") or str(measure_single.exact_path())
        ),
        "work": lambda: measure_work.measure(quick),
    }
    for part in parts:
        begin = time.perf_counter()
        try:
            found[part] = calls[part]()
        except Exception as problem:  # one part that fails must not cost the hour of the others
            found[part] = {"rows": [], "left_out": {f"part {part}": f"{type(problem).__name__}: {problem}"}}
        say(f"{part}: {time.perf_counter() - begin:.0f} s")
    return found


def ratios(found: dict[str, Any]) -> dict[str, float]:
    """Return those measured numbers that have a target value."""
    rows = [row for part in found.values() for row in part["rows"]]

    def pick(key: str, **wanted: Any) -> float | None:
        return next((row[key] for row in rows if all(row.get(k) == v for k, v in wanted.items()) and key in row), None)

    many = {"group": "batch", "lanes": 1024, "dtype": "float64"}
    own = pick("rate", case="muscle", engine="native", **many)
    mujoco = [row["rate"] for row in rows if row.get("program", "").startswith("MuJoCo ")]
    gradients, startup = found.get("gradients", {}).get("gradients", {}), found.get("startup", {}).get("startup", {})
    out = {
        "c_share_of_peak": pick("share", group="peak", case="muscle", dtype="float64"),
        "batch1024_f64_vs_c": pick("vs_c", case="muscle", engine="native", **many),
        "batch1024_f64_fast_vs_c": pick("vs_c", case="muscle", engine="native, fast", **many),
        "batch1024_f64_xla_vs_c": pick("vs_c", case="muscle", engine="XLA", **many),
        "batch1024_f64_vs_mujoco": own / max(mujoco) if own and mujoco else None,
        "valve1024_f64_vs_c": pick("vs_c", case="valve", engine="native", **many),
        "two_cores_vs_one": found.get("scaling", {}).get("two_cores_vs_one", {}).get("native"),
        "two_cores_vs_one_peak": found.get("scaling", {}).get("two_cores_vs_one", {}).get("peak"),
        "single_vs_lsoda": found.get("single", {}).get("vs_lsoda", {}).get("native"),
        "s1_vs_c": found.get("single", {}).get("s1_vs_c", {}).get("native"),
        "s1_off": pick("off", group="s1", engine="native"),
        "tangents4_vs_primal": gradients.get("tangents_native"),
        "adjoint8_vs_primal": gradients.get("adjoint_native"),
        "tangents4_vs_jax": gradients.get("tangents_vs_jax"),
        "adjoint8_vs_jax": gradients.get("adjoint_vs_jax"),
        "tangents4_vs_lowered": gradients.get("tangents_vs_lowered"),
        "adjoint8_vs_lowered": gradients.get("adjoint_vs_lowered"),
        "rig1000_compile_s": pick("compile", group="rig", case="independent", muscles=1000),
        "rig1000_vs_batch": pick("vs_batch", group="rig", case="independent", muscles=1000),
        "tank1000_compile_s": pick("compile", group="rig", case="tank", muscles=1000),
        "tank1000_vs_batch": pick("vs_batch", group="rig", case="tank", muscles=1000),
        "joint1000_compile_s": pick("compile", group="rig", case="joint", muscles=1000),
        "joint1000_vs_batch": pick("vs_batch", group="rig", case="joint", muscles=1000),
        "first_result_cached_s": startup.get("native", {}).get("cached"),
        "first_result_cold_s": startup.get("native", {}).get("cold"),
        "saved_program_s": startup.get("saved", {}).get("whole"),
    }
    return {name: float(value) for name, value in out.items() if value is not None}


def main() -> int:
    """Measure, write the results, and print which numbers miss their target; the exit code is 1 if one is an error."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a smoke test of two minutes, without other programs")
    parser.add_argument("--only", nargs="+", choices=PARTS, help="parts to run")
    parser.add_argument("--out", type=Path, help="folder of results.json and results.md; this one, for a whole run")
    given = parser.parse_args()
    pin()
    parts = given.only or [p for p in PARTS if not (given.quick and p in ("gradients", "startup", "peers", "work"))]
    start = datetime.now(UTC).isoformat(timespec="seconds")
    found = measured(parts, given.quick, lambda line: print(line, file=sys.stderr, flush=True))
    result = {
        "schema": 1, "started": start, "quick": given.quick, "machine": machine(), "ratios": ratios(found),
        "wanted": {name: {"sign": w[0], "value": w[1], "meaning": w[2]} for name, w in WANTED.items()},
        "rows": [row for part in found.values() for row in part["rows"]],
        "linear": found.get("scaling", {}).get("linear", {}),
        "left_out": {name: why for part in found.values() for name, why in part.get("left_out", {}).items()},
        "notes": [note for part in found.values() for note in part.get("notes", [])],
    }  # fmt: skip
    whole = not (given.only or given.quick)  # a part replaces no results of a whole run
    out = given.out or (HERE if whole else None)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "results.json").write_text(json.dumps(result, indent=1) + "\n")
        import page

        page.write(result, out)
    for name, (sign, value, meaning) in WANTED.items():
        got = result["ratios"].get(name)
        fair = got is not None and (got >= value if sign == ">=" else got <= value)
        mark = "-" if got is None else "ok" if fair else "short"
        print(f"{mark:6}{name:26}{'-' if got is None else f'{got:.4g}':>10}  {sign} {value:g}: {meaning}")
    for name, why in result["left_out"].items():
        print(f"error: {name}: {why}")
    return int(bool(result["left_out"]))


if __name__ == "__main__":
    sys.exit(main())
