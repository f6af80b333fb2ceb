"""Every command and every option with broken input: exit code 2 and one line that names it, and nothing is written.

The cases are made of the table of commands below: each place that takes a quantity, a name, a file .. gets what is wrong
for its kind, all else stays as it is right. Beside them, files that are right are changed at random; these may be right
afterwards. All of it runs in this process, and always in the same way.
"""

import json
import os
import random
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomlkit
import typer

from mckibben.cli import main
from mckibben.cli.app import app
from mckibben.recordings import Channel, Recording, write

SEED = 16
CHANGES = 25  # of each file that was right
SHARE = 0.4  # of the cases that are tried where not all are
LONG = "a" * 100_000
ODD = "naïve-\u202e筋肉"  # letters of others, and a sign that turns the line around

# ---- files

PROTOCOL = """
schema = 1
name = "short"
title = "A short one"
sample_rate = "1 kHz"
[parameters.high]
unit = "Pa"
value = "3 bar"
[[steps]]
label = "high"
span = "1 L0"
pressure = {to = "$high", in = "0.1 s"}
[[steps]]
label = "hold"
span = "1 L0"
pressure = "$high"
for = "0.1 s"
"""
CIRCUIT = (Path(__file__).parents[2] / "examples" / "circuits" / "filling-a-tank.toml").read_text(encoding="utf-8")
SWEEP = """
schema = 1
protocol = "protocol.toml"
muscle = "nylon"
[grid]
high = ["1 bar", "2 bar"]
[outputs.peak]
channel = "tension"
reduce = "max"
"""
CALIBRATION = """
schema = 1
rig = "modern"
created = "2026-03-31T12:00:00+00:00"
[channels.tension]
unit = "N"
sensor = "S/N 123"
[channels.tension.gain]
value = 1.0023
uncertainty = 0.0002
degrees = 14.2
method = "weights"
date = "2026-03-31T12:00:00+00:00"
reference = "M1 masses"
reference_uncertainty = "0.01 N"
scale_uncertainty = 0.0015
valid_for = "365 day"
points = 7
"""
TABLE = "length_mm,pressure_bar,force_N\n" + "".join(
    f"{mm},{bar},{0.0466 * bar * (mm - 99.1):.6f}\n" for mm in (110, 120, 130, 140) for bar in (1, 2, 3)
)
TIME = 1e-3 * np.arange(50)
RECORD = Recording(
    TIME,
    {
        "pressure": Channel(1e5 * (1.0 + np.sin(TIME)), "Pa", "measured"),
        "tension": Channel(10.0 + np.cos(TIME), "N", "measured"),
        "span": Channel(0.15 + 0.01 * np.sin(TIME), "m", "measured"),
    },
    {"title": "t", "rig": "paper"},
)
SOURCE = Path(__file__).parents[2] / "src" / "mckibben"
DEEP = {
    "lists": "a = " + "[" * 5_000 + "]" * 5_000,
    "tables": "[" + ".".join("a" * 5_000) + "]\nx = 1",
    "keys": "schema = 1\n" + ".".join("a" * 5_000) + " = 1",
}


HEAD = """DMCv5.3 Data File
Sample Frequency (Hz): 1000
Calibration Data:
Channel\tAI0\tAI1
Units\tmm\tmN
Scale (units/V)\t1.0\t500.0
Offset (volts)\t0.0\t0.0
Test Comments:
Protocol Array:
0.0\tStimulus-Train\tStimulator\t.012,300,0.2,4,25
0.0\tSine Wave\tLength Out\t25,3.15,6
Test Data in Volts:
Sample\tAI0\tAI1\tStim
"""
TURNS = np.sin(2.0 * np.pi * 25.0 * np.arange(240) / 1000.0)
LEVER = HEAD + "".join(f"{i}\t{x:.6f}\t{1.0 + 0.3 * x:.6f}\t{int(i % 40 == 1)}\n" for i, x in enumerate(TURNS))


