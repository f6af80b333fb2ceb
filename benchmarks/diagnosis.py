"""How well `mckibben diagnose` does on simulated rigs: false alarms of sound runs, and the confusion matrix of faults.

    python benchmarks/diagnosis.py [--sound N] [--faulty N] [--seed N] [--out FILE]
    python benchmarks/diagnosis.py --off N --rounds N [--times X] [--only FAULTS] [--protocol NAME] [--seed N] [--out FILE]
    python benchmarks/diagnosis.py --draw FILE

Sound runs differ in the seed of the sensors' noise; each muscle and protocol has its share of them, run in lanes. Faulty
runs have one fault each, of a size drawn between 1.5 and 15 times what the recordings of the first sound runs can show, by
their own limits, and within what the rig can still run with. The size of a slipping clamp is that by which its grip is below
the largest tension of these sound runs. A bound of the rate of false alarms is that of Clopper and Pearson at 95 %. `--draw`
writes figure and tables of the documentation from the results. All these take the files as exact.

`--off` runs sound and faulty rigs whose files are off: every number that a diagnosis counts as uncertain is drawn anew for
each run, by its deviation; the faults are of the sizes in `BESIDE`, or so many `--times` as large. Rows are added to those
in the file of results.

The seed chooses noise and sizes of both. The diagnosis was made and mended with seeds 0 to 8; a run that is published
has one that was never run before.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import written

import mckibben as mk
from mckibben.bench.rig import DRIFT, RigFaults
from mckibben.errors import MckibbenError
from mckibben.quantities import declared
from mckibben.studies.diagnosis.fault_fit import SIZES, Diagnosis, diagnose_sections, observer_of, sections_of, shown

SEED = 9  # of the published run
SEEDS = 10_000  # by which the seeds of the noise of sound runs differ from one seed to the next
FIRST = 8  # sound runs of each case, by whose limits the sizes of its faults are drawn
CHANNELS = ("span", "valve.command", "pressure", "valve_pressure", "tension")


class Case(NamedTuple):
    """A muscle and a protocol on a rig, with values of the protocol."""

    muscle: str
    protocol: str
    rig: str
    values: dict[str, Any]


CASES = (
    Case("nylon", "work-loop", "modern", {"cycles": 2}),
    Case("nylon", "quasi-static", "modern", {"cycles": 2, "pressure": "4 bar", "precondition": 1}),
    Case("nylon", "isotonic-triangle", "modern", {"cycles": 2, "load": "30 N", "frequency": "1 Hz"}),
    Case("fiberglass", "work-loop", "modern", {"cycles": 2}),
    Case("DMSP-20-300", "work-loop", "modern", {"cycles": 2}),
    Case("nylon", "isometric-step", "modern", {"cycles": 1}),
    Case("DMSP-10-250", "isometric-step", "modern", {"cycles": 1}),
    Case("nylon", "work-loop", "paper", {"cycles": 2}),
)
# Beside files that are off the other protocols are run too, one condition of each.
OFF_CASES = (
    *CASES,
    Case("nylon", "isokinetic", "modern", {"speed": "1 L0/s", "pressure": "3 bar"}),
    Case("nylon", "quick-release", "modern", {"load": "30 N"}),
    Case("nylon", "sinusoids", "modern", {"frequency": "2 Hz", "cycles": 4}),
    Case("nylon", "isobaric-map", "modern", {"pressure": "3 bar", "speed": "0.1 L0/s"}),
    Case("nylon", "preconditioning", "modern", {"cycles": 3}),
)
# Largest faults with which the rigs still run, and which a person would not see at once [SI].
LARGEST = {
    "leak": 5e-10, "valve_blockage": 0.7, "valve_sticking": 5e4, "pressure_drift": 2e3, "valve_pressure_drift": 2e3,
    "tension_drift": 2.0, "span_drift": 5e-4, "clamp_slack": 4e-3, "clamp_grip": 10.0, "lost_threads": 0.3,
    "rubber_warming": 60.0,
}  # fmt: skip


def sound_runs(case: Case, seeds: range) -> Iterator[mk.Recording]:
    """Run a case with several seeds in lanes, as recordings with what a diagnosis needs."""
    from mckibben.batch import Output, listed
    from mckibben.batch.run import LANES, Runner
    from mckibben.batch.run_template import make_template
    from mckibben.experiments.read import protocol

    outputs = tuple(Output(name, "samples", name) for name in CHANNELS)
    first = mk.run(case.protocol, case.rig, muscle=case.muscle, seed=seeds[0], **case.values)
    template = make_template(protocol(case.protocol, **case.values), case.muscle, case.rig, outputs=outputs)
    template = make_template(
        protocol(case.protocol, **case.values),
        case.muscle,
        case.rig,
        outputs=outputs,
        settings={"noise_seed": template.setting("noise_seed")},
    )
    runner = Runner(template, {}, threads=1)
    for begin in range(0, len(seeds), LANES):
        some = seeds[begin : begin + LANES]
        done = runner.run(listed([{"noise_seed": str(seed)} for seed in some]))
        for row in range(len(some)):
            assert done.code[row] == 0, done.message[row]
            kept = np.isfinite(done.outputs["time"][row])
            channels = {n: first.channels[n].with_values(done.outputs[n][row][kept]) for n in CHANNELS}
            yield mk.Recording(done.outputs["time"][row][kept], channels, dict(first.meta))


def diagnosed(record: mk.Recording) -> Diagnosis:
    """Diagnose a recording by what it states."""
    observer = observer_of(record, exact=True)
    return diagnose_sections(observer, sections_of(record, observer.channels))


def measure_sound(count: int, seed: int, tell: Any) -> dict[str, Any]:
    """Count false alarms in sound runs, and keep the largest likelihood ratios."""
    rows = []
    for case in CASES:
        begun, alarms, largest, limits, sound = time.perf_counter(), [], [], [], []
        first, observer = SEEDS * seed + 1, None
        for record in sound_runs(case, range(first, first + count // len(CASES))):
            observer = observer or observer_of(record, exact=True)  # all runs of a case state the same rig
            found = diagnose_sections(observer, sections_of(record, observer.channels))
            largest.append(found.faults[0].ratio)
            if len(limits) < FIRST:
                limits.append({one.name: abs(one.limit - one.sound) for one in found.faults})
                sound.append({one.name: one.sound for one in found.faults})
            alarms += [found.fault] if found.fault else []
        shares = [float(np.quantile(largest, q)) for q in (0.5, 0.9, 0.99, 1.0)]
        rows.append(
            {
                "case": case._asdict(), "runs": len(largest), "alarms": alarms, "ratio": shares,
                "limits": {name: float(np.median([one[name] for one in limits])) for name in limits[0]},
                "sound": {name: float(np.median([one[name] for one in sound])) for name in sound[0]},
                "seconds": time.perf_counter() - begun,
            }
        )  # fmt: skip
        tell(rows[-1])
    runs, alarms = sum(r["runs"] for r in rows), sum(len(r["alarms"]) for r in rows)
    return {"runs": runs, "alarms": alarms, "bound": bound(alarms, runs), "cases": rows}


# Faults that are looked for beside files that are off; drifts are 1 % of the range in a minute.
BESIDE = {
    "none": "", "leak": "0.05 l/min/bar", "valve_blockage": "10 %", "pressure_drift": "1.7 mbar/s",
    "tension_drift": "0.17 N/s", "lost_threads": "5 %", "clamp_slack": "0.5 mm", "rubber_warming": "15 K",
    "pressure gain": "2 %", "tension gain": "2 %", "law": "",
}  # fmt: skip
OTHER_LAWS = {
    "nylon": "ideal",
    "DMSP-10-250": "linear_threshold",
    "DMSP-20-300": "linear_threshold",
}  # that a file states instead


def measure_off(
    count: int,
    rounds: int,
    seed: int,
    before: list[dict[str, Any]],
    tell: Any,
    *,
    times: float = 1.0,
    only: tuple[str, ...] = (),
    protocol: str = "",
) -> Iterator[dict[str, Any]]:
    """Diagnose runs of rigs whose files are off: sound ones, and rounds of one run of each fault on each case.

    Args:
        count: of the sound runs.
        rounds: of faults.
        seed: of all draws.
        before: rows that are there, behind which it goes on.
        tell: called with each row.
        times: by which the sizes of the faults are larger than those in `BESIDE`.
        only: names of faults; all where empty.
        protocol: whose cases are run; all where empty.
    """
    from mckibben.components import paths
    from mckibben.quantities import parse
    from mckibben.studies.diagnosis.observer import stated_numbers

    present = Counter((row["case"], row["fault"]) for row in before if (row["seed"], row["times"]) == (seed, times))
    cases = [(number, case) for number, case in enumerate(OFF_CASES) if protocol in ("", case.protocol)]
    turns = -(-count // len(cases))
    wanted = [name for name in only or BESIDE if name != "none"]
    order = [*itertools.product(range(turns), cases, ["none"]), *itertools.product(range(rounds), cases, wanted)]
    for turn, (number, case), fault in order:
        if fault == "law" and case.muscle not in OTHER_LAWS:
            continue
        if present[number, fault]:
            present[number, fault] -= 1
            continue
        chance = np.random.default_rng([seed, turn, number, list(BESIDE).index(fault)])
        place = f"sensors.{fault.removesuffix(' gain')}.gain_error" if " gain" in fault else f"faults.{fault}"
        words, _, unit = BESIDE[fault].partition(" ")
        rig = mk.rig(case.rig, {place: f"{times * float(words)!r} {unit}"} if words else {})
        noise = int(chance.integers(1, 1 << 30))
        record = mk.run(case.protocol, rig, muscle=case.muscle, seed=noise, **case.values)
        other = mk.muscle(case.muscle, law=OTHER_LAWS[case.muscle]) if fault == "law" else None
        true = observer_of(record, case.rig, muscle=other)  # whose file knows of no gain
        off = {one.path: one.value + chance.standard_normal() * one.deviation for one in true.description}
        parts = paths.put({"muscle": true.unit, "plumbing": true.plumbing}, off)
        stated = stated_numbers(parts["plumbing"], parts["muscle"])
        observer = true._replace(unit=parts["muscle"], plumbing=parts["plumbing"], description=stated)
        begun = time.perf_counter()
        found = diagnose_sections(observer, sections_of(record, observer.channels))
        row = {
            "case": number, "fault": fault, "times": times, "found": _found(found), "described": found.described,
            "alternatives": list(found.alternatives), "ratio": found.faults[0].ratio, "misfit": found.misfit,
            "farthest": max((abs(one.off) for one in found.description), default=0.0),
            "seconds": time.perf_counter() - begun, "seed": seed,
        }  # fmt: skip
        if fault == "none":
            row["limits"] = {one.name: abs(one.limit - one.sound) for one in found.faults}
        elif fault in SIZES:
            size = parse(BESIDE[fault], declared(RigFaults)[fault].unit, field=fault)
            row |= {"limit": found[fault].limit, "size": times * size}
        tell(row)
        yield row


def _found(found: Diagnosis) -> str:
    """What was found in a word: a fault, a sensor's gain or zero, a description that is none, or nothing."""
    if not found.described:
        return "law"
    words = found.calibration.split()  # such as "a gain of pressure that .."
    return f"{words[3]} {words[1]}" if words else found.fault or "none"


