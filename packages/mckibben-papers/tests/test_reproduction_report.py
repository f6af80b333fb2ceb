"""The papers, reproduced: every row and every figure stands in both files with its verdict; and the command."""

import json
import re
import sys

import pytest

from mckibben.cli import main
from mckibben.errors import InputError
from mckibben.report import document_pdf
from mckibben.report.figures import style
from mckibben_papers import PrintedRow, RowOutcome
from mckibben_papers import report as reproduction_report
from mckibben_papers.figures import FIGURES, PaperFigure
from mckibben_papers.inference import RowPrediction
from mckibben_papers.report import Drawn, chosen_figures, difference, draw, predictions_first
from mckibben_papers.report import reproduction_report as report
from mckibben_papers.rows import accepted_band, all_rows, judge

NASTY = r"<b>a</b> & #panic() $x$ @me \ "


def row(name: str, paper=2.0, expect: str = "near", **more) -> PrintedRow:
    return PrintedRow(
        name, more.pop("part", "I"), more.pop("what", f"what {name} is"), paper, more.pop("unit", "N"), expect, **more
    )


def outcome(found: PrintedRow, ours: float | None, note: str = "") -> RowOutcome:
    return RowOutcome(found, ours, None if ours is None else judge(found, ours), note)


OUTCOMES = [
    outcome(row("a.holds", tolerance=0.1), 2.1, "seen `in code` and -3 +-2"),
    outcome(row("a.words", tolerance=0.1, basis="words", printed=False), 1.9),
    outcome(row("a.printed", 0.75, "printed", unit="N/(L0 cm2)"), 0.7512),
    outcome(row("b.range", (1.0, 3.0), "range", part="IV"), 2.5),
    outcome(row("b.misprint", 126.0, "erratum", part="IV", what=NASTY, unit="1/cm"), 1263.0, NASTY),
    outcome(row("b.open", 5.0, "open", part="IV"), 4.0),
    outcome(row("b.synthetic", 5.0, "synthetic", part="IV"), 6.0),
    outcome(row("b.to_come", part="IV"), None),
]
SHORT = outcome(row("c.short", tolerance=0.01, part="discussion"), 3.0)


@style.styled()
def picture():
    fig = style.figure(3.0, 2.0)
    fig.add_axes((0.2, 0.2, 0.7, 0.6)).plot([0.0, 1.0], [0.0, 1.0])
    return fig


def figure(name: str, part: str = "I", rows=(), paper: str = "chou1996", recordings: bool = False) -> PaperFigure:
    return PaperFigure(
        name, paper, part, f"title of {name}", f"caption of {name} {NASTY}", tuple(rows), picture, recordings
    )


KNOWN = {
    f.id: f
    for f in (
        figure("3a", rows=("a.holds",)), figure("3b", recordings=True), figure("12c", "IV", ("b.range", "b.open")),
        figure("table1", "discussion"), figure("1994-5a", rows=("a.holds",), paper="chou1994"),
    )
}  # fmt: skip


@pytest.fixture(scope="module")
def document():
    return report([*OUTCOMES, SHORT], draw(KNOWN.values()))


def text(page: str) -> str:
    page = re.sub(r"(?s)<style.*?</style>|<svg.*?</svg>", "", page)
    return " ".join(re.sub(r"<[^>]+>", " ", page).replace("\N{THIN SPACE}", " ").split())


def test_every_row_stands_in_both_files_with_verdict_and_note(document):
    page, source = text(document.html()), document_pdf.sources(document)["main"].decode()
    for o in [*OUTCOMES, SHORT]:
        assert o.row.id in page
        assert (
            document_pdf.quoted(o.row.id.replace(".", ".\N{ZERO WIDTH SPACE}").replace("_", "_\N{ZERO WIDTH SPACE}"))
            in source
        )
        assert o.verdict.replace(" ", "\N{NO-BREAK SPACE}") in source
    assert "seen in code and \N{MINUS SIGN}3 ±2" in page
    for words in (
        "1 of 8 numbers fall short",
        "8 printed numbers: 3 are arithmetic (0 to +5 %)",
        "beside them 1 row has no printed value",
        "N/(L₀ cm²)",
        "+5.0 %",
        "inside",
        "+902 %",
        "–",
    ):
        assert words in page, words


