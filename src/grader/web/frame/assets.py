"""Styles, scripts and fonts under an address that names their content, so that browsers keep them for good. The address
holds one digest of the whole folder: modules import each other, and the style sheet its fonts, by relative
addresses."""

import hashlib
import re
from functools import cache
from pathlib import Path

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

FOLDER = Path(__file__).parents[1] / "static"
DIGEST_LENGTH = 12
DIGEST = re.compile(rf"[0-9a-f]{{{DIGEST_LENGTH}}}")
FOR_GOOD = "public, max-age=31536000, immutable"

_files = StaticFiles(directory=FOLDER)


@cache
def digest() -> str:
    """Returns the digest of all files with their names, as they are when the process first asks."""
    files = sorted(path for path in FOLDER.rglob("*") if path.is_file())
    parts = (f"{path.relative_to(FOLDER).as_posix()}\0".encode() + path.read_bytes() for path in files)
    return hashlib.sha256(b"\0".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:DIGEST_LENGTH]


def static(name: str) -> str:
    """Returns the address of a file for templates."""
    return f"/static/{digest()}/{name}"


async def static_file(path: str, scope: Scope) -> Response:
    """Renders a file by its path, with or without the digest before it. Raises HTTPException 404. Only the digest of
    what is served now lets browsers keep the file; any other address is asked for again."""
    first, _, rest = path.partition("/")
    is_current = first == digest()
    if rest and (is_current or DIGEST.fullmatch(first)):
        path = rest
    response = await _files.get_response(path, scope)
    caching = FOR_GOOD if is_current else "no-cache"
    response.headers.update({"Cache-Control": caching, "X-Content-Type-Options": "nosniff"})
    return response
