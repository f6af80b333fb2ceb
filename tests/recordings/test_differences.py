"""By what recordings differ: what was set, under its name, and nothing that all share."""

from mckibben.recordings.provenance import differing, facts, labels


def meta(frequency: str, rig: str = "paper", tube: str = "50 cm", **more):
    return {
        "title": "Work loop",
        "specimen": "nylon",
        "rig": rig,
        "protocol": {
            "name": "work-loop",
            "parameters": {"frequency": {"value": frequency, "unit": "1/s", "low": "0 Hz"}},
        },
        "rig_document": {"plumbing": {"direct": {"tube": {"length": tube}}}},
        "parameters": {"circuit": {"tube": {"length": {"value": tube, "unit": "m"}}}},
        "created": frequency,
        "balance": {"mass": 1e-12},
    } | more


def test_only_what_differs_is_named_and_nothing_that_follows_from_it():
    assert differing([meta("1 Hz"), meta("2 Hz")]) == {"frequency": ["1 Hz", "2 Hz"]}
    assert list(differing([meta("1 Hz"), meta("1 Hz", tube="2 m")])) == ["rig.plumbing.direct.tube.length"]
    assert differing([meta("1 Hz"), meta("1 Hz")]) == {}


def test_of_what_parts_recordings_alike_only_that_which_was_set_is_named():
    assert list(differing([meta("1 Hz"), meta("1 Hz", rig="other", tube="2 m")])) == ["rig"]
    assert list(differing([meta("1 Hz"), meta("2 Hz", rig="other")])) == ["rig", "frequency"]  # both were set


def test_everything_names_results_too():
    assert "created" in differing([meta("1 Hz"), meta("2 Hz")], everything=True)
    assert "balance.mass" in facts(meta("1 Hz"), everything=True) and "balance.mass" not in facts(meta("1 Hz"))


def test_a_recording_that_lacks_an_entry_has_an_empty_one():
    assert differing([meta("1 Hz", seed=3), meta("1 Hz")])["seed"] == ["3", ""]


def test_recordings_are_labelled_by_what_differs_else_numbered():
    assert labels([meta("1 Hz"), meta("2 Hz")]) == ["1 Hz", "2 Hz"]
    assert labels([meta("1 Hz"), meta("1 Hz")]) == ["1", "2"]
