"""The report of a recording tells what the recording tells, whoever wrote it, and marks what was inferred."""

import datetime
import json
import math
import re

import numpy as np
import pytest

from machine_records import machine_record
from mckibben.cli import main
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording
from mckibben.recordings.calibration import Calibration, Correction, CorrectionTerm, Origin
from mckibben.report import document_pdf
from mckibben.report.blocks import Figure, Fold, ReportTable, Span, TableRow, plain
from mckibben.report.document import Document
from mckibben.report.origins import inferred_inputs, parameters
from mckibben.report.recording_report import recording_report, write_recording_report

RECORD = machine_record(pressure=["1 bar", "5 bar"])
NASTY = r"""<script>alert(1)</script> & #panic("no") $\nosuch$ @me \ *b* _i_"""


def law(name: str, value: float, unit: str) -> dict:
    return {f"units.muscle.law.{name}": {"value": value, "unit": unit}}


# What the test machine writes beside the channels, in its own words, shortened.
ABOUT = {
    "specimen": "nylon", "rig": "paper", "plumbing": "direct", "rest_length": 0.14, "created": "2026-01-02T03:04:05+00:00",
    "rig_document": {"title": "Machine", "motor": {"torque_constant": "0.22 N*m/A", "current_limit": "24 A"},
                     "plumbing": {"direct": {"tube": {"length": "50 cm"}}, "other": {"tube": {"length": "1 m"}}}},
    "inferred": ["motor.torque_constant", "plumbing.direct.tube.length", "plumbing.other.tube.length",
                 "laws.linear_threshold.rest_volume", "laws.ideal.turns"],
    "parameters": law("stiffness_per_pressure", 0.00466, "m") | law("rest_volume", 5.63e-6, "m^3")
    | law("shortest_length", 0.0995, "m") | {
        "load.motor.torque_constant": {"value": 0.22, "unit": "N*m/A"},
        "load.motor.current_limit": {"value": 24.0, "unit": "A"},
        "circuit.elements.tube.length": {"value": 0.5, "unit": "m"},
        "circuit.gas.heat_ratio": {"value": 1.4, "unit": "1"},
        "units.muscle.end_mass": {"value": 0.02, "unit": "kg"},
        "units.muscle.friction.stiffness": {"value": [100.0, 200.0], "unit": "N/m"},
    },
    "energy": {
        "exergy": {"into": {"supply": 10.0}, "out": {"valve": 4.0, "shaft_work": 5.0, "leak": 0.0}, "stored": {"gas": 1.0},
                   "throughput": 10.0, "remainder": 1e-9},
        "laws": {"muscle": "linear_threshold"}, "air": 0.0015, "compressor": {"isothermal": 10.0},
    },
    "deadlines": {"samples": 1000, "late": 20, "behind": 5, "percentiles": [1e-5, 1e-4, 1e-3, 2e-3]},
    "versions": {"mckibben": "9.9.9"}, "warnings": ["the valve is slow"],
}  # fmt: skip


@pytest.fixture(scope="module")
def document() -> Document:
    weighed = Origin(
        method="weights", date="2026-01-01T00:00:00+00:00", reference="M1 masses", valid_for=3600.0, points=5
    )
    found = CorrectionTerm(1.02, 0.004, 8.0, weighed)
    correction = Correction(unit="N", terms={"gain": found}, sensor="S/N 7")
    used = Calibration(rig="paper", created="2026-01-01T00:00:00+00:00", corrections={"tension": correction})
    return recording_report(RECORD.with_meta(ABOUT, calibration=used.plain()), name="loops.nc")


def words(document: Document) -> str:
    page = re.sub(r"(?s)<style.*?</style>|<svg.*?</svg>", "", document.html())
    return " ".join(re.sub(r"<[^>]+>", " ", page).replace("\N{WORD JOINER}", "").replace("\N{THIN SPACE}", " ").split())


def blocks(document: Document, kind: type) -> list:
    found, queue = [], [b for s in document.sections for b in s.blocks]
    while queue:
        block = queue.pop(0)
        found += [block] if isinstance(block, kind) else []
        queue = [*block.blocks, *queue] if isinstance(block, Fold) else queue
    return found


def table_rows(document: Document) -> list[TableRow]:
    return [row for table in blocks(document, ReportTable) for row in table.rows]


def rows(document: Document, name: str) -> list[list[str]]:
    """The rows of all tables whose first cell has that text; of cells and gauges that are more than text nothing is left."""
    cells = [[plain(c) if isinstance(c, str | tuple | Span) else "" for c in row.cells] for row in table_rows(document)]
    return [row for row in cells if row[0] == name]


