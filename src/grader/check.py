"""Everything that must hold of a content folder: it loads, its keys are what physics says, its references grade true."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from grader.certify import certify_question
from grader.domain.verdict import Status
from grader.errors import ContentError, Fault, NotFound
from grader.library import Library, load
from grader.pipeline import Pipeline

Progress = Callable[[str], None]


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


def check_content(root: Path, make_pipeline: Callable[[Library], Pipeline], say: Progress) -> Report:
    """Load the folder, certify every key, grade every reference solution; `make_pipeline` brings the jail."""
    report = Report()
    try:
        library = load(root)
    except ContentError as error:
        report.faults.extend(error.faults)
        return report
    report.warnings.extend(library.warnings)
    certify_library(library, report, say)
    grade_references(make_pipeline(library), report, say)
    report.faults.sort()
    return report


def certify_library(library: Library, report: Report, say: Progress) -> None:
    """Re-derive every key that physics can decide; a key that it contradicts is a fault."""
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            certificate = certify_question(question, library.model_xml)
            if certificate is None:
                continue
            say(f"{quiz.id} {question.id}: key {'certified' if certificate.ok else 'REFUSED'}")
            report.certificates.append({"quiz": quiz.id, "question": question.id, **certificate.to_json()})
            file, key = library.file(quiz.id), f"{question.id}.answer"
            report.warnings.extend(Fault(file, key, remark) for remark in certificate.remarks)
            if not certificate.ok:
                report.faults.append(Fault(file, key, certificate.why))


@dataclass(frozen=True)
class Reference:
    """A program of reference_solutions/<quiz>/<question>/<status>__<why>.py."""

    path: Path
    quiz: str
    question: str
    status: str
    diagnosis: str | None


def find_references(root: Path) -> Iterator[Reference]:
    """Every reference program; its first line may demand a diagnosis: `# diagnosis: part of the sentence`."""
    for path in sorted((root / "reference_solutions").glob("*/*/*.py")):
        first = path.read_text().partition("\n")[0]
        diagnosis = first.removeprefix("# diagnosis:").strip() if first.startswith("# diagnosis:") else None
        quiz, question = path.parts[-3:-1]
        yield Reference(path, quiz, question, path.stem.partition("__")[0], diagnosis)


def grade_references(pipeline: Pipeline, report: Report, say: Progress) -> None:
    """Every reference program must get the status in its name and the diagnosis in its first line."""
    root = pipeline.library.root
    with ThreadPoolExecutor(max_workers=2) as pool:
        references = list(find_references(root))
        for reference, outcome in zip(references, pool.map(lambda r: grade_one(pipeline, r), references), strict=True):
            name = reference.path.relative_to(root).as_posix()
            say(f"{name}: {outcome['got']}")
            report.references.append({"file": name, "expected": reference.status, **outcome})
            report.faults.extend(Fault(name, reference.status, why) for why in complaints(reference, outcome))


def grade_one(pipeline: Pipeline, reference: Reference) -> dict[str, Any]:
    """What a reference program got."""
    try:
        verdict = pipeline.grade(reference.quiz, reference.question, {"source": reference.path.read_text()})
    except NotFound as error:
        return {"got": "not found", "diagnosis": str(error)}
    return {"got": verdict.status.value, "diagnosis": verdict.diagnosis}


def complaints(reference: Reference, outcome: dict[str, Any]) -> Iterable[str]:
    """What is wrong with an outcome, if anything."""
    if reference.status not in set(Status):
        yield f"the name must begin with a status: {', '.join(Status)}"
    elif outcome["got"] != reference.status:
        yield f"graded {outcome['got']} ({outcome['diagnosis']})"
    elif reference.diagnosis and reference.diagnosis not in (outcome["diagnosis"] or ""):
        yield f"diagnosis is {outcome['diagnosis']!r}, not {reference.diagnosis!r}"
