"""``compare``: the contract's JSON, figures and recordings as asked, and bad input in one line before any work."""

import json

import numpy as np
import pytest

from mckibben.cli import main
from mckibben.recordings import Channel, Recording


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["compare", *words])
        out, err = capsys.readouterr()
        return stop.value.code or 0, out, err

    return call


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Two cycles of a straight muscle without friction."""
    time = np.arange(0.0, 2.0, 1e-3)
    length = 0.125 - 0.015 * np.cos(2.0 * np.pi * time)
    channels = {"span": Channel(length, "m"), "tension": Channel(2000.0 * (length - 0.11), "N")}
    path = tmp_path_factory.mktemp("compare") / "mine.nc"
    return Recording(time, channels, {"rest_length": 0.13}).save(path)


def test_the_contract_holds(run, recording):
    code, text, err = run("nylon", "fast-fibre", "--recording", str(recording), "--json")
    found = json.loads(text)
    assert (code, err) == (0, "")
    assert found["columns"] == ["nylon", "fast-fibre", "mine"]
    rows = {row["property"]: row for row in found["rows"]}
    for row in rows.values():
        assert {"property", "unit", "values"} <= set(row)
        assert len(row["values"]) == 3
        assert all(v is None or isinstance(v, float) for v in row["values"])
    # Values stand in the unit beside them; those of the paper's Table 1 at the decimals in print.
    assert rows["tension_intensity"]["unit"] == "N/cm^2"
    assert round(rows["tension_intensity"]["values"][0]) == 116
    assert rows["tension_intensity"]["values"][1] == pytest.approx(35.0)
    assert rows["tension_intensity"]["values"][2] is None
    assert round(rows["work_density"]["values"][0], 2) == 0.20
    assert rows["maximum_velocity"]["published"]["high"] == 20.0
    assert rows["tension_intensity"]["published"]["sources"] == ["gordon1989", "guyton1986"]


def test_a_person_reads_a_table_with_sources(run):
    code, text, err = run("nylon", "slow-fibre")
    assert (code, err) == (0, "")
    assert "Tension intensity" in text and "30 to 35" in text and "[guyton1986]" in text
    assert "its size is inferred" in text


@pytest.mark.slow  # all protocols
def test_protocols_of_biological_muscles_and_their_figure(run, tmp_path):
    figure = tmp_path / "fibres.png"
    stimulation = ("--stimulation", "phase=60 deg", "--stimulation", "duty=0.4")
    code, text, err = run("fast-fibre", "slow-fibre", "--protocols", *stimulation, "--out", str(figure), "--json")
    found = json.loads(text)
    assert (code, err) == (0, "")
    rows = {row["property"]: row["values"] for row in found["rows"]}
    # The two differ by their speed only.
    assert rows["hill_velocity"] == pytest.approx([8.0, 2.0], rel=0.05)
    assert rows["step_rise"][0] == pytest.approx(rows["step_rise"][1])
    assert rows["cycle_work"][0] > rows["cycle_work"][1]
    assert figure.read_bytes()[:4] == b"\x89PNG"


REFUSED = {
    "stimulation without protocols": (["fast-fibre", "--stimulation", "duty=0.4"], "only with --protocols"),
    "an unknown stimulation": (
        ["fast-fibre", "--protocols", "--stimulation", "lead=1 s"],
        "Unknown --stimulation 'lead'",
    ),
    "a duty above one": (["fast-fibre", "--protocols", "--stimulation", "duty=2"], "duty"),
    "nobody": ([], "muscles are missing"),
    "an unknown muscle": (["nylon", "wool"], "Unknown specimen 'wool'"),
    "a valve": (["MPP-3-1-8"], "must be a muscle"),
    "a pressure without a unit": (["nylon", "--pressure", "5"], "the unit is missing"),
    "a pressure that moves nothing": (["nylon", "--pressure", "0.2 bar"], "pulls nothing at its rest length"),
    "a target of the wrong kind": (["nylon", "--match", "bridgestone"], "must be a biological muscle"),
    "a match without a McKibben muscle": (["fast-fibre", "--match", "slow-fibre"], "must be a McKibben muscle"),
    "a figure of another kind": (
        ["nylon", "--out", "x.gif"],
        "--out must be a name that ends in .html or .pdf or .svg or .png",
    ),
    "a recording that is not there": (["nylon", "--recording", "none.nc"], "none.nc"),
    "a rig that is not there": (["nylon", "--protocols", "--rig", "wooden"], "wooden"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_clear_line(run, case):
    words, said = REFUSED[case]
    code, text, err = run(*words)
    assert (code, text) == (2, "")
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("mckibben: ") and said in err


def test_a_recording_alone_has_no_law_to_draw(run, recording, tmp_path):
    code, _, err = run("--recording", str(recording), "--out", str(tmp_path / "x.svg"))
    assert code == 2 and "needs a specimen" in err
