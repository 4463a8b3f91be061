"""Checks beyond the schema: models exist, starters define their entry, labs run, exercises can be planned."""

import ast
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

from grader.domain.lab import Lab, LabConfig, UnknownLab
from grader.domain.pages.prose import remove_comments
from grader.domain.run import SOURCE_BYTES_MAX
from grader.errors import Fault, NotFound
from grader.labs import lab_kind_of, lab_kinds, name_lab_kind
from grader.library.checking.passed import PassedChecks
from grader.library.checking.prose_remarks import list_prose_remarks
from grader.library.files import read_text
from grader.library.json_text import join_key
from grader.questions import ModelXml, Question, Quiz, kind_of
from grader.questions.drawing import list_unknown_names

if TYPE_CHECKING:
    from grader.exercises import TextOf

PROSE = ("q", "title", "options", "explain", "reference", "note")
"""Keys of texts that are shown with TeX between dollar signs."""

PROSE_LISTS = re.compile(r"(?:^|\.)(?:options|whys|items|extra|pairs\.[0-9]+)$")
"""Where a list of such texts stands."""

LABELS = re.compile(r"(?:^|\.)fields\.[0-9]+\.label$")


def unknown_models(raw: Any, models: Mapping[str, str], file: str, key: str) -> Iterator[Fault]:
    """Yield a fault for every model that a question or lab names and that is not in models/."""
    for at, name in list_named_models(raw, key) if not of_unknown_kind(raw) else ():
        if name not in models:
            bare = PurePosixPath(name).stem
            near = get_close_matches(name, models, n=1)
            names = f"take one of {', '.join(sorted(models))}" if models else "add it, there is no model yet"
            others = f"did you mean {near[0]!r}?" if near else names
            cure = f"write {bare!r}, without folder and .xml" if bare in models else others
            yield Fault(file, at, f"there is no models/{name}.xml: {cure}")


def of_unknown_kind(raw: Any) -> bool:
    """Says whether a part of a quiz is a lab of an unknown kind, whose keys are not read."""
    return isinstance(raw, dict) and "q" not in raw and name_lab_kind(raw) not in lab_kinds()


def list_named_models(raw: Any, key: str) -> Iterator[tuple[str, str]]:
    """Key and value of every `model`, and of every entry of `models`, at any depth."""
    if isinstance(raw, list):
        for index, item in enumerate(raw):
            yield from list_named_models(item, join_key(key, index))
    elif isinstance(raw, dict):
        for name, item in raw.items():
            if name == "model" and isinstance(item, str):
                yield join_key(key, name), item
            elif name == "models" and isinstance(item, list):
                named = [part[0] if isinstance(part, list) and part else part for part in item]
                yield from (
                    (join_key(key, name, index), model) for index, model in enumerate(named) if isinstance(model, str)
                )
            elif not name.startswith("x-"):
                yield from list_named_models(item, join_key(key, name))


def read_starter(root: Path, raw: Any, file: str, key: str, own: Mapping[str, str]) -> tuple[str | None, list[Fault]]:
    """Returns the text of a question's starter, or None, and its faults. It is one of the file's `own`, by path, or a
    file of the content folder."""
    name = raw.get("starter") if isinstance(raw, dict) else None
    if not isinstance(name, str):
        return None, []
    at = join_key(key, "starter")
    is_model = raw.get("takes") == "mjcf"  # beside a question that takes a file stands a script that writes it
    suffix = ".xml" if is_model else ".py"
    if not name.endswith(suffix):
        return None, [Fault(file, at, f"{name!r} must be a {suffix} file of the content folder")]
    source = own[name] if name in own else read_text(root, name, SOURCE_BYTES_MAX)
    if isinstance(source, Fault):
        return None, [Fault(file, at, f"{name!r} {source.why}" if source.key == "path" else f"{name!r}: {source.why}")]
    return source, [] if is_model else [
        *find_undefined_entry(source, raw, file, at)
    ]  # a model may be broken on purpose


def find_undefined_entry(source: str, raw: Mapping[str, Any], file: str, at: str) -> Iterator[Fault]:
    """Yields a fault for a starter that is no Python, or does not define the question's entry."""
    name, entry = raw["starter"], raw.get("entry")
    try:
        defined = _top_level_names(source)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        line = getattr(error, "lineno", None)
        yield Fault(name, f"line {line}", f"not valid Python: {getattr(error, 'msg', error)}")
        return
    if isinstance(entry, str) and entry not in defined:
        yield Fault(file, at, f"{name!r} does not define {entry!r}, the entry of this exercise")


