"""Whoever cannot see, hold a mouse or tell colours uses the same pages: WCAG 2.1 AA, as far as a program can check it."""

import pytest
from screen_figures import COVERED, ZOOMED, violations
from screen_server import settled

PAGES = ("/", "/fit?map=DMSP-20-300", "/compare", "/energy", "/circuit", "/size?lines=no", "/paper", "/recordings")


def found(page):
    """What speaks against a page, a line each."""
    pytest.importorskip("axe_playwright_python.sync_playwright", reason="axe is not installed")
    return violations(page)


# Pages that compute before they show take a quarter of a minute each.
LATER = ("/fit?map=DMSP-20-300", "/compare", "/size?lines=no", "/paper")


@pytest.mark.parametrize("scheme", ["light", pytest.param("dark", marks=pytest.mark.slow)])
@pytest.mark.parametrize("path", [pytest.param(p, marks=pytest.mark.slow) if p in LATER else p for p in PAGES])
def test_names_roles_and_contrasts_are_as_wcag_asks(visit, path, scheme):
    page = visit(path, color_scheme=scheme)
    settled(page)
    assert not found(page)


@pytest.mark.slow
@pytest.mark.parametrize("path", PAGES)
def test_so_they_are_on_a_phone(visit, path):
    page = visit(path, width=390, height=844)
    settled(page)
    assert not found(page)
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= 390, f"the page is {wide} px wide"


@pytest.mark.parametrize("path", [p for p in PAGES if p not in LATER])
def test_no_page_is_wider_than_its_window(visit, until, path):
    page = visit(path)
    settled(page)
    outside = "e => e.checkVisibility() && !e.closest('.scroll-x') && e.getBoundingClientRect().right > innerWidth + 1"
    elements = f"[...document.querySelectorAll('button, .foot *, .minis *')].filter({outside}).map(e => e.id || '?')"
    for width in (1200, 1024, 1000, 800, 761, 760, 390):
        page.set_viewport_size({"width": width, "height": 800})
        try:  # charts follow their place
            until(lambda: page.evaluate(f"document.documentElement.scrollWidth <= innerWidth && !{elements}[0]"), 10.0)
        except AssertionError:
            raise AssertionError(f"at {width} px: {page.evaluate(elements)}") from None


@pytest.mark.parametrize("path", [pytest.param(p, marks=pytest.mark.slow) if p in LATER else p for p in PAGES])
def test_at_twice_the_size_no_words_lie_over_others_and_none_are_cut_off(visit, path):
    for width, height in ZOOMED.items():
        page = visit(path, width=width, height=height, device_scale_factor=2.0)
        settled(page)
        covered = page.evaluate(COVERED)
        assert not covered["over"] and not covered["cut"], (width, covered)


CALLED = """e => e.tagName + ' ' + (
    e.getAttribute('aria-label') || e.textContent.trim() || e.id || e.name).replace('\\u2026', '')"""
WANTED = """() => [...document.querySelectorAll('button, a[href], input, select, textarea, [tabindex="0"]')].filter(e => {
    const box = e.getBoundingClientRect()
    return box.width && box.height && !e.disabled && e.tabIndex >= 0
        && e.checkVisibility({ visibilityProperty: true }) && !(e.type === 'radio' && !e.checked)
}).map(called)"""
# A ring around it or what it stands in; the line under the console; the frame of a part of a circuit.
FOCUS = """() => {
    const e = document.activeElement
    if (!e || e === document.body) return null
    const style = x => getComputedStyle(x)
    const ringed = x => style(x).outlineStyle !== 'none' && parseFloat(style(x).outlineWidth) >= 1.5
    const near = [...e.querySelectorAll('*'), e.parentElement, e.nextElementSibling].filter(Boolean).some(x => ringed(x)
        || (x === e.parentElement && style(x).boxShadow !== 'none')
        || (x.classList.contains('frame') && parseFloat(style(x).strokeWidth) >= 2))
    return [called(e), ringed(e) || near] }"""


@pytest.mark.parametrize("path", [pytest.param(p, marks=pytest.mark.slow) if p in LATER else p for p in PAGES])
def test_the_tab_key_reaches_every_control_and_each_shows_that_it_has_the_focus(visit, path):
    page = visit(path, control=True)
    settled(page)
    # known by what they are called, for a page draws some of them anew while it is walked through
    page.evaluate(f"() => {{ window.called = {CALLED} }}")
    wanted = page.evaluate(WANTED)
    page.evaluate("document.activeElement?.blur(); window.scrollTo(0, 0)")
    reached, plain = set(), set()
    for _ in range(2 * len(wanted) + 60):
        page.keyboard.press("Tab")
        at = page.evaluate(FOCUS)
        if at is None:
            continue
        reached.add(at[0])
        if not at[1]:
            plain.add(at[0])
    missed = set(wanted) - reached
    assert not missed and not plain, {"not reached": missed, "no ring": plain}