def test_every_figure_stands_in_both_files_and_rows_lead_to_theirs(document):
    page, files = document.html(), document_pdf.sources(document)
    for known in KNOWN.values():
        assert f'id="figure-{known.id}"' in page and f"title of {known.id}." in page
        assert f'label("figure-{known.id}")' in files["main"].decode()
    assert page.count('href="#figure-3a"') == 1 and page.count('href="#figure-12c"') == 2
    assert "Fig.\N{NO-BREAK SPACE}5a of 1994" in page and "Table\N{NO-BREAK SPACE}1" in page
    drawn = sum(name != "main" for name in files)
    gauges = sum(accepted_band(o.row) is not None and o.ours is not None for o in [*OUTCOMES, SHORT])
    assert drawn == len(KNOWN) + gauges == page.count("<svg")


def test_names_from_outside_are_no_markup(document):
    assert "<b>a</b>" not in document.html() and "&lt;b&gt;a&lt;/b&gt;" in document.html()
    assert "#panic" not in re.sub(r'"(?:[^"\\]|\\.)*"', "", document_pdf.sources(document)["main"].decode())


def test_both_files_are_the_same_twice(document):
    pytest.importorskip("typst")
    assert document.html() == report([*OUTCOMES, SHORT], draw(KNOWN.values())).html()
    assert document.pdf() == document.pdf()


def test_sections_follow_the_papers(document):
    assert [s.anchor for s in document.sections] == [
        "verdict", "part-I", "part-IV", "part-discussion", "conference", "papers", "versions"
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("found", "ours", "said"),
    [
        (row("x", 2.0), 2.001, "+0.05 %"), (row("x", -2.0), -2.2, "-10.0 %"), (row("x", 2.0), 8.0, "+300 %"),
        (row("x", 0.0), 0.5, "+0.5"), (row("x", (1.0, 2.0), "range"), 2.0, "inside"),
        (row("x", (1.0, 2.0), "range"), 2.2, "+10.0 %"), (row("x", (1.0, 2.0), "range"), 0.5, "-50.0 %"),
        (row("x"), None, ""),
    ],
)  # fmt: skip
def test_differences_are_in_percent_where_that_makes_sense(found, ours, said):
    assert difference(found, ours).replace("\N{MINUS SIGN}", "-").replace("\N{THIN SPACE}", " ") == said


def test_the_gauge_ends_where_the_verdict_turns():
    for one in all_rows():
        allowed = accepted_band(one)
        if allowed is None:
            assert one.expect in ("erratum", "open", "synthetic")
            continue
        middle, half = allowed
        inside = 1.0 - 1e-6  # rounding half up at the very end is not the gauge's concern
        assert judge(one, middle + inside * half) and judge(one, middle - inside * half), one.id
        assert not judge(one, middle + (2.0 - inside) * half) and not judge(one, middle - (2.0 - inside) * half), one.id


def test_figures_are_chosen_by_name_part_and_row():
    def ids(*words, **more):
        return [f.id for f in chosen_figures(*words, known=KNOWN, **more)]

    assert ids() == [*KNOWN]
    assert ids(["3"]) == ["3a", "3b"] and ids(["12c", "3a"]) == ["12c", "3a"]
    assert ids(part="IV") == ["12c"] and ids(rows=["b."]) == ["12c"]
    assert "3b" not in ids(recordings=False)
    for words, more, says in ((["9"], {}, "Known are 3a"), (["3b"], {"recordings": False}, "recordings=False} leaves out"),
                              (["3a"], {"part": "IV"}, "not in part IV")):  # fmt: skip
        with pytest.raises(InputError, match=says):
            ids(words, **more)


def test_the_registry_of_the_papers_can_be_chosen_from():
    rows = {r.id for r in all_rows()}
    for known in FIGURES.values():
        assert set(known.rows) <= rows, known.id
        assert chosen_figures([known.id]) == [known]
    assert {"3a", "3b", "3c", "3d"} == {f.id for f in chosen_figures(["3"])}


# ---- the command