def test_what_was_done_is_told(document):
    told = words(document)
    for word in ("Quasi-static triangle", "For each pressure of 1, 5 bar", "Nylon shell muscle", "14 cm", "rig paper",
                 "2026-01-02T03:04:05+00:00", "loops.nc", "1 gap where nothing was recorded", "the valve is slow",
                 "mckibben 9.9.9", "Chou, Ching-Ping", "@article{chou1996", "loops began"):  # fmt: skip
        assert word in told, word


def test_there_are_figures_over_time_and_of_the_loops(document):
    figures = blocks(document, Figure)
    assert [f.alt.split(":")[0] for f in figures] == ["Over time", "Tension over span, step “loops”."]


def test_the_table_of_loops_has_the_friction_of_the_recording(document):
    found = {row[0]: float(row[-1]) for row in rows(document, "pressure 5 bar") if len(row) == 7 and row[1].isdigit()}
    # the record has a Coulomb friction of 2.5 N; noise of 0.15 N on a mean of loops leaves less than 10 %
    assert found["pressure 5 bar"] == pytest.approx(2.5, rel=0.1)


def test_every_channel_step_and_balance_is_listed(document):
    told = words(document)
    assert all(rows(document, name) for name in RECORD.channels)
    assert all(step["label"] in told for step in RECORD.meta["steps"])
    assert rows(document, "Mass")[0][1].startswith("2 × 10⁻¹²".replace(" ", "\N{THIN SPACE}"))


def test_the_ledger_is_told_part_by_part_and_what_is_nothing_is_left_out(document):
    assert rows(document, "valve")[0][1:] == ["went out", "4", "40"]
    assert rows(document, "shaft work")[0][2] == "5"
    assert not rows(document, "leak")
    assert "is accounted for nowhere" in rows(document, "remainder")[0][1]
    assert "Air drawn from supplies 1.5 g" in words(document)


def test_a_calibration_has_uncertainty_dates_and_a_mark_where_it_had_expired(document):
    (row,) = rows(document, "tension (S/N 7)")
    assert row[1:3] == ["gain", "1.02"]
    # Student's t of 8 degrees of freedom, 2.306, times 0.004
    assert float(row[3]) == pytest.approx(2.306 * 0.004, rel=1e-3)
    assert row[5:7] == ["weights, M1 masses, 5 points", "2026-01-01"]
    assert "▲" in words(document) and "2026-01-01" in words(document)  # valid for an hour, used a day later


def test_deadlines_are_shares_of_all_samples(document):
    told = words(document)
    assert "Began more than a tenth of a period late 20 (2 %)" in told
    assert "half of them within 10 us" in told


def test_every_parameter_says_where_it_comes_from():
    found = {p.path.rpartition(".")[2]: p for p in parameters(ABOUT)}
    assert found["stiffness_per_pressure"].origin == "specimen nylon, chou1996"
    assert (found["rest_volume"].inferred, found["shortest_length"].inferred) == (True, False)
    assert found["shortest_length"].origin == "set for this run"  # the specimen states 9.91 cm
    assert found["torque_constant"].origin == "inferred: motor.torque_constant"
    assert found["current_limit"].origin == "rig paper"
    assert found["length"].inferred and found["end_mass"].inferred
    assert found["stiffness"].value.endswith("2 values")


def test_only_what_this_run_used_of_the_inferred_is_listed():
    names = [i.name for i in inferred_inputs(ABOUT)]
    assert names == ["motor.torque_constant", "plumbing.direct.tube.length", "laws.linear_threshold.rest_volume"]
    assert inferred_inputs(ABOUT)[2].note.startswith("not printed; follows from the total input work")


def test_the_report_has_no_date_but_the_recordings_own(document):
    page = document.html()
    assert page == document.html()
    dates = set(re.findall(r"20\d\d-\d\d-\d\d", page))
    assert dates == {"2026-01-01", "2026-01-02"}
    assert datetime.date.today().isoformat() not in dates


