"""What the tests of files share."""

import pytest

from mckibben import isolation


@pytest.fixture
def read_here(monkeypatch):
    """Files are parsed in this process, whose libraries a test replaces; else a process of its own parses them."""
    monkeypatch.setattr(isolation, "inside", isolation.ReadingLimits.of(0))
