"""Calibration files: everything reads back exactly, others' channels are kept, and what is wrong is named."""

import math

import pytest

from mckibben.errors import InputError
from mckibben.recordings.calibration import DAY, Calibration, Correction, CorrectionTerm, Origin
from mckibben.recordings.calibration_file import document, merged, read_calibration, write_calibration

DATE = "2026-03-31T12:00:00+00:00"


def calibration() -> Calibration:
    by = Origin(
        method="weights", date=DATE, reference='M1 "brass", S/N 7', reference_uncertainty=0.1 / 3.0,
        scale_uncertainty=1e-4, valid_for=365.0 * DAY, points=7,
    )  # fmt: skip
    tension = Correction(
        unit="N",
        terms={"gain": CorrectionTerm(1.0 / 1.02, 1e-4 / 3.0, 12.3, by), "zero": CorrectionTerm(3.1, 0.01, math.inf, by)},
        sensor="S/N 123", correlation=-0.4, linearity=0.02,
    )  # fmt: skip
    odd = Origin(method="skew", date=DATE, valid_for=1234.5)
    pressure = Correction(
        unit="Pa", terms={"zero": CorrectionTerm(-61.5), "skew": CorrectionTerm(1.7e-5 / 3.0, 1e-8, 23.0, odd)}
    )
    return Calibration(rig="modern", created=DATE, corrections={"tension": tension, "pressure": pressure})


def test_a_file_reads_back_exactly_and_a_person_can_read_it(tmp_path):
    path = write_calibration(calibration(), tmp_path / "a.toml")
    assert read_calibration(path) == calibration()
    text = path.read_text()
    assert 'valid_for = "365 day"' in text and 'zero]\nvalue = "3.1 N"' in text
    assert list(tmp_path.iterdir()) == [path]


def test_words_in_other_units_are_read(tmp_path):
    path = tmp_path / "a.toml"
    path.write_text(
        f'schema = 1\nrig = "modern"\ncreated = "{DATE}"\n[channels.pressure]\nunit = "Pa"\n'
        '[channels.pressure.zero]\nvalue = "20 mbar"\nuncertainty = "1 mbar"\n[channels.pressure.skew]\nvalue = "15 us"\n'
    )
    found = read_calibration(path).corrections["pressure"]
    assert (found.zero, found.term("zero").uncertainty) == pytest.approx((2000.0, 100.0))
    assert found.skew == pytest.approx(15e-6)


def test_new_channels_join_the_file_and_the_others_are_kept(tmp_path):
    path = write_calibration(calibration(), tmp_path / "a.toml")
    new = Correction(unit="m", terms={"gain": CorrectionTerm(1.005, 1e-5)})
    both = merged(path, "modern", {"span": new}, "2026-05-01T00:00:00+00:00")
    assert both.corrections == {**calibration().corrections, "span": new}
    assert merged(tmp_path / "none.toml", "modern", {"span": new}, DATE).corrections == {"span": new}
    with pytest.raises(InputError, match="rig is 'paper': the calibration is of modern; choose another file"):
        merged(path, "paper", {"span": new}, DATE)
    with pytest.raises(InputError, match="unit is 'Pa': the calibration has N"):
        merged(path, "modern", {"tension": Correction(unit="Pa")}, DATE)


HEAD = f'schema = 1\nrig = "modern"\ncreated = "{DATE}"\n'
CHANNEL = HEAD + '[channels.tension]\nunit = "N"\n'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("schema = 2\nwonder = 1\n", "schema must be 1 for this version of mckibben, got 2; a newer one wrote it"),
        ('rig = "modern"', "schema is missing"),
        ('schema = "1"', "schema must be 1"),
        (HEAD + "channel = 1\n", "Unknown field 'channel'. Did you mean 'channels'?"),
        (CHANNEL + "sensr = 'a'\n", "Unknown field 'channels.tension.sensr'. Did you mean 'sensor'?"),
        (
            CHANNEL + "[channels.tension.gain]\nvalu = 1\n",
            "Unknown field 'channels.tension.gain.valu'. Did you mean 'value'?",
        ),
        (CHANNEL + "[channels.tension.gain]\n", "channels.tension.gain.value is missing"),
        (
            CHANNEL + "[channels.tension.gain]\nvalue = 0\n",
            "channels.tension.gain.value must be between 0.001 and 1000, got 0",
        ),
        (
            CHANNEL + '[channels.tension.zero]\nvalue = "3 bar"\n',
            "channels.tension.zero.value must be a force such as '110 N', got 3 bar",
        ),
        (
            CHANNEL + "[channels.tension.zero]\nvalue = 3\n",
            "got 3; the unit is missing",
        ),
        (CHANNEL + "gain = 3\n", "channels.tension.gain must be a table"),
        (HEAD + "[channels.tension]\n", "channels.tension.unit is missing"),
        (
            HEAD + "[channels.tension]\nunit = 'furlong'\n",
            "channels.tension.unit must be an SI unit",
        ),
        ("schema = ", "not TOML"),
        ("schema = 1" + "0" * 5000, "not TOML"),
        (
            CHANNEL + "[channels.tension.gain]\nvalue = 1.0\ndegrees = 1" + "0" * 400,
            "calibration is not TOML: a whole number takes more than 64 bits",
        ),
        (
            CHANNEL + "[channels.tension.gain]\nvalue = 1.0\ndegrees = 1e30",
            "channels.tension.gain.degrees must be",
        ),
    ],
)
def test_a_file_that_is_wrong_is_refused_in_one_line_with_its_name_and_path(tmp_path, text, said):
    path = tmp_path / "a.toml"
    path.write_text(text)
    with pytest.raises(InputError) as error:
        read_calibration(path)
    assert said in str(error.value) and str(path) in str(error.value) and "\n" not in str(error.value)


def test_places_that_cannot_be_read_or_written_are_named(tmp_path):
    with pytest.raises(InputError, match="not found"):
        read_calibration(tmp_path / "none.toml")
    with pytest.raises(InputError, match="it is a folder"):
        read_calibration(tmp_path)
    with pytest.raises(InputError, match="there is no folder"):
        write_calibration(calibration(), tmp_path / "none" / "a.toml")


def test_the_tables_have_words_with_units():
    tables = document(calibration())["channels"]["tension"]
    assert tables["linearity"] == "0.02 N" and "degrees" not in tables["zero"]
