"""Checks a content folder: it loads, its keys are certified, its reference programs get their statuses."""

import zlib
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grader.certify import certify_question
from grader.domain.quiz import CodeQuestion
from grader.domain.run import SOURCE_BYTES_MAX
from grader.domain.verdict import Status
from grader.errors import CallerError, ContentError, Fault, InvalidAnswer, NotFound
from grader.exercises import chance_of_luck, lazy_answers
from grader.library import Library, load
from grader.library.files import list_files, read_text
from grader.pipeline import Pipeline

POINTS_ROUNDING = 1e-6
"""Rounding of shares of points."""

Say = Callable[[str], None]


@dataclass
class Report:
    """The results of a check; it passed if there are no `faults`."""

    faults: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    certificates: list[dict[str, Any]] = field(default_factory=list)
    references: list[dict[str, Any]] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, faults as {"file", "key", "why"}."""
        return {
            "ok": not self.faults,
            "faults": [vars(fault) for fault in self.faults],
            "warnings": [vars(fault) for fault in self.warnings],
            "certificates": self.certificates,
            "references": self.references,
        }


def content_root(path: Path) -> Path:
    """Return the content folder that is or contains `path`. Raises ContentError if there is none."""
    for folder in (path.resolve(), *path.resolve().parents):
        if (folder / "quizzes").is_dir():
            return folder
    raise ContentError([Fault(str(path), "-", "no content folder here: a folder with quizzes/ and models/ inside")])


def check_content(path: Path, pipeline_for: Callable[[Library], AbstractContextManager[Pipeline]], say: Say) -> Report:
    """Load the content folder of `path`, certify its keys, and grade its reference programs.

    A path inside the folder restricts certificates and reference programs to those below it. `pipeline_for` opens a
    pipeline, with its jail, for a library.
    """
    report = Report()
    try:
        library = load(content_root(path))
    except ContentError as error:
        report.faults.extend(error.faults)
        return report
    report.warnings.extend(library.warnings)
    exercises = list(find_exercises(library, path.resolve()))
    report.faults.extend(
        fault for quiz_id, question in exercises for fault in luck_faults(library, quiz_id, question, say)
    )
    certify_library(library, path.resolve(), report, say)
    found = [item for item in find_references(library.root) if within(library.root / item.file, path.resolve())]
    report.faults.extend(item for item in found if isinstance(item, Fault))
    references = [item for item in found if isinstance(item, ReferenceProgram)]
    if references or exercises:
        with pipeline_for(library) as pipeline:
            grade_references(pipeline, references, report, say)
            for quiz_id, question in exercises:
                report.faults.extend(grade_lazy_answers(pipeline, quiz_id, question, say))
    report.faults.sort()
    return report


def within(path: Path, folder: Path) -> bool:
    """Whether `path` is `folder` or below it."""
    return path.is_relative_to(folder)


def certify_library(library: Library, path: Path, report: Report, say: Say) -> None:
    """Certify every key that physics can decide; a refused key is a fault."""
    chosen = (quiz for quiz in library.quizzes.values() if within(library.root / library.file(quiz.id), path))
    for quiz in chosen:
        for question in quiz.questions:
            certificate = certify_question(question, library.model_xml)
            if certificate is None:
                continue
            say(f"{quiz.id} {question.id}: key {'certified' if certificate.ok else 'REFUSED'}")
            report.certificates.append({"quiz": quiz.id, "question": question.id, **certificate.to_json()})
            file = library.file(quiz.id)
            report.warnings.extend(Fault(file, f"{question.id}.answer", remark) for remark in certificate.remarks)
            if not certificate.ok:
                report.faults.append(Fault(file, f"{question.id}.{certificate.key}", certificate.why))


def find_exercises(library: Library, path: Path) -> Iterator[tuple[str, CodeQuestion]]:
    """Yields every exercise of the quizzes under `path`, with the quiz's id."""
    for quiz in library.quizzes.values():
        if within(library.root / library.file(quiz.id), path):
            yield from ((quiz.id, question) for question in quiz.questions if isinstance(question, CodeQuestion))


