"""What a content folder changes, question by question, beside the content that is in use."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from grader.library.checking.semantics import list_named_models
from grader.library.edits import Edit, is_reordered, join_path, list_edits
from grader.library.lesson_text import Heading, LessonText, Placement
from grader.library.snapshot import Library
from grader.questions import Question, Quiz, kind_of

ADDED, REMOVED, CHANGED = "added", "removed", "changed"
ORDER = "order of the questions"
SAME_RIGHT = "the same texts are right"
OTHER_RIGHT = "other texts are right"

SILENT = frozenset({"q", "title", "label", "explain", "whys", "reference", "sim", "starter"})
"""Keys of a question whose change alters no verdict: texts, and what is shown beside them."""
OF_PERSONS = frozenset({"rubric"})
"""Keys whose change alters only what persons have decided, which no regrade touches."""


@dataclass(frozen=True)
class Change:
    """What happens to a question or lab, or to a whole quiz or the text of a lesson where `part` is empty: one of
    ADDED, REMOVED and CHANGED. `quiz` is empty for the text of a lesson, which `lesson` names.
    `keys` are the author's keys that differ, with `models` and `programs` for files of theirs.
    `edits` are the old and new values of what is changed."""

    quiz: str
    part: str
    how: str
    keys: tuple[str, ...] = ()
    is_question: bool = True
    lesson: str = ""
    edits: tuple[Edit, ...] = field(default=(), compare=False)

    @property
    def is_for_regrade(self) -> bool:
        """Whether verdicts of the grader on a question can differ."""
        return self.how == CHANGED and self.is_question and bool(self.part) and bool({*self.keys} - SILENT - OF_PERSONS)


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
        if old is None or new is None:
            yield Change("", "", ADDED if old is None else REMOVED, lesson=lesson)
        elif old != new:
            edits = tuple(list_edits(_dump_lesson(old), _dump_lesson(new)))
            yield Change("", "", CHANGED, lesson=lesson, edits=edits)


def _dump_lesson(lesson: LessonText) -> dict[str, Any]:
    """Returns the text of a lesson, paragraph by paragraph."""
    text: list[str] = []
    for part in lesson.parts:
        if isinstance(part, Placement):
            text.append(f"{part.quiz} {part.lab}".strip())
        else:
            text += [part.html] if isinstance(part, Heading) else part.blocks
    return {"title": lesson.title, "text": text, "source": lesson.source}


def _compare_quiz(quiz: Quiz, before: Library, after: Library) -> Iterator[Change]:
    old = before.quizzes.get(quiz.id)
    if old is None:
        yield Change(quiz.id, "", ADDED)
        return
    if before.digests.get(quiz.id) == after.digests.get(quiz.id):
        return
    own = _differing(_dump_own(old), _dump_own(quiz))
    edits = tuple(list_edits(_dump_own(old), _dump_own(quiz)))
    ids, olds = ([part.id for part in version.questions] for version in (quiz, old))
    if ids != olds and set(ids) == set(olds):
        own = (*own, ORDER)
        edits = (*edits, Edit(ORDER, ", ".join(olds), ", ".join(ids)))
    if own:
        yield Change(quiz.id, "", CHANGED, own, edits=edits)
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
            continue
        was, now = _dump_part(old), _dump_part(part)
        keys, files = _differing(was, now), tuple(_differing_files(old, part, before, after))
        if keys or files:
            own = _list_own_edits((old, was), (part, now), keys)
            edits = (*own, *(edit for _, some in files for edit in some))
            yield Change(quiz, part.id, CHANGED, (*keys, *(key for key, _ in files)), is_question, edits=edits)
    yield from (Change(quiz, part, REMOVED, is_question=is_question) for part in known)


def _dump_own(quiz: Quiz) -> dict[str, Any]:
    """Returns what a quiz says beside its questions and labs."""
    return quiz.model_dump(mode="json", exclude={"questions", "labs"})


def _dump_part(part: Any) -> dict[str, Any]:
    """Returns what an author says of a question or lab; of drawn numbers the names, in place of the middle."""
    dump: dict[str, Any] = part.model_dump(mode="json")
    template = dump.pop("template", "")
    return dump | (json.loads(template) if template else {})


def _list_own_edits(
    old: tuple[Any, Mapping[str, Any]], new: tuple[Any, Mapping[str, Any]], keys: Sequence[str]
) -> Iterator[Edit]:
    """Yields what differs in the keys of a question or lab, given with what its author says of it. Where options have
    changed places, it is said whether those that are right are the same, as an unchanged `answer` names others then."""
    (_, was), (_, now) = old, new
    rights, rights_now = _list_right(old[0]), _list_right(new[0])
    is_moved = bool(rights) and is_reordered(was.get("options"), now.get("options"))
    for key in keys if "answer" in keys or not is_moved else (*keys, "answer"):
        before, after = _show_options(*old, key), _show_options(*new, key)
        if key == "answer" and is_moved:
            yield Edit(key, "", SAME_RIGHT if rights == rights_now else OTHER_RIGHT)
            if rights == rights_now:
                continue
        yield from list_edits(before, after, key)


def _list_right(part: Any) -> list[str]:
    """Returns the texts of the right options of a question, in an order that tells nothing; none of a lab."""
    options = kind_of(part).options(part) if isinstance(part, Question) else ()
    return sorted(option.text for option in options if option.is_right)


def _show_options(part: Any, dump: Mapping[str, Any], key: str) -> Any:
    """Returns a value of a question; a key that names options with their texts."""
    value = dump.get(key)
    options = kind_of(part).options(part) if key == "answer" and isinstance(part, Question) else ()
    if isinstance(value, int) and value < len(options):
        return f"{value}, “{options[value].text}”"
    if isinstance(value, list) and all(isinstance(index, int) and index < len(options) for index in value):
        return [f"{index}, “{options[index].text}”" for index in value]
    return value


def _differing(old: Mapping[str, Any], new: Mapping[str, Any]) -> tuple[str, ...]:
    return tuple(name for name in {**old, **new} if old.get(name) != new.get(name))


def _differing_files(old: Any, part: Any, before: Library, after: Library) -> Iterator[tuple[str, list[Edit]]]:
    """Yields which files of a question or lab differ, with what differs in them: its starter, the models and programs
    that it names."""
    if isinstance(part, Question) and before.starter(old) != after.starter(part):
        yield "starter", list(list_edits(before.starter(old), after.starter(part), "starter"))
    dumped = part.model_dump()
    named = [name for _, name in list_named_models(dumped, "")]
    if models := _compare_texts("models", named, before.models, after.models):
        yield "models", models
    if programs := _compare_texts("programs", _list_texts(dumped), before.texts, after.texts):
        yield "programs", programs


def _compare_texts(key: str, names: Iterable[str], olds: Mapping[str, str], news: Mapping[str, str]) -> list[Edit]:
    """Returns what differs in the files of these names."""
    each = (list_edits(olds.get(name), news.get(name), join_path(key, name)) for name in dict.fromkeys(names))
    return [edit for some in each for edit in some]


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
