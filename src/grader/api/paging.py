"""Pages of a list, by an opaque cursor and a link to the next page."""

import base64
import binascii
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Generic, TypeVar
from urllib.parse import urlencode

from fastapi import Depends, Path, Query, Request, Response
from pydantic import BaseModel, Field

from grader.api.bodies import ResponseBody
from grader.errors import Unprocessable
from grader.gate.admission import PREFIX
from grader.store.tables import ROW_ID_MAX

Item = TypeVar("Item")

RowId = Annotated[int, Path(ge=1, le=ROW_ID_MAX)]
"""The number of a row, in a path."""

INVALID = "The cursor is invalid: send the `next_cursor` of the page before."
NO_NUL = r"^[^\x00]*$"
"""PostgreSQL cannot store NUL in text, and refuses queries that hold one."""


class CursorQuery(BaseModel):
    """The query parameters of a list: which page of it."""

    cursor: str | None = None
    limit: int = Field(default=50, ge=1, le=100)

    @property
    def start(self) -> str | None:
        """The id of the last item of the page before; None for the first page. Raises Unprocessable."""
        return None if self.cursor is None else read_cursor(self.cursor)

    def read_number(self, digits_max: int = 18) -> int:
        """The number of the last item of the page before; 0 for the first page. Raises Unprocessable."""
        return read_number(self.start or "0", digits_max)


class QuestionQuery(CursorQuery):
    """The query parameters of a list of submissions: to which question, and which page of them."""

    quiz: str | None = Field(default=None, pattern=NO_NUL)
    question: str | None = Field(default=None, pattern=NO_NUL)


class PageQuery(QuestionQuery):
    """The query parameters of a list of submissions: whose too."""

    user: str | None = Field(default=None, pattern=NO_NUL)
    learner: str | None = Field(default=None, pattern=NO_NUL)


class Page(ResponseBody, Generic[Item]):
    """One page of a list; `next_cursor` is None on the last page."""

    items: list[Item]
    next_cursor: str | None


PageParams = Annotated[PageQuery, Query()]


def build_page(items: list[dict[str, Any]], query: CursorQuery, path: str, response: Response) -> dict[str, Any]:
    """The body of a page, and its `Link` header. `items` are one more than the limit if there is a next page."""
    if len(items) <= query.limit:
        return {"items": items, "next_cursor": None}
    items = items[: query.limit]
    following = query.model_copy(update={"cursor": write_cursor(items[-1]["id"])})
    response.headers["Link"] = next_link(path, following)
    return {"items": items, "next_cursor": following.cursor}


def next_link(path: str, following: BaseModel) -> str:
    """The `Link` header of the next page, from its query parameters."""
    return f'<{PREFIX}{path}?{urlencode(following.model_dump(exclude_none=True))}>; rel="next"'


def write_cursor(last: str) -> str:
    """The cursor of the page after the item with this id. Opaque to callers: its format may change."""
    return base64.urlsafe_b64encode(f"at:{last}".encode()).decode().rstrip("=")


def read_cursor(cursor: str) -> str:
    """The id of the last item of the page before. Raises Unprocessable."""
    try:
        decoded = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode("ascii")
    except (ValueError, binascii.Error) as error:
        raise Unprocessable(INVALID) from error
    if not decoded.startswith("at:") or not decoded.removeprefix("at:").isalnum():
        raise Unprocessable(INVALID)
    return decoded.removeprefix("at:")


def read_number(text: str, digits_max: int = 18) -> int:
    """The number in a cursor. Raises Unprocessable."""
    if not text.isdecimal() or len(text) > digits_max:
        raise Unprocessable(INVALID)
    return int(text)


def cut_list(
    request: Request,
    response: Response,
    cursor: str | None = None,
    limit: Annotated[int | None, Query(ge=1, le=100)] = None,
) -> Callable[[Sequence[Any]], dict[str, Any]]:
    """Returns what cuts a list that is read whole: to its items from the cursor on, at most `limit`, or all of them."""
    start = 0 if cursor is None else read_number(read_cursor(cursor))

    def cut(items: Sequence[Any]) -> dict[str, Any]:
        end = len(items) if limit is None else start + limit
        if end >= len(items):
            return {"items": items[start:], "next_cursor": None}
        following = dict(request.query_params) | {"cursor": write_cursor(str(end))}
        response.headers["Link"] = f'<{request.url.path}?{urlencode(following)}>; rel="next"'
        return {"items": items[start:end], "next_cursor": following["cursor"]}

    return cut


Cut = Annotated[Callable[[Sequence[Any]], dict[str, Any]], Depends(cut_list)]