POSTERIOR = {
    "law": "gas_spring",
    "samples": {"stiffness_per_pressure": [0.0046, 0.0047, 0.0048], "shortest_length": [0.099, 0.1, 0.0985]},
    "noise_samples": [1.0, 1.1, 0.9], "discrepancy_samples": [0.5, 0.6, 0.4], "correlation_length": 0.3,
    "known": {"rest_length": 0.14, "upper_length": 0.154},
    "points": {"length": [0.12, 0.13, 0.14], "pressure": [2e5, 3e5, 4e5], "tension": [20.0, 43.0, 76.0]},
    "sensor_noise": [0.5, 0.5, 0.5], "shared_errors": [], "seed": 0, "r_hat": 1.0, "effective": 3.0, "divergences": 0,
}  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with right files, wrong ones, and a folder that is named like a file."""
    folder = tmp_path_factory.mktemp("broken")
    rng = random.Random(SEED)
    right = {
        "protocol.toml": PROTOCOL, "circuit.toml": CIRCUIT, "sweep.toml": SWEEP, "calibration.toml": CALIBRATION,
        "rig.toml": (SOURCE / "bench" / "rigs" / "modern.toml").read_text(encoding="utf-8"),
        "specimen.toml": (SOURCE / "specimens" / "data" / "nylon.toml").read_text(encoding="utf-8"),
        "table.csv": TABLE, "lever.ddf": LEVER,
        "check.json": (SOURCE.parents[1] / "packages/mckibben-hardware/tests/checks/sound.json").read_text(encoding="utf-8"),
        "fit.json": json.dumps({"fits": [{"law": "gas_spring", "posterior": POSTERIOR}]}),
    }  # fmt: skip
    for name, text in right.items():
        (folder / name).write_text(text, encoding="utf-8")
    for ending in ("nc", "csv", "mcap", "mat", "tdms", "parquet"):
        write(RECORD, folder / f"record.{ending}")
    tank = RECORD.with_channels({"tank.pressure": RECORD.channels["pressure"]})
    write(tank, folder / "tank.csv")
    noise = rng.randbytes(3_000)
    for ending in ("toml", "csv", "nc", "mcap", "mat", "tdms", "parquet", "json", "txt"):
        for name, data in {
            "empty": b"", "noise": noise, "zeros": bytes(3_000), "sixteen": "schema = 1".encode("utf-16"),
            "half": b"schema = 1\n\xc3", "nul": b"schema = \"\x00\"\n", "words": b"What is this?\n" * 20,
            "json": json.dumps({"schema": 1, "fits": [[]]}).encode(), ODD: b"\xff\xfe",
        }.items():  # fmt: skip
            (folder / f"{name}.{ending}").write_bytes(data)
        (folder / f"folder.{ending}").mkdir()
    for name, text in DEEP.items():
        (folder / f"{name}.toml").write_text(text)
    for ending in ("nc", "mcap", "mat", "tdms", "parquet"):
        data = (folder / f"record.{ending}").read_bytes()
        (folder / f"cut.{ending}").write_bytes(data[:200])
    (folder / "later.toml").write_text("schema = 99\n")
    return folder


# ---- what is wrong for which kind; what stands before the colon of a place names the kind

NUMBERS = ["", " ", "abc", "nan", "1e999", "5 furlongz", "5 kg m", "5 **", "5 9**9**9", LONG, ODD, "\udcff"]
TOML = ["missing.toml", f"{ODD}-none.toml", "folder.toml", "empty.toml", "noise.toml", "zeros.toml", "sixteen.toml",
        "half.toml", "words.toml", "json.toml", f"{ODD}.toml", "later.toml", *(f"{name}.toml" for name in DEEP)]  # fmt: skip
RECORDS = ["missing.nc", "folder.nc", "empty.csv", "noise.csv", "zeros.csv", "words.csv", "sixteen.csv", "empty.mcap",
           "noise.mcap", "zeros.mcap", "cut.mcap", "noise.xyz", "protocol.toml", f"{ODD}.csv", "\udcff.csv"]  # fmt: skip
OUTSIDE = ["noise.nc", "cut.nc"]  # read by a process of their own, which takes half a second
OTHERS = [
    "cut.mat",
    "noise.mat",
    "empty.mat",
    "cut.tdms",
    "noise.tdms",
    "cut.parquet",
    "noise.parquet",
    "empty.parquet",
]
WRONG = {
    "length": [*NUMBERS, "5", "5 bar", "inf cm"], "pressure": [*NUMBERS, "5", "5 cm", "inf bar"],
    "force": [*NUMBERS, "5", "5 bar", "-inf N"], "time": [*NUMBERS, "5", "5 N", "inf s", "-1 s"],
    "amount": NUMBERS, "moment": [*NUMBERS, "5 N", "inf s"],
    "number": [*NUMBERS, "5 bar", "inf"],
    "seconds": ["", "abc", "nan", "-1", "inf", LONG],
    "whole": ["", "abc", "1.5", "nan", "-1", "1e3", LONG, "٣x", "5 bar"],
    "name": ["", " ", "nosuch", "../../etc/passwd", LONG, ODD, "a\nb", "\x1b[2J", "\udcff"],
    "pair": ["", "=", "abc", "=5", "a=", "nosuch=5", ".=5", "a.b.c.d=5", "__class__=5", f"{LONG}=5", f"{ODD}=5",
             ".".join("a" * 5_000) + "=5"],
    "specimen": ["nosuch", "", ODD, LONG, *TOML],
    "protocol": ["nosuch", "", ODD, *TOML],
    "rig": ["nosuch", "", ODD, *TOML],
    "toml": TOML, "record": RECORDS, "outside": OUTSIDE,
    "source": [*RECORDS, *OTHERS],
    "table": [*RECORDS[2:], "cut.mat", "cut.tdms", "missing.csv", "folder.csv"],
    "picture": ["none/f.svg", "f.xyz", "", "folder.csv", "f", f"{ODD}/f.png"],
    "fit": ["missing.json", "folder.json", "empty.json", "noise.json", "words.json", "json.json"],
    "report": ["none/r.html", "r.xyz", "", "folder.csv", f"{ODD}/r.html"],
    "out": ["none/o.nc", "o.xyz", "", "words.txt/o.nc"],
    "saved": ["none/o.toml", "o.xyz", "", "words.txt/o.toml"],
    "machine": ["", "nosuch", "serial:", "serial:/dev/none", f"serial:{ODD}", "daq:1", LONG],
    "kind": ["", "nosuch", "serial:", "daq:1", LONG], "place": ["none/p", "folder.csv", "", "words.txt/p"],
    "new": ["words.txt", "none/deeper", LONG],
    "script": ["missing.txt", "folder.txt", "noise.txt"],
    "port": ["", "abc", "-1", "70000", "1.5", LONG],
}  # fmt: skip

# ---- the commands, each as it is right; {kind:value} is a place
SHOW = {"--law": "name", "--out": "picture"}
TENSION = {
    "--for": "force", "--law": "name", "--set": "pair", "--from-posterior": "toml", "--activation": "number",
    "--contraction": "number", "--out": "picture",
}  # fmt: skip
RUN = {"--rig": "rig", "--set": "pair", "--fault": "pair", "--plumbing": "name", "--seed": "whole", "--step": "time",
       "--on": "kind", "--calibration": "toml", "--out": "out", "--log": "out"}  # fmt: skip
RIG = {
    "--on": "machine",
    "--set": "pair",
    "--seed": "whole",
    "--samples": "whole",
    "--valid-for": "time",
    "--out": "saved",
}
COMMANDS = {
    "show": ("show @specimen:nylon", SHOW),
    "tension": ("tension @specimen:nylon --length @length:12_cm --pressure @pressure:3_bar", TENSION),
    "read": ("read @table:table.csv", {
        "--column": "pair", "--unit": "pair", "--rest-length": "length", "--period": "seconds", "--branch": "name",
        "--pressure-zero": "pressure", "--as": "name",
    }),
    "fit": ("fit @table:table.csv", {
        "--law": "name", "--rest-length": "length", "--like": "specimen", "--set": "pair", "--column": "pair",
        "--unit": "pair", "--branch": "name", "--pressure-zero": "pressure", "--train-below": "pressure",
        "--length-error": "length", "--friction": "name", "--hysteresis": "record",
        "--out": "report",
    }),
    "next": ("next --from @fit:fit.json --budget 20s", {
        "--rig": "rig", "--law": "name", "--laws": "name", "--budget": "time", "--wait": "time", "--out": "saved",
    }),
    "protocols": ("protocols @protocol:protocol.toml", {"--set": "pair"}),
    "run": ("run @protocol:protocol.toml --muscle @specimen:nylon --dry-run", RUN),
    "characterise": ("characterise --muscle @specimen:nylon --rig @rig:modern --dry-run --out place", {
        "--rest-length": "length", "--plumbing": "name", "--law": "name", "--max-pressure": "pressure",
        "--max-tension": "force", "--gain-error": "number", "--rest-length-error": "number", "--seed": "whole",
        "--on": "kind",
    }),
    "console": ("console --muscle @specimen:nylon --script @script:words.txt", {
        "--rig": "rig", "--on": "machine", "--calibration": "toml", "--span": "length", "--plumbing": "name",
        "--rate": "number", "--seed": "whole",
    }),
    "device check": ("device check --rig @rig:modern --simulate", {
        "--pressure": "pressure", "--rate": "number", "--muscle": "specimen", "--plumbing": "name", "--seed": "whole",
        "--out": "saved",
    }),
    "device replay": ("device replay @fit:check.json", {"--muscle": "specimen", "--out": "saved"}),
    "device serve": ("device serve @protocol:protocol.toml --muscle @specimen:nylon --duration 0", {
        "--rig": "rig", "--set": "pair", "--plumbing": "name", "--seed": "whole", "--duration": "seconds", "--out": "place",
    }),
    "energy": ("energy @specimen:nylon --pressure @pressure:3_bar", {
        "--cycle": "name", "--accumulator-pressure": "pressure", "--friction": "force", "--reading": "name",
        "--volume": "name", "--stretched": "length", "--ambient": "pressure", "--law": "name", "--set": "pair",
        "--contraction": "number", "--out": "picture",
    }),
    "compare": ("compare @specimen:nylon --pressure @pressure:3_bar", {
        "--recording": "record", "--match": "name", "--rig": "rig", "--out": "report",
    }),
    "reproduce": ("reproduce", {
        "--part": "name", "--row": "name", "--figure": "name", "--out": "new", "--save-recordings": "new",
    }),
    "size": ("size --force @force:100_N --stroke @length:2_cm --pressure @pressure:5_bar", {
        "--space": "length", "--speed": "number", "--cycles": "number", "--tube": "length", "--law": "name",
        "--top": "whole", "--out": "picture", "--from-posterior": "toml",
    }),
    "parts": ("parts valves", {"--min-flow": "number", "--max-mass": "number", "--out": "picture"}),
    "sweep": ("sweep @toml:sweep.toml --dry-run --out results", {"--scheduler": "name", "--workers": "whole"}),
    "serve": ("serve --no-open --port 0", {
        "--host": "name", "--port": "port", "--calibration": "toml", "--on": "machine", "--rig": "rig",
    }),
    "braid": (
        "braid --length @length:300_mm --angle @number:25_deg --diameter @length:12_mm --thread @length:0.25_mm"
        " --bladder @length:1_mm",
        {"--shore": "number", "--out": "saved"},
    ),
    "export": ("export @specimen:nylon --out part", {
        "--for": "name", "--name": "identifier", "--supply": "pressure", "--valve": "name", "--span": "length",
        "--substep": "time",
    }),
    "check": ("check @name:ideal", {"--set": "pair", "--lowest": "pressure"}),
    "conform": ("conform @name:python --scenario hang", {"--scenario": "name", "--out": "out"}),
    "diagnose": ("diagnose @record:record.nc --rig modern --muscle nylon", {
        "--rig": "rig", "--muscle": "specimen", "--plumbing": "name", "--out": "out",
    }),
    "benchmark": ("benchmark --task @name:map-above-4-bar --model @name:ideal", {"--out": "out"}),
    "joint": ("joint @specimen:nylon --command flexor=0.2 --duration @time:0.02_s", {
        "--play": "record", "--command": "pair", "--angle": "number", "--arm": "length", "--inertia": "number",
        "--supply": "pressure", "--valve": "name", "--start-pressure": "pressure", "--period": "time", "--out": "out",
    }),
    "circuit show": ("circuit show @toml:circuit.toml", {"--set": "pair", "--out": "picture"}),
    "circuit run": ("circuit run @toml:circuit.toml", {"--set": "pair", "--out": "out"}),
    "circuit frequency": ("circuit frequency @toml:circuit.toml --input time --output tank.pressure_abs", {
        "--input": "name", "--output": "name", "--at": "time", "--from": "number", "--to": "number", "--set": "pair",
        "--out": "picture",
    }),
    "circuit fit": ("circuit fit @toml:circuit.toml @table:tank.csv --free elements.tube.length", {
        "--free": "name", "--predict": "name", "--start": "pair", "--column": "pair", "--unit": "pair", "--set": "pair",
        "--out": "picture",
    }),
    "record show": ("record show @record:record.nc", {"--out": "picture"}),
    "record plot": ("record plot @record:record.nc --out @picture:f.svg", {
        "--channels": "name", "--against": "name", "--from": "moment", "--to": "moment", "--width": "length",
        "--style": "name",
    }),
    "record convert": ("record convert @source:record.nc @out:r.csv", {
        "--column": "pair", "--unit": "pair", "--period": "time",
    }),
    "record energy": ("record energy @record:record.nc", {
        "--out": "picture", "--from": "moment", "--to": "moment", "--muscle": "specimen",
        "--accumulator-pressure": "amount",
    }),
    "record frequency": ("record frequency @record:record.nc --input pressure --output tension", {
        "--input": "name", "--output": "name", "--resolution": "number", "--sines": "number", "--from": "moment",
        "--to": "moment", "--out": "picture",
    }),
    "record loops": ("record loops @record:record.nc", {
        "--length": "name", "--tension": "name", "--from": "moment", "--to": "moment",
    }),
    "record work": ("record work @record:record.nc", {"--length": "name", "--from": "moment", "--to": "moment"}),
    "record stiffness": ("record stiffness @record:record.nc", {"--tension": "name", "--from": "moment"}),
    "record steps": ("record steps @record:record.nc", {"--command": "name", "--channel": "name"}),
    "record leak": ("record leak @record:record.nc", {"--pressure": "name", "--from": "moment", "--to": "moment"}),
    "control": ("control --plants 1 --duration 10s", {"--controller": "name", "--bench": "name", "--reference": "name"}),
    "record repeatability": ("record repeatability @record:record.nc", {
        "--channel": "name", "--drive": "name", "--from": "moment", "--to": "moment", "--out": "picture",
    }),
    "record contraction": ("record contraction @record:lever.ddf", {
        "--rising": "number", "--relaxing": "number", "--above": "name", "--force-channel": "name",
        "--stimulus-channel": "name", "--gear-ratio": "number", "--column": "pair", "--out": "picture",
    }),
    "record work-loops": ("record work-loops @record:lever.ddf", {
        "--cut": "name", "--keep": "number", "--cycle-frequency": "number", "--length-channel": "name",
        "--force-channel": "name", "--gear-ratio": "number", "--out": "picture",
    }),
    "record repair": ("record repair @record:record.mcap --out @out:r.nc", {}),
    "record report": ("record report @record:record.nc --out @report:r.html", {}),
    "calibrate zero": ("calibrate zero --rig @rig:modern --simulate", {
        "--channels": "name", "--uncertainty": "pressure", **RIG,
    }),
    "calibrate weights": ("calibrate weights --rig modern --simulate --masses @number:0_kg,1_kg", {
        "--gravity": "number", "--gravity-uncertainty": "number", "--channel": "name", "--uncertainty": "force",
    }),
    "calibrate pressure": ("calibrate pressure --rig modern --simulate --pressures @pressure:0_bar,3_bar", {
        "--scale-uncertainty": "length", "--channels": "name", "--uncertainty": "pressure",
    }),
    "calibrate encoder": ("calibrate encoder --rig modern --simulate --travels @length:0_mm,50_mm", {
        "--uncertainty": "length",
    }),
    "calibrate skew": ("calibrate skew --rig modern --simulate", {
        "--channels": "name", "--frequency": "number", "--to": "name",
    }),
    "calibrate show": ("calibrate show @toml:calibration.toml", {}),
    "calibrate apply": ("calibrate apply @record:record.nc --out @out:r.nc --calibration @toml:calibration.toml", {}),
    "study tube": ("study tube --quick", {"--out": "picture"}),
    "study robot": ("study robot @robot:missing.csv", {"--out": "picture"}),
    "study loops": ("study loops @folder:none", {"--friction": "name", "--out": "picture"}),
    "study validation": ("study validation --data @folder:none", {"--only": "name", "--law": "name", "--out": "report"}),
}  # fmt: skip


def cases(command):
    """What is called, the option or argument that is wrong, and its value."""
    base, options = COMMANDS[command]
    words = [w.replace("_", " ") if w.startswith("@") else w for w in base.split()]
    right = [re.sub("^@[a-z]+:", "", w) for w in words]
    for i, word in enumerate(words):
        if word.startswith("@"):
            kind = word[1:].partition(":")[0]
            for value in WRONG[kind]:
                yield [*right[:i], value, *right[i + 1 :]], words[i - 1], value
    for option, kind in options.items():
        for value in WRONG[kind]:
            yield [*right, option, value], option, value


WRONG["identifier"] = [name for name in WRONG["name"] if name != "nosuch"]  # a name that the user gives
WRONG["folder"] = ["none", "words.txt", "none/deeper", LONG]
WRONG["robot"] = ["missing.csv", "folder.csv", "empty.csv", "noise.csv", "words.csv"]


def called(words, capsys):
    """Exit code and what was said."""
    with pytest.raises(SystemExit) as stop:
        main(words)
    out, err = capsys.readouterr()
    return stop.value.code, out, err


def listed(folder):
    return {(str(p), p.stat().st_size, p.stat().st_mtime_ns) for p in folder.rglob("*")}


def verdict(code, out, err, option, value):
    """What is wrong with the answer to something wrong; nothing where it is one line that names it."""
    if code != 2:
        return f"code {code}"
    last = err.splitlines()[-1:]  # what a computation had to say before stands above
    if [line for line in err.splitlines() if not line.startswith("mckibben: caution: ")] != last:
        return "lines"
    if not err.startswith("mckibben: "):
        return "lines"
    if out:
        return "output"
    name = value.removeprefix("serial:").partition("=")[0] or value
    shown = "".join(c if c.isprintable() else repr(c)[1:-1] for c in name)[:12] if value.strip() else repr(value)
    folder = name.rpartition("/")[0]  # what is missing may be the folder that a file would lie in
    named = option in err or shown in err or (not value and ("'.'" in err or "not found: ." in err))
    return "" if named or (folder and f"/{folder}" in err) else "unnamed"


def tried(files, monkeypatch, capsys, command, share):
    """Try a share of a command's cases, none of which may be answered otherwise than in one line; how many they were."""
    monkeypatch.chdir(files)
    before, wrong, rng = listed(files), [], random.Random(f"{SEED} {command}")
    some = [case for case in cases(command) if rng.random() < share]
    for words, option, value in some:
        try:
            code, out, err = called(words, capsys)
        except BaseException as error:  # noqa: BLE001 - a traceback
            capsys.readouterr()
            code, out, err = None, "", f"{type(error).__name__}: {error}"
        if verdict(code, out, err, option, value):
            wrong.append((" ".join(w[:40] for w in words), code, out[:80], err[:300]))
    assert wrong == []
    assert listed(files) == before
    return len(some)


