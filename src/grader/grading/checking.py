"""Checks a content folder: it loads, its keys are certified, its reference programs get their statuses."""

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field
from functools import cache
from itertools import takewhile
from pathlib import Path
from threading import Lock
from typing import Any

from grader.certify.keys import bound_luck, build_fault, certify_quizzes
from grader.certify.remarks import UNVERIFIED, is_decidable
from grader.domain.run import SOURCE_BYTES_MAX
from grader.domain.verdict import Status
from grader.errors import CallerError, ContentError, Fault, InvalidAnswer, NotFound
from grader.exercises import TextOf, plan_exercise, write_lazy_answers, write_wrong_scripts
from grader.grading.pipeline import Pipeline
from grader.grading.selection import EVERYTHING, Selection
from grader.library import NOTHING_PASSED, Library, PassedChecks, load
from grader.library.files import list_files, read_text
from grader.library.semantics import list_inputs
from grader.numerics.version import INSTALLED, parse_version
from grader.questions.kinds.script import ScriptQuestion

POINTS_ROUNDING = 1e-6
"""Rounding of shares of points."""

FROM_VERSION = re.compile(r"# from MuJoCo (\d+\.\d+\.\d+): (\w+)(?:: (.+))?")
"""A line of a reference program: the version of MuJoCo from which on it gets another status, and its diagnosis."""

Say = Callable[[str], None]


@dataclass
class Report:
    """The results of a check; it passed if there are no `faults`, and no keys that are `undecided` by simulation.
    `chances` are sentences on the luck at exercises."""

    faults: list[Fault] = field(default_factory=list)
    undecided: list[Fault] = field(default_factory=list)
    warnings: list[Fault] = field(default_factory=list)
    chances: list[str] = field(default_factory=list)
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
    path: Path, pipeline_for: Callable[[Library], AbstractContextManager[Pipeline]], say: Say, draws: int = 1,
    passed: PassedChecks = NOTHING_PASSED, *, only: Selection = EVERYTHING, doing: Say = lambda _: None,
) -> Report:  # fmt: skip
    """Load the content folder of `path`, certify its keys, and grade its reference programs. A path inside the folder
    restricts certificates and reference programs to those below it. `pipeline_for` opens a pipeline, with its jail, for
    a library. Each reference program is graded under `draws` draws of the hidden cases, and must get one status and one
    diagnosis under all of them. What has `passed` before does not run again. `only` a part is checked; `doing` is told
    what runs now, `say` what came out."""
    report = Report()
    doing("loading quizzes and models")
    try:
        library = load(find_content_root(path), only.quiz, passed=passed)
    except ContentError as error:
        report.faults.extend(error.faults)
        return report
    if fault := only.find_fault(library):
        report.faults.append(fault)
        return report
    with ExitStack() as stack:
        opening, enter = Lock(), cache(lambda: stack.enter_context(pipeline_for(library)))

        def opened() -> Pipeline:  # the jail starts once, for what must run
            with opening:
                return enter()

        ContentCheck(library, path.resolve(), opened, say, draws, passed, only, doing, report).run()
    report.faults.sort()
    return report


