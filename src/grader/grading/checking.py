"""Checks a content folder: it loads, its keys are certified, its reference programs get their statuses."""

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from grader.certify.keys import build_fault, certify_quizzes
from grader.certify.remarks import UNVERIFIED, estimate_luck, is_decidable
from grader.domain.run import SOURCE_BYTES_MAX
from grader.domain.verdict import Status
from grader.errors import CallerError, ContentError, Fault, InvalidAnswer, NotFound
from grader.exercises import write_lazy_answers
from grader.grading.pipeline import Pipeline
from grader.library import Library, load
from grader.library.files import list_files, read_text
from grader.numerics.version import INSTALLED, parse_version
from grader.questions.kinds.script import ScriptQuestion

POINTS_ROUNDING = 1e-6
"""Rounding of shares of points."""

FROM_VERSION = re.compile(r"# from MuJoCo (\d+\.\d+\.\d+): (\w+)(?:: (.+))?")
"""A line of a reference program: the version of MuJoCo from which on it gets another status, and its diagnosis."""

Say = Callable[[str], None]


@dataclass
class Report:
    """The results of a check; it passed if there are no `faults`, and no keys that are `undecided` by simulation."""

    faults: list[Fault] = field(default_factory=list)
    undecided: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    certificates: list[dict[str, Any]] = field(default_factory=list)
    references: list[dict[str, Any]] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """Plain JSON, faults as {"file", "key", "why"}."""
        return {
            "ok": not self.faults and not self.undecided,
            "faults": [vars(fault) for fault in self.faults],
            "undecided": [vars(fault) for fault in self.undecided],
            "warnings": [vars(fault) for fault in self.warnings],
            "certificates": self.certificates,
            "references": self.references,
        }


def find_content_root(path: Path) -> Path:
    """Return the content folder that is or contains `path`. Raises ContentError if there is none."""
    for folder in (path.resolve(), *path.resolve().parents):
        if (folder / "quizzes").is_dir():
            return folder
    raise ContentError([Fault(str(path), "-", "no content folder here: a folder with quizzes/ and models/ inside")])


def check_content(
    path: Path, pipeline_for: Callable[[Library], AbstractContextManager[Pipeline]], say: Say, draws: int = 1
) -> Report:
    """Load the content folder of `path`, certify its keys, and grade its reference programs. A path inside the folder
    restricts certificates and reference programs to those below it. `pipeline_for` opens a pipeline, with its jail, for
    a library. Each reference program is graded under `draws` draws of the hidden cases, and must get one status and one
    diagnosis under all of them."""
    report = Report()
    try:
        library = load(find_content_root(path))
    except ContentError as error:
        report.faults.extend(error.faults)
        return report
    report.warnings.extend(library.warnings)
    exercises = list(find_exercises(library, path.resolve()))
    report.faults.extend(
        fault for quiz_id, question in exercises for fault in find_luck_faults(library, quiz_id, question, say)
    )
    certify_library(library, path.resolve(), report, say)
    found = [
        item for item in find_references(library.root) if (library.root / item.file).is_relative_to(path.resolve())
    ]
    report.faults.extend(item for item in found if isinstance(item, Fault))
    references = [item for item in found if isinstance(item, ReferenceProgram)]
    if references or exercises:
        with pipeline_for(library) as pipeline:
            grade_references(pipeline, references, report, say, draws)
            for quiz_id, question in exercises:
                report.faults.extend(grade_lazy_answers(pipeline, quiz_id, question, say))
    report.faults.sort()
    return report


def certify_library(library: Library, path: Path, report: Report, say: Say) -> None:
    """Certify every key that physics can decide; a refuted key is a fault, and so is a `verify` that cannot run."""
    chosen = (quiz for quiz in library.quizzes if (library.root / library.file(quiz)).is_relative_to(path))
    for one in certify_quizzes(library, chosen):
        file, named = library.file(one.quiz), ".".join(filter(None, (one.question.id, one.key.place)))
        certificate = one.certificate
        if certificate is None:
            if is_decidable(one.key):
                report.warnings.append(Fault(file, f"{named}.verify", UNVERIFIED))
            continue
        say(f"{one.quiz} {named}: key {certificate.verdict if certificate.ok else certificate.verdict.upper()}")
        report.certificates.append({"quiz": one.quiz, "question": one.question.id, **certificate.to_json()})
        report.warnings.extend(Fault(file, f"{named}.answer", remark) for remark in certificate.remarks)
        if certificate.accepted is not None:
            why = f"simulation cannot tell ({certificate.why}); accepted: {certificate.accepted}"
            report.warnings.append(Fault(file, f"{named}.verify.accept", why))
        if not certificate.is_publishable:
            is_fault = certificate.verdict == "refuted" or certificate.method == "verify"
            faults = report.faults if is_fault else report.undecided
            faults.append(build_fault(library, one.quiz, one.question, certificate))


def find_exercises(library: Library, path: Path) -> Iterator[tuple[str, ScriptQuestion]]:
    """Yields every exercise of the quizzes under `path`, with the quiz's id."""
    for quiz in library.quizzes.values():
        if (library.root / library.file(quiz.id)).is_relative_to(path):
            yield from ((quiz.id, question) for question in quiz.questions if isinstance(question, ScriptQuestion))


