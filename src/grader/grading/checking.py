"""Checks a content folder: it loads, its keys are certified, its reference programs get their statuses."""

import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from threading import Lock

from grader.certify.keys import CertifiedKey, bound_luck, build_fault, certify_quizzes, propose_for_key
from grader.certify.remarks import UNVERIFIED, is_decidable
from grader.domain.verdict import Status, format_points
from grader.errors import ContentError, Fault, GraderError, NotFound
from grader.exercises import STARTER, TextOf, certify_exercise, plan_exercise, write_lazy_answers, write_wrong_scripts
from grader.grading.pipeline import Pipeline
from grader.grading.references import ReferenceOutcome, ReferenceProgram, find_references, grade_one, list_mismatches
from grader.grading.report import Report
from grader.grading.selection import EVERYTHING, Selection
from grader.library import NOTHING_PASSED, Library, PassedChecks, load
from grader.library.checking.semantics import list_inputs
from grader.questions import kind_of
from grader.questions.kinds.script import ScriptQuestion

POINTS_ROUNDING = 1e-6
"""Rounding of shares of points."""

ALL_CRASH = (
    "every script that does not solve it ends with an error, so that the judge never sees a wrong answer: let the kind "
    "write some in `write_lazy_answers`, or add wrong reference programs"
)

Say = Callable[[str], None]
Look = Callable[[Library, Callable[[str, str], bool]], Iterable[Fault]]


def nothing_unshown(_library: Library, _is_wanted: Callable[[str, str], bool]) -> Iterable[Fault]:
    """Returns no fault: of the grader's own kinds every question can be shown."""
    return ()


def find_content_root(path: Path) -> Path:
    """Return the content folder that is or contains `path`. Raises ContentError if there is none."""
    for folder in (path.resolve(), *path.resolve().parents):
        if (folder / "quizzes").is_dir():
            return folder
    raise ContentError(
        [
            Fault(
                str(path),
                "-",
                "no content folder here, which has quizzes/ inside: `grader new course FOLDER` begins one",
            )
        ]
    )


