"""Makes the table of answer keys on the instructor page: derives each again by simulation."""

import json
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from grader.certify import Certificate, certify_question
from grader.domain.quiz import CodeQuestion, OpenQuestion
from grader.library import Library


@dataclass(frozen=True)
class _Keyed:
    """A quiz of a library; equal to another where its content is."""

    digest: str
    quiz: str
    library: Library = field(compare=False)


def certificate_rows(library: Library) -> list[dict[str, Any]]:
    """A row for every question with an answer key. Those of a quiz are derived again when its content changes."""
    return [row for quiz in library.quizzes for row in _rows_of(_Keyed(library.digest(quiz), quiz, library))]


@lru_cache(maxsize=64)
def _rows_of(keyed: _Keyed) -> tuple[dict[str, Any], ...]:
    return tuple(
        {
            "quiz": keyed.quiz,
            "question": question.id,
            "kind": question.kind,
            **words(certify_question(question, keyed.library.model_xml)),
        }
        for question in keyed.library.quiz(keyed.quiz).questions
        if not isinstance(question, OpenQuestion | CodeQuestion)
    )


def words(certificate: Certificate | None) -> dict[str, Any]:
    """Returns a certificate as cells of the table."""
    if certificate is None:
        return {"state": "not derivable by simulation", "tone": "", "why": "", "remarks": (), "measured": ""}
    return {
        "state": "certified" if certificate.ok else "refused",
        "tone": "good" if certificate.ok else "bad",
        "why": certificate.why,
        "remarks": certificate.remarks,
        "measured": json.dumps(certificate.to_json()["measured"], indent=1),
    }
