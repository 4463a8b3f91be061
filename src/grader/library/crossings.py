"""What a quiz needs from outside its own file: models that exist, starters that can be run."""

import ast
import re
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from grader.domain.quiz import NumericQuestion, Quiz
from grader.domain.run import SOURCE_BYTES_MAX
from grader.errors import Fault
from grader.grading.units import known_unit
from grader.library.files import read_text
from grader.library.json_text import join

PROSE = ("q", "title", "options", "explain", "reference", "note")
"""Keys of texts that are shown with TeX between dollar signs."""

DOLLAR = re.compile(r"(?<!\\)\$")


def unknown_models(raw: Any, models: Mapping[str, str], file: str, key: str) -> Iterator[Fault]:
    """Every model that is named in a question or lab and is no file of models/."""
    for place, name in named_models(raw, key):
        if name not in models:
            yield Fault(file, place, f"there is no models/{name}.xml: take one of {', '.join(sorted(models))}")


def named_models(raw: Any, key: str) -> Iterator[tuple[str, str]]:
    """Key and value of every `model`, and of every entry of `models`, at any depth."""
    if isinstance(raw, list):
        for index, item in enumerate(raw):
            yield from named_models(item, join(key, index))
    elif isinstance(raw, dict):
        for name, item in raw.items():
            if name == "model" and isinstance(item, str):
                yield join(key, name), item
            elif name == "models" and isinstance(item, list):
                yield from ((join(key, name, index), one) for index, one in enumerate(item) if isinstance(one, str))
            elif not name.startswith("x-"):
                yield from named_models(item, join(key, name))


def read_starter(root: Path, raw: Any, file: str, key: str) -> tuple[str | None, list[Fault]]:
    """The text of a question's starter, if it has one, and what is wrong with it."""
    name = raw.get("starter") if isinstance(raw, dict) else None
    if not isinstance(name, str):
        return None, []
    place = join(key, "starter")
    if not name.endswith(".py"):
        return None, [Fault(file, place, f"{name!r} must be a .py file of the content folder")]
    source = read_text(root, name, SOURCE_BYTES_MAX)
    if isinstance(source, Fault):
        return None, [
            Fault(file, place, f"{name!r} {source.why}" if source.key == "path" else f"{name!r}: {source.why}")
        ]
    entry = raw.get("entry")
    try:
        defined = top_level_names(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = getattr(error, "lineno", None)
        return source, [Fault(name, f"line {line}", f"not valid Python: {getattr(error, 'msg', error)}")]
    if isinstance(entry, str) and entry not in defined:
        return source, [Fault(file, place, f"{name!r} does not define {entry!r}, the entry of this exercise")]
    return source, []


def top_level_names(source: str) -> set[str]:
    """The functions that a script defines. Raises SyntaxError and what else the parser may."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        tree = ast.parse(source)
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def prose_warnings(raw: Any, file: str, key: str) -> Iterator[Fault]:
    """Texts with an odd number of dollar signs."""
    for place, text in prose(raw, key):
        if len(DOLLAR.findall(text)) % 2:
            yield Fault(file, place, "an odd number of $ signs: TeX stands between two; write \\$ for a dollar")


def number_warnings(quiz: Quiz, file: str) -> Iterator[Fault]:
    """Units and tolerances that accept less than an author may think."""
    for question in quiz.questions:
        if not isinstance(question, NumericQuestion):
            continue
        if question.unit and known_unit(question.unit) is None:
            yield Fault(file, join(question.id, "unit"), f"{question.unit!r} is no known unit: nothing is converted")
        if question.tolerance == 0 and question.tol is None:
            yield Fault(file, join(question.id, "tol"), "2 % of 0 is 0: give tol, or only an exact 0 is right")


def prose(raw: Any, key: str) -> Iterator[tuple[str, str]]:
    """Key and value of every text that a student may see."""
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for name, item in items:
        if not isinstance(item, str):
            yield from prose(item, join(key, name))
        elif name in PROSE or (isinstance(raw, list) and key.endswith("options")):
            yield join(key, name), item