@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_wrong_is_named_in_one_line(files, monkeypatch, capsys, command):
    assert tried(files, monkeypatch, capsys, command, SHARE) > 0


@pytest.mark.slow
def test_all_that_can_be_wrong_is_named_in_one_line(files, monkeypatch, capsys):
    count = sum(tried(files, monkeypatch, capsys, command, 2.0) for command in COMMANDS)
    assert count > 1_900  # none was lost


def test_every_command_is_in_the_table():
    found = set()

    def below(group, name):
        for word, inner in group.commands.items():
            if hasattr(inner, "commands"):
                below(inner, f"{name}{word} ")
            else:
                found.add(f"{name}{word}")

    below(typer.main.get_command(app), "")
    assert found - set(COMMANDS) == {
        "muscles",
        "completion",
        "help",
        "record list",
    }  # which read nothing, or leave out what they cannot read
    assert set(COMMANDS) <= found


# ---- files that were right

BAD = [
    float("nan"), float("inf"), -1e300, 1e300, -1, 0, 2**70, True, "", "abc", "nan bar", "5 furlongz", "5 bar", "5 cm",
    "-5 s", "1e999", "$nosuch", "9**9**9", ODD, "a\nb", "\x1b[2J", "x" * 5_000, "../../etc/passwd",
    [], [[]], [1, "a"], {}, {"kind": "nosuch"},
]  # fmt: skip
CHANGED = {
    "specimen.toml": "show @", "protocol.toml": "run @ --muscle nylon --dry-run", "circuit.toml": "circuit show @",
    "sweep.toml": "sweep @ --dry-run --out results", "calibration.toml": "calibrate show @",
    "rig.toml": "run protocol.toml --muscle nylon --rig @ --dry-run",
}  # fmt: skip
BINARY = {
    "mcap": "record show @",
    "csv": "record show @",
    "tdms": "record convert @ r.csv",
    "parquet": "record convert @ r.csv",
}


