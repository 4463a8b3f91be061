"""Begins content: a folder, a quiz, and questions and labs that pass the check at once, for their author to change."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import chain, count
from pathlib import Path
from typing import Any

from grader.errors import Conflict, ContentError, Fault, NotFound, Unprocessable
from grader.exercises import load_kinds
from grader.labs import lab_kinds
from grader.library.checking.semantics import list_named_models
from grader.library.files import QUIZ_BYTES_MAX, list_files, read_text
from grader.library.json_schema import build_quiz_schema
from grader.library.markdown import write_lab, write_markdown, write_question
from grader.library.quiz_files import is_markdown, list_quiz_files, parse_quiz
from grader.library.quiz_source import QuizSource
from grader.questions import FORMS, Quiz, installed_kinds
from grader.settings import default_content

SCHEMA = "quiz.schema.json"

FIRST_QUIZ = "1.1-check"


@dataclass(frozen=True)
class SampleQuestion:
    """A question that passes the check: its JSON, the files that it needs by path, and a script that is right where
    it asks for one."""

    question: Mapping[str, Any]
    files: Mapping[str, bytes] = field(default_factory=dict)
    right: bytes | None = None


def begin_course(root: Path, *, as_markdown: bool = False) -> list[Path]:
    """Makes a content folder with one quiz of one question, and the schema for editors. Returns the files. Raises
    Conflict where there is content already."""
    if (root / "quizzes").exists():
        raise Conflict(f"{root / 'quizzes'} is there already: name a new folder")
    return begin_quiz(root, FIRST_QUIZ, "Knowledge check", as_markdown=as_markdown)


def begin_quiz(root: Path, quiz: str, title: str, *, as_markdown: bool = False) -> list[Path]:
    """Makes a quiz of one question, as JSON or Markdown. Returns the files. Raises Conflict where its file is there,
    and Unprocessable for a name that is no id."""
    if there := next((file for file in list_quiz_files(root) if Path(file).stem == quiz), None):
        raise Conflict(f"{root / there} is there already: add to it, or choose another id")
    written = begin_empty_quiz(root, quiz, title, as_markdown=as_markdown)
    add_question(root, quiz, "mcq")
    return written


def begin_empty_quiz(root: Path, quiz: str, title: str, *, as_markdown: bool = False) -> list[Path]:
    """Makes a quiz without questions, and the schema for editors. Returns the files. Raises Unprocessable for a name
    that is no id."""
    require_id(quiz)
    if as_markdown:
        return write_files(root, {f"quizzes/{quiz}.md": write_markdown({"id": quiz, "title": title}).encode()})
    schema = {} if (root / SCHEMA).exists() else {SCHEMA: f"{json.dumps(build_quiz_schema(), indent=1)}\n".encode()}
    document = {"$schema": f"../{SCHEMA}", "id": quiz, "title": title, "questions": []}
    return write_files(root, {**schema, f"quizzes/{quiz}.json": write_json(document).encode()})


def add_question(root: Path, quiz: str, kind: str) -> list[Path]:
    """Adds a question of a kind to a quiz, named as QUIZ or QUIZ/ID. Returns the files that were written. Raises
    NotFound, Conflict."""
    return add_to_quiz(root, quiz, find_sample(kind), "Knowledge check")


def add_exercise(root: Path, quiz: str, kind: str) -> list[Path]:
    """Adds an exercise of a kind to a quiz, named as QUIZ or QUIZ/ID, with a reference program that is right. Returns
    the files that were written. Raises NotFound, Conflict."""
    return add_to_quiz(root, quiz, find_exercise(kind), "Exercises")


def add_to_quiz(root: Path, named: str, sample: SampleQuestion, title: str) -> list[Path]:
    """Adds a question to a quiz, named as QUIZ or QUIZ/ID; begins a quiz that is not there. A question that is named
    names its starter and its program too. Returns the files that were written. Raises as `add_sample`."""
    quiz, slash, id_ = named.partition("/")
    if slash:
        require_id(id_)
        sample = name_sample(sample, id_)
    try:
        _, document = find_quiz(root, quiz)
    except NotFound:
        as_markdown = any(map(is_markdown, list_quiz_files(root)))
        begun, document = begin_empty_quiz(root, quiz, title, as_markdown=as_markdown), {}
    else:
        begun = []
    if slash and choose_id(id_, document.get("questions", [])) != id_:
        raise Conflict(f"{quiz} has a question {id_!r} already: choose another id")
    try:
        added = add_sample(root, quiz, sample)
    except Conflict:
        for file in begun:  # an empty quiz is of no use
            file.unlink()
        raise
    return list(dict.fromkeys((*begun, *added)))


def add_lab(root: Path, quiz: str, kind: str) -> list[Path]:
    """Adds a lab of a kind to a quiz. Returns the files that were written. Raises NotFound, Conflict."""
    kinds = lab_kinds()
    if kind not in kinds:
        raise NotFound(f"There is no kind of lab {kind!r}; the kinds are {', '.join(kinds)}.")
    example = kinds[kind].example()
    file, document = find_quiz(root, quiz)
    labs = document.setdefault("labs", [])
    lab = {"id": choose_id(kind, labs), **example.lab, "kind": kind}
    written = write_files(root, {path: text.encode() for path, text in example.files.items()})
    if is_markdown(file):  # labs stand before the first question
        text = (root / file).read_text(encoding="utf-8")
        head, mark, rest = text.partition("\n## ")
        text = f"{head.rstrip()}\n\n{write_lab(lab)}\n{mark}{rest}"
    else:
        labs.append(lab)
        text = write_json(document)
    (root / file).write_text(text, encoding="utf-8")
    return [root / file, *written]


def find_sample(kind: str) -> SampleQuestion:
    """Returns a question of a kind. Raises NotFound."""
    kinds = installed_kinds()
    if kind not in kinds:
        raise NotFound(f"There is no kind of question {kind!r}; the kinds are {', '.join(kinds)}.")
    example = kinds[kind].example()
    right = example.answers[0][0]["source"].encode() if kinds[kind].is_script else None
    files = {path: text.encode() for path, text in example.files.items()}
    return SampleQuestion({**example.question, "kind": kind}, files, right)


def find_exercise(kind: str) -> SampleQuestion:
    """Returns an exercise of a kind: the example of scripts, one of the content that the grader brings along, or that
    of the kind. Raises NotFound."""
    samples = collect_exercises()
    if kind not in samples:
        known = ", ".join(sorted(samples))
        raise NotFound(f"There is no example of an exercise of the kind {kind!r}; there are examples of {known}.")
    return samples[kind]


def collect_exercises() -> dict[str, SampleQuestion]:
    """Returns an exercise of each kind of which there is an example, by kind."""
    samples = dict[str, SampleQuestion]()
    for sample in (*list_scripts(), *list_shipped(), *list_examples()):
        samples.setdefault(sample.question["check"]["kind"], sample)
    return samples


@cache
def list_exercise_kinds() -> tuple[str, ...]:
    """Returns the kinds of exercise of which there is an example."""
    return tuple(sorted(collect_exercises()))


def list_scripts() -> Iterator[SampleQuestion]:
    """Yields the examples of the kinds of question that ask for a script."""
    return (find_sample(name) for name, kind in installed_kinds().items() if kind.is_script)


def list_shipped() -> Iterator[SampleQuestion]:
    """Yields the exercises of the content that the grader brings along."""
    ours = default_content()
    for file in list_files(ours, "quizzes", "*.json"):
        quiz = json.loads((ours / file).read_text(encoding="utf-8"))
        for question in quiz.get("questions", ()):
            programs = list_files(ours, f"reference_solutions/{quiz['id']}/{question.get('id')}", "correct__*.*")
            if programs:
                models = {f"models/{name}.xml" for _, name in list_named_models(question, "")}
                check = question["check"]
                named = [mistake["program"] for mistake in check.get("mistakes", ())]
                named += [check[key] for key in ("reference", "program") if key in check]
                named += [question["starter"]] if "starter" in question else []
                *files, right = ((path, (ours / path).read_bytes()) for path in [*sorted(models), *named, programs[0]])
                yield SampleQuestion(question, dict(files), right[1])


def list_examples() -> Iterator[SampleQuestion]:
    """Yields the examples of the kinds that have one, such as those of other packages."""
    for name, kind in load_kinds().items():
        if (example := kind.example()) is not None:
            question = {"id": name, "kind": "code", **example.question}
            files = {path: text.encode() for path, text in example.files.items()}
            yield SampleQuestion(question, files, example.right.encode())


def name_sample(sample: SampleQuestion, id_: str) -> SampleQuestion:
    """Returns a sample whose question has this id, with a function of that name, where it is one, and with its starter
    and its program in files of that name. The starter says how a learner runs it, who gets it as a module."""
    if (entry := sample.question.get("entry")) and (function := re.sub(r"\W", "_", id_)).isidentifier():
        sample = rename(sample, entry, function)
    question = {**sample.question, "id": id_, "check": dict(sample.question.get("check", {}))}
    files = dict(sample.files)
    for part, key in ((question, "starter"), (question["check"], "program")):
        if (path := part.get(key)) in files:
            part[key] = str(Path(path).with_name(id_ + Path(path).suffix))
            body = files.pop(path)
            called = f"python {id_.replace('-', '_')}.py".encode()
            files[part[key]] = body.replace(f"python {Path(path).name}".encode(), called)
    if not question["check"]:
        del question["check"]
    return SampleQuestion(question, files, sample.right)


def rename(sample: SampleQuestion, old: str, new: str) -> SampleQuestion:
    """Returns a sample whose entry has another name, also in texts, wherever arguments follow it: the same word stands
    for other things too, such as the form of a controller."""
    called = re.compile(rf"\b{re.escape(old)}(?=\()")
    question = json.loads(called.sub(new, json.dumps(sample.question))) | {"entry": new}
    texts = {path: body if path.startswith("models/") else called.sub(new, body.decode()).encode()
             for path, body in sample.files.items()}  # fmt: skip
    return SampleQuestion(question, texts, sample.right and called.sub(new, sample.right.decode()).encode())


def add_sample(root: Path, quiz: str, sample: SampleQuestion) -> list[Path]:
    """Adds a question to a quiz, with an id that no other has. Returns the files that were written. Raises NotFound
    without such a quiz, ContentError where its file cannot be read, and Conflict where another text is in a file."""
    file, document = find_quiz(root, quiz)
    named = sample.question.get("id") or sample.question["kind"]
    questions = document.setdefault("questions", [])
    id_ = choose_id(named, questions)
    question = {"id": id_, **{key: value for key, value in sample.question.items() if key != "id"}}
    suffix = FORMS[sample.question.get("takes", "python")].suffix
    program = f"reference_solutions/{quiz}/{id_}/correct__example{suffix}"
    right = {} if sample.right is None else {program: sample.right}
    written = write_files(root, {**sample.files, **right})
    if right:
        (root / "models").mkdir(exist_ok=True)  # which scripts may read; without it no script runs
    if is_markdown(file):
        text = f"{(root / file).read_text(encoding='utf-8').rstrip()}\n\n{write_question(question)}\n"
    else:
        questions.append(question)
        text = write_json(document)
    (root / file).write_text(text, encoding="utf-8")
    return [root / file, *written]


def require_id(name: str) -> None:
    """Raises Unprocessable for a name that is no id."""
    try:
        Quiz.model_validate({"id": name, "title": name})
    except ValueError as error:
        raise Unprocessable(
            f"{name!r} is no id: 1 to 64 letters, digits, dots, dashes and underscores, such as 2.1-check"
        ) from error


def choose_id(named: str, parts: list[Any]) -> str:
    """Returns an id that no other question or lab has."""
    taken = {part.get("id") for part in parts if isinstance(part, dict)}
    names = chain([named], (f"{named}-{number}" for number in count(2)))
    return next(name for name in names if name not in taken)


def find_quiz(root: Path, quiz: str) -> tuple[str, dict[str, Any]]:
    """Returns the file of a quiz and what it says. Raises NotFound, and ContentError where a file cannot be read."""
    for file in list_quiz_files(root):
        text = read_text(root, file, QUIZ_BYTES_MAX)
        source = QuizSource(None, (text,)) if isinstance(text, Fault) else parse_quiz(text, file)
        if source.faults:
            raise ContentError(source.faults)
        document = source.raw
        if not isinstance(document, dict) or document.get("id") != quiz:
            continue
        if all(isinstance(document.get(name, []), list) for name in ("questions", "labs")):
            return file, document
    raise NotFound(f"There is no quiz {quiz!r} in {root}; `grader new lesson {quiz}` makes one.")


def write_files(root: Path, files: Mapping[str, bytes]) -> list[Path]:
    """Writes files that are not there yet, and returns them. Raises Conflict where another one is there."""
    missing = {root / path: body for path, body in files.items() if not (root / path).exists()}
    for path, body in files.items():
        if root / path not in missing and (root / path).read_bytes() != body:
            cure = "rename it first" if path.startswith("models/") else "choose another id, or rename it first"
            raise Conflict(f"{root / path} is there already, and is another one: {cure}")
    for place, body in missing.items():
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(body)
    return list(missing)


def write_json(document: Mapping[str, Any]) -> str:
    """Returns a quiz as its file holds it."""
    return json.dumps(document, ensure_ascii=False, indent=2) + "\n"
