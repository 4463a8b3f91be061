"""Bearer tokens for the users of tests."""

from grader.courses.people.tokens import create_token
from grader.service.accounts import in_database
from grader.settings import Settings


def issue_token(settings: Settings, user: str, role: str, course: str | None) -> str:
    """Creates a bearer token in the database of these settings. Raises Unprocessable."""
    return in_database(settings, lambda session: create_token(session, user, role, course))
