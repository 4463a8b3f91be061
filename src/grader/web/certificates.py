"""Makes the table of answer keys on the instructor page: derives each again by simulation."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from threading import Lock
from typing import Any

from grader.certify import Certificate, certify_question
from grader.certify.remarks import UNVERIFIED, Luck, could_be_decided, luck_of
from grader.domain.quiz import CodeQuestion, OpenQuestion
from grader.library import Library
from grader.web.figures import unbroken

LUCKS_MAX = 1000
"""Chances of luck that are kept."""


@dataclass(frozen=True)
class _Keyed:
    """A quiz of a library; equal to another where its content is."""

    digest: str
    quiz: str
    library: Library = field(compare=False)


def certificate_rows(library: Library, *, with_luck: bool = False) -> list[dict[str, Any]]:
    """A row for every question with an answer key, and for every exercise.

    Those of a quiz are derived again when its content changes. The chance of luck at an exercise takes seconds: it is
    computed `with_luck` alone, and told again as long as the quiz stays the same.
    """
    return [row for quiz in library.quizzes for row in rows_of(_Keyed(library.digest(quiz), quiz, library), with_luck)]


def rows_of(keyed: _Keyed, with_luck: bool) -> Iterator[dict[str, Any]]:
    """The rows of one quiz, in the order of its questions."""
    certified = {row["question"]: row for row in _certified(keyed)}
    for question in keyed.library.quiz(keyed.quiz).questions:
        if question.id in certified:
            yield certified[question.id]
        elif isinstance(question, CodeQuestion):
            luck = lucks.of(keyed, question, compute=with_luck)
            yield {"quiz": keyed.quiz, "question": question.id, "kind": question.kind, **luck_words(luck)}


class Lucks:
    """Chances of luck that were computed, by the digest of the quiz and the question; one at a time."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Luck] = {}
        self._computing = Lock()

    def of(self, keyed: _Keyed, question: CodeQuestion, *, compute: bool) -> Luck | None:
        """The chance at an exercise; None if it is not known and not to be computed."""
        at = (keyed.digest, question.id)
        if at in self._known or not compute:
            return self._known.get(at)
        with self._computing:
            if at not in self._known:
                if len(self._known) >= LUCKS_MAX:
                    self._known.clear()
                self._known[at] = luck_of(question, keyed.library.model_xml, keyed.library.text)
            return self._known[at]


lucks = Lucks()


@lru_cache(maxsize=64)
def _certified(keyed: _Keyed) -> tuple[dict[str, Any], ...]:
    return tuple(
        {
            "quiz": keyed.quiz,
            "question": question.id,
            "kind": question.kind,
            **words(certify_question(question, keyed.library.model_xml), could_be_decided(question)),
        }
        for question in keyed.library.quiz(keyed.quiz).questions
        if not isinstance(question, OpenQuestion | CodeQuestion)
    )


def luck_words(luck: Luck | None) -> dict[str, Any]:
    """Returns a chance of luck as cells of the table."""
    cells: dict[str, Any] = {"remarks": (), "measured": "", "tone": "", "state": "luck not computed", "why": ""}
    if luck is None:
        return cells
    why = f"A fixed answer passes with a chance of at most {luck.chance:.1e}; {luck.allowed:g} is allowed."
    told = {"state": "no luck", "tone": "ok"} if luck.why is None else {"state": "luck", "tone": "no"}
    return cells | told | {"why": unbroken(why), "remarks": () if luck.why is None else (luck.why,)}


def words(certificate: Certificate | None, could_be: bool) -> dict[str, Any]:
    """Returns a certificate as cells of the table; without one, whether there could be one."""
    if certificate is None:
        remarks = (UNVERIFIED,) if could_be else ()
        return {"state": "not derivable by simulation", "tone": "", "why": "", "remarks": remarks, "measured": ""}
    return {
        "state": "certified" if certificate.ok else "refused",
        "tone": "ok" if certificate.ok else "no",
        "why": certificate.why,
        "remarks": certificate.remarks,
        "measured": json.dumps(certificate.to_json()["measured"], indent=1),
    }
