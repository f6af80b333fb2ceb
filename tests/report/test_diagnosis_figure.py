"""The figure of a confusion matrix shows shares of the runs of each row."""

import pytest

from mckibben.errors import InputError
from mckibben.report.figures.study_figures import confusion_figure

MATRIX = {"leak": {"leak": 19, "slack": 1, "none": 0}, "slack": {"leak": 0, "slack": 10, "none": 10}}


def test_shares_are_of_the_runs_of_each_row():
    texts = [t.get_text() for t in confusion_figure(MATRIX, {"leak": "a leak"}).axes[0].texts]
    assert [t for t in texts if t.isdigit()] == ["95", "5", "50", "50"]


def test_a_matrix_without_runs_is_refused():
    with pytest.raises(InputError, match="at least one run"):
        confusion_figure({"leak": {"leak": 0}}, {})