def spots(value, path=()):
    """The places of a document, tables and lists among them."""
    pairs = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in pairs:
        yield (*path, key)
        yield from spots(inner, (*path, key))


def changed(document, rng):
    """A document with one thing other than it was: a value, a name, or something that is missing or too much."""
    path = rng.choice(list(spots(document)))
    owner = document
    for key in path[:-1]:
        owner = owner[key]
    way = rng.choice(["value", "value", "value", "value", "missing", "name", "more"])
    if way == "value" or isinstance(owner, list):
        owner[path[-1]] = rng.choice(BAD)
    elif way == "name":
        owner[rng.choice(["nosuch", ODD, "a.b", "", "__class__", "a\nb"])] = owner.pop(path[-1])
    elif way == "more":
        owner[rng.choice(["nosuch", ODD, "", "schema", "__init__"])] = rng.choice(BAD)
    else:
        del owner[path[-1]]
    return tomlkit.dumps(document)


def answered(words, capsys):
    """What is wrong with the answer to a file that may be wrong; whether it was refused."""
    try:
        code, out, err = called(words, capsys)
    except BaseException as error:  # noqa: BLE001 - a traceback
        capsys.readouterr()
        return f"{type(error).__name__}: {error}", True
    if code == 0:
        return err, False
    lines = err.splitlines()
    # all that a dry run finds is said, a line for each; else one line, with the file or with what stands in it
    named = all(re.match("mckibben: (step|first|last|protocol) ", line) for line in lines) or (
        len(lines) == 1
        and lines[0].startswith("mckibben: ")
        and any(word in err for word in ("changed.", *(repr(bad)[1:30] for bad in BAD if isinstance(bad, str) and bad)))
    )
    return "" if code == 2 and lines and named else f"{code} {err}", True


