"""What the tests of pages share."""

from collections.abc import Iterator

import pytest

from web.browsing import Chromium, chromium


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    """A browser for the tests of one file."""
    with chromium() as browser:
        yield browser
