"""Tries to make a sentence on a mistake false: every program of both corpora, handed in for its own exercise or for
another one, as it is or with small edits. What a sentence claims is held against the script, its trace and simulations
of our own."""

import ast
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from grader.domain.run import Job, Limits, RunReport
from grader.domain.verdict import Status, Verdict
from grader.exercises.explaining.claims import CLAIMS, Evidence, correct_sentence, find_untrue
from grader.exercises.explaining.script import ParsedScript
from grader.exercises.kinds.threshold.judging.judge import Bracket
from grader.exercises.kinds.threshold.search_trace import read_search
from grader.exercises.kinds.values.mutants.edits import make_edits
from grader.exercises.running import diagnosing, runner
from grader.exercises.running.diagnosing import gather_evidence
from grader.grading.pipeline import Pipeline
from grader.numerics.stability.horizon import warns_within
from grader.sandbox.jail import Jail
from support.content import load_content

ROOT = Path(__file__).parents[2]
PROGRAMS = sorted(
    [*(Path(__file__).parent / "corpus").glob("*/*.py"), *(ROOT / "reference_solutions/1.3-exercises").glob("*/*.py")]
)
EXERCISES = ("servo-threshold", "rk4-step", "rk4-free-joint")
EDITS_MAX = 400
LIMITS = Limits(cpu_s=4, wall_s=40)
"""Edited programs that loop for ever end soon."""

MILLISECONDS = re.compile(r"(?<![\w.-])(-?\d+(?:\.\d+)?) ms\b|(\d+(?:\.\d+)?) and (\d+(?:\.\d+)?) ms\b")


@dataclass
class Told:
    """What was told last: the sentence, by which kind, of which trials."""

    kind: Any = None
    parameters: Any = None
    judged: Sequence[Any] = ()
    sentence: str = ""
    count: int = field(default=0)


@pytest.fixture(scope="module")
def told() -> Iterator[Told]:
    """Follows which sentences are told."""
    last, diagnose = Told(), diagnosing.diagnose

    def follow(kind: Any, parameters: Any, judged: Any, whole: Any, run: Any, **more: Any) -> Any:
        mistake, direction = diagnose(kind, parameters, judged, whole, run, **more)
        last.kind, last.parameters, last.judged = kind, parameters, whole
        last.sentence = mistake.sentence if mistake else ""
        last.count += 1
        return mistake, direction

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "diagnose", follow)
        yield last


@pytest.fixture(scope="module")
def pipeline() -> Iterator[Pipeline]:
    library = load_content()
    with Jail(library.root / "models", allow_t2=True) as jail:

        def run(job: Job) -> RunReport:
            return jail.run(replace(job, limits=LIMITS))

        yield Pipeline(library, run)


def edit(source: str, places: Sequence[int]) -> str:
    """The source with the edits at some places of the list of all, one after the other."""
    for place in places:
        tree = ast.parse(source)
        functions = frozenset(node.name for node in tree.body if isinstance(node, ast.FunctionDef))
        for _ in islice(make_edits(tree, functions), place, place + 1):
            source = ast.unparse(ast.fix_missing_locations(tree))
    return source


def list_known_milliseconds(told: Told) -> list[float]:
    """Every time [ms] that a sentence on a search may tell: of its runs, its answers, and the exercise."""
    parameters = told.parameters
    known = [*parameters.search_s, parameters.width_s, *[10**-decimals for decimals in (2, 3)]]
    for one in told.judged:
        search, claim = read_search(one.trace), one.judgement.outcome
        known += [run.timestep_s for run in search.runs] if search else []
        known += claim.numbers if isinstance(claim, Bracket) else []
        model = one.problem.scene.model
        known += [-model.actuator_biasprm[0, 2] / model.actuator_gainprm[0, 0]] if model.nu else []
    return [1e3 * number for number in known]


