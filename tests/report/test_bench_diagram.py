"""The picture of a rig: its numbers, a star at what is inferred, nothing that it has not, and no two texts on each other."""

import dataclasses

import pytest
from matplotlib.figure import Figure

from mckibben.bench.rig_file import rig, rig_names
from mckibben.report.figures.bench_diagram import draw

PICTURES = [(name, layout) for name in rig_names() for layout in rig(name).plumbing]


def texts(fig: Figure) -> list[str]:
    return [t.get_text() for t in fig.axes[0].texts]


def test_numbers_are_those_of_the_rig_and_a_star_marks_the_inferred_ones() -> None:
    shown = texts(draw(rig("paper", {"sensors.tension.cutoff": "123 1/s", "sensors.tension.high": "77 N"})))
    assert "filter 123 Hz*" in shown
    assert "0 N to 77 N" in shown  # printed in the paper, so without a star


def test_a_rig_that_infers_nothing_has_no_star() -> None:
    plain = dataclasses.replace(rig("paper"), inferred=())
    assert not any("*" in text for text in texts(draw(plain)))


def test_what_a_rig_has_not_is_not_drawn() -> None:
    whole = rig("paper")
    plate = dataclasses.replace(whole, motor=None, motor_out=None, encoder=None)
    assert {"motor", "span", "output, motor"} <= set(texts(draw(whole)))
    assert not {"motor", "span", "output, motor"} & set(texts(draw(plate)))
    vessel = texts(draw(whole, layout="10 in3"))
    assert "accumulator" in vessel and not {"muscle", "tension", "motor"} & set(vessel)


@pytest.mark.parametrize(("name", "layout"), PICTURES)
def test_no_text_lies_on_another_and_none_leaves_the_picture(name: str, layout: str) -> None:
    fig = draw(rig(name), layout=layout)
    fig.canvas.draw()
    boxes = [(t.get_text(), t.get_window_extent()) for t in fig.axes[0].texts]
    for i, (one, box) in enumerate(boxes):
        assert fig.bbox.x0 <= box.x0 and box.x1 <= fig.bbox.x1 and fig.bbox.y0 <= box.y0 and box.y1 <= fig.bbox.y1, one
        for other, second in boxes[i + 1 :]:
            wide = min(box.x1, second.x1) - max(box.x0, second.x0)
            high = min(box.y1, second.y1) - max(box.y0, second.y0)
            assert wide < 1.0 or high < 1.0, (one, other)  # a pixel of rounding
