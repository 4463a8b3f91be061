"""Styles, scripts and fonts under an address that names their content, so that browsers keep them for good. The address
holds one digest of all of them: modules import each other, and the style sheet its fonts, by relative addresses. The
script of a kind of lab, which lies beside its code, is one of them: `labs/KIND.js`."""

import hashlib
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from grader.labs import lab_kinds, script_of

FOLDER = Path(__file__).parents[1] / "static"
DIGEST_LENGTH = 12
DIGEST = re.compile(rf"[0-9a-f]{{{DIGEST_LENGTH}}}")
FOR_GOOD = "public, max-age=31536000, immutable"

_files = StaticFiles(directory=FOLDER)


@cache
def list_lab_scripts() -> Mapping[str, Path]:
    """Returns the scripts of the installed kinds of lab, by the names under which they are served."""
    return {f"labs/{name}.js": script_of(kind) for name, kind in lab_kinds().items()}


@cache
def compute_digest() -> str:
    """Returns the digest of all files with their names, as they are when the process first asks."""
    files = {path.relative_to(FOLDER).as_posix(): path for path in FOLDER.rglob("*") if path.is_file()}
    parts = (f"{name}\0".encode() + path.read_bytes() for name, path in sorted({**files, **list_lab_scripts()}.items()))
    return hashlib.sha256(b"\0".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()[:DIGEST_LENGTH]


def static(name: str) -> str:
    """Returns the address of a file for templates."""
    return f"/static/{compute_digest()}/{name}"


async def static_file(path: str, scope: Scope) -> Response:
    """Renders a file by its path, with or without the digest before it. Raises HTTPException 404. Only the digest of
    what is served now lets browsers keep the file; any other address is asked for again."""
    first, _, rest = path.partition("/")
    is_current = first == compute_digest()
    if rest and (is_current or DIGEST.fullmatch(first)):
        path = rest
    script = list_lab_scripts().get(path)
    files, name = (_files, path) if script is None else (StaticFiles(directory=script.parent), script.name)
    response = await files.get_response(name, scope)
    caching = FOR_GOOD if is_current else "no-cache"
    response.headers.update({"Cache-Control": caching, "X-Content-Type-Options": "nosniff"})
    return response