def grade_lazy_answers(pipeline: Pipeline, quiz_id: str, question: ScriptQuestion, say: Say) -> Iterator[Fault]:
    """Yields a fault for every script that does not solve the exercise and earns too many points."""
    library = pipeline.library
    starter = read_text(library.root, question.starter, SOURCE_BYTES_MAX) if question.starter else None
    own = starter if isinstance(starter, str) else None
    earned: dict[str, float] = {}
    for lazy in write_lazy_answers(question, library.model_xml, own, library.text):
        verdict = pipeline.grade(quiz_id, question.id, {"source": lazy.source})
        most = min(lazy.points_max, earned.get(lazy.like, lazy.points_max))
        earned[lazy.name] = verdict.points
        say(f"{quiz_id} {question.id}: {lazy.name} earns {verdict.points:g}, at most {most:g}")
        if verdict.points > most + POINTS_ROUNDING:
            why = f"{lazy.name} earns {verdict.points:g} points, and may earn {most:g} at most"
            cure = "give hidden cases other numbers or more points"
            yield Fault(library.file(quiz_id), f"{question.id}.check", f"{why}: {cure}")


def find_luck_faults(library: Library, quiz_id: str, question: ScriptQuestion, say: Say) -> Iterator[Fault]:
    """Yields a fault if an answer that ignores its inputs is too likely to be right in every case."""
    luck = estimate_luck(question, library.model_xml, library.text)
    chance = f"a fixed answer passes with a chance of at most {luck.chance:.1e}; {luck.allowed:g} is allowed"
    say(f"{quiz_id} {question.id}: {chance}")
    if luck.why is not None:
        yield Fault(library.file(quiz_id), f"{question.id}.check.luck", luck.why)


@dataclass(frozen=True)
class ReferenceProgram:
    """A file reference_solutions/<quiz>/<question>/<status>__<why>.py; `file` is relative to the root. `status` and
    `diagnosis` are what it must get with the installed MuJoCo."""

    file: str
    source: str
    quiz: str
    question: str
    status: str
    diagnosis: str | None


def find_references(root: Path) -> Iterator[ReferenceProgram | Fault]:
    """Yield every reference program, or the fault of its file."""
    for file in list_files(root, "reference_solutions", "*/*/*.py"):
        source = read_text(root, file, SOURCE_BYTES_MAX)
        if isinstance(source, Fault):
            yield source
            continue
        _, quiz, question, name = Path(file).parts
        status, diagnosis = read_demand(source, Path(name).stem.partition("__")[0])
        yield ReferenceProgram(file, source, quiz, question, status, diagnosis)


def read_demand(source: str, status: str, installed: str = INSTALLED) -> tuple[str, str | None]:
    """Return the status and the diagnosis that a program must get, `status` being the one in its name. A first line `#
    diagnosis: ...` requires that diagnosis. A line `# from MuJoCo 4.0.0: incorrect: ...` below it says what the program
    gets with this version or a later one; of several lines the last that applies counts."""
    head = list(takewhile(lambda line: line.startswith("#"), source.splitlines()))
    diagnosis = head[0].removeprefix("# diagnosis:").strip() if head and head[0].startswith("# diagnosis:") else None
    for found in filter(None, map(FROM_VERSION.fullmatch, head)):
        if parse_version(installed) >= parse_version(found[1]):
            status, diagnosis = found[2], found[3]
    return status, diagnosis


@dataclass(frozen=True)
class ReferenceOutcome:
    """What a reference program got under one seed."""

    got: str
    diagnosis: str | None

    def __str__(self) -> str:
        return f"{self.got} ({self.diagnosis})" if self.diagnosis else self.got


def grade_references(
    pipeline: Pipeline, references: list[ReferenceProgram], report: Report, say: Say, draws: int
) -> None:
    """Grade every reference program; a wrong status or diagnosis, or one that depends on the draw, is a fault."""
    with ThreadPoolExecutor(max_workers=2) as pool:
        graded = pool.map(lambda reference: grade_with_seeds(pipeline, reference, draws), references)
        for reference, outcomes in zip(references, graded, strict=True):
            first = next(iter(outcomes.values()))
            say(f"{reference.file}: {', '.join(dict.fromkeys(one.got for one in outcomes.values()))}")
            report.references.append({"file": reference.file, "expected": reference.status, **vars(first)})
            report.faults.extend(
                Fault(reference.file, reference.status, why) for why in list_mismatches(reference, outcomes)
            )


def grade_with_seeds(pipeline: Pipeline, reference: ReferenceProgram, draws: int) -> dict[int, ReferenceOutcome]:
    """Grade a reference program under consecutive seeds, the first from the name of its file; return seed: outcome."""
    first = zlib.crc32(reference.file.encode())
    return {seed: grade_one(pipeline, reference, seed) for seed in range(first, first + draws)}


def grade_one(pipeline: Pipeline, reference: ReferenceProgram, seed: int) -> ReferenceOutcome:
    """Grade a reference program under one seed."""
    try:
        verdict = pipeline.grade(reference.quiz, reference.question, {"source": reference.source}, seed)
    except (CallerError, InvalidAnswer) as error:
        return ReferenceOutcome("not found" if isinstance(error, NotFound) else "no verdict", str(error))
    return ReferenceOutcome(verdict.status.value, verdict.diagnosis)


def list_mismatches(reference: ReferenceProgram, outcomes: dict[int, ReferenceOutcome]) -> Iterator[str]:
    """Yield each difference between the outcomes, by seed, and what the reference program requires."""
    if reference.status not in set(Status):
        yield f"the name must begin with a status: {', '.join(Status)}"
        return
    counts = Counter(outcomes.values())
    for outcome, count in counts.items():
        seed = next(seed for seed, one in outcomes.items() if one == outcome)
        where = f" in {count} of {len(outcomes)} draws, as with --seed {seed}" if len(outcomes) > 1 else ""
        if outcome.got != reference.status:
            yield f"graded {outcome}{where}"
        elif reference.diagnosis and reference.diagnosis not in (outcome.diagnosis or ""):
            yield f"diagnosis is {outcome.diagnosis!r}, not {reference.diagnosis!r}{where}"
        elif len(counts) > 1:
            yield f"the verdict depends on the draw: {outcome}{where}"
