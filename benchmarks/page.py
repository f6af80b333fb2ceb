"""Write the page and the figures of a benchmark run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

TITLES = {
    "batch": "Many muscles on one core",
    "peak": "The processor's peak",
    "single": "One muscle for 2 s",
    "s1": "Benchmark system S1, 10 s",
    "curve": "S1, 10 s: work over precision",
    "cores": "Two cores",
    "rig": "Many muscles in one machine",
    "gradients": "Derivatives of whole runs",
    "startup": "First result of a fresh process",
    "peers": "Other programs",
    "tank": "FONSim's network",
    "work": "Applications",
    "clock": "The real-time loop",
}
COLUMNS = {
    "program": "program",
    "case": "case",
    "engine": "engine",
    "setting": "setting",
    "lanes": "muscles",
    "muscles": "muscles in the machine",
    "states": "states",
    "dtype": "numbers",
    "rate": "per second",
    "real_time": "x real time",
    "seconds": "seconds",
    "cpu": "processor s",
    "whole": "whole process s",
    "compile": "compilation s",
    "vs_c": "of C",
    "vs_lsoda": "x LSODA",
    "vs_primal": "x primal",
    "operations_per_step": "operations per step",
    "reached": "reached op/s",
    "peak": "peak op/s",
    "share": "share",
    "error": "error",
    "samples": "samples",
    "late": "samples late by 0.1 of a period",
    "behind": "samples late by a period",
    "lateness": "lateness, 50, 99, 99.9 and 100 %, ms",
    "core": "share of a core",
}


def write(result: dict[str, Any], folder: Path) -> None:
    """Write results.md and its figures."""
    drawn = [name for name, draw in PICTURES.items() if draw(result, folder / f"{name}.svg")]
    (folder / "results.md").write_text(text(result, drawn))


def text(result: dict[str, Any], drawn: list[str]) -> str:
    """Return the text of the page."""
    m = result["machine"]
    lines = [
        "# Benchmarks",
        "",
        f"Run of {result['started']} on {m['processor']}, {m['cores']} cores, {m['compiler']}, Python {m['python']}, "
        + ", ".join(f"{name} {v}" for name, v in m["versions"].items() if v)
        + ".",
        "",
        "Medians of one run in which all programs were measured alternately. An error is the largest deviation from a",
        "converged result, relative to the range of the channel. Full muscle: length, velocity, pressure, gas, tube flow,",
        "friction; Runge-Kutta at 100 us, outputs at 1 kHz.",
        "",
    ]
    if result["quick"]:
        lines += ["**A quick run: it shows that everything works, but its numbers are not representative.**", ""]
    lines += ["| ratio or time | measured | target | met |", "|---|---|---|---|"]
    for name, want in result["wanted"].items():
        got = result["ratios"].get(name)
        fair = got is not None and (got >= want["value"] if want["sign"] == ">=" else got <= want["value"])
        lines.append(
            f"| {want['meaning']} | {'not measured' if got is None else f'{got:.3g}'} | {want['sign']} {want['value']:g} | "
            f"{'' if got is None else 'yes' if fair else 'no'} |"
        )
    lines += [""]
    for name in drawn:
        lines += [f"![{PICTURE_TITLES[name]}]({name}.svg)", ""]
    for group, title in TITLES.items():
        rows = [row for row in result["rows"] if row["group"] == group]
        if rows:
            lines += [f"## {title}", "", *table(rows), ""]
    for engine, line in result["linear"].items():
        lines.append(
            f"Cost of {engine} against batch size over {line['decades']:.1f} decades: exponent {line['exponent']:.3f}, "
            f"with a deviation of at most a factor {line['off']:.2f}."
        )
    for title, notes in (
        ("Errors", [f"{name}: {why}" for name, why in result["left_out"].items()]),
        ("Not measured", result["notes"]),
    ):
        lines += ["", f"## {title}", "", *(f"- {note}" for note in notes)] if notes else []
    return "\n".join(lines).rstrip() + "\n"


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Return rows as a Markdown table, with the columns for which they have values."""
    keys = [key for key in COLUMNS if any(key in row for row in rows)]
    lines = ["| " + " | ".join(COLUMNS[key] for key in keys) + " |", "|" + "---|" * len(keys)]
    for row in rows:
        lines.append("| " + " | ".join(cell(row, key) for key in keys) + " |")
    return lines


