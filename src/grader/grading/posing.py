"""Poses questions with drawn numbers: which numbers a learner has, and the key of their case by simulation."""

import hmac
from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any, cast

from grader.library import Library
from grader.questions import Question
from grader.questions.drawing import Drawable, draw_numbers, is_drawn

SEED_BITS = 53
"""Integers up to 2**53 are exact in every JSON reader. Source: RFC 8259, section 6."""

POSED_MAX, SHOWN_MAX = 2000, 500
"""Questions with their keys, and libraries of learners, that are kept."""


def derive_seed(secret: bytes, learner: str, quiz: str, question: str) -> int:
    """Returns the seed of a learner's numbers at a question: the first 53 bits of HMAC-SHA256. It stays the same over
    attempts, restarts and servers with the same secret."""
    message = "\0".join(("draw", learner, quiz, question)).encode()
    return int.from_bytes(hmac.digest(secret, message, "sha256")[:8], "big") >> (64 - SEED_BITS)


class Poser:
    """Poses the questions of one content. Threads may share it."""

    def __init__(self, library: Library, secret: bytes) -> None:
        self.library, self._secret = library, secret
        every = (question for quiz in library.quizzes.values() for question in quiz.questions)
        self.has_draws = any(map(is_drawn, every))
        """Whether any question of the content is drawn."""
        self.pose = lru_cache(POSED_MAX)(self._pose)
        self._library_of = lru_cache(SHOWN_MAX)(self._make_library)

    def seed_of(self, learner: str, quiz: str, question: str) -> int:
        """Returns the seed of a learner's numbers at a question."""
        return derive_seed(self._secret, learner, quiz, question)

    def library_of(self, learner: str) -> Library:
        """Returns the content as a learner sees it, without the keys of their numbers; the content itself where nothing
        is drawn, and for nobody."""
        return self._library_of(learner) if self.has_draws and learner else self.library

    def draws_of(self, quiz: str, question: str, seed: int) -> Mapping[str, float]:
        """Returns the numbers of a learner."""
        return draw_numbers(cast(Drawable, self.library.question(quiz, question)).draw, seed)

    def _pose(self, quiz: str, question: str, seed: int) -> Question:
        """Returns the question of a learner with the key of their own case. Takes as long as a few simulations. Raises
        NoKey."""
        from grader.certify.drawn import settle  # it simulates; most questions are posed without

        base, numbers = self.library.question(quiz, question), self.draws_of(quiz, question, seed)
        return settle(base, numbers, self.library.model_xml)

    def _make_library(self, learner: str) -> Library:
        quizzes = dict(self.library.quizzes)
        for name, quiz in self.library.quizzes.items():
            if any(map(is_drawn, quiz.questions)):
                seen = tuple(self._show(name, question, learner) for question in quiz.questions)
                quizzes[name] = quiz.model_copy(update={"questions": seen})
        return replace(self.library, quizzes=quizzes)

    def _show(self, quiz: str, question: Any, learner: str) -> Any:
        if not is_drawn(question):
            return question
        return question.with_numbers(self.draws_of(quiz, question.id, self.seed_of(learner, quiz, question.id)))
