"""What the instructor page says of the answer keys: re-derived by physics just now, or why not."""

import json
from collections.abc import Iterator
from typing import Any

from grader.certify import Certificate, certify_question
from grader.domain.quiz import CodeQuestion, OpenQuestion
from grader.library import Library


def certificate_rows(library: Library) -> Iterator[dict[str, Any]]:
    """Every question that has a key, with its certificate; the whole lesson takes a few seconds at most."""
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            if isinstance(question, OpenQuestion | CodeQuestion):
                continue
            certificate = certify_question(question, library.model_xml)
            yield {"quiz": quiz.id, "question": question.id, "kind": question.kind, **words(certificate)}


def words(certificate: Certificate | None) -> dict[str, Any]:
    """A certificate as the table takes it."""
    if certificate is None:
        return {"state": "not decided by physics", "tone": "", "why": "", "remarks": (), "measured": ""}
    return {
        "state": "certified" if certificate.ok else "refused",
        "tone": "good" if certificate.ok else "bad",
        "why": certificate.why,
        "remarks": certificate.remarks,
        "measured": json.dumps(certificate.to_json()["measured"], indent=1),
    }
