"""Pictures and files of a content folder, under their digest. They show and run nothing but themselves."""

from typing import Annotated
from urllib.parse import quote

from fastapi import Path
from fastapi.responses import Response

from grader.domain.pages.media import ADDRESS, PICTURES, SVG, Media
from grader.errors import NotFound, Unauthorized
from grader.gate.late_routes import page_router
from grader.gate.services import AppServices
from grader.web.frame.inputs import Visitor
from grader.web.learner.pages import SIGN_IN, find_reader

HEADERS = {
    "Cache-Control": "private, max-age=31536000, immutable",
    "Content-Security-Policy": "default-src 'none'; style-src 'unsafe-inline'; sandbox",
    "Cross-Origin-Resource-Policy": "same-origin",
    "X-Content-Type-Options": "nosniff",
}
"""An SVG is a document: opened by itself it is a download, and no script in it would run."""

Digest = Annotated[str, Path(pattern="^[0-9a-f]{64}$")]

router = page_router()


@router.get(ADDRESS + "{sha256}/{name}")
def show_media(sha256: Digest, name: str, services: AppServices, who: Visitor) -> Response:
    """A picture or file of the course, for whoever may see its pages. Raises Unauthorized, NotFound."""
    if who is None and not services.sessions.anonymous:
        raise Unauthorized(SIGN_IN)
    reader = find_reader(who)
    file = services.content.get(reader.course).find_media(sha256, name, with_draft=reader.is_instructor)
    if file is None:
        raise NotFound("There is no such picture or file.")
    return send_media(file)


def send_media(media: Media) -> Response:
    """Returns a picture or file as it is sent."""
    shown = media.type in PICTURES and media.type != SVG
    disposition = "inline" if shown else f"attachment; filename*=UTF-8''{quote(media.name, safe='')}"
    return Response(media.body, media_type=media.type, headers=HEADERS | {"Content-Disposition": disposition})
