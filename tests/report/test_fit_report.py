import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from mckibben.identification import Fit, fit_all
from mckibben.identification.ranking import Ranking
from mckibben.muscles.build import build_law
from mckibben.recordings import ForceMap
from mckibben.report.fit_report import fit_report, write_fit_report
from mckibben.specimens import specimen

NAME = '<script>alert("1")</script> & sons'


@pytest.fixture(scope="module")
def study() -> Ranking:
    law = build_law("ideal", {"thread_length": 0.3, "turns": 3.0})
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.18, 0.25, 5), np.linspace(1e5, 5e5, 5)))
    tension = np.asarray(law.tension(length, pressure)) + 0.5 * np.sin(40.0 * np.arange(length.size))
    points = ForceMap(name=NAME, length=length, pressure=pressure, tension=tension)
    fits = fit_all(
        points,
        laws=["ideal", "gas_spring"],
        known={"rest_length": 0.25},
        schemes=("pressure", "length"),
        train_below=3e5,
    )
    return Ranking(
        NAME,
        specimen("DMSP-20-300"),
        points,
        fits,
        [("As published", fits[0].error * 2.0)],
        {"sarosi": f"too few {NAME}"},
    )


@pytest.fixture(scope="module")
def page(study: Ranking) -> str:
    return fit_report([study])


class Reader(HTMLParser):
    """Collects what a page would load, its ids, and its visible words."""

    void = {"meta", "br", "link", "img", "input", "hr"}

    def __init__(self) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.titles: list[str] = []

    def handle_starttag(self, tag, attrs) -> None:
        if tag not in self.void:
            self.tags.append(tag)
        for name, value in attrs:
            if name == "src" or (name == "href" and tag in ("link", "image", "use")):
                self.loads.append(value)
            if name == "href" and tag == "a":
                self.links.append(value)
            if name == "id":
                self.ids.append(value)
            if name in ("title", "aria-label"):
                self.titles.append(value)

    def handle_endtag(self, tag) -> None:
        assert self.tags.pop() == tag

    def handle_startendtag(self, tag, attrs) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.void:
            self.tags.pop()

    def handle_data(self, data) -> None:
        if not self.tags or self.tags[-1] not in ("style", "script"):
            self.words.append(data)


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    reader.close()
    assert not reader.tags
    return reader


def test_it_needs_nothing_else(page: str) -> None:
    found = read(page)
    assert all(load.startswith("#") for load in found.loads)
    assert "<script" not in page and "<link" not in page and "@import" not in page
    assert not re.search(r"url\((?!#)", page)
    assert len(page.encode()) < 1.5e6


def test_ids_are_unique_and_links_lead_somewhere(page: str) -> None:
    found = read(page)
    assert len(found.ids) == len(set(found.ids))
    assert {link.removeprefix("#") for link in [*found.links, *found.loads]} <= set(found.ids)


def test_every_law_is_named_with_its_parameters(page: str, study: Ranking) -> None:
    words = " ".join(read(page).words)
    for title in ("Ideal virtual work", "Gas spring", "As published", "Passed over"):
        assert title in words
    for fit in study.fits:
        assert all(name in words for name in fit.parameters)
    assert "M. Martens, I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0" in words
    assert "mckibben" in words and "jax" in words and "Python" in words


def test_what_is_missing_is_a_dash_with_a_reason(study: Ranking) -> None:
    first, second = study.fits
    lost = replace(second.cross["pressure"], failed=1, error=second.cross["pressure"].error * np.nan)
    broken = replace(
        second, converged=False, message="ran away", cross={"pressure": lost}, holdout=None, correlation=None
    )
    gone = replace(first, holdout=replace(first.holdout, error=first.holdout.error * np.inf))
    page = fit_report([replace(study, fits=[gone, broken])])
    found = read(page)
    text = " ".join(found.words)
    assert not re.search(r"\b(nan|inf|none)\b", text, re.I)
    assert "–" in text and any("did not converge" in title for title in found.titles)
    assert "did not converge" in text and "ran away" in text


def test_a_law_alone_without_specimen_or_cross_validation(study: Ranking) -> None:
    bare: Fit = replace(study.fits[0], cross={}, holdout=None)
    text = " ".join(read(fit_report([Ranking("Bare", None, study.points, [bare])])).words)
    assert "Ideal virtual work" in text and not re.search(r"\bnan\b", text)


def test_names_from_outside_cannot_become_markup(page: str) -> None:
    assert "<script" not in page and 'alert("1")' not in page
    assert "&lt;script&gt;" in page


def test_the_same_studies_give_the_same_file(study: Ranking, page: str, tmp_path) -> None:
    path = write_fit_report([study], tmp_path / "report.html")
    assert path.read_text(encoding="utf-8") == page
