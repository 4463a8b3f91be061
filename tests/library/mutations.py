"""Mutations of content: every value of a quiz is reversed, negated, dropped, made huge or tiny, or replaced.

`python tests/library/mutations.py` tries all of them, and prints those that are neither refused nor checked.
"""

import argparse
import copy
import json
import random
import re
import signal
import sys
import time
import traceback
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from grader.certify.keys import certify_quizzes
from grader.certify.remarks import estimate_luck
from grader.domain.lab import LabConfig
from grader.domain.run import Job, RunReport, RunStatus
from grader.errors import ContentError
from grader.exercises import judge_exercise, luck, plan_exercise, prepare_exercise, write_lazy_answers
from grader.labs import watch_lab
from grader.labs.kinds.integrators.comparison import run_integrators
from grader.labs.kinds.integrators.lab import IntegratorsLab
from grader.library import Library, load
from grader.questions import installed_kinds, kind_of, question_view
from grader.questions.kinds.script import ScriptQuestion

ROOT = Path(__file__).parents[2]
FOLDERS = (ROOT, ROOT / "tests/exercises/values")
PAGE = ROOT / "docs/authoring.md"

DRAWS = 2
"""How often the chance of luck draws every case; `grader check` draws 200 times the same code."""

CPU_S_MAX = 60.0
"""Most CPU time for one mutation [s]."""

SEEDS = (1, 2)

WRONG: tuple[Any, ...] = (None, True, "", [], {}, 0, 1.5, "x", "-1", "$", "../x", [[]], ["a", 1], {"x-a": 1})
HUGE, TINY = (1e300, -1e300, 10**9, 10**400), (1e-300, -1e-300)
TEXTS = ("", " ", "0", "nan", "x" * 5000, "\x00", "é∞", "(", "1/0", "model", "../../etc/passwd", "data.qpos[99]")

Way = tuple[Any, ...]


class TooSlow(BaseException):
    """A mutation took more than its budget; no handler of Exception may catch this."""


class Mutation(NamedTuple):
    """The value at `way` of a quiz of some content becomes `value`, or is dropped."""

    content: int
    file: str
    way: Way
    name: str
    value: Any = None

    def __str__(self) -> str:
        value = "" if self.name in ("drop", "reverse", "negate") else f" {json.dumps(self.value)[:40]}"
        return f"{self.content} {self.file}: {'.'.join(map(str, self.way))}: {self.name}{value}"


@cache
def contents() -> tuple[dict[str, str], ...]:
    """The files, by path, of every content: of this repository, the tests, the author's guide, and every kind."""
    folders = [files_of(folder) for folder in FOLDERS]
    guide = re.findall(
        r"^`([\w./-]+)`:\n\n```\w+\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE
    )
    examples = []
    for kind in dict.fromkeys(installed_kinds().values()):
        example = kind.example()
        quiz = {"id": "example", "title": "An example", "questions": [example.question]}
        examples.append({**example.files, "quizzes/example.json": json.dumps(quiz)})
    return (*folders, dict(guide), *examples)


def files_of(root: Path) -> dict[str, str]:
    """The text of every file that content is made of."""
    patterns = ("quizzes/*.json", "quizzes/*/*.py", "quizzes/*/*.xml", "models/*.xml", "programs/*.py")
    return {
        path.relative_to(root).as_posix(): path.read_text(encoding="utf-8")
        for pattern in patterns
        for path in sorted(root.glob(pattern))
    }


def list_mutations() -> Iterator[Mutation]:
    """Every mutation of every content."""
    for index, files in enumerate(contents()):
        for file in sorted(name for name in files if name.startswith("quizzes/") and name.endswith(".json")):
            for way, value in list_values(json.loads(files[file])):
                yield Mutation(index, file, way, "drop")
                yield from (Mutation(index, file, way, name, other) for name, other in list_changes(value))