@pytest.fixture
def run(capsys, monkeypatch):
    monkeypatch.setattr(reproduction_report, "FIGURES", FIGURES)

    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["reproduce", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_a_person_is_told_paper_ours_difference_verdict_and_note_of_every_row(run):
    code, out, _ = run("--part", "discussion")
    lines = out.splitlines()
    assert code == 0 and lines[0] == "Discussion"
    assert lines[1].split() == ["row", "paper", "ours", "unit", "difference", "verdict"]
    for one in (r for r in all_rows() if r.part == "discussion"):
        (line,) = (line for line in lines if line.startswith(f"{one.id} "))
        assert line.rstrip().endswith("arithmetic") and one.unit in line and "%" in line
    assert lines[-1] == "6 printed numbers: 6 are arithmetic (−3 to 0 %), none falls short."


def test_rows_that_fall_short_give_exit_code_1_after_the_report_is_written(run, tmp_path, monkeypatch):
    monkeypatch.setattr("mckibben_papers.rows.judge", lambda row, ours: False)
    code, out, _ = run("--row", "valve.festo_power", "--out", str(tmp_path / "r.html"), "--json", "--no-recordings")
    found = json.loads(out)
    assert found["kinds"] == {
        "short": {"rows": 1, "lowest": found["rows"][0]["difference"], "highest": pytest.approx(0)}
    }
    assert found["headline"] == "1 printed number: 1 falls short (0 %)."
    assert code == 1 and found["failed"] == 1 and found["files"] == [str(tmp_path / "r.html")]
    assert "1 of 1 numbers fall short" in (tmp_path / "r.html").read_text(encoding="utf-8")


def test_out_takes_both_reports_or_single_figures(run, tmp_path):
    pytest.importorskip("typst")
    folder = tmp_path / "new"
    code, out, _ = run("--row", "static.zero_force_angle", "--out", str(folder), "--json")
    assert code == 0 and [*map(str, sorted(folder.iterdir()))] == sorted(json.loads(out)["files"])
    assert 'id="figure-5a"' in (folder / "reproduction.html").read_text(encoding="utf-8")
    code, out, _ = run("--figure", "5a", "--out", str(tmp_path))
    assert code == 0 and "static.zero_force_angle" in out
    assert (tmp_path / "figure-5a.svg").read_text(encoding="utf-8").startswith("<?xml")


def test_a_wide_tolerance_is_shown_with_its_reason(run):
    name = "table1.bridgestone.work_density"
    code, out, _ = run("--row", name)
    assert code == 0 and "tolerance 5 %: the print divides 31 by the area" in " ".join(out.split())
    code, out, _ = run("--row", name, "--json")
    (row,) = json.loads(out)["rows"]
    assert row["tolerance"] == pytest.approx(0.05) and row["reason"] in row["note"] and row["kind"] == "predicted"
    assert row["basis"] == "other rows" and row["inputs"] in row["note"]
    assert row["rows"] == 6 and row["told"] and row["sensitivities"] in row["note"] and row["needed"] == ""


def test_predictions_come_first_and_those_that_agree_before_the_open_ones():
    agreeing, missed = (
        outcome(row(name, paper=2.0, basis="other rows", part="III", tolerance=0.1), value)._replace(
            prediction=RowPrediction(value, 0.1, True, ("b",), {}, None), ok=value < 2.2 or None
        )
        for name, value in (("z.agrees", 2.1), ("y.open", 2.9))
    )
    order = predictions_first([*OUTCOMES, missed, agreeing])
    assert order == [agreeing, missed, *OUTCOMES]
    document = report([*OUTCOMES, missed, agreeing])
    assert [s.anchor for s in document.sections][:3] == ["verdict", "predictions", "part-I"]


def test_without_typst_out_is_refused_before_any_work_and_html_alone_is_offered(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    monkeypatch.setattr(
        "mckibben_papers.reproduction.reproduce", lambda *args, **options: pytest.fail("it computed first")
    )
    folder = tmp_path / "new"
    code, out, err = run("--out", str(folder))
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "typst" in err and "mckibben[report]" in err and "--no-pdf" in err and not folder.exists()
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "typst", None)
    assert run("--row", "static.zero_force_angle", "--no-recordings", "--out", str(folder), "--no-pdf")[0] == 0
    assert [p.name for p in folder.iterdir()] == ["reproduction.html"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--out", "r.doc"], "ends in .html or .pdf"), (["--out", "no/such/r.html"], "older not found"),
        (["--out", "no/such/folder"], "older not found"), (["--out", "file"], "it is a file"),
        (["--figure", "99"], "Known are 1, 2"),
        (["--figure", "3a", "--no-recordings"], "no-recordings"), (["--row", "nothing"], "no row begins"),
    ],
)  # fmt: skip
def test_bad_words_are_one_clear_line_before_any_work(run, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("")
    code, out, err = run(*words)
    assert (code, out) == (2, "") and err.count("\n") == 1 and says in err


def test_a_figure_that_is_drawn_is_told_before():
    seen = []
    found = draw([KNOWN["3a"]], seen.append)
    assert seen == [KNOWN["3a"]] and found == [Drawn(KNOWN["3a"], found[0].picture)]
