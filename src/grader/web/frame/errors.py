"""Errors as pages: a browser that asked for a page gets one, where the API answers with a problem document."""

import json
from urllib.parse import quote

from fastapi.responses import HTMLResponse, RedirectResponse, Response
from starlette.datastructures import Headers
from starlette.types import Scope

from grader.web.frame.rendering import HEADERS, templates

NOT_PAGES = ("/api/", "/healthz", "/readyz", "/metrics", "/openapi.json", "/static/")

WORDS = {
    401: ("You are signed out", "Open your sign-in link again; what you handed in is kept."),
    403: ("This is not open to you", "Go back to the page you came from and try again from there."),
    404: ("There is nothing here", "The address may be mistyped, or the course has changed."),
    405: ("There is nothing here", "This address takes forms only."),
    409: ("Not now", "Reload the page to see what holds at present."),
    413: ("This is too long", "Shorten it and send it again; nothing was taken."),
    422: ("This could not be read", "Go back, mend it and send it again; nothing was taken."),
    429: ("Too many requests", "Wait a moment, then go back and try again; nothing was taken."),
    503: ("The service cannot answer now", "What you handed in is kept. Try again in a moment."),
}
SIGNED_OUT_WHILE_SENDING = "Nothing was taken. Sign in in another tab, then go back here and send it again."
OURS = ("Something went wrong on our side", "It is noted. What you handed in is kept; try again in a moment.")


def error_page(scope: Scope, problem: Response) -> Response | None:
    """Renders a problem document as a page, with its status and headers, for a browser that opens a page; else None.
    An address that ends in a slash leads to the page without it, never to another host."""
    accepted, path = Headers(scope=scope).get("accept", ""), scope["path"]
    if path.startswith(NOT_PAGES) or "text/html" not in accepted:
        return None
    if problem.status_code == 404 and scope["method"] == "GET" and path.endswith("/") and path.strip("/"):
        query = scope["query_string"].decode("latin-1")
        return RedirectResponse(f"/{quote(path.strip('/'))}{'?' + query if query else ''}", 308, HEADERS)
    body = json.loads(bytes(problem.body))
    title, advice = WORDS.get(problem.status_code, OURS)
    if problem.status_code == 401 and scope["method"] == "POST":
        advice = SIGNED_OUT_WHILE_SENDING
    page = templates.get_template("error.html").render(
        who=None, status=problem.status_code, title=title, advice=advice,
        detail=body["detail"], request_id=body.get("request_id", ""),
    )  # fmt: skip
    kept = {name: value for name, value in problem.headers.items() if not name.startswith("content-")}
    return HTMLResponse(page, problem.status_code, {**kept, **HEADERS, "Cache-Control": "no-store"})