def list_values(value: Any, way: Way = ()) -> Iterator[tuple[Way, Any]]:
    """The way to every value inside a JSON value, but remarks."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for step, inner in items:
        if not str(step).startswith("x-"):
            yield (*way, step), inner
            yield from list_values(inner, (*way, step))


def list_changes(value: Any) -> Iterator[tuple[str, Any]]:
    """What a value may become, with a name for the change."""
    yield from (("replace", other) for other in WRONG if other != value)
    if isinstance(value, list):
        yield "reverse", value[::-1]
        yield "double", value * 2
        yield "many", value * 3000
    elif isinstance(value, str):
        yield from (("text", other) for other in TEXTS)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield "negate", -value
        yield from (("huge", other) for other in HUGE)
        yield from (("tiny", other) for other in TINY)


def mutate(quiz: Any, mutation: Mutation) -> Any:
    """The quiz with the mutation, and of its questions and labs only the one that is mutated."""
    quiz = copy.deepcopy(quiz)
    place = quiz
    for step in mutation.way[:-1]:
        place = place[step]
    last = mutation.way[-1]
    if mutation.name == "drop":
        del place[last]
    else:
        place[last] = mutation.value
    part, index = (*mutation.way, None)[:2]
    for name in ("questions", "labs"):
        if isinstance(quiz.get(name), list) and (part, index) != (name, None):
            kept = quiz[name][index : index + 1] if part == name and isinstance(index, int) else []
            quiz[name] = kept or (quiz[name][:1] if part not in ("questions", "labs") else [])
    return quiz


def try_mutation(mutation: Mutation) -> str | None:
    """Loads and checks the mutated content; returns what went wrong, or None."""
    files = contents()[mutation.content]
    with TemporaryDirectory(prefix="grader-mutation-") as name:
        root = Path(name)
        for path, text in files.items():
            if path == mutation.file or not path.startswith("quizzes/") or not path.endswith(".json"):
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text(text, encoding="utf-8")
        (root / mutation.file).write_text(json.dumps(mutate(json.loads(files[mutation.file]), mutation)), "utf-8")
        began = time.process_time()
        try:
            with cpu_limit(CPU_S_MAX):
                return check(root, mutation)
        except (Exception, TooSlow, SystemExit):
            return f"after {time.process_time() - began:.1f} s: {traceback.format_exc()}"


def check(root: Path, mutation: Mutation) -> str | None:
    """Loads content, and checks it as `grader check` does; returns what is wrong with a fault, or None."""
    try:
        library = load(root)
    except ContentError as error:
        bad = [fault for fault in error.faults if not is_clear(fault.file, fault.key, fault.why, mutation)]
        return f"not a clear fault: {bad}" if bad else None
    for quiz in library.quizzes.values():
        for question in quiz.questions:
            question_view(question)
            if isinstance(question, ScriptQuestion):
                check_script(question, library)
            elif (lab := kind_of(question).lab(question)) is not None:
                run_one(lab, library)
        for one in quiz.labs:
            if isinstance(one, LabConfig | IntegratorsLab):
                run_one(one, library)
    list(certify_quizzes(library, library.quizzes))
    return None


def check_script(question: ScriptQuestion, library: Library) -> None:
    """Plans an exercise, judges a script that submits nothing, and computes what `grader check` computes."""
    for seed in SEEDS:
        plan = plan_exercise(question, library.model_xml, seed, library.text)
        json.dumps([plan.inputs, plan.hidden_inputs], allow_nan=False)
        prepare_exercise(question, plan)
        judge_exercise(question, plan, RunReport(RunStatus.RETURNED), fail_to_measure).model_dump_json()
    write_lazy_answers(question, library.model_xml, None, library.text)
    draws, luck.DRAWS = luck.DRAWS, DRAWS
    try:
        estimate_luck(question, library.model_xml, library.text)
    finally:
        luck.DRAWS = draws


def fail_to_measure(job: Job) -> RunReport:
    """Says that what the script made cannot be measured: no jail is here."""
    return RunReport(RunStatus.CRASHED)


def run_one(lab: LabConfig | IntegratorsLab, library: Library) -> None:
    """Runs a lab as a learner does."""
    if isinstance(lab, IntegratorsLab):
        json.dumps(run_integrators(lab, library.model_xml(lab.model)).to_json(), allow_nan=False)
    else:
        json.dumps(watch_lab(lab, lab.xml or library.model_xml(lab.model or "")).to_json(), allow_nan=False)


def is_clear(file: str, key: str, why: str, mutation: Mutation) -> bool:
    """Whether a fault names the file, and the key in it, and says why."""
    known = file == mutation.file or file in contents()[mutation.content]
    return known and bool(key) and len(why) > 5 and "Traceback" not in why


@contextmanager
def cpu_limit(seconds: float) -> Iterator[None]:
    """Raises TooSlow in this, the main thread, after so much CPU time of the process."""

    def stop(_number: int, _frame: object) -> None:
        raise TooSlow

    old = signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, old)


def timed(mutation: Mutation) -> tuple[str | None, float]:
    """What goes wrong, and the CPU time that the mutation takes [s]."""
    began = time.process_time()
    return try_mutation(mutation), time.process_time() - began


def main(arguments: Sequence[str] | None = None) -> int:
    """Tries all mutations, or a draw of them; prints what goes wrong and the dearest."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draw", type=int, help="try this many, drawn by --seed")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="a regular expression for the mutations to try")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args(arguments)
    mutations = [one for one in list_mutations() if re.search(options.only, str(one))]
    if options.draw is not None:
        mutations = random.Random(options.seed).sample(mutations, min(options.draw, len(mutations)))
    faults, costs = 0, list[tuple[float, str]]()
    with ProcessPoolExecutor(options.processes) as pool:
        for mutation, (why, cpu_s) in zip(mutations, pool.map(timed, mutations, chunksize=8), strict=True):
            costs.append((cpu_s, str(mutation)))
            if why is not None:
                faults += 1
                print(f"--- {mutation}\n{why}", flush=True)
    total = sum(cost for cost, _ in costs)
    print(f"{len(mutations)} mutations, {faults} not refused and not checked, {total:.0f} s of CPU; the dearest:")
    print("\n".join(f"{cost:6.1f} s {name}" for cost, name in sorted(costs)[-8:]))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