@pytest.mark.parametrize(
    "meta",
    [
        {},
        {"title": NASTY, "sentence": NASTY, "specimen": NASTY, "rig": NASTY, "created": NASTY, "message": NASTY,
         "result": "stopped"},
        {"protocol": "text", "rig_document": 3, "inferred": "x", "parameters": [1], "balance": "no", "energy": [1, 2],
         "events": "x", "saturation": 5, "calibration": {"schema": 99, "x": NASTY}, "deadlines": "late",
         "warnings": [{"text": NASTY}, 7], "citations": [NASTY, "chou1996"], "environment": None, "timing": {"step": "x"}},
        {"energy": {"exergy": {"into": {NASTY: 1.0}, "out": {}, "stored": None, "remainder": math.nan}},
         "other": {NASTY: [NASTY, 1]}, "parameters": {"a": {"value": "x", "unit": None}, "b": 3}},
    ],
)  # fmt: skip
def test_a_recording_of_anybody_gives_both_files(meta):
    pytest.importorskip("typst")
    time = np.linspace(0.0, 1.0, 20)
    channels = {
        "a b*c$x": Channel(np.sin(time), "Pa", "measured", NASTY),
        "void": Channel(time * math.nan, "N", "true"),
    }
    found = recording_report(Recording(time, channels, meta), name=NASTY)
    assert "<script" not in found.html()
    assert found.pdf().startswith(b"%PDF-")


def test_steps_that_are_none_are_named():
    with pytest.raises(InputError, match="steps.1.start"):
        recording_report(Recording([0.0, 1.0], {"p": Channel([1.0, 2.0])}, {"steps": [{"label": "no step"}]}))


def test_a_recording_in_which_nothing_is_known_or_with_one_sample():
    one = Recording([1.0], {"p": Channel([math.nan], "Pa")})
    assert "No channel holds a value" in words(recording_report(one))
    assert "1 samples" in words(recording_report(Recording([1.0], {"p": Channel([2.0], "Pa")})))


def test_contractions_are_a_table_and_tension_over_the_rate_of_stimulation_is_a_curve():
    """Three tetani of 1, 2 and 3 N at 10, 20 and 30 Hz, each from the sample after the first stimulus on."""
    time = np.arange(0.0, 3.0, 1e-3)
    on = np.mod(time, 1.0) < 0.5
    words = {"path": "steps.1", "label": "train", "ended_by": "time", "recorded": True, "sentence": ""}
    steps = [
        words | {"index": i, "case": {"rate": f"{10 * i} Hz"}, "start": i - 1.0, "end": float(i)} for i in (1, 2, 3)
    ]
    channels = {
        "tension": Channel((1.0 + np.floor(time)) * np.roll(on, 1), "N"),
        "excitation": Channel(on.astype(float), "1"),
        "span": Channel(np.full(time.shape, 0.1), "m"),
    }
    document = recording_report(Recording(time, channels, {"steps": steps}))
    assert [rows(document, f"rate {10 * i} Hz")[0][1] for i in (1, 2, 3)] == ["1", "2", "3"]
    assert any("rate of stimulation" in figure.alt for figure in blocks(document, Figure))


def test_pressure_cycles_without_length_cycles_are_drawn_over_pressure():
    time = np.linspace(0.0, 4.0, 400)
    drive = 2e5 + 1e5 * np.sin(2.0 * math.pi * time)
    channels = {
        "pressure": Channel(drive),
        "span": Channel(0.14 + 0.0 * time, "m"),
        "tension": Channel(1e-4 * drive, "N"),
    }
    alts = [f.alt for f in blocks(recording_report(Recording(time, channels)), Figure)]
    assert alts[1:] == ["Tension over pressure."]


# ---- the command


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["record", "report", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_the_command_writes_both_kinds(run, tmp_path):
    pytest.importorskip("typst")
    file = RECORD.save(tmp_path / "loops.nc")
    code, out, err = run(str(file), "--out", str(tmp_path / "r.html"), "--json")
    assert (code, err) == (0, "") and json.loads(out) == {"file": str(tmp_path / "r.html")}
    assert run(str(file), "--out", str(tmp_path / "r.pdf"))[0] == 0
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF-")
    again = write_recording_report(file, tmp_path / "again.html")
    assert again.read_bytes() == (tmp_path / "r.html").read_bytes()


@pytest.mark.parametrize(
    ("file", "out", "says"),
    [("loops.nc", "r.txt", "ends in .html or .pdf"), ("loops.nc", "no/r.html", "older not found"),
     ("none.nc", "r.html", "none.nc")],
)  # fmt: skip
def test_bad_places_are_one_clear_line(run, tmp_path, file, out, says):
    RECORD.save(tmp_path / "loops.nc")
    code, printed, err = run(str(tmp_path / file), "--out", str(tmp_path / out))
    assert (code, printed) == (2, "") and err.count("\n") == 1 and says in err
    assert not (tmp_path / out).exists()


def test_paper_and_page_have_the_same_pictures(document):
    kept = document_pdf.sources(document)
    assert sum(b"<svg" in v and n != "main" for n, v in kept.items()) == document.html().count("<svg")
