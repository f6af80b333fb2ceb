"""Every 95 % interval that the product prints, and how often it held what it was about: on virtual and on measured muscles.

    python benchmarks/intervals.py            # gather the files of results, write intervals.json and the page
    python benchmarks/intervals.py --anew     # measure all of them first: hours, and the data that MCKIBBEN_DATA names

On virtual muscles the truth is known, and the interval is of it; on measured ones it is of a further reading, which the fit
was not shown. Which benchmark counted a row, and how, stands in that benchmark.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import written

HERE = Path(__file__).resolve().parent
OUT = HERE / "intervals.json"
BEGIN, END = "<!-- written by benchmarks/intervals.py; do not edit -->", "<!-- end of intervals -->"
# Options with which each benchmark continues or replaces its file of results.
MEASURED = {
    "coverage": ("--out", "coverage.json"),
    "coverage_measured": ("--out", "coverage_measured.json"),
    "between": ("--out", "between.json"),
    "characterise": ("--out", "characterise.json"),
    "diagnosis": ("--out", "diagnosis.json"),
}
# What else the file of results of one has that its page is written from, measured behind it.
FURTHER = {"diagnosis": ("--off", "104", "--rounds", "2", "--seed", "14", "--out", "diagnosis.json")}
CASES = {"right": "muscles", "wrong": "muscles", "loop": "loops", "circuit": "circuits", "size": "muscles"}
NOT_COUNTED = {  # intervals that are printed and that no benchmark holds against anything
    "braid": "states what its dimensions leave open, which is no interval of 95 %",
    "posterior": "on measured muscles",
    "characterise": "on measured muscles",
    "diagnose": "on measured rigs",
    "size": "on measured muscles",
}


def gathered() -> list[dict[str, Any]]:
    """One row per interval and kind of case: verb, what of, whose, inside and least inside, half width [share], count."""
    results = {name: json.loads((HERE / f"{name}.json").read_text(encoding="utf-8")) for name in MEASURED}
    return [
        *_virtual_fits(results["coverage"]),
        *_measured_predictions(results["coverage_measured"]),
        *_other_muscles(results["between"]),
        *_characterised(results["characterise"]),
        *_diagnosed(results["diagnosis"]),
    ]


def _row(verb: str, of: str, kind: str, count: str, inside: float, **more: float) -> dict[str, Any]:
    return {
        "verb": verb,
        "of": of,
        "kind": kind,
        "count": count,
        "inside": inside,
        "least": None,
        "half_width": None,
    } | more


def _virtual_fits(cases: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    names = {
        "least squares, parameters": ("fit", "parameters"),
        "posterior, parameters": ("posterior", "parameters"),
        "posterior, tension": ("posterior", "tension"),
        "posterior, record": ("posterior", "record"),
        "posterior, force at a stroke": ("size", "force at a stroke, from a posterior"),
        "posterior, stroke at a force": ("size", "stroke at a force, from a posterior"),
    }
    words = {
        "right": "",
        "wrong": ", law of another kind",
        "loop": " of a loop",
        "circuit": " of a circuit",
        "size": "",
    }
    rows = []
    for name, (verb, of) in names.items():
        for case, muscles in cases.items():
            inside = [one["inside"][name] for one in muscles if name in one.get("inside", {})]
            if inside:
                count, share = f"{len(inside)} {CASES[case]}", float(np.mean(inside))
                rows.append(_row(verb, f"{of}{words[case]}", "virtual", count, share))
    return rows


def _measured_predictions(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [
        _row("predict", f"`{one['task']}`, `{one['law']}`", "measured", f"{one['points']} points", one["inside"],
             least=min(one["folds"].values()), half_width=one["half_width"])
        for one in rows
    ]  # fmt: skip


def _other_muscles(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    made = []
    for one in rows:
        p, read = one["declared"], one["readings"]
        verb = "predict" if read == "none" else "calibrate"
        of = one["task"] if read == "none" else f"{one['task']}, reading{'s' * (read == 'both')}: {read}"
        count = f"{len(p['muscles'])} muscle{'s' * (len(p['muscles']) != 1)}"
        more = {"least": p["least"], "half_width": p["half_width"]}
        made.append(_row(verb, of, "measured", count, p["coverage"], **more))
    return made


def _characterised(result: dict[str, Any]) -> list[dict[str, Any]]:
    some = result["summary"]["sound"]
    names = {"tensions within their 95 % interval": "tension", "relaxation within its 95 % interval": "relaxation"}
    passed = some["muscles"] - some["failed and said so"]
    return [_row("characterise", of, "virtual", f"{passed} muscles", some[name]) for name, of in names.items()]


def _diagnosed(result: dict[str, Any]) -> list[dict[str, Any]]:
    runs = [one for one in result["faulty"]["runs"] if "error" not in one]
    inside = float(np.mean([one["inside"] for one in runs]))
    return [_row("diagnose", "size of the fault", "virtual", f"{len(runs)} runs", inside)]


def table(rows: list[dict[str, Any]]) -> str:
    """The table of the page."""
    lines = [
        "| printed by | interval of | kind | counted | inside | least | half width |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    verbs = list(dict.fromkeys(one["verb"] for one in rows))
    for one in sorted(rows, key=lambda one: (verbs.index(one["verb"]), one["kind"] == "measured")):
        least, half = (one.get(name) for name in ("least", "half_width"))
        cells = [
            f"`{one['verb']}`",
            one["of"],
            one["kind"],
            one["count"],
            f"{100.0 * one['inside']:.0f} %",
            "" if least is None else f"{100.0 * least:.0f} %",
            "" if half is None else f"{100.0 * half:.1f} %",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    missing = "; ".join(f"`{verb}` {words}" for verb, words in NOT_COUNTED.items())
    return "\n".join([*lines, "", f"Not counted: {missing}."])


WRITTEN = (written.WrittenPart("explanation/how-far-to-trust-a-number.md", BEGIN, END, table),)


def main() -> None:
    """Gather, and write the page; or measure first."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--anew", action="store_true", help="Measure every benchmark anew first, which takes hours.")
    if parser.parse_args().anew:
        for name, options in MEASURED.items():
            (HERE / f"{name}.json").unlink(missing_ok=True)  # the others go on where their files end
            for more in filter(None, (options, FURTHER.get(name))):
                subprocess.run([sys.executable, f"{name}.py", *more], cwd=HERE, check=True)
            subprocess.run(
                [sys.executable, f"{name}.py", "--draw", *options[1:][: name != "characterise"]], cwd=HERE, check=True
            )
    rows = gathered()
    OUT.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    written.write(WRITTEN, rows)


if __name__ == "__main__":
    main()