def _top_level_names(source: str) -> set[str]:
    """Returns the functions that a script defines. Raises what `ast.parse` may raise."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        tree = ast.parse(source)
    return {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def prose_warnings(raw: Any, file: str, key: str) -> Iterator[Fault]:
    """Yield a warning for each part of a text that a page does not show as it was meant."""
    for parts, name, at in _list_prose(raw, key):
        yield from (Fault(file, at, why) for why in list_prose_remarks(parts[name]))


def drop_comments(raw: Any) -> None:
    """Takes the comments of HTML out of every text that a learner may see: an author's notes are no feedback, and pages
    do not show them. Lists and objects are changed in place."""
    for parts, name, _ in _list_prose(raw, ""):
        parts[name] = remove_comments(parts[name])


def question_warnings(quiz: Quiz, file: str) -> Iterator[Fault]:
    """Yields what may surprise the authors of questions."""
    for question in quiz.questions:
        for key, why in kind_of(question).warnings(question):
            yield Fault(file, join_key(question.id, key), why)
        for key, name in list_unknown_names(question):
            why = f"{{{name}}} is shown as it stands: `draw` has {', '.join(getattr(question, 'draw', ()))}"
            yield Fault(file, join_key(question.id, key), why)


def lab_warnings(quiz: Quiz, file: str) -> Iterator[Fault]:
    """Yields a warning for every lab of an unknown kind, and what may surprise the authors of others."""
    labs: dict[str, Lab | LabConfig | UnknownLab] = {lab.id: lab for lab in quiz.labs}
    for question in quiz.questions:
        if (simulation := kind_of(question).lab(question)) is not None:
            labs[join_key(question.id, "sim")] = simulation
    for key, lab in labs.items():
        if isinstance(lab, UnknownLab):
            yield Fault(file, join_key(key, "kind"), unknown_kind(lab.kind))
        else:
            yield from (Fault(file, join_key(key, at), why) for at, why in lab_kind_of(lab).warnings(lab))


def unknown_kind(kind: str) -> str:
    """Returns the remark on a lab of an unknown kind."""
    near = get_close_matches(kind, lab_kinds(), n=1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    return f"there is no lab {kind!r}{meant}: learners see a placeholder; the kinds are {', '.join(lab_kinds())}"


def _list_prose(raw: Any, key: str) -> Iterator[tuple[Any, Any, str]]:
    """Yields the list or object, the name in it and the key of every text that a learner may see."""
    items = raw.items() if isinstance(raw, dict) else enumerate(raw) if isinstance(raw, list) else ()
    for name, item in items:
        if not isinstance(item, str):
            yield from _list_prose(item, join_key(key, name))
        elif name in PROSE or (isinstance(raw, list) and PROSE_LISTS.search(key)) or is_html(item, join_key(key, name)):
            yield raw, name, join_key(key, name)


def is_html(text: str, key: str) -> bool:
    """Whether a text is HTML by its key, or by the pictures that it shows, as that of a kind of another package."""
    return LABELS.search(key) is not None or "<img " in text


def semantic_faults(
    parts: Iterable[Question | Lab | UnknownLab],
    models: Mapping[str, str],
    text_of: "TextOf",
    file: str,
    passed: PassedChecks,
) -> Iterator[Fault]:
    """Yield faults of the questions and labs whose models are all in `models`, which compile."""
    for part in parts:
        for fault in passed.run(
            "part",
            list_inputs(part, models),
            lambda text_of, part=part: [*_part_faults(part, models, text_of)],  # type: ignore[misc]
            text_of=text_of,
            write=lambda faults: None if faults else [],
            read=list,
        ):
            yield replace(fault, file=file, why=" ".join(fault.why.split()))


def list_inputs(part: Question | Lab | UnknownLab, models: Mapping[str, str]) -> list[str]:
    """Returns the JSON of a question or lab, and name and text of each model that it names."""
    named = {name for _, name in list_named_models(part.model_dump(), "")}
    return [part.model_dump_json(), *(text for name in sorted(named) for text in (name, models.get(name, "")))]


def _part_faults(part: Question | Lab | UnknownLab, models: Mapping[str, str], text_of: "TextOf") -> Iterator[Fault]:
    """Faults of one question or lab."""

    def model_xml(name: str) -> str:
        if name not in models:
            raise NotFound(f"There is no model {name!r}.")
        return models[name]

    if isinstance(part, Lab):
        yield from _lab_faults(part, models, model_xml, part.id)
    elif isinstance(part, Question):
        yield from _question_faults(part, models, model_xml, text_of)


def _question_faults(
    question: Question, models: Mapping[str, str], model_xml: ModelXml, text_of: "TextOf"
) -> Iterator[Fault]:
    """Faults of one question: those of its kind, its exercise and its lab."""
    kind = kind_of(question)
    for key, why in kind.faults(question):
        yield Fault("", join_key(question.id, key), why)
    if kind.is_script and {name for _, name in list_named_models(question.model_dump(), "")} <= set(models):
        from grader.exercises import check_exercise  # not needed to grade another answer

        yield from check_exercise(question, model_xml, "", text_of)
    if (lab := kind.lab(question)) is not None:
        yield from _lab_faults(lab, models, model_xml, join_key(question.id, "sim"))
    keys = kind.answer_keys(question)
    for answer in keys:
        if answer.verify is not None:
            from grader.library.checking.verify_texts import list_verify_faults  # it compiles expressions

            yield from list_verify_faults(answer, model_xml, question.id)
    if question.verify is not None and all(key.place for key in keys):
        cure = f"move it to {' or '.join(key.place for key in keys)}" if keys else "remove it"
        yield Fault("", join_key(question.id, "verify"), f"{question.kind} has no key to derive again: {cure}")


def _lab_faults(lab: Lab | LabConfig, models: Mapping[str, str], model_xml: ModelXml, key: str) -> Iterator[Fault]:
    """Faults of one lab, whose models must compile; their `file` is empty."""
    if {name for _, name in list_named_models(lab.model_dump(), "")} <= {*models, ""}:
        yield from lab_kind_of(lab).check(lab, key, model_xml)
