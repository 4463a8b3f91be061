"""Loads a content folder, and collects the faults of all its files."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from grader.domain.lab import Lab, UnknownLab
from grader.domain.pages.media import Media
from grader.domain.run import SOURCE_BYTES_MAX
from grader.errors import ContentError, Fault, NotFound
from grader.library.authors_jail import run_in_authors_jail
from grader.library.checking.mjcf import flatten, inline_faults, model_faults
from grader.library.checking.passed import NOTHING_PASSED, PassedChecks
from grader.library.checking.schema import name_parts, read_quiz
from grader.library.checking.semantics import (
    drop_comments,
    lab_warnings,
    of_unknown_kind,
    prose_warnings,
    question_warnings,
    read_starter,
    semantic_faults,
    unknown_models,
)
from grader.library.files import MODEL_BYTES_MAX, QUIZ_BYTES_MAX, list_files, list_unread_files, read_text
from grader.library.json_text import json_faults
from grader.library.lesson_ids import rank_quiz
from grader.library.media import find_named_media, place_media, read_media
from grader.library.quiz_files import list_quiz_files, parse_quiz
from grader.library.quiz_source import QuizSource
from grader.library.snapshot import Library, compute_digest
from grader.questions import Question, Quiz, kind_of

if TYPE_CHECKING:
    from grader.library.lesson_text import LessonText


@dataclass
class _Loading:
    """The files read so far, with faults and warnings; `compiled` are the models that MuJoCo accepts."""

    root: Path
    passed: PassedChecks
    only: str | None = None
    question: str | None = None
    faults: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    media: dict[str, Media] = field(default_factory=dict)
    models: dict[str, str] = field(default_factory=dict)
    compiled: dict[str, str] = field(default_factory=dict)
    starters: dict[str, str] = field(default_factory=dict)
    texts: dict[str, str] = field(default_factory=dict)
    quizzes: dict[str, Quiz] = field(default_factory=dict)
    lessons: "dict[str, LessonText]" = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)
    digests: dict[str, str] = field(default_factory=dict)
    sources: dict[str, dict[str, str | bytes]] = field(default_factory=dict)


def load(
    root: Path, only: str | None = None, passed: PassedChecks = NOTHING_PASSED, question: str | None = None
) -> Library:
    """Load quizzes/*.json and *.md, lessons/*.md, models/*.xml, images/, files/ and the starters that the quizzes name,
    below `root`.
    Raises ContentError with all faults of all files; lessons are read once the rest has none. With `only`, the library
    holds that quiz alone: all files are read, but neither labs nor exercises of other quizzes are tried, which takes
    most of the time; nor is what has `passed` before. With a `question` of it the labs of its other questions are not
    tried either, and nothing is remarked on."""
    loading = _Loading(root, passed, only, question)
    loading.media, faults, loading.warnings = read_media(root)
    loading.faults += [*list_unread_files(root), *faults]
    _load_models(loading)
    names = list_quiz_files(root)
    if not names:
        lacks = (
            f"no quiz in {root.name or root}: is this a content folder?"
            if root.is_dir()
            else f"there is no folder {root}"
        )
        loading.faults.append(Fault("quizzes", "*.json", f"{lacks} (GRADER_CONTENT or GRADER_COURSES names it)"))
    for name in names:
        _load_quiz(loading, name)
    loading.quizzes = {name: loading.quizzes[name] for name in sorted(loading.quizzes, key=rank_quiz)}
    if only is None and not loading.faults:  # a lesson names quizzes, which must be whole
        _load_lessons(loading)
    if loading.faults:
        raise ContentError(sorted({(fault.file, fault.key): fault for fault in reversed(loading.faults)}.values()))
    parts = ("quizzes", "lessons", "media", "files", "models", "starters", "texts", "digests", "sources")
    frozen: dict[str, Any] = {name: MappingProxyType(getattr(loading, name)) for name in parts}
    return Library(root, **frozen, warnings=tuple(sorted(loading.warnings)))


def load_files(files: Mapping[str, str | bytes], passed: PassedChecks = NOTHING_PASSED) -> Library:
    """Loads content of these texts and pictures by path, such as the `sources` of a quiz. Raises ContentError."""
    with TemporaryDirectory(prefix="grader-content-") as folder:
        for path, body in files.items():
            place = Path(folder, path)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(body.encode() if isinstance(body, str) else body)
        return load(Path(folder), passed=passed)


def _load_models(loading: _Loading) -> None:
    for file in list_files(loading.root, "models", "*.xml"):
        xml = read_text(loading.root, file, MODEL_BYTES_MAX)
        if isinstance(xml, Fault):
            loading.faults.append(xml)
            continue
        name = Path(file).stem
        whole = flatten(xml, file, partial(read_text, loading.root, bytes_max=MODEL_BYTES_MAX))
        loading.models[name] = whole if isinstance(whole, str) else xml
        faults = model_faults(whole, file) if isinstance(whole, str) else whole
        loading.faults += faults
        if not faults:
            loading.compiled[name] = loading.models[name]


def _load_quiz(loading: _Loading, file: str) -> None:
    text = read_text(loading.root, file, QUIZ_BYTES_MAX)
    source = QuizSource(None, (text,)) if isinstance(text, Fault) else parse_quiz(text, file)
    if isinstance(text, Fault) or source.faults:
        loading.faults += source.faults
        return
    if not isinstance(source.raw, dict):
        loading.faults.append(Fault(file, "whole file", 'must be an object: {"id", "title", "questions": [...]}'))
        return
    faults, warnings = len(loading.faults), len(loading.warnings)
    _load_source(loading, file, text, source.raw, source.starters)
    loading.faults[faults:] = map(source.add_line, loading.faults[faults:])
    loading.warnings[warnings:] = map(source.add_line, loading.warnings[warnings:])


def _load_source(loading: _Loading, file: str, text: str, raw: dict[str, Any], own: Mapping[str, str]) -> None:
    """Loads what the file of a quiz says; `own` are the starters that stand in it."""
    media = find_named_media(raw, loading.media)
    place_media(raw, media)
    drop_comments(raw)
    parsed = read_quiz(raw, file)
    known = [(key, part) for key, part in name_parts(raw) if not of_unknown_kind(part)]
    refused = [fault for key, part in known for fault in inline_faults(part, file, key)]
    loading.faults += [*parsed.faults, *_raw_faults(loading, raw, file, own), *refused]
    keys = [fault.key for fault in refused]
    if loading.only not in (None, raw.get("id")):
        return
    tried = [p for p in (*parsed.questions, *parsed.labs) if not any(key.startswith(f"{p.id}.") for key in keys)]
    named: dict[str, str] = {}
    text_of = partial(_read_into, named, loading.root)
    if loading.question is not None:  # an exercise names texts, which are part of the quiz's digest
        tried = [part for part in tried if part.id == loading.question or _is_exercise(part)]
    if any(map(_is_exercise, tried)):
        from grader.exercises import use_jail  # a quiz without exercises is loaded without it

        use_jail(run_in_authors_jail, loading.passed)
    loading.faults += semantic_faults(tried, loading.compiled, text_of, file, loading.passed)
    loading.texts |= named
    if parsed.quiz is None:
        return
    quiz_id = parsed.quiz.id
    if quiz_id in loading.quizzes:
        loading.faults.append(
            Fault(file, "id", f"{quiz_id!r} is also the id of {loading.files[quiz_id]}: give each its own")
        )
    _keep(loading, parsed.quiz, file, raw)
    starters = _starters(loading, parsed.quiz)
    models = {f"models/{name}.xml": xml for name, xml in loading.models.items()}
    pictures = {path: medium.sha256 for path, medium in media.items()}
    loading.digests[quiz_id] = compute_digest({file: text}, loading.models, starters, named, pictures)
    beside = {path: starter for path, starter in starters.items() if path not in own}
    loading.sources[quiz_id] = {
        file: text, **models, **beside, **named, **{path: medium.body for path, medium in media.items()},
    }  # fmt: skip


def _is_exercise(part: Question | Lab | UnknownLab) -> bool:
    return isinstance(part, Question) and kind_of(part).is_script


def _load_lessons(loading: _Loading) -> None:
    from grader.library.lesson_text import LESSON_BYTES_MAX, read_lesson  # a single quiz is loaded without lessons

    for file in list_files(loading.root, "lessons", "*.md"):
        text = read_text(loading.root, file, LESSON_BYTES_MAX)
        if isinstance(text, Fault):
            loading.faults.append(text)
            continue
        lesson, faults, remarks = read_lesson(text, file, loading.quizzes, loading.media)
        loading.lessons[lesson.id] = lesson
        loading.faults += faults
        loading.warnings += remarks


def _read_into(texts: dict[str, str], root: Path, path: str) -> str:
    """Return the text of a file that an exercise names, and keep it in `texts`. Raises NotFound."""
    text = read_text(root, path, SOURCE_BYTES_MAX)
    if isinstance(text, Fault):
        raise NotFound(f"{path!r} {text.why}")
    texts[path] = text
    return text


def _raw_faults(loading: _Loading, raw: dict[str, Any], file: str, own: Mapping[str, str]) -> Iterator[Fault]:
    """Faults that are found in the JSON itself, whether or not the question is valid."""
    for key, part in name_parts(raw):
        yield from json_faults(part, file, key)
        yield from unknown_models(part, loading.models, file, key)
        starter, faults = read_starter(loading.root, part, file, key, own)
        if starter is not None:
            loading.starters[part["starter"]] = starter
        yield from faults


def _keep(loading: _Loading, quiz: Quiz, file: str, raw: dict[str, Any]) -> None:
    loading.quizzes[quiz.id] = quiz
    loading.files[quiz.id] = file
    if loading.question is not None:
        return
    loading.warnings.extend(
        loading.passed.run(  # reading the TeX of a course takes longer than all else
            "prose",
            [file, json.dumps(raw)],
            lambda _: [fault for key, part in name_parts(raw) for fault in prose_warnings(part, file, key)],
            text_of=partial(_read_into, {}, loading.root),
            write=lambda remarks: [asdict(remark) for remark in remarks],
            read=lambda stored: [Fault(**remark) for remark in stored],
        )
    )
    loading.warnings.extend((*question_warnings(quiz, file), *lab_warnings(quiz, file)))


def _starters(loading: _Loading, quiz: Quiz) -> dict[str, str]:
    """Returns the starters of a quiz, by path."""
    wanted = {kind_of(question).starter(question) for question in quiz.questions}
    return {name: text for name, text in loading.starters.items() if name in wanted}
