"""Content by digest: the files that grading depends on, which quiz file of today is in use, and every query on them."""

import hashlib
import json
from collections.abc import Mapping
from datetime import datetime
from pathlib import PurePosixPath

from sqlalchemy import LargeBinary, String, Text, delete, select
from sqlalchemy.orm import Mapped, Session, mapped_column

from grader.domain.pages.media import FOLDERS, Media, find_type
from grader.store.tables import NAME, Base, now

EVERY = ""
"""In the place of a course: every course without content of its own."""


NO_QUIZ = ""
"""In the place of a quiz: the manifest of all pictures and files of a content folder."""


class ContentFile(Base):
    """A file of some content; never changed. The key is the sha256 of the body."""

    __tablename__ = "content_files"

    sha256: Mapped[str] = mapped_column(String(64), primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class ContentManifest(Base):
    """The files that one quiz was graded with; never changed."""

    __tablename__ = "content_manifests"

    digest: Mapped[str] = mapped_column(String(80), primary_key=True)
    """As in submissions and verdicts."""
    quiz: Mapped[str] = mapped_column(String(64))
    files: Mapped[str] = mapped_column(Text)
    """The sha256 of every file by its path in the content folder, as a JSON object."""
    created_at: Mapped[datetime] = mapped_column(default=now)


class ContentInUse(Base):
    """The content that a server has loaded last for a quiz: its policy counts. No row: the quiz is gone. The rows of
    the course `EVERY` are for courses without content of their own, which have no rows."""

    __tablename__ = "content_in_use"

    course: Mapped[str] = mapped_column(String(NAME), primary_key=True)
    quiz: Mapped[str] = mapped_column(String(64), primary_key=True)
    digest: Mapped[str] = mapped_column(String(80))


def keep(session: Session, quiz: str, digest: str, files: Mapping[str, str | bytes]) -> None:
    """Keeps the files of a quiz under its digest, unless they are kept. The caller holds a lock."""
    if session.get(ContentManifest, digest) is not None:
        return
    bodies = {path: body.encode() if isinstance(body, str) else body for path, body in files.items()}
    hashes = {path: hashlib.sha256(body).hexdigest() for path, body in bodies.items()}
    known = set(session.scalars(select(ContentFile.sha256).where(ContentFile.sha256.in_(hashes.values()))))
    new = {hashes[path]: body for path, body in bodies.items() if hashes[path] not in known}
    session.add_all(ContentFile(sha256=sha256, body=body) for sha256, body in new.items())
    session.add(ContentManifest(digest=digest, quiz=quiz, files=json.dumps(hashes)))
    session.flush()


def use(session: Session, course: str, digests: Mapping[str, str]) -> None:
    """Sets the digests of all quizzes of a course that are in use; none for no content. The caller holds a lock."""
    theirs = ContentInUse.course == course
    if {row.quiz: row.digest for row in session.scalars(select(ContentInUse).where(theirs))} != digests:
        session.execute(delete(ContentInUse).where(theirs))
        session.add_all(ContentInUse(course=course, quiz=quiz, digest=digest) for quiz, digest in digests.items())


def list_courses(session: Session) -> set[str]:
    """The courses with content of their own, and `EVERY`."""
    return set(session.scalars(select(ContentInUse.course).distinct()))


def in_use(session: Session, course: str, quiz: str) -> str | None:
    """The digest of a course's quiz as it is now; None if it is gone."""
    rows = select(ContentInUse).where(ContentInUse.course.in_((course, EVERY)))
    digests: dict[str, dict[str, str]] = {}
    for row in session.scalars(rows):
        digests.setdefault(row.course, {})[row.quiz] = row.digest
    return (digests.get(course) or digests.get(EVERY, {})).get(quiz)


def read_files(session: Session, digest: str) -> dict[str, str | bytes] | None:
    """The bytes of every file of some content by path; None if a file is missing or damaged."""
    manifest = session.get(ContentManifest, digest)
    if manifest is None:
        return None
    hashes: dict[str, str] = json.loads(manifest.files)
    rows = session.execute(select(ContentFile.sha256, ContentFile.body).where(ContentFile.sha256.in_(hashes.values())))
    bodies = {row.sha256: row.body for row in rows if hashlib.sha256(row.body).hexdigest() == row.sha256}
    if any(sha256 not in bodies for sha256 in hashes.values()):
        return None
    return {path: bodies[sha256] for path, sha256 in hashes.items()}


def find_media(session: Session, sha256: str, name: str) -> Media | None:
    """Returns the picture or file with this sha256 and name of any content; None where no content folder has it below
    images/ or files/: models, programs and quizzes are kept in the same table and never served."""
    rows = select(ContentManifest.files).where(ContentManifest.files.contains(sha256, autoescape=True))
    for files in session.scalars(rows):
        for path, digest in json.loads(files).items():
            if digest == sha256 and path.startswith(FOLDERS) and PurePosixPath(path).name == name:
                file = session.get(ContentFile, sha256)
                return None if file is None else Media(path, find_type(path, file.body), file.body)
    return None
