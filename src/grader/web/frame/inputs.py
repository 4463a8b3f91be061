"""What pages read from a request: the visitor, the fields of a form, the number of a row."""

from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, Path, Request
from fastapi.concurrency import run_in_threadpool

from grader.courses.people.identity import Identity, Role
from grader.errors import Unauthorized, Unprocessable
from grader.store.tables import ROW_ID_MAX
from grader.web.frame.multipart import parse_multipart, read_boundary

FIELDS_MAX = 1000
"""Fields of a form: a box for each learner of a large course."""

RowId = Annotated[int, Path(ge=1, le=ROW_ID_MAX)]
"""The number of a row, in a path."""


async def get_visitor(request: Request) -> Identity | None:
    """Returns the user of the browser, whom the middleware has identified; None without a valid session."""
    identity: Identity | None = request.state.identity
    return identity


Visitor = Annotated[Identity | None, Depends(get_visitor)]


async def require_instructor(who: Visitor) -> Identity:
    """Returns the instructor of the browser. Raises Unauthorized, Forbidden."""
    if who is None:
        raise Unauthorized("Sign in first.")
    who.require(Role.INSTRUCTOR)
    return who


Instructor = Annotated[Identity, Depends(require_instructor)]


async def read_form_fields(request: Request) -> dict[str, list[str]]:
    """Reads the values of every field of the form that the browser sent; of a file its base64."""
    body, boundary = await request.body(), read_boundary(request.headers.get("content-type", ""))
    if boundary is not None:
        return await run_in_threadpool(parse_multipart, body, boundary, FIELDS_MAX)
    return await run_in_threadpool(parse_form, body)


def parse_form(body: bytes) -> dict[str, list[str]]:
    """Parses the fields of a form, without NUL, which PostgreSQL does not keep. Raises Unprocessable for too many."""
    try:
        sent = parse_qs(body.decode(errors="replace"), keep_blank_values=True, max_num_fields=FIELDS_MAX)
    except ValueError as error:
        raise Unprocessable(f"A form has at most {FIELDS_MAX} fields.") from error
    return {name: [value.replace("\0", "") for value in values] for name, values in sent.items()}


FormFields = Annotated[dict[str, list[str]], Depends(read_form_fields)]


async def read_form(fields: FormFields) -> dict[str, str]:
    """Reads the form that the browser sent; of a repeated field, the first."""
    return {name: values[0] for name, values in fields.items()}


Form = Annotated[dict[str, str], Depends(read_form)]
