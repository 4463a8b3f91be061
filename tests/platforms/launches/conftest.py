"""A grader and a platform, shared by the tests of a module."""

from collections.abc import Iterator

import pytest

from platforms.joined import Joined, joined_in


@pytest.fixture(scope="module")
def shared_pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Joined]:
    with joined_in(tmp_path_factory.mktemp("lti")) as joined:
        yield joined


@pytest.fixture
def pair(shared_pair: Joined) -> Joined:
    """The pair with a course of its own, which is linked."""
    return shared_pair.new_course()
