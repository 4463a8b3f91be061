"""Bearer tokens for the users of tests."""

from grader.accounts import in_database
from grader.courses.tokens import create_token
from grader.settings import Settings


def issue_token(settings: Settings, user: str, role: str, course: str | None) -> str:
    """Creates a bearer token in the database of these settings. Raises Unprocessable."""
    return in_database(settings, lambda session: create_token(session, user, role, course))
