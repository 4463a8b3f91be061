"""Makes the table of answer keys on the instructor page: derives each again by simulation."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from threading import Lock
from typing import Any

from grader.certify import Certificate
from grader.certify.keys import certify_quizzes
from grader.certify.remarks import UNVERIFIED, Luck, estimate_luck, is_decidable
from grader.library import Library
from grader.questions import AnswerKey, Question, kind_of
from grader.web.instructor.certificate_text import luck_told, told
from grader.web.text.questions import short_title

LUCKS_MAX = 1000
"""Chances of luck that are kept."""


@dataclass(frozen=True)
class _Keyed:
    """A quiz of a library; equal to another where its content is."""

    digest: str
    quiz: str
    library: Library = field(compare=False)


def certificate_rows(library: Library, *, with_luck: bool = False) -> list[dict[str, Any]]:
    """A row for every question with an answer key, and for every exercise. Those of a quiz are derived again when its
    content changes. The chance of luck at an exercise takes seconds: it is computed `with_luck` alone, and told again
    as long as the quiz stays the same."""
    return [row for quiz in library.quizzes for row in rows_of(_Keyed(library.digest(quiz), quiz, library), with_luck)]


def rows_of(keyed: _Keyed, with_luck: bool) -> Iterator[dict[str, Any]]:
    """The rows of one quiz, in the order of its questions."""
    certified = _certified(keyed)
    for question in keyed.library.quiz(keyed.quiz).questions:
        yield from (row for row in certified if row["question"] == question.id)
        if kind_of(question).is_script:
            luck = lucks.of(keyed, question, compute=with_luck)
            yield {"quiz": keyed.quiz, "question": question.id, "title": title_of(question), **luck_words(luck)}


class Lucks:
    """Chances of luck that were computed, by the digest of the quiz and the question; one at a time."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Luck] = {}
        self._computing = Lock()

    def of(self, keyed: _Keyed, question: Question, *, compute: bool) -> Luck | None:
        """The chance at an exercise; None if it is not known and not to be computed."""
        at = (keyed.digest, question.id)
        if at in self._known or not compute:
            return self._known.get(at)
        with self._computing:
            if at not in self._known:
                if len(self._known) >= LUCKS_MAX:
                    self._known.clear()
                self._known[at] = estimate_luck(question, keyed.library.model_xml, keyed.library.text)
            return self._known[at]


lucks = Lucks()


@lru_cache(maxsize=64)
def _certified(keyed: _Keyed) -> tuple[dict[str, Any], ...]:
    return tuple(
        {
            "quiz": one.quiz,
            "question": one.question.id,
            "title": f"{title_of(one.question)}: {short_title(None, one.key.text)}"
            if one.key.place
            else title_of(one.question),
            **words(one.key, one.certificate),
        }
        for one in certify_quizzes(keyed.library, [keyed.quiz])
    )


def title_of(question: Question) -> str:
    """The title of a question, or its first words."""
    return short_title(question.title or question.label, question.q)


def luck_words(luck: Luck | None) -> dict[str, Any]:
    """Returns a chance of luck as cells of the table."""
    if luck is None:
        return {"state": "guessing not computed", "tone": "", "why": "", "told": [], "remarks": ()}
    why, remarks = luck_told(luck)
    state = (
        {"state": "cannot be guessed", "tone": "ok"} if luck.why is None else {"state": "can be guessed", "tone": "no"}
    )
    return {**state, "why": why, "told": [], "remarks": remarks}


def words(key: AnswerKey, certificate: Certificate | None) -> dict[str, Any]:
    """Returns a certificate as cells of the table; without one, whether there could be one."""
    if certificate is None:
        remarks = (UNVERIFIED,) if is_decidable(key) else ()
        return {"state": "not derivable by simulation", "tone": "", "why": "", "told": [], "remarks": remarks}
    return {
        "state": "certified" if certificate.ok else "refused",
        "tone": "ok" if certificate.ok else "no",
        "why": "" if certificate.ok else certificate.why,
        "told": told(key, certificate),
        "remarks": certificate.remarks,
    }