def check_content(
    path: Path, pipeline_for: Callable[[Library], AbstractContextManager[Pipeline]], say: Say, draws: int = 1,
    passed: PassedChecks = NOTHING_PASSED, *, only: Selection = EVERYTHING, doing: Say = lambda _: None,
    look: Look = nothing_unshown,
) -> Report:  # fmt: skip
    """Load the content folder of `path`, certify its keys, and grade its reference programs. A path inside the folder
    restricts certificates and reference programs to those below it. `pipeline_for` opens a pipeline, with its jail, for
    a library. Each reference program is graded under `draws` draws of the hidden cases, and must get one status and one
    diagnosis under all of them. What has `passed` before does not run again. `only` a part is checked; `doing` is told
    what runs now, `say` what came out. `look` finds questions that a page cannot show, of those that are wanted."""
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
        opening, enter = Lock(), cache(lambda: replace(stack.enter_context(pipeline_for(library)), names_faults=True))

        def opened() -> Pipeline:  # the jail starts once, for what must run
            with opening:
                return enter()

        ContentCheck(library, path.resolve(), opened, say, draws, passed, only, doing, report).run()
        report.faults.extend(look(library, only.has))
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
        exercises = [
            exercise
            for exercise in find_exercises(self.library, self.path)
            if self.only.has(exercise[0], exercise[1].id)
        ]
        for quiz_id, question in exercises:
            self.certify_exercise(quiz_id, question)
            self.check_luck(quiz_id, question)
        self.certify_keys()
        outcomes = [
            reference
            for reference in find_references(self.library.root)
            if is_below(self.library, reference.file, self.path)
        ]
        self.report.faults.extend(fault for fault in outcomes if isinstance(fault, Fault))
        programs = [program for program in outcomes if isinstance(program, ReferenceProgram)]
        self.grade_references([program for program in programs if self.only.has(program.quiz, program.question)])
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

        for certified in certify_quizzes(library, chosen, self.passed, is_wanted=is_wanted):
            quiz, question, certificate = certified.quiz, certified.question.id, certified.certificate
            file, named = library.file(quiz), ".".join(filter(None, (question, certified.key.place)))
            if certificate is None:
                self.propose(certified)
                continue
            self.say(f"{quiz} {named}: key {certificate.verdict if certificate.ok else certificate.verdict.upper()}")
            report.certificates.append({"quiz": quiz, "question": question, **certificate.to_json()})
            report.warnings.extend(Fault(file, f"{named}.answer", remark) for remark in certificate.remarks)
            if certificate.accepted is not None:
                why = f"simulation cannot tell ({certificate.why}); accepted: {certificate.accepted}"
                report.warnings.append(Fault(file, f"{named}.verify.accept", why))
            if not certificate.is_publishable:
                is_fault = certificate.verdict == "refuted" or certificate.method == "verify"
                faults = report.faults if is_fault else report.undecided
                faults.append(build_fault(library, quiz, certified.question, certificate))

    def propose(self, certified: CertifiedKey) -> None:
        """Remarks on a key that no simulation confirms, with a `verify` to paste where one can be proposed."""
        if not is_decidable(certified.key):
            return
        named = ".".join(filter(None, (certified.question.id, certified.key.place)))
        self.doing(f"looking for a verify of {certified.quiz} {named}")
        proposal = propose_for_key(self.library, certified.quiz, certified.question, certified.key, self.passed)
        why = UNVERIFIED if proposal is None else str(proposal)
        self.report.warnings.append(Fault(self.library.file(certified.quiz), f"{named}.verify", why))
        if proposal is not None:
            place = {"quiz": certified.quiz, "question": certified.question.id, "place": certified.key.place}
            self.report.proposals.append(place | proposal.to_json())

    def certify_exercise(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault for every case whose kind is not certain of what it compares with."""
        library, where = self.library, self.library.file(quiz_id)
        self.doing(f"certifying {quiz_id} {question.id}")
        faults = self.passed.run(
            "exercise",
            list_inputs(question, library.models),
            lambda text_of: certify_exercise(question, library.model_xml, where, text_of),
            text_of=library.text,
            write=lambda faults: None if faults else [],
            read=list,
        )
        self.report.faults.extend(faults)

    def check_luck(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault if an answer that ignores its inputs is too likely to be right in every case."""
        self.doing(f"drawing the cases of {quiz_id} {question.id} 200 times")
        try:
            luck = bound_luck(self.library, question, self.passed)
        except (GraderError, ValueError) as error:
            self.report.faults.append(Fault(self.library.file(quiz_id), f"{question.id}.check", str(error)))
            return
        bound = f"at most {luck.chance:.1e}" if luck.chance else "0"
        chance = f"a fixed answer passes with a chance of {bound}; {luck.allowed:g} is allowed"
        self.say(f"{quiz_id} {question.id}: {chance}")
        self.report.chances.append(chance)
        if luck.why is not None:
            self.report.faults.append(Fault(self.library.file(quiz_id), f"{question.id}.check.luck", luck.why))

    def grade_lazy_answers(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault for every script that does not solve the exercise and earns too many points."""
        library = self.library
        self.doing(f"grading scripts that do not solve {quiz_id} {question.id}")
        own = library.starter(question)
        key = f"{question.id}.check"
        earned = self.passed.run(
            "lazy answers",
            [*list_inputs(question, library.models), own or ""],
            lambda text_of: [*earn_lazily(self.opened(), quiz_id, question, own, text_of)],
            text_of=library.text,
            write=lambda earned: (
                earned if all(not fault and not earns_too_much(*both) for _, *both, fault, _ in earned) else None
            ),
            read=list,
        )
        self.say(f"{quiz_id} {question.id}: {len(earned)} scripts that do not solve it are tried")
        if earned and all(status == Status.CRASHED for *_, status in earned):
            self.report.warnings.append(Fault(library.file(quiz_id), key, ALL_CRASH))
        for name, points, most, fault, _ in earned:
            if earns_too_much(points, most):
                subject = name if name == STARTER else f"the answer {name!r}"  # a name may be a plural
                why = f"{subject} earns {format_points(points)}, and may earn {most:g} at most"
                solved = f"take the solution out of {question.starter}" if name == STARTER else ""
                cure = solved or "give hidden cases other numbers or more points"
                self.report.faults.append(Fault(library.file(quiz_id), key, f"{why}: {cure}"))
            if fault:
                why = f"{name} cannot be judged: {fault}; the log on stderr has the traceback"
                self.report.faults.append(Fault(library.file(quiz_id), key, why))

    def grade_mistakes(self, quiz_id: str, question: ScriptQuestion) -> None:
        """Reports a fault for every mistake of the author's whose own program is not told its sentence."""
        library = self.library

        def name_all(text_of: TextOf) -> list[tuple[str, str, str | None, str]]:
            named = []
            for program, source, sentence in write_wrong_scripts(question, text_of):
                self.doing(f"grading {program}")
                answer = kind_of(question).from_text(question, source)
                verdict = self.opened().grade(quiz_id, question.id, answer, choose_seed(program))
                named.append((program, verdict.status.value, verdict.diagnosis, sentence))
            return named

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
                told = "nothing" if diagnosis is None else repr(diagnosis)
                why = f"{program} is graded {status} and told {told}, not its own sentence"
                cure = "write a whole script that makes this mistake alone, or remove an earlier one that does the same"
                key = f"{question.id}.check.mistakes.{index}.program"
                self.report.faults.append(Fault(library.file(quiz_id), key, f"{why}: {cure}"))

    def grade_references(self, references: Sequence["ReferenceProgram"]) -> None:
        """Grade reference programs; a wrong status or diagnosis, or one that depends on the draw, is a fault."""
        with ThreadPoolExecutor(max_workers=2) as pool:
            for reference, outcomes in zip(references, pool.map(self.grade_reference, references), strict=True):
                first = next(iter(outcomes.values()))
                self.say(f"{reference.file}: {', '.join(dict.fromkeys(outcome.got for outcome in outcomes.values()))}")
                self.report.references.append({"file": reference.file, "expected": reference.status, **vars(first)})
                self.report.faults.extend(
                    Fault(reference.file, reference.status, why) for why in list_mismatches(reference, outcomes)
                )

    def grade_reference(self, reference: "ReferenceProgram") -> dict[int, "ReferenceOutcome"]:
        """Grade a reference program under consecutive seeds, the first from the name of its file; return seed: outcome.
        A program of no exercise gets no verdict."""
        self.doing(f"grading {reference.file}")
        first = choose_seed(reference.file)
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
            read=lambda stored: dict(zip(seeds, (ReferenceOutcome(**fields) for fields in stored), strict=True)),
        )


def is_below(library: Library, file: str, path: Path) -> bool:
    """Whether a file of the content is this path, or below it."""
    return (library.root / file).is_relative_to(path)


def earn_lazily(
    pipeline: Pipeline, quiz_id: str, question: ScriptQuestion, starter: str | None, text_of: TextOf
) -> Iterator[tuple[str, float, float, str, str]]:
    """Yields name, points and most points of every script that does not solve the exercise, why it could not be judged,
    and its status."""
    earned: dict[str, float] = {}
    for lazy in write_lazy_answers(question, pipeline.library.model_xml, starter, text_of):
        answer = kind_of(question).from_text(question, lazy.source)
        verdict = pipeline.grade(quiz_id, question.id, answer, choose_seed(f"{quiz_id}/{question.id}/{lazy.name}"))
        earned[lazy.name] = verdict.points
        most = min(lazy.points_max, earned.get(lazy.like, lazy.points_max))
        fault = (verdict.diagnosis or "") if verdict.status is Status.GRADER_FAULT else ""
        yield lazy.name, verdict.points, most, fault, verdict.status.value


def choose_seed(name: str) -> int:
    """Returns the seed under which a script of this name is graded: the same in every check."""
    return zlib.crc32(name.encode())


def earns_too_much(points: float, most: float) -> bool:
    """Whether a script earns more points than it may."""
    return points > most + POINTS_ROUNDING


def find_exercises(library: Library, path: Path) -> Iterator[tuple[str, ScriptQuestion]]:
    """Yields every exercise of the quizzes under `path`, with the quiz's id."""
    for quiz in library.quizzes.values():
        if is_below(library, library.file(quiz.id), path):
            yield from ((quiz.id, question) for question in quiz.questions if isinstance(question, ScriptQuestion))
