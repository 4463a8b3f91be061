"""Makes the table of answer keys on the instructor page: derives each again by simulation."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from threading import Lock
from typing import Any

import structlog

from grader.certify import Certificate
from grader.certify.keys import bound_luck, certify_quizzes
from grader.certify.remarks import UNVERIFIED, Luck, is_decidable
from grader.errors import GraderError
from grader.library import NOTHING_PASSED, Library, PassedChecks
from grader.questions import AnswerKey, Question, kind_of
from grader.web.text.certificates import describe_luck, word_key
from grader.web.text.questions import shorten_title
from grader.web.verdict.key_plot import draw_key

LUCKS_MAX = 1000
"""Chances of luck that are kept."""

FAILED = (
    "Whether a fixed answer passes is not known. Answers are graded all the same: mend what is named here, or tell "
    "the author of the kind. The log has the details."
)

log = structlog.get_logger()


@dataclass(frozen=True)
class _Keyed:
    """A quiz of a library; equal to another where its content is."""

    digest: str
    quiz: str
    library: Library = field(compare=False)
    passed: PassedChecks = field(compare=False)


def list_certificates(
    library: Library, passed: PassedChecks = NOTHING_PASSED, *, with_luck: bool = False
) -> list[dict[str, Any]]:
    """Returns a row for every question with an answer key, and for every exercise. Those of a quiz are derived again
    when its content changes and they have not `passed` before. The chance of luck at an exercise takes seconds: it is
    computed `with_luck` alone, and told again as long as the quiz stays the same."""
    every = [_Keyed(library.digest(quiz), quiz, library, passed) for quiz in library.quizzes]
    return [row for keyed in every for row in list_rows(keyed, with_luck)]


def list_rows(keyed: _Keyed, with_luck: bool) -> Iterator[dict[str, Any]]:
    """Yields the rows of one quiz, in the order of its questions."""
    certified = _certified(keyed)
    for question in keyed.library.quiz(keyed.quiz).questions:
        yield from (row for row in certified if row["question"] == question.id)
        if kind_of(question).is_script:
            cells = list_luck_cells(keyed, question, with_luck)
            yield {"quiz": keyed.quiz, "question": question.id, "title": choose_title(question), **cells}


def list_luck_cells(keyed: _Keyed, question: Question, with_luck: bool) -> dict[str, Any]:
    """Returns the chance of luck at an exercise as cells of the table, or why its kind cannot tell it."""
    try:
        return word_luck(lucks.find(keyed, question, compute=with_luck))
    except (GraderError, ValueError) as error:
        log.exception("no chance of luck", quiz=keyed.quiz, question=question.id)
        return {"state": "cannot be computed", "tone": "no", "why": f"{error}.", "facts": [], "remarks": (FAILED,)}


class Lucks:
    """Chances of luck that were computed, by the digest of the quiz and the question; one at a time."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Luck] = {}
        self._computing = Lock()

    def find(self, keyed: _Keyed, question: Question, *, compute: bool) -> Luck | None:
        """Returns the chance at an exercise; None if it is not known and not to be computed."""
        at = (keyed.digest, question.id)
        if at in self._known or not compute:
            return self._known.get(at)
        with self._computing:
            if at not in self._known:
                if len(self._known) >= LUCKS_MAX:
                    self._known.clear()
                self._known[at] = bound_luck(keyed.library, question, keyed.passed)
            return self._known[at]


lucks = Lucks()


@lru_cache(maxsize=64)
def _certified(keyed: _Keyed) -> tuple[dict[str, Any], ...]:
    return tuple(
        {
            "quiz": certified.quiz,
            "question": certified.question.id,
            "title": f"{choose_title(certified.question)}: {shorten_title(None, certified.key.text)}"
            if certified.key.place
            else choose_title(certified.question),
            **word_certificate(certified.key, certified.certificate),
        }
        for certified in certify_quizzes(keyed.library, [keyed.quiz], keyed.passed)
    )


def choose_title(question: Question) -> str:
    """Returns the title of a question, or its first words."""
    return shorten_title(question.title or question.label, question.q)


def word_luck(luck: Luck | None) -> dict[str, Any]:
    """Returns a chance of luck as cells of the table."""
    if luck is None:
        return {"state": "guessing not computed", "tone": "", "why": "", "facts": [], "remarks": ()}
    why, remarks = describe_luck(luck)
    state = (
        {"state": "cannot be guessed", "tone": "ok"} if luck.why is None else {"state": "can be guessed", "tone": "no"}
    )
    return {**state, "why": why, "facts": [], "remarks": remarks}


def word_certificate(key: AnswerKey, certificate: Certificate | None) -> dict[str, Any]:
    """Returns a certificate as cells of the table; without one, whether there could be one."""
    if certificate is None:
        remarks = (UNVERIFIED,) if is_decidable(key) else ()
        return {"state": "not derivable by simulation", "tone": "", "why": "", "facts": [], "remarks": remarks}
    accepted = f"Accepted: {certificate.accepted} Simulation cannot tell: " if certificate.accepted else ""
    return {
        "state": certificate.verdict,
        "tone": {"certified": "ok", "refuted": "no", "cannot tell": ""}[certificate.verdict],
        "why": "" if certificate.ok else f"{accepted}{certificate.why}",
        "facts": word_key(key, certificate),
        "remarks": certificate.remarks,
        "figure": draw_key(certificate.to_json()),
    }