def bound(events: int, runs: int) -> float:
    """One-sided 95 % upper bound of a rate by Clopper and Pearson."""
    from scipy.stats import beta

    return float(beta.ppf(0.95, events + 1, runs - events))


def measure_faulty(
    count: int,
    seed: int,
    cases: list[dict[str, Any]],
    before: dict[str, Any],
    tell: Any,
    only: tuple[str, ...] = (),
) -> Iterator[dict[str, Any]]:
    """Run faults of random sizes, and count what was found; yields the results so far after each round of all faults.

    A round has one run of each fault and case, with a size and noise of its own, whatever number of rounds there is; those
    in the results before are not run again, but all of the faults `only`.
    """
    names = list(SIZES)
    if only:
        before = {
            "matrix": {
                n: dict.fromkeys([*names, "none"], 0) if n in only else row for n, row in before["matrix"].items()
            },
            "runs": [run for run in before["runs"] if run["fault"] not in only],
        }
    matrix = before.get("matrix") or {name: dict.fromkeys([*names, "none"], 0) for name in names}
    runs: list[dict[str, Any]] = list(before.get("runs", []))
    for turn in range(before.get("turns", 0), count // len(CASES) // len(names)):
        for (number, case), (place, name) in itertools.product(enumerate(CASES), enumerate(names)):
            if only and name not in only:
                continue
            chance = np.random.default_rng([seed, turn, number, place])
            low, sound = 1.5 * cases[number]["limits"][name], cases[number]["sound"][name]
            high = min(10.0 * low, LARGEST[name])
            if not low < high:
                continue
            size = float(np.exp(chance.uniform(np.log(low), np.log(high))))
            size *= -1.0 if name.endswith(DRIFT) and chance.random() < 0.5 else 1.0
            noise = int(chance.integers(1, 1 << 30))
            real = size if sound == 0.0 else sound - size
            rig = mk.rig(case.rig, {f"faults.{name}": _words(name, real)})
            try:
                found = diagnosed(mk.run(case.protocol, rig, muscle=case.muscle, seed=noise, **case.values))
            except MckibbenError as error:
                runs.append({"case": number, "fault": name, "size": size, "error": str(error)})
                continue
            matrix[name][found.fault or "none"] += 1
            value, low95, high95, _ = found[name].estimate
            inside = bool(low95 <= real <= high95)
            runs.append(
                {
                    "case": number, "fault": name, "size": size, "found": found.fault,
                    "alternatives": list(found.alternatives), "value": value if sound == 0.0 else sound - value,
                    "inside": inside, "explained": found.explained, "seed": seed,
                }
            )  # fmt: skip
        tell({"turn": turn, "runs": len(runs), "right": sum(matrix[name][name] for name in names)})
        yield {"turns": turn + 1, "matrix": matrix, "runs": runs}


def _words(name: str, size: float) -> str:
    unit = declared(RigFaults)[name].unit
    return f"{size!r}" if unit == "1" else f"{size!r} {unit}"


SHORT = {
    "leak": "leak", "valve_blockage": "blocked valve", "valve_sticking": "sticking valve",
    "pressure_drift": "drift, pressure", "valve_pressure_drift": "drift, valve pressure", "tension_drift": "drift, tension",
    "span_drift": "drift, span", "clamp_slack": "slack clamp", "clamp_grip": "slipping clamp",
    "lost_threads": "lost threads", "rubber_warming": "warm rubber", "none": "no fault",
}  # fmt: skip


def draw(results: dict[str, Any]) -> None:
    """Write the figure and the tables between the marks of the documentation's page."""
    from mckibben.report.figures.study_figures import confusion_figure

    docs = Path(__file__).resolve().parents[1] / "docs"
    matrix = results["faulty"]["matrix"]
    mk.save_figure(confusion_figure(matrix, SHORT), docs / "assets" / "diagnosis.svg")
    written.write(WRITTEN, results)


BEGIN, END = "<!-- written by benchmarks/diagnosis.py; do not edit -->", "<!-- end -->"


def tables(results: dict[str, Any]) -> str:
    """Tables of the page: false alarms by case, faults, and the confusion matrix."""
    sound, faulty = results["sound"], results["faulty"]
    lines = [
        f"{sound['alarms']} false alarm{'s' * (sound['alarms'] != 1)} in {sound['runs']} sound runs: "
        f"below {sound['bound']:.2g} of the runs at 95 %.", "",
        "| muscle | protocol | rig | sound runs | false alarms | ratio, median | 99 % | largest |",
        "|---|---|---|---:|---:|---:|---:|---:|",
    ]  # fmt: skip
    for row in sound["cases"]:
        case, (half, _, most, largest) = row["case"], row["ratio"]
        words = f"| {case['muscle']} | {case['protocol']} | {case['rig']} | {row['runs']} | {len(row['alarms'])} "
        lines.append(f"{words}| {half:.1f} | {most:.1f} | {largest:.1f} |")
    head = "right | named | found | error | 90 % | within 10 % | in interval"
    lines += ["", f"| fault | runs | {head} |"]
    lines += ["|---|" + "---:|" * 8]
    every = [r for r in faulty["runs"] if "error" not in r]
    for name in [*SIZES, ""]:
        some = [r for r in every if name in ("", r["fault"])]
        if not some:
            continue
        right = [r for r in some if r["found"] == r["fault"]]
        named = [r for r in some if r["fault"] in (r["found"], *r["alternatives"])]
        errors = np.array([abs(r["value"] / r["size"] - 1.0) for r in some])
        cells = [
            SHORT.get(name, "all"), str(len(some)), f"{100 * len(right) / len(some):.0f} %",
            f"{100 * len(named) / len(some):.0f} %", f"{100 * np.mean([bool(r['found']) for r in some]):.0f} %",
            f"{100 * np.median(errors):.1f} %",
            f"{100 * high:.1f} %" if (high := float(np.quantile(errors, 0.9))) < 10.0 else "> 1,000 %",
            f"{100 * np.mean(errors <= 0.1):.0f} %", f"{100 * np.mean([r['inside'] for r in some]):.0f} %",
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    stopped = len(faulty["runs"]) - len(every)
    lines += ["", f"{stopped} faulty runs were stopped by the rig itself and gave no recording to diagnose."]
    names = [*SIZES, "none"]
    lines += ["", "| there was, found | " + " | ".join(SHORT[n] for n in names) + " |", "|---|" + "---:|" * len(names)]
    for name in SIZES:
        row = faulty["matrix"][name]
        lines.append(f"| {SHORT[name]} | " + " | ".join(str(row[n]) if row[n] else "" for n in names) + " |")
    return "\n".join(lines)


BEGIN_OFF = "<!-- written by benchmarks/diagnosis.py --off; do not edit -->"
END_OFF = "<!-- end of off -->"


def off_tables(results: dict[str, Any]) -> str:
    """Tables of the page on rigs whose files are off: false alarms by case, and faults by their size."""
    rows = results["off"]
    sound = [r for r in rows if r["fault"] == "none"]
    alarms = [r for r in sound if r["found"] not in ("none", "law")]
    lost = sum(not r["described"] for r in sound)
    lines = [
        f"{len(alarms)} false alarm{'s' * (len(alarms) != 1)} in {len(sound)} sound runs: "
        f"below {100 * bound(len(alarms), len(sound)):.2g} % of the runs at 95 %. {lost} were said not to be described "
        "by their files.",
        "",
        "| muscle | protocol | rig | sound runs | false alarms | not described | ratio, largest |",
        "|---|---|---|---:|---:|---:|---:|",
    ]
    for number, case in enumerate(OFF_CASES):
        some = [r for r in sound if r["case"] == number]
        counts = len(some), sum(r in alarms for r in some), sum(not r["described"] for r in some)
        cells = [case.muscle, case.protocol, case.rig, *map(str, counts), f"{max(r['ratio'] for r in some):.1f}"]
        lines.append(f"| {' | '.join(cells)} |")
    lines += [
        "",
        "| fault | size | runs | right | named | told as none | seen from, median |",
        "|---|---|" + "---:|" * 5,
    ]
    for name, words in BESIDE.items():
        for times in sorted({r["times"] for r in rows if r["fault"] == name}) if name != "none" else ():
            some = [r for r in rows if (r["fault"], r["times"]) == (name, times)]
            right = sum(r["found"] == name for r in some)
            named = sum(name in (r["found"], *r["alternatives"]) for r in some)
            size, _, unit = words.partition(" ")
            seen = [r["limit"] / (r["size"] / (times * float(size))) for r in some if r.get("limit")]
            cells = [
                SHORT.get(name, "another law" if name == "law" else name), f"{times * float(size):g} {unit}" if size else "",
                str(len(some)), *(f"{100 * count / len(some):.0f} %" for count in (right, named)),
                f"{100 * sum(r['found'] == 'none' for r in some) / len(some):.0f} %",
                f"{np.median(seen):.2g} {unit}" if seen else "",
            ]  # fmt: skip
            lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "| seen from, as computed for the sound runs | median | least of a case | largest of a case |"]
    lines += ["|---|" + "---:|" * 3]
    for name in SIZES:
        by_case = [
            [r["limits"][name] for r in sound if r["case"] == n and name in r["limits"]] for n in range(len(OFF_CASES))
        ]
        middles = [float(np.median(some)) for some in by_case if some]
        cells = [shown(name, value) for value in (float(np.median(middles)), min(middles), max(middles))]
        lines.append(f"| {SHORT[name]} | {' | '.join(cells)} |")
    return "\n".join(lines)


WRITTEN = (
    written.WrittenPart("explanation/diagnosis.md", BEGIN, END, tables),
    written.WrittenPart("explanation/diagnosis.md", BEGIN_OFF, END_OFF, off_tables),
)


def main() -> int:
    """Measure, and write the results as JSON; or draw results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--sound", type=int, default=3072, help="sound runs in all; 0 goes on with the results of the file"
    )
    parser.add_argument("--faulty", type=int, default=300, help="faulty runs in all")
    parser.add_argument("--seed", type=int, default=SEED, help="seed of noise and sizes")
    parser.add_argument("--only", default="", help="faults to run anew beside the results of the file, with commas")
    parser.add_argument("--off", type=int, default=0, help="sound runs of rigs whose files are off")
    parser.add_argument("--rounds", type=int, default=0, help="rounds of faults on rigs whose files are off")
    parser.add_argument("--protocol", default="", help="protocol of the cases whose files are off; all by default")
    parser.add_argument("--times", type=float, default=1.0, help="factor of the sizes of these faults")
    parser.add_argument("--out", default="diagnosis.json", help="JSON file of the results")
    parser.add_argument("--draw", default="", help="write figure and tables of the documentation from a JSON file")
    options = parser.parse_args()
    if options.draw:
        with open(options.draw, encoding="utf-8") as file:
            draw(json.load(file))
        return 0

    def tell(row: dict[str, Any]) -> None:
        print(json.dumps(row), file=sys.stderr, flush=True)

    only = tuple(name for name in options.only.split(",") if name)
    if options.off or options.rounds:
        out = Path(options.out)
        kept = json.loads(out.read_text(encoding="utf-8")) if out.exists() else {}
        rows = kept.setdefault("off", [])
        for row in measure_off(
            options.off,
            options.rounds,
            options.seed,
            list(rows),
            tell,
            times=options.times,
            only=only,
            protocol=options.protocol,
        ):
            rows.append(row)
            write(kept, options.out)
        return 0
    before = json.loads(Path(options.out).read_text(encoding="utf-8")) if options.sound == 0 or only else {}
    sound = before["sound"] if before else measure_sound(options.sound, options.seed, tell)
    results = {"seed": before.get("seed", options.seed), "sound": sound}
    results |= {"off": before["off"]} if "off" in before else {}
    if not before:
        write(results, options.out)
    cases = results["sound"]["cases"]
    for faulty in measure_faulty(options.faulty, options.seed, cases, before.get("faulty", {}), tell, only):
        write(results | {"faulty": faulty}, options.out)
    return 0


def write(results: dict[str, Any], out: str) -> None:
    """Write what there is so far."""
    Path(out).write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
