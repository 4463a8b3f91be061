"""What a real class hands in: a quiz with every kind of question that is installed, and answers as learners give them.

The questions are the examples of the kinds. About half of the answers are choices, a third are typed numbers, of which
half have never been typed before, and the others order, match or write.
"""

import json
import shutil
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

from grader.questions import AnyKind, installed_kinds
from grader.settings import Settings

QUIZ = "class"

WEIGHTS = {"mcq": 7, "predict": 2, "numeric": 6}
"""How often a kind is answered beside the others, which are answered once."""

NEW_NUMBERS = 0.5
"""The share of typed numbers that nobody has typed before."""

SPELLINGS = ("{0:.4g}", "{0:.4g} s", "{1:.4g} ms", "{1:.5g}ms", "T = {0:.4g} s", "about {0:.3g}", "{0:.3e}", "-{0:.4g}")
"""How people type a time: it is given in seconds and in milliseconds."""


@cache
def list_kinds() -> Mapping[str, AnyKind]:
    """Returns the installed kinds whose answers are graded at once, by the id of their question."""
    kinds: dict[AnyKind, str] = {}
    for name, kind in installed_kinds().items():
        if not kind.is_script:
            kinds.setdefault(kind, name)
    return {name: kind for kind, name in kinds.items()}


def write_class(folder: Path) -> None:
    """Writes the quiz into a content folder, with the models and the files that its questions need."""
    shutil.copytree(Settings().content / "models", folder / "models")
    questions = []
    for name, kind in list_kinds().items():
        example = kind.example()
        questions.append({"id": name, **example.question})
        for path, text in example.files.items():
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_text(text, encoding="utf-8")
    (folder / "quizzes").mkdir(exist_ok=True)
    quiz = {"id": QUIZ, "title": "A class", "questions": questions}
    (folder / "quizzes" / f"{QUIZ}.json").write_text(json.dumps(quiz), encoding="utf-8")


def make_answers(random: Random) -> Iterator[tuple[str, Any]]:
    """Yields question and answer, without end. Refused answers are left out: a page says so before they are sent."""
    kinds = list_kinds()
    readable = {name: list_readable(kind) for name, kind in kinds.items()}
    weights = [WEIGHTS.get(name, 1) for name in kinds]
    while True:
        (name,) = random.choices(list(kinds), weights)
        answer = random.choice(readable[name])
        if name == "numeric" and random.random() < NEW_NUMBERS:
            answer = type_number(random)
        elif name == "numbers" and random.random() < NEW_NUMBERS:
            answer = {field: type_number(random) if field == "T" else typed for field, typed in answer.items()}
        elif name == "open":
            answer = f"{answer} I think so because of {random.random():.6f}."
        yield name, answer


def list_readable(kind: AnyKind) -> Sequence[Any]:
    """Returns the answers of a kind's example that can be read."""
    return [answer for answer, status in kind.example().answers if status != "invalid_answer"]


def type_number(random: Random) -> str:
    """Returns a period near the right one or off by a slip, as somebody types it."""
    value = 2.22845 * random.choice((1.0, 1.0, 0.5, 2.0, 0.1)) * random.uniform(0.98, 1.02)
    return random.choice(SPELLINGS).format(value, 1000 * value)