@pytest.mark.parametrize("name", CHANGED)
def test_a_file_that_was_changed_anywhere_is_taken_or_refused_in_one_line(files, tmp_path, monkeypatch, capsys, name):
    text, rng, wrong, refused = (files / name).read_text(encoding="utf-8"), random.Random(f"{SEED} {name}"), [], 0
    for other in files.glob("*.toml"):
        if other.is_file():
            (tmp_path / other.name).write_bytes(other.read_bytes())
    monkeypatch.chdir(tmp_path)
    words = [w.replace("@", "changed.toml") for w in CHANGED[name].split()]
    for number in range(CHANGES):
        new = changed(tomllib.loads(text), rng) if number % 6 else text[: rng.randrange(len(text))]
        Path("changed.toml").write_text(new, encoding="utf-8")
        said, no = answered(words, capsys)
        refused += no
        if said:
            wrong.append((said[:400], [line for line in new.splitlines() if line not in text.splitlines()][:3]))
    assert wrong == []
    assert refused > CHANGES / 3  # else nothing was tried
    assert not Path("results").exists()


@pytest.mark.parametrize("ending", BINARY)
def test_a_recording_with_other_bytes_is_taken_or_refused_in_one_line(files, tmp_path, monkeypatch, capfd, ending):
    data, rng, wrong = (files / f"record.{ending}").read_bytes(), random.Random(f"{SEED} {ending}"), []
    monkeypatch.chdir(tmp_path)
    words = [w.replace("@", f"changed.{ending}") for w in BINARY[ending].split()]
    for number in range(CHANGES):
        new = bytearray(data if number % 3 else data[: rng.randrange(len(data))])
        for _ in range(rng.choice([1, 3, 30])):
            at = rng.randrange(len(new)) if new else 0
            new[at : at + 1] = rng.choice([b"", b"\x00", b"\xff", rng.randbytes(1), rng.randbytes(9), b"\n,,"])
        Path(f"changed.{ending}").write_bytes(new)
        said, refused = answered(words, capfd)
        if said:
            wrong.append((said[:400], bytes(new[:60])))
        assert os.listdir() == [f"changed.{ending}"] or not refused
        Path("r.csv").unlink(missing_ok=True)
    assert wrong == []
