"""What the tests of pages share."""

from collections.abc import Iterator

import pytest

from web.browsing import Chromium, bounded, chromium


@pytest.fixture(autouse=True)
def limit() -> Iterator[None]:
    """No test of pages hangs for ever."""
    with bounded():
        yield


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    """A browser for the tests of one file."""
    with chromium() as browser:
        yield browser