def check_search(told: Told) -> None:
    """Asserts what a sentence tells of the numbers and outcomes of a search."""
    sentence, known = told.sentence, list_known_milliseconds(told)
    for match in MILLISECONDS.finditer(sentence):
        for number in filter(None, match.groups()):
            digits = len(number.lstrip("-").replace(".", "").strip("0")) or 1
            assert any(abs(float(number) - value) <= 10.0 ** (1 - digits) * abs(value) for value in known), sentence
    right = re.search(r"search is right: ([\d.]+) ms stayed stable, and at ([\d.]+) ms MuJoCo warned", sentence)
    if right is not None:
        cells = [one.problem for one in told.judged if not one.hidden and not one.counts]
        horizon_s = told.parameters.horizon_s
        assert any(
            not warns_within(cell.scene, 0.999 * float(right[1]) / 1e3, horizon_s, integrator=cell.integrator.code)
            and warns_within(cell.scene, 1.001 * float(right[2]) / 1e3, horizon_s, integrator=cell.integrator.code)
            for cell in cells
        )
    failed = [search for one in told.judged if not one.counts and (search := read_search(one.trace)) is not None]
    runs = [run for search in failed for run in search.runs]
    if "raised no warning" in sentence:
        assert any(not run.warnings for run in runs)
    if re.search(r"At [\d.]+ ms MuJoCo raised", sentence):
        assert any(run.warnings for run in runs)
    if "Every run used a timestep" in sentence:
        assert len({f"{run.timestep_s:.6g}" for run in failed[0].runs}) == 1


def check_verdict(verdict: Verdict, told: Told, source: str) -> None:
    """Asserts that nothing untrue is told."""
    assert verdict.status is not Status.GRADER_FAULT
    if verdict.line is not None:
        assert verdict.span is not None
        assert verdict.span.line <= verdict.line <= verdict.span.end_line <= len(source.splitlines())
    if verdict.diagnosis != told.sentence or not told.judged:
        return
    evidence = gather_evidence(told.judged)
    assert evidence.script.source == source
    assert not list(find_untrue(told.sentence, evidence, (*CLAIMS, *told.kind.claims))), told.sentence
    if hasattr(told.parameters, "search_s"):
        check_search(told)


@pytest.fixture(scope="module")
def check(pipeline: Pipeline, told: Told) -> Callable[[str, str], None]:
    def check(exercise: str, source: str) -> None:
        told.sentence, told.judged = "", ()
        check_verdict(pipeline.grade("1.3-exercises", exercise, {"source": source}, 1), told, source)

    return check


@pytest.mark.jail
@pytest.mark.slow
@settings(
    max_examples=40, deadline=None, derandomize=True, database=None, phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
@given(
    program=st.sampled_from(PROGRAMS),
    exercise=st.none() | st.sampled_from(EXERCISES),
    places=st.lists(st.integers(0, EDITS_MAX), max_size=2),
)
def test_nothing_untrue_is_told(
    check: Callable[[str, str], None], program: Path, exercise: str | None, places: list[int]
) -> None:
    source = program.read_text(encoding="utf-8")
    try:
        source = edit(source, places)
    except (SyntaxError, ValueError):
        return
    check(exercise or program.parent.name, source)


@pytest.mark.jail
@pytest.mark.parametrize("exercise", EXERCISES)
@pytest.mark.parametrize(
    "source",
    [
        "import mujoco\n\ndef {entry}(model, data):\n    mujoco.mj_forward(model, data)\n",
        "def {entry}(model, data):\n    return None\n",
        "def {entry}(model, data):\n    print(1.5)\n",
        "def {entry}(m, d):\n    try:\n        return m.nothing\n    except AttributeError:\n        return 0.02\n",
        "import mujoco\n\ndef {entry}(m, code):\n    data = mujoco.MjData(m)\n    mujoco.mj_step(m, data)\n",
        "found = []\n\ndef {entry}(model, integrator):\n    found.append(0.01)\n    return found[-1], 0.0101\n",
    ],
)
def test_nothing_untrue_is_told_of_a_short_program(
    check: Callable[[str, str], None], pipeline: Pipeline, exercise: str, source: str
) -> None:
    entry = getattr(pipeline.library.question("1.3-exercises", exercise), "entry", "")
    check(exercise, source.format(entry=entry))


def test_a_claim_is_held_against_the_script() -> None:
    """The test itself can fail: a sentence of one program is not true of another."""
    bare = Evidence(ParsedScript("def f(x):\n    return x\n"), (), ())
    looped = Evidence(ParsedScript("def f(x):\n    while x:\n        return x\n"), (), ())
    assert list(find_untrue("Turn the test of your loop round.", bare)) == ["your loop"]
    assert not list(find_untrue("Turn the test of your loop round.", looped))
    assert correct_sentence("Line 7 raised a ValueError", bare) is None
    assert correct_sentence("Line 2 raised a ValueError", bare)
    assert correct_sentence("a list outside of the function", looped) is None
