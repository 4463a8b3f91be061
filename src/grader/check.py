"""What must hold of a content folder: it loads, its keys are what physics says, its references grade true."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grader.certify import certify_question
from grader.domain.run import SOURCE_BYTES_MAX
from grader.domain.verdict import Status
from grader.errors import CallerError, ContentError, Fault, InvalidAnswer, NotFound
from grader.library import Library, load
from grader.library.files import list_files, read_text
from grader.pipeline import Pipeline

Say = Callable[[str], None]


@dataclass
class Report:
    """What was found; `faults` empty means that all holds."""

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
    """The content folder that `path` is or lies in. Raises ContentError where there is none."""
    for folder in (path.resolve(), *path.resolve().parents):
        if (folder / "quizzes").is_dir():
            return folder
    raise ContentError([Fault(str(path), "-", "no content folder here: a folder with quizzes/ and models/ inside")])


def check_content(path: Path, pipeline_for: Callable[[Library], AbstractContextManager[Pipeline]], say: Say) -> Report:
    """Load the folder that `path` lies in, certify its keys, grade its reference solutions.

    A path inside the folder narrows certificates and references to what lies under it; `pipeline_for` brings the jail.
    """
    report = Report()
    try:
        library = load(content_root(path))
    except ContentError as error:
        report.faults.extend(error.faults)
        return report
    report.warnings.extend(library.warnings)
    certify_library(library, path.resolve(), report, say)
    found = [item for item in find_references(library.root) if within(library.root / item.file, path.resolve())]
    report.faults.extend(item for item in found if isinstance(item, Fault))
    references = [item for item in found if isinstance(item, Reference)]
    if references:
        with pipeline_for(library) as pipeline:
            grade_references(pipeline, references, report, say)
    report.faults.sort()
    return report


def within(path: Path, folder: Path) -> bool:
    """Whether `path` is `folder` or lies in it."""
    return path.is_relative_to(folder)


def certify_library(library: Library, path: Path, report: Report, say: Say) -> None:
    """Re-derive every key that physics can decide; a key that it contradicts is a fault."""
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


@dataclass(frozen=True)
class Reference:
    """A program of reference_solutions/<quiz>/<question>/<status>__<why>.py; `file` is relative to the root."""

    file: str
    source: str
    quiz: str
    question: str
    status: str
    diagnosis: str | None


def find_references(root: Path) -> Iterator[Reference | Fault]:
    """Every reference program, or why it cannot be read; its first line may demand a diagnosis: `# diagnosis: ...`."""
    for file in list_files(root, "reference_solutions", "*/*/*.py"):
        source = read_text(root, file, SOURCE_BYTES_MAX)
        if isinstance(source, Fault):
            yield source
            continue
        first = source.partition("\n")[0]
        diagnosis = first.removeprefix("# diagnosis:").strip() if first.startswith("# diagnosis:") else None
        _, quiz, question, name = Path(file).parts
        yield Reference(file, source, quiz, question, Path(name).stem.partition("__")[0], diagnosis)


def grade_references(pipeline: Pipeline, references: list[Reference], report: Report, say: Say) -> None:
    """Every reference program must get the status in its name and the diagnosis in its first line."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        for reference, outcome in zip(references, pool.map(lambda r: grade_one(pipeline, r), references), strict=True):
            say(f"{reference.file}: {outcome['got']}")
            report.references.append({"file": reference.file, "expected": reference.status, **outcome})
            report.faults.extend(Fault(reference.file, reference.status, why) for why in complaints(reference, outcome))


def grade_one(pipeline: Pipeline, reference: Reference) -> dict[str, Any]:
    """What a reference program got."""
    try:
        verdict = pipeline.grade(reference.quiz, reference.question, {"source": reference.source})
    except (CallerError, InvalidAnswer) as error:
        return {"got": "not found" if isinstance(error, NotFound) else "no verdict", "diagnosis": str(error)}
    return {"got": verdict.status.value, "diagnosis": verdict.diagnosis}


def complaints(reference: Reference, outcome: dict[str, Any]) -> Iterable[str]:
    """What is wrong with an outcome, if anything."""
    if reference.status not in set(Status):
        yield f"the name must begin with a status: {', '.join(Status)}"
    elif outcome["got"] != reference.status:
        yield f"graded {outcome['got']} ({outcome['diagnosis']})"
    elif reference.diagnosis and reference.diagnosis not in (outcome["diagnosis"] or ""):
        yield f"diagnosis is {outcome['diagnosis']!r}, not {reference.diagnosis!r}"
