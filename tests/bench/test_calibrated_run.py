"""A run with a calibration: the software sees true values, the recording carries the calibration, and takes another one."""

import dataclasses

import numpy as np
import pytest
from short_runs import ADIABATIC, SHORT, bench, triangle

from mckibben.bench.rig_file import rig
from mckibben.bench.run import run
from mckibben.errors import InputError
from mckibben.recordings.calibration import Calibration, Correction, CorrectionTerm, Origin, recalibrate

VALUES = SHORT["isotonic-triangle"]
GAIN, OFFSET = 0.04, 2.0  # of the cell: reading (1 + g) x + b
WRONG = ADIABATIC | {"sensors.tension.gain_error": str(GAIN), "sensors.tension.offset": f"{OFFSET} N"}


def calibration(name="paper", valid_for=np.inf):
    origin = Origin(method="weights", date="2020-01-01T00:00:00+00:00", valid_for=valid_for)
    terms = {
        "gain": CorrectionTerm(1.0 / (1.0 + GAIN), 1e-4, 9.0, origin),
        "zero": CorrectionTerm(OFFSET, 1e-2, 9.0, origin),
    }
    found = Correction(unit="N", terms=terms, sensor="S/N 1")
    return Calibration(rig=name, created="2020-01-01T00:00:00+00:00", corrections={"tension": found})


def test_with_the_calibration_of_a_wrong_cell_the_machine_does_what_a_right_one_does():
    """An 8-bit cell: a count is 0.39 N; the load is held where the true tension is what was asked, within a count or so."""
    wrong, right = (run(bench("isotonic-triangle", on=on, **VALUES)) for on in (
        rig("paper", WRONG), rig("paper", WRONG).calibrated(calibration())
    ))  # fmt: skip
    count = 100.0 / 2**8
    held = float(np.mean(triangle()["muscle.load_tension"]))
    assert abs(np.mean(right["muscle.load_tension"]) - held) < count
    assert np.mean(wrong["muscle.load_tension"]) - held < -1.5  # it pulls 4 N too little: 4 % of 50 N, and 2 N
    error = right["tension"] - right["muscle.load_tension"]
    assert abs(np.mean(error)) < 0.5 * count
    # what the recording says can be taken off and put on again
    assert right.meta["calibration"] == calibration().plain()
    plain = recalibrate(right, None)
    ends = right.meta["converters"]["tension"]
    counts = (plain["tension"] - ends["low"]) / ((ends["high"] - ends["low"]) / (2 ** ends["bits"] - 1))
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)  # rounding of a few hundred counts
    np.testing.assert_array_equal(recalibrate(plain, calibration())["tension"], right["tension"])


def test_an_expired_calibration_is_said_and_another_rigs_is_refused():
    on = rig("paper", ADIABATIC)
    prepared = bench("isotonic-triangle", on=on.calibrated(calibration(valid_for=86400.0)), **VALUES)
    (said,) = prepared.cautions
    assert "tension" in said and "expired on 2020-01-02" in said
    with pytest.raises(InputError, match="has to be of the rig paper"):
        on.calibrated(calibration("modern"))
    odd = dataclasses.replace(calibration(), corrections={"colour": calibration().corrections["tension"]})
    with pytest.raises(InputError, match="Unknown channel 'colour'. The rig measures"):
        on.calibrated(odd)


def test_what_the_rig_does_not_know_how_to_do_is_said():
    text = '[[steps]]\nask = "paint the muscle green"\npressure = "1 bar"\nspan = "1 L0"\nfor = "10 ms"\n'
    from short_runs import written

    (said,) = written(text).cautions
    assert "paint the muscle green" in said and "nothing does" in said
