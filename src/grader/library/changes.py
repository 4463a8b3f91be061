"""What a content folder changes, question by question, beside the content that is in use."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from grader.library.checking.semantics import named_models
from grader.library.snapshot import Library
from grader.questions import Question, Quiz

ADDED, REMOVED, CHANGED = "added", "removed", "changed"

SILENT = frozenset({"q", "title", "label", "explain", "whys", "reference", "sim", "starter"})
"""Keys of a question whose change alters no verdict: texts, and what is shown beside them."""


@dataclass(frozen=True)
class Change:
    """What happens to a question or lab, or to a whole quiz or the text of a lesson where `part` is empty: one of
    ADDED, REMOVED and CHANGED. `quiz` is empty for the text of a lesson, which `lesson` names.
    `keys` are the author's keys that differ, with `models` and `programs` for files of theirs. `is_silent`: no verdict
    can differ."""

    quiz: str
    part: str
    how: str
    keys: tuple[str, ...] = ()
    is_question: bool = True
    lesson: str = ""

    @property
    def is_silent(self) -> bool:
        """Whether no verdict can differ."""
        return self.how == CHANGED and SILENT.issuperset(self.keys)


def list_changes(before: Library, after: Library) -> list[Change]:
    """Returns what differs, in the order of the quizzes: first those of `after`, then those that are gone, then the
    texts of lessons."""
    return [
        *(change for quiz in after.quizzes.values() for change in _compare_quiz(quiz, before, after)),
        *(Change(quiz, "", REMOVED) for quiz in before.quizzes if quiz not in after.quizzes),
        *_compare_lessons(before, after),
    ]


def _compare_lessons(before: Library, after: Library) -> Iterator[Change]:
    for lesson in {**after.lessons, **before.lessons}:
        old, new = before.lessons.get(lesson), after.lessons.get(lesson)
        if old != new:
            yield Change("", "", ADDED if old is None else REMOVED if new is None else CHANGED, lesson=lesson)


def _compare_quiz(quiz: Quiz, before: Library, after: Library) -> Iterator[Change]:
    old = before.quizzes.get(quiz.id)
    if old is None:
        yield Change(quiz.id, "", ADDED)
        return
    if before.digests.get(quiz.id) == after.digests.get(quiz.id):
        return
    own = _differing(_dump_own(old), _dump_own(quiz))
    ids, olds = ([part.id for part in one.questions] for one in (quiz, old))
    if ids != olds and set(ids) == set(olds):
        own = (*own, "order of the questions")
    if own:
        yield Change(quiz.id, "", CHANGED, own)
    for parts, before_parts, is_question in ((quiz.questions, old.questions, True), (quiz.labs, old.labs, False)):
        yield from _compare_parts(quiz.id, before_parts, parts, before, after, is_question=is_question)


def _compare_parts(
    quiz: str, olds: Sequence[Any], parts: Sequence[Any], before: Library, after: Library, *, is_question: bool
) -> Iterator[Change]:
    known = {part.id: part for part in olds}
    for part in parts:
        old = known.pop(part.id, None)
        if old is None:
            yield Change(quiz, part.id, ADDED, is_question=is_question)
        elif keys := (
            *_differing(old.model_dump(mode="json"), part.model_dump(mode="json")),
            *_differing_files(old, part, before, after),
        ):
            yield Change(quiz, part.id, CHANGED, keys, is_question)
    yield from (Change(quiz, part, REMOVED, is_question=is_question) for part in known)


def _dump_own(quiz: Quiz) -> dict[str, Any]:
    """Returns what a quiz says beside its questions and labs."""
    return quiz.model_dump(mode="json", exclude={"questions", "labs"})


def _differing(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(name for name in {**old, **new} if old.get(name) != new.get(name))


def _differing_files(old: Any, part: Any, before: Library, after: Library) -> Iterator[str]:
    """Yields which files of a question or lab differ: its starter, the models and programs that it names."""
    if isinstance(part, Question) and before.starter(old) != after.starter(part):
        yield "starter"
    dumped = part.model_dump()
    if any(before.models.get(name) != after.models.get(name) for _, name in named_models(dumped, "")):
        yield "models"
    if any(before.texts.get(text) != after.texts.get(text) for text in _list_texts(dumped)):
        yield "programs"


def _list_texts(value: Any) -> Iterator[str]:
    """Yields every text in nested JSON."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for inner in value.values():
            yield from _list_texts(inner)
    elif isinstance(value, Sequence):
        for inner in value:
            yield from _list_texts(inner)
