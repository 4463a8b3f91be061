"""Load a content folder; every fault of every file is told at once."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from grader.domain.quiz import Quiz
from grader.errors import ContentError, Fault
from grader.library.crossings import (
    number_warnings,
    prose_warnings,
    read_starter,
    unknown_models,
)
from grader.library.files import MODEL_BYTES_MAX, QUIZ_BYTES_MAX, list_files, read_text
from grader.library.json_text import json_faults, parse_json
from grader.library.library import Library, digest_of
from grader.library.meaning import meaning_faults
from grader.library.mjcf import inline_faults, model_faults
from grader.library.schema import named_parts, read_quiz


@dataclass
class _Loading:
    """What has been read so far, and what was wrong with it."""

    root: Path
    faults: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    models: dict[str, str] = field(default_factory=dict)
    compiled: dict[str, str] = field(default_factory=dict)
    starters: dict[str, str] = field(default_factory=dict)
    quizzes: dict[str, Quiz] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)


def load(root: Path) -> Library:
    """The content folder `root` with quizzes/*.json, models/*.xml and the starters that the quizzes name.

    Raises ContentError with every fault of every file: file, key, why and cure.
    """
    now = _Loading(root)
    _load_models(now)
    names = list_files(root, "quizzes", "*.json")
    if not names:
        now.faults.append(Fault("quizzes", "*.json", f"no quiz in {root.name or root}: is this a content folder?"))
    for name in names:
        _load_quiz(now, name)
    if now.faults:
        raise ContentError(sorted({(fault.file, fault.key): fault for fault in reversed(now.faults)}.values()))
    return Library(
        root=root,
        quizzes=MappingProxyType(now.quizzes),
        files=MappingProxyType(now.files),
        models=MappingProxyType(now.models),
        starters=MappingProxyType(now.starters),
        digests=MappingProxyType(now.digests),
        warnings=tuple(sorted(now.warnings)),
    )


def _load_models(now: _Loading) -> None:
    for file in list_files(now.root, "models", "*.xml"):
        xml = read_text(now.root, file, MODEL_BYTES_MAX)
        if isinstance(xml, Fault):
            now.faults.append(xml)
            continue
        name = Path(file).stem
        now.models[name] = xml
        faults = model_faults(xml, file)
        now.faults += faults
        if not faults:
            now.compiled[name] = xml


def _load_quiz(now: _Loading, file: str) -> None:
    text = read_text(now.root, file, QUIZ_BYTES_MAX)
    raw = text if isinstance(text, Fault) else parse_json(text, file)
    if isinstance(text, Fault) or isinstance(raw, Fault):
        now.faults.append(text if isinstance(text, Fault) else raw)
        return
    if not isinstance(raw, dict):
        now.faults.append(Fault(file, "whole file", 'must be an object: {"id", "title", "questions": [...]}'))
        return
    reading = read_quiz(raw, file)
    refused = [fault for key, part in named_parts(raw) for fault in inline_faults(part, file, key)]
    now.faults += [*reading.faults, *_outside_faults(now, raw, file), *refused]
    keys = [fault.key for fault in refused]
    tried = [p for p in (*reading.questions, *reading.labs) if not any(key.startswith(f"{p.id}.") for key in keys)]
    now.faults += meaning_faults(tried, now.compiled, file)
    if reading.quiz is None:
        return
    quiz_id = reading.quiz.id
    if quiz_id in now.quizzes:
        now.faults.append(Fault(file, "id", f"{quiz_id!r} is also the id of {now.files[quiz_id]}: give each its own"))
    _keep(now, reading.quiz, file, text, raw)


def _outside_faults(now: _Loading, raw: dict[str, Any], file: str) -> Iterator[Fault]:
    """Faults that can be seen in the JSON as it stands, even where the rest of a question is wrong."""
    for key, part in named_parts(raw):
        yield from json_faults(part, file, key)
        yield from unknown_models(part, now.models, file, key)
        starter, faults = read_starter(now.root, part, file, key)
        if starter is not None:
            now.starters[part["starter"]] = starter
        yield from faults


def _keep(now: _Loading, quiz: Quiz, file: str, text: str, raw: dict[str, Any]) -> None:
    now.quizzes[quiz.id] = quiz
    now.files[quiz.id] = file
    wanted = {getattr(question, "starter", None) for question in quiz.questions}
    starters = {name: text for name, text in now.starters.items() if name in wanted}
    now.digests[quiz.id] = digest_of({file: text}, now.models, starters)
    for key, part in named_parts(raw):
        now.warnings.extend(prose_warnings(part, file, key))
    now.warnings.extend(number_warnings(quiz, file))