def grade_lazy_answers(pipeline: Pipeline, quiz_id: str, question: CodeQuestion, say: Say) -> Iterator[Fault]:
    """Yields a fault for every script that does not solve the exercise and earns too many points."""
    library = pipeline.library
    starter = read_text(library.root, question.starter, SOURCE_BYTES_MAX) if question.starter else None
    own = starter if isinstance(starter, str) else None
    for lazy in lazy_answers(question, library.model_xml, own, library.text):
        verdict = pipeline.grade(quiz_id, question.id, {"source": lazy.source})
        say(f"{quiz_id} {question.id}: {lazy.name} earns {verdict.points:g}, at most {lazy.points_max:g}")
        if verdict.points > lazy.points_max + POINTS_ROUNDING:
            why = f"{lazy.name} earns {verdict.points:g} points, and may earn {lazy.points_max:g} at most"
            cure = "give hidden cases other numbers or more points"
            yield Fault(library.file(quiz_id), f"{question.id}.check", f"{why}: {cure}")


def luck_faults(library: Library, quiz_id: str, question: CodeQuestion, say: Say) -> Iterator[Fault]:
    """Yields a fault if an answer that ignores its inputs is too likely to be right in every case."""
    chance, allowed = chance_of_luck(question, library.model_xml, library.text)
    say(f"{quiz_id} {question.id}: a fixed answer passes with a chance of at most {chance:.1e}; {allowed:g} is allowed")
    if chance > allowed:
        why = f"a fixed answer is right in every case with a chance of {chance:.1e}; {allowed:g} is allowed"
        if chance == 1:
            why += "; no case draws a number, or the kind does not say what it accepts (Kind.accepted)"
        cure = "draw more numbers, from wider ranges, or raise `luck` and say why in `x-luck`"
        yield Fault(library.file(quiz_id), f"{question.id}.check.luck", f"{why}: {cure}")


@dataclass(frozen=True)
class ReferenceProgram:
    """A file reference_solutions/<quiz>/<question>/<status>__<why>.py; `file` is relative to the root."""

    file: str
    source: str
    quiz: str
    question: str
    status: str
    diagnosis: str | None


def find_references(root: Path) -> Iterator[ReferenceProgram | Fault]:
    """Yield every reference program, or the fault of its file. A first line `# diagnosis: ...` requires it."""
    for file in list_files(root, "reference_solutions", "*/*/*.py"):
        source = read_text(root, file, SOURCE_BYTES_MAX)
        if isinstance(source, Fault):
            yield source
            continue
        first = source.partition("\n")[0]
        diagnosis = first.removeprefix("# diagnosis:").strip() if first.startswith("# diagnosis:") else None
        _, quiz, question, name = Path(file).parts
        yield ReferenceProgram(file, source, quiz, question, Path(name).stem.partition("__")[0], diagnosis)


def grade_references(pipeline: Pipeline, references: list[ReferenceProgram], report: Report, say: Say) -> None:
    """Grade every reference program; a wrong status or diagnosis is a fault."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        for reference, outcome in zip(references, pool.map(lambda r: grade_one(pipeline, r), references), strict=True):
            say(f"{reference.file}: {outcome['got']}")
            report.references.append({"file": reference.file, "expected": reference.status, **outcome})
            report.faults.extend(Fault(reference.file, reference.status, why) for why in mismatches(reference, outcome))


def grade_one(pipeline: Pipeline, reference: ReferenceProgram) -> dict[str, Any]:
    """Grade a reference program, seeded by the name of its file; return status and diagnosis."""
    seed = zlib.crc32(reference.file.encode())
    try:
        verdict = pipeline.grade(reference.quiz, reference.question, {"source": reference.source}, seed)
    except (CallerError, InvalidAnswer) as error:
        return {"got": "not found" if isinstance(error, NotFound) else "no verdict", "diagnosis": str(error)}
    return {"got": verdict.status.value, "diagnosis": verdict.diagnosis}


def mismatches(reference: ReferenceProgram, outcome: dict[str, Any]) -> Iterable[str]:
    """Yield each difference between the outcome and what the reference program requires."""
    if reference.status not in set(Status):
        yield f"the name must begin with a status: {', '.join(Status)}"
    elif outcome["got"] != reference.status:
        yield f"graded {outcome['got']} ({outcome['diagnosis']})"
    elif reference.diagnosis and reference.diagnosis not in (outcome["diagnosis"] or ""):
        yield f"diagnosis is {outcome['diagnosis']!r}, not {reference.diagnosis!r}"
