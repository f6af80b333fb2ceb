"""Laws of the scores: what is measured of a run, and who may enter one."""

from __future__ import annotations

import numpy as np
import pytest

import mckibben as mk
from mckibben.control import REFERENCES, control_task
from mckibben.control.scores import NORMAL, _filled, _score

OWN = """
class Own:
    preview = 0

    def __init__(self, task):
        self.task = task

    def reset(self, measured, window):
        self.sum = 0.0

    def step(self, measured, window):
        error = window[0] - self.task.output(measured)
        self.sum += error * self.task.period
        return 2e5 + 1e7 * error + 5e7 * self.sum
"""


class Unfinished:
    def __init__(self, task):
        self.preview = 0


def test_a_constant_error_is_its_own_settled_and_tracking_error():
    task, reference = control_task("B1"), REFERENCES["R1"]
    wanted = reference.samples(task.period, 0, 20.0)
    score = _score(wanted, wanted - 1e-4, np.full(len(wanted), 2e5), task, reference, 0.0)
    assert score.settled == pytest.approx(1e-4) and score.tracking == pytest.approx(1e-4)
    assert score.travel == 0.0 and score.saturated == 0.0


def test_only_what_goes_beyond_a_new_level_is_overshoot():
    task, reference = control_task("B1"), REFERENCES["R1"]
    wanted = reference.samples(task.period, 0, 20.0)
    ways = np.repeat(np.sign(np.diff(wanted[::200], prepend=wanted[0] - 1.0)), 200)
    beyond, short = (
        _score(wanted, wanted + side * 2e-4 * ways, np.full(len(wanted), 2e5), task, reference, 0.0)
        for side in (1.0, -1.0)
    )
    assert beyond.overshoot == pytest.approx(2e-4) and short.overshoot == pytest.approx(0.0, abs=1e-12)


def test_air_is_counted_when_it_enters_and_not_when_it_leaves():
    class Vessel:
        def braid_volume(self, lengths, pressures):
            return np.full(np.shape(lengths), 1e-3)

    pressures = np.array([0.0, 1e5, 0.0, 1e5])
    assert _filled(Vessel(), pressures, np.ones(4), 1e5) == pytest.approx(2.0 * 1e5 * 1e-3 * NORMAL)


def test_the_staircase_is_the_same_for_everybody_and_within_the_published_strokes():
    levels = REFERENCES["R1"].samples(0.01)[::200]
    assert len(levels) == 60
    assert levels.min() >= 3.82e-3 + 0.05 * 22.86e-3 and levels.max() <= 3.82e-3 + 0.85 * 22.86e-3


def test_a_class_of_ones_own_enters_by_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.py").write_text(OWN)
    answer = mk.control.score("own.py:Own,pid", plants=0, duration="4 s")
    assert set(answer.known) == {"own.py:Own", "pid"}
    assert answer.known["own.py:Own"]["nominal"].tracking < 5e-3


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ({"controller": "pidd"}, "Unknown controller 'pidd'. Did you mean 'pid'"),
        ({"bench": "B2"}, "Unknown bench 'B2'"),
        ({"reference": "R9"}, "Unknown reference 'R9'"),
        ({"reference": "R3"}, "reference must be one of R1, R2, R4, which B1 can follow"),
        ({"duration": "1 s"}, "duration must be above 2 s"),
        ({"plants": -1}, "plants must be a whole number from 0"),
        ({"controller": Unfinished}, "must have reset"),
    ],
)
def test_what_does_not_fit_is_refused_in_a_sentence(words, sentence):
    with pytest.raises(mk.InputError, match=sentence.replace("(", r"\(")):
        mk.control.score(**({"plants": 0, "duration": "3 s"} | words))


def test_the_headline_is_of_plants_not_seen():
    answer = mk.control.score("inverse", plants=2, duration="3 s")
    first, second = answer.tables()
    assert first.title.startswith("2 plants not seen") and second.title.startswith("Built on this plant")
    assert {row["of"] for row in first.rows} == {"median", "worst"}
    assert len(answer.rows()) == 5
