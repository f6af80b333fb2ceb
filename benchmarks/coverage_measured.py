"""Coverage of `Fit.predict`: how often the 95 % interval of a tension holds what was measured and not shown to the fit.

    python benchmarks/coverage_measured.py --out coverage_measured.json
    python benchmarks/coverage_measured.py --draw coverage_measured.json

Tasks and splits are those of `mckibben benchmark`; data that do not ship lie in the folder that MCKIBBEN_DATA names. Counted
are the taut points that were left out; their number says little, because the points of one muscle at one length share an
error. *Half width* is the mean of the intervals' halves, as a share of the muscle's largest tension.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
import written

from mckibben.errors import MissingDataError
from mckibben.identification import fit
from mckibben.identification.problem import SAME_LENGTH
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared
from mckibben_benchmark.physics import RULER, joined
from mckibben_benchmark.tasks import task
from mckibben_benchmark.validation import measured_data

TASKS = ("map-pressure-out", "map-above-4-bar", "map-length-out", "data-sheet", "other-lengths")
LAWS = ("seated_hyperelastic_braid", "seated_braid")
BEGIN, END = "<!-- written by benchmarks/coverage_measured.py; do not edit -->", "<!-- end of measured coverage -->"


def main() -> None:
    """Count, write the figures and the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--task", action="append", help="Task to count; all by default.")
    parser.add_argument("--law", action="append", help="Law to fit; both by default.")
    parser.add_argument("--out", type=Path, default=Path("coverage_measured.json"), help="Figures.")
    parser.add_argument("--draw", type=Path, metavar="FILE", help="Write the table of results, and measure nothing.")
    chosen = parser.parse_args()
    if chosen.draw:
        written.write(WRITTEN, json.loads(chosen.draw.read_text()))
        return
    rows = []
    for name in chosen.task or TASKS:
        for law in chosen.law or LAWS:
            rows += [row] if (row := coverage(name, law)) else []
            print(rows[-1:], flush=True)
    chosen.out.write_text(json.dumps(rows, indent=1) + "\n")


def coverage(name: str, law: str) -> dict[str, Any]:
    """The share of left-out points within their intervals; empty without the data."""
    inside, halves, by_fold = [], [], {}
    try:
        folds = task(name).load(measured_data(None))
    except MissingDataError:
        return {}
    fields = declared(law_type(law))
    for fold in folds:
        points = joined(fold.train)
        several = points.rest_length is not None and np.ptp(points.rest_length) > SAME_LENGTH
        shared = {k: v for k, v in fold.train[0].dimensions.items() if k != "rest_length" or not several}
        fitted = fit(law, points, known=shared, schemes=(), length_error=RULER if several else None)
        held = []
        for record, scored in zip(fold.test, fold.scored, strict=True):
            length, pressure = record.inputs["length"], record.inputs["pressure"]
            other = {"rest_length": record.dimensions["rest_length"]} if several else {}
            if "upper_length" in fields and "upper_length" not in fitted.parameters:
                other["upper_length"] = float(length.max() if several else max(length.max(), points.length.max()))
            at = fitted.predict(length, pressure, **other)
            tension = record.outputs["tension"]
            counted = scored & (tension > 0.0)
            held.append(((at.low <= tension) & (tension <= at.high))[counted])
            halves.append((0.5 * (at.high - at.low))[counted] / tension.max())
        by_fold[fold.name] = float(np.mean(np.concatenate(held)))
        inside += held
    return {
        "task": name,
        "law": law,
        "points": int(sum(map(len, inside))),
        "inside": float(np.mean(np.concatenate(inside))),
        "half_width": float(np.mean(np.concatenate(halves))),
        "folds": by_fold,
    }


def drawn(rows: list[dict[str, Any]]) -> str:
    """The table."""
    lines = [
        "| left out | law | points | inside | least of a fold | half width |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for r in rows:
        shares = [
            f"{100.0 * s:.{d}f} %" for s, d in ((r["inside"], 0), (min(r["folds"].values()), 0), (r["half_width"], 1))
        ]
        lines.append(f"| `{r['task']}` | `{r['law']}` | {r['points']} | {' | '.join(shares)} |")
    return "\n".join(lines)


WRITTEN = (written.WrittenPart("explanation/uncertainty.md", BEGIN, END, drawn),)

if __name__ == "__main__":
    main()
