"""Pages of a list: opaque cursors, and the link to the next page."""

import base64
import binascii
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import Query, Response
from pydantic import BaseModel, Field

from grader.api.gate import PREFIX
from grader.errors import Unprocessable

LIMIT, LIMIT_MAX = 50, 100
NO_NUL = r"^[^\x00]*$"
"""PostgreSQL keeps no NUL in text, so nothing with one can be there."""


class PageQuery(BaseModel):
    """Which submissions, and which page of them."""

    quiz: str | None = Field(default=None, pattern=NO_NUL)
    question: str | None = Field(default=None, pattern=NO_NUL)
    user: str | None = Field(default=None, pattern=NO_NUL)
    cursor: str | None = None
    limit: int = Field(default=LIMIT, ge=1, le=LIMIT_MAX)

    @property
    def start(self) -> str | None:
        """The submission next to which the page begins. Raises Unprocessable."""
        return None if self.cursor is None else read_cursor(self.cursor)


class Page(BaseModel):
    """One page of a list; `next_cursor` is None on the last."""

    items: list[dict[str, Any]]
    next_cursor: str | None


Asked = Annotated[PageQuery, Query()]


def page_of(items: list[dict[str, Any]], asked: PageQuery, path: str, response: Response) -> dict[str, Any]:
    """The page of `items`, which are one more than were asked for where there is a next page."""
    if len(items) <= asked.limit:
        return {"items": items, "next_cursor": None}
    items = items[: asked.limit]
    onward = asked.model_copy(update={"cursor": write_cursor(items[-1]["id"])})
    response.headers["Link"] = f'<{PREFIX}{path}?{urlencode(onward.model_dump(exclude_none=True))}>; rel="next"'
    return {"items": items, "next_cursor": onward.cursor}


def write_cursor(submission_id: str) -> str:
    """Opaque: what stands in it may change."""
    return base64.urlsafe_b64encode(f"at:{submission_id}".encode()).decode().rstrip("=")


def read_cursor(cursor: str) -> str:
    """The submission where the last page ended. Raises Unprocessable."""
    try:
        decoded = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode("ascii")
    except (ValueError, binascii.Error) as error:
        raise Unprocessable("The cursor is not one of ours.") from error
    if not decoded.startswith("at:") or not decoded.removeprefix("at:").isalnum():
        raise Unprocessable("The cursor is not one of ours.")
    return decoded.removeprefix("at:")
