"""Makes the table of answer keys on the instructor page: derives each again by simulation."""

import json
from collections.abc import Iterator
from typing import Any

from grader.certify import Certificate, certify_question
from grader.domain.quiz import CodeQuestion, OpenQuestion
from grader.library import Library


def certificate_rows(library: Library) -> Iterator[dict[str, Any]]:
    """A row for every question with an answer key. The whole lesson takes a few seconds at most."""
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            if isinstance(question, OpenQuestion | CodeQuestion):
                continue
            certificate = certify_question(question, library.model_xml)
            yield {"quiz": quiz.id, "question": question.id, "kind": question.kind, **words(certificate)}


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
