"""Certifies the answer keys of whole quizzes: for a check of the content, and before it is served."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from grader.certify import Certificate, certify_key
from grader.errors import Fault
from grader.library import Library
from grader.questions import AnswerKey, Question, kind_of

ACCEPT = "or write why the key holds as verify.accept"


@dataclass(frozen=True)
class Certified:
    """A key of a question of a quiz, and its certificate; None if physics cannot decide it."""

    quiz: str
    question: Question
    key: AnswerKey
    certificate: Certificate | None


def certify_quizzes(library: Library, quizzes: Iterable[str]) -> Iterator[Certified]:
    """Certifies every key of these quizzes."""
    for quiz in quizzes:
        for question in library.quiz(quiz).questions:
            for key in kind_of(question).answer_keys(question):
                yield Certified(quiz, question, key, certify_key(key, library.model_xml))


def find_refused_keys(library: Library, quizzes: Iterable[str]) -> Iterator[Fault]:
    """Yields a fault for each key that simulation refutes, or cannot tell and the author has not accepted."""
    for one in certify_quizzes(library, quizzes):
        if one.certificate is not None and not one.certificate.is_publishable:
            yield build_fault(library, one.quiz, one.question, one.certificate)


def build_fault(library: Library, quiz: str, question: Question, certificate: Certificate) -> Fault:
    """Returns the fault of a key that may not be published: file, field and why, with a cure."""
    cure = "" if certificate.verdict == "refuted" or certificate.method == "verify" else f"; {ACCEPT}"
    why = f"{certificate.verdict}: {certificate.why}{cure}"
    return Fault(library.file(quiz), f"{question.id}.{certificate.key}", why)
