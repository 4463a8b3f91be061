"""What the tests of skipping share."""

from collections.abc import Iterator

import pytest

from grader.numerics import workspace


@pytest.fixture(scope="class")  # outside classes: for one test, and for all examples of a property
def bare_at_once() -> Iterator[None]:
    """Runs that skip have the model without visuals, if there is one, from their first step on."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workspace, "BARE_AFTER", 0)
        yield
