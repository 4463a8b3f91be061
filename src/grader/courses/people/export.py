"""Exports all that is held of one learner, as a zip file or a folder: one JSON document, and their scripts."""

import json
import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sqlalchemy.orm import Session

from grader.courses.people.audit import Action, record
from grader.courses.people.erasure import find_member
from grader.errors import Conflict
from grader.store.upkeep.holdings import gather_holdings

DOCUMENT = "learner.json"


def export_learner(
    session: Session, *, user: str | None = None, member_id: str | None = None, course: str | None = None
) -> dict[str, str]:
    """Returns the files that hold everything about the member with this name or id, by their paths. Raises NotFound.
    The source of a script is a file of its own, which `script` in the document names."""
    member = find_member(session, course, user, member_id)
    held = gather_holdings(session, member)
    files: dict[str, str] = {}
    for submission in held["submissions"]:
        answer = submission["answer"]
        if isinstance(answer, dict) and isinstance(answer.get("source"), str):
            suffix = ".xml" if answer["source"].lstrip().startswith("<") else ".py"
            submission["script"] = path = f"scripts/{submission['id']}{suffix}"
            files[path] = submission["answer"].pop("source")
    record(session, None, member.course, Action.MEMBER_EXPORTED, member.name, member=member.id)
    return {DOCUMENT: format_document(held), **files}


def format_document(held: Mapping[str, Any]) -> str:
    """JSON for people and programs: times in ISO 8601."""
    text = json.dumps(held, ensure_ascii=False, allow_nan=False, indent=2, default=lambda moment: moment.isoformat())
    return f"{text}\n"


def name_file(files: Mapping[str, str]) -> str:
    """Returns the name of a zip file, by the member's id: a name may hold what a path must not."""
    return f"learner-{json.loads(files[DOCUMENT])['member']['id'][:8]}.zip"


def write_export(files: Mapping[str, str], target: Path) -> None:
    """Writes the files to a new zip file, or to a new folder if the name does not end in .zip, for their owner alone.
    Raises Conflict if the target exists."""
    if target.exists():
        raise Conflict(f"{target} exists: name a new file or folder.")
    if target.suffix == ".zip":
        descriptor = os.open(target, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600)
        with os.fdopen(descriptor, "wb") as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:
            for path, text in files.items():
                packed.writestr(path, encode(text))
        return
    target.mkdir(mode=0o700)
    for path, text in files.items():
        place = target / path
        place.parent.mkdir(exist_ok=True)
        place.write_bytes(encode(text))


def encode(text: str) -> bytes:
    """Returns the text in UTF-8, also where a script has halves of surrogate pairs."""
    return text.encode("utf-8", errors="surrogatepass")