@dataclass(frozen=True)
class ContentCheck:
    """The check of a folder that could be loaded, into a report. `opened` opens the pipeline, once."""

    library: Library
    path: Path
    opened: Callable[[], Pipeline]
    say: Say
    draws: int = 1
    passed: PassedChecks = NOTHING_PASSED
    only: Selection = EVERYTHING
    doing: Say = lambda _: None
    report: Report = field(default_factory=Report)

    def run(self) -> None:
        """Runs every check below the path."""
        self.report.warnings.extend(filter(self.is_about, self.library.warnings))
        exercises = [one for one in find_exercises(self.library, self.path) if self.only.has(one[0], one[1].id)]
        for quiz_id, question in exercises:
            self.check_luck(quiz_id, question)
        self.certify_keys()
        found = [one for one in find_references(self.library.root) if is_below(self.library, one.file, self.path)]
        self.report.faults.extend(one for one in found if isinstance(one, Fault))
        programs = [one for one in found if isinstance(one, ReferenceProgram)]
        self.grade_references([one for one in programs if self.only.has(one.quiz, one.question)])
        for quiz_id, question in exercises:
            self.grade_lazy_answers(quiz_id, question)
            self.grade_mistakes(quiz_id, question)

    def is_about(self, fault: Fault) -> bool:
        """Whether a remark is about what is checked."""
        quizzes = [quiz for quiz in self.library.quizzes if self.library.file(quiz) == fault.file]
        return all(self.only.has(quiz, fault.key.partition(".")[0] or None) for quiz in quizzes)

    def certify_keys(self) -> None:
        """Certify every key that physics can decide; a refuted key is a fault, and so is a `verify` that cannot run."""
        library, report = self.library, self.report
        chosen = (quiz for quiz in library.quizzes if is_below(library, library.file(quiz), self.path))

        def is_wanted(quiz: str, question: str) -> bool:
            self.doing(f"certifying the key of {quiz} {question}")
            return self.only.has(quiz, question)

        for one in certify_quizzes(library, chosen, self.passed, is_wanted=is_wanted):
            file, named = library.file(one.quiz), ".".join(filter(None, (one.question.id, one.key.place)))
            certificate = one.certificate
            if certificate is None:
                if is_decidable(one.key):
                    report.warnings.append(Fault(file, f"{named}.verify", UNVERIFIED))
                continue
            self.say(
                f"{one.quiz} {named}: key {certificate.verdict if certificate.ok else certificate.verdict.upper()}"
            )
            report.certificates.append({"quiz": one.quiz, "question": one.question.id, **certificate.to_json()})
            report.warnings.extend(Fault(file, f"{named}.answer", remark) for remark in certificate.remarks)
            if certificate.accepted is not None:
                why = f"simulation cannot tell ({certificate.why}); accepted: {certificate.accepted}"
                report.warnings.append(Fault(file, f"{named}.verify.accept", why))
            if not certificate.is_publishable:
                is_fault = certificate.verdict == "refuted" or certificate.method == "verify"
                faults = report.faults if is_fault else report.undecided
                faults.append(build_fault(library, one.quiz, one.question, certificate))

    def check_luck(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault if an answer that ignores its inputs is too likely to be right in every case."""
        self.doing(f"drawing the cases of {quiz_id} {question.id} 200 times")
        luck = bound_luck(self.library, question, self.passed)
        chance = f"a fixed answer passes with a chance of at most {luck.chance:.1e}; {luck.allowed:g} is allowed"
        self.say(f"{quiz_id} {question.id}: {chance}")
        self.report.chances.append(chance)
        if luck.why is not None:
            self.report.faults.append(Fault(self.library.file(quiz_id), f"{question.id}.check.luck", luck.why))

    def grade_lazy_answers(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault for every script that does not solve the exercise and earns too many points."""
        library = self.library
        self.doing(f"grading scripts that do not solve {quiz_id} {question.id}")
        own = library.starter(question)
        for name, points, most in self.passed.run(
            "lazy answers",
            [*list_inputs(question, library.models), own or ""],
            lambda text_of: [*earn_lazily(self.opened(), quiz_id, question, own, text_of)],
            text_of=library.text,
            write=lambda earned: None if any(earns_too_much(*rest) for _, *rest in earned) else earned,
            read=list,
        ):
            self.say(f"{quiz_id} {question.id}: {name} earns {points:g}, at most {most:g}")
            if earns_too_much(points, most):
                why = f"{name} earns {points:g} points, and may earn {most:g} at most"
                cure = "give hidden cases other numbers or more points"
                self.report.faults.append(Fault(library.file(quiz_id), f"{question.id}.check", f"{why}: {cure}"))

    def grade_mistakes(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault for every mistake of the author's whose own program is not told its sentence."""
        library = self.library

        def name_all(text_of: TextOf) -> list[tuple[str, str, str | None, str]]:
            found = []
            for program, source, sentence in write_wrong_scripts(question, text_of):
                self.doing(f"grading {program}")
                verdict = self.opened().grade(quiz_id, question.id, {"source": source})
                found.append((program, verdict.status.value, verdict.diagnosis, sentence))
            return found

        for index, (program, status, diagnosis, sentence) in enumerate(
            self.passed.run(
                "mistakes",
                list_inputs(question, library.models),
                name_all,
                text_of=library.text,
                write=lambda named: named if all(sentence in (told or "") for *_, told, sentence in named) else None,
                read=list,
            )
        ):
            self.say(f"{quiz_id} {question.id}: {program} is {status}: {diagnosis}")
            if sentence not in (diagnosis or ""):
                why = f"{program} is graded {status} and told {diagnosis!r}, not its own sentence"
                cure = "write a whole script that makes this mistake alone, or remove an earlier one that does the same"
                key = f"{question.id}.check.mistakes.{index}.program"
                self.report.faults.append(Fault(library.file(quiz_id), key, f"{why}: {cure}"))

    def grade_references(self, references: Sequence["ReferenceProgram"]) -> None:
        """Grade reference programs; a wrong status or diagnosis, or one that depends on the draw, is a fault."""
        with ThreadPoolExecutor(max_workers=2) as pool:
            for reference, outcomes in zip(references, pool.map(self.grade_reference, references), strict=True):
                first = next(iter(outcomes.values()))
                self.say(f"{reference.file}: {', '.join(dict.fromkeys(one.got for one in outcomes.values()))}")
                self.report.references.append({"file": reference.file, "expected": reference.status, **vars(first)})
                self.report.faults.extend(
                    Fault(reference.file, reference.status, why) for why in list_mismatches(reference, outcomes)
                )

    def grade_reference(self, reference: "ReferenceProgram") -> dict[int, "ReferenceOutcome"]:
        """Grade a reference program under consecutive seeds, the first from the name of its file; return seed: outcome.
        A program of no exercise gets no verdict."""
        self.doing(f"grading {reference.file}")
        first = zlib.crc32(reference.file.encode())
        seeds = range(first, first + self.draws)
        try:
            question = self.library.question(reference.quiz, reference.question)
            inputs = list_inputs(question, self.library.models)
        except NotFound:
            question, inputs = None, []

        def grade(text_of: TextOf) -> dict[int, ReferenceOutcome]:
            if isinstance(question, ScriptQuestion):
                plan_exercise(question, self.library.model_xml, first, text_of)  # notes the author's programs
            return {seed: grade_one(self.opened(), reference, seed) for seed in seeds}

        return self.passed.run(
            "reference",
            [*inputs, *map(str, vars(reference).values()), str(self.draws)],
            grade,
            text_of=self.library.text,
            write=lambda outcomes: None if [*list_mismatches(reference, outcomes)] else [*map(vars, outcomes.values())],
            read=lambda kept: dict(zip(seeds, (ReferenceOutcome(**one) for one in kept), strict=True)),
        )


def is_below(library: Library, file: str, path: Path) -> bool:
    """Whether a file of the content is this path, or below it."""
    return (library.root / file).is_relative_to(path)


def earn_lazily(
    pipeline: Pipeline, quiz_id: str, question: ScriptQuestion, starter: str | None, text_of: TextOf
) -> Iterator[tuple[str, float, float]]:
    """Yields name, points and most points of every script that does not solve the exercise."""
    earned: dict[str, float] = {}
    for lazy in write_lazy_answers(question, pipeline.library.model_xml, starter, text_of):
        verdict = pipeline.grade(quiz_id, question.id, {"source": lazy.source})
        earned[lazy.name] = verdict.points
        yield lazy.name, verdict.points, min(lazy.points_max, earned.get(lazy.like, lazy.points_max))


def earns_too_much(points: float, most: float) -> bool:
    """Whether a script earns more points than it may."""
    return points > most + POINTS_ROUNDING


def find_exercises(library: Library, path: Path) -> Iterator[tuple[str, ScriptQuestion]]:
    """Yields every exercise of the quizzes under `path`, with the quiz's id."""
    for quiz in library.quizzes.values():
        if is_below(library, library.file(quiz.id), path):
            yield from ((quiz.id, question) for question in quiz.questions if isinstance(question, ScriptQuestion))


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