def cell(row: dict[str, Any], key: str) -> str:
    """Return the text of one cell."""
    value = row.get(key, "")
    if key == "lateness" and value:
        return ", ".join(f"{1e3 * late:.3g}" for late in value)
    if not isinstance(value, float):
        return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value)
    unit = f" {row['error_unit']}" if key == "error" and "error_unit" in row else ""
    return f"{value:.3g}{unit}"


def _axes(title: str, size: tuple[float, float] = (7.0, 4.2)) -> Any:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=size, layout="constrained")
    axes.set_title(title, fontsize=11, loc="left")
    axes.grid(alpha=0.25, which="both", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _saved(figure: Any, path: Path) -> bool:
    import matplotlib.pyplot as plt

    with plt.rc_context({"svg.hashsalt": "mckibben"}):
        figure.savefig(path, metadata={"Date": None})
    plt.close(figure)
    return True


def batches(result: dict[str, Any], path: Path) -> bool:
    """Draw the rate over the size of a batch."""
    rows = [r for r in result["rows"] if r["group"] == "batch" and r["case"] == "muscle"]
    if not rows:
        return False
    figure, axes = _axes(PICTURE_TITLES["batches"])
    names = list(dict.fromkeys((r["engine"], r["dtype"]) for r in rows))
    engines = list(dict.fromkeys(name for name, _ in names))
    for engine, dtype in names:
        mine = sorted((r["lanes"], r["rate"]) for r in rows if (r["engine"], r["dtype"]) == (engine, dtype))
        axes.loglog(
            *zip(*mine, strict=True),
            "o-" if dtype == "float64" else "s--",
            color=f"C{engines.index(engine)}",
            ms=4,
            lw=1.4,
            label=f"{engine}, {dtype}",
        )
    axes.set_xlabel("muscles in the batch")
    axes.set_ylabel("muscle-steps per second, one core")
    axes.legend(fontsize=8, frameon=False, ncols=2)
    return _saved(figure, path)


def errors(result: dict[str, Any], path: Path) -> bool:
    """Draw simulated time per second over error, for one muscle and all programs."""
    rows = [
        r
        for r in result["rows"]
        if r["group"] in ("single", "s1", "peers", "tank") and r.get("error") and r.get("real_time")
    ]
    if not rows:
        return False
    figure, axes = _axes(PICTURE_TITLES["errors"], (7.0, 6.4))
    names = list(dict.fromkeys(name_of(r) for r in rows))
    for i, name in enumerate(names):
        mine = [(r["error"], r["real_time"]) for r in rows if name_of(r) == name]
        axes.loglog(*zip(*mine, strict=True), "osD^vP*X"[i % 8], color=f"C{i % 10}", ms=6, label=name)
    axes.set_xlabel("largest error over the range, relative to the converged result of each program")
    axes.set_ylabel("simulated seconds per second")
    axes.legend(fontsize=7, frameon=False, loc="upper left", bbox_to_anchor=(0.0, -0.14), ncols=2)
    return _saved(figure, path)


def curves(result: dict[str, Any], path: Path) -> bool:
    """Draw work over precision on S1: a line for each program, and for each method of one that has several."""
    lines: dict[str, list[tuple[float, float]]] = {}
    for r in result["rows"]:
        if r.get("case") == "S1, one muscle" and r.get("error"):
            method = r["setting"].rpartition(", ")[0]
            lines.setdefault(", ".join(filter(None, (r["program"], method))), []).append((r["error"], r["real_time"]))
    if len(lines) < 2:
        return False
    figure, axes = _axes(PICTURE_TITLES["curves"])
    for i, (name, points) in enumerate(lines.items()):
        axes.loglog(
            *zip(*sorted(points), strict=True), "osD^vP*X"[i % 8] + "-", color=f"C{i}", ms=4, lw=1.4, label=name
        )
    axes.set_xlabel("largest error of the contraction over its range, relative to the exact path")
    axes.set_ylabel("simulated seconds per second")
    axes.legend(fontsize=7, frameon=False)
    return _saved(figure, path)


def name_of(row: dict[str, Any]) -> str:
    """Return program and case of a row, for the legend."""
    who = row.get("program") or f"mckibben, {row['engine'].split(',')[0]}"
    who = row["engine"].split(",")[0] if row.get("engine", "").startswith(("C", "LSODA")) else who
    return f"{who}: {row['case'].split(', error')[0]}"


PICTURES = {"batches": batches, "errors": errors, "curves": curves}
PICTURE_TITLES = {
    "batches": "Full muscle with gas and friction",
    "errors": "One machine: speed against error",
    "curves": "S1, one muscle: work over precision",
}
