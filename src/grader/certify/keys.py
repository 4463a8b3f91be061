"""Certifies the answer keys of whole quizzes: for a check of the content, and before it is served."""

from collections.abc import Iterable, Iterator

from grader.certify import Certificate, certify_question
from grader.domain.quiz import Question
from grader.errors import Fault
from grader.library import Library


def certificates_of(library: Library, quizzes: Iterable[str]) -> Iterator[tuple[str, Question, Certificate | None]]:
    """Every question of these quizzes, with its quiz and its certificate; None if physics cannot decide the key."""
    for quiz in quizzes:
        for question in library.quiz(quiz).questions:
            yield quiz, question, certify_question(question, library.model_xml)


def refused_keys(library: Library, quizzes: Iterable[str]) -> Iterator[Fault]:
    """A fault for each key of these quizzes that simulation refuses."""
    for quiz, question, certificate in certificates_of(library, quizzes):
        if certificate is not None and not certificate.ok:
            yield refusal(library, quiz, question, certificate)


def refusal(library: Library, quiz: str, question: Question, certificate: Certificate) -> Fault:
    """The fault of a refused key: file, field and why."""
    return Fault(library.file(quiz), f"{question.id}.{certificate.key}", certificate.why)
