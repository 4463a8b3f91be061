"""Edits of the author's program name a student's mistake, edits of the student's program its line: in the real jail."""

import ast
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from exercises.test_values_exercise import folder
from grader.domain.run import Job, RunReport
from grader.domain.verdict import Verdict
from grader.exercises.kinds.values.mutants import edits
from grader.exercises.kinds.values.mutants.edits import find_functions, make_edits
from grader.exercises.kinds.values.mutants.matching import MISTAKES, REPAIRS, list_edits
from grader.grading.pipeline import Pipeline
from grader.library import load
from grader.sandbox.jail import Jail

PROGRAM = """import numpy as np


def slope(values):
    return np.sin(values)


def two(a, b):
    force = 3.0 * a - 0.5 * b**2
    force += slope(a) * b
    if b < 3.5:
        force += 1.25
    return force, np.sqrt(a * b) / 4
"""
SECRETS = ("force", "slope", "3.0", "0.5", "1.25", "3.5", "a * b", "b**2")
"""Parts of the author's program: no sentence may hold one."""


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pipeline]:
    results = [{"name": "load", "unit": "N"}, {"name": "mean", "unit": "m"}]
    library = load(folder(tmp_path_factory.mktemp("content"), PROGRAM, functions=[{"results": results}]))
    with Jail(library.root) as jail:
        yield Pipeline(library, jail.run)


@pytest.fixture(scope="module")
def grade(pipeline: Pipeline) -> Callable[[str], Verdict]:
    return lambda source: pipeline.grade("q", "two", {"source": source}, 1)


@pytest.mark.jail
@pytest.mark.parametrize(
    ("old", "new", "said", "line"),
    [
        ("- 0.5", "+ 0.5", "one sign changed", 9),
        ("np.sin", "np.cos", "another function in one place", 5),
        ("np.sin(values)", "np.sin(np.deg2rad(values))", "converted to radians that is in radians already", 5),
        ("np.sin(values)", "np.sin(np.rad2deg(values))", "one angle in degrees where radians are needed", 5),
        ("3.0 * a -", "6.0 * a -", "one number twice as large", 9),
        ("b**2", "b", "another power", None),
        (" - 0.5 * b**2", "", "one term left out", None),
        (" * b\n", "\n", "one factor left out", None),
        ("b < 3.5", "b > 3.5", "one comparison that is turned round", 11),
        ("    force += slope(a) * b\n", "", "one term left out|one update left out", None),
    ],
)
def test_a_mistake_is_named_and_nothing_of_the_authors_program(
    grade: Callable[[str], Verdict], old: str, new: str, said: str, line: int | None
) -> None:
    source = PROGRAM.replace(old, new)
    assert source != PROGRAM
    verdict = grade(source)
    assert any(part in (verdict.diagnosis or "") for part in said.split("|")), verdict.diagnosis
    assert verdict.line == line
    assert not [part for part in SECRETS if part in (verdict.diagnosis or "")]


@pytest.mark.jail
def test_a_program_of_another_kind_is_mended_by_one_edit_of_its_own(grade: Callable[[str], Verdict]) -> None:
    assert grade("def two(x, y):\n    return 3 * x - y * y / 2 + sin(x) * y, 0\n").status == "crashed"
    source = """import math

def two(x, y):
    return 3 * x - y * y / 2 + math.sin(x) * y + (1.25 if y < 3.5 else 0), math.exp(math.log(x * y) / 3) / 4
"""
    verdict = grade(source)
    assert verdict.line is None
    assert verdict.diagnosis == "seen: mean is wrong."  # no single edit of either program
    source = source.replace("/ 3) / 4", "/ 2) / 2 ** 1")
    verdict = grade(source)
    assert "twice what it should be" in (verdict.diagnosis or "")
    source = source.replace("/ 2 ** 1", "/ 2 ** 2 + 0.001 * x")
    verdict = grade(source)
    assert "mean is wrong. One small change in line 4 of your script" in (verdict.diagnosis or "")
    assert "one term too many" in (verdict.diagnosis or "")
    assert verdict.line == 4


@pytest.mark.jail
def test_a_program_that_an_edit_makes_endless_or_hostile_costs_little(pipeline: Pipeline) -> None:
    source = PROGRAM + "\n\ndef unused():\n    pass\n"
    endless = source.replace(
        "    return force, np", "    while b > 1:\n        b = b - 1\n    return force**2 + 7 * a, np"
    )
    jobs: list[RunReport] = []
    run = pipeline.run
    assert run is not None

    def watch(job: Job) -> RunReport:
        jobs.append(run(job))
        return jobs[-1]

    verdict = Pipeline(pipeline.library, watch).grade("q", "two", {"source": endless}, 1)
    assert verdict.status == "incorrect", verdict.diagnosis
    assert [job.status for job in jobs] == ["returned"] * 3  # the script, then edits of both programs
    assert max(job.cpu_s for job in jobs) < 4


SAMPLE = """
def helper(x):
    return sin(x)

def other(y):
    return y + 1

def entry(model, data, n):
    mj_forward(model, data)
    total = -data.qpos[1] * 2.0 - n / 3
    for k in range(n):
        total += k ** 2 + hypot(k, n)
    if total < 0:
        total = sqrt(helper(total).T)
    return total
"""


def test_the_tree_is_as_before_after_all_edits_and_each_is_another_program() -> None:
    tree = ast.parse(SAMPLE)
    before, seen = ast.dump(tree), set[str]()
    functions = find_functions(tree, "entry")
    assert functions == {"entry", "helper"}
    for kind, line in make_edits(tree, functions):
        assert kind in MISTAKES
        assert kind in REPAIRS
        assert 1 <= line <= len(SAMPLE.splitlines())
        compile(ast.fix_missing_locations(tree), "edited", "exec")
        seen.add(kind)
        assert ast.dump(tree) != before
    assert ast.dump(tree) == before
    missing = {*MISTAKES} - seen
    assert missing <= {"order"} | {"quotient"}, missing


def test_a_program_that_is_none_or_too_long_has_no_edits() -> None:
    assert list_edits("def (", "two") == ()
    assert list_edits("x = 1\n" * 10_000, "two") == ()
    assert list_edits("def two():\n    return 1" + " + 1" * 3000, "two") == ()


def test_the_text_of_the_edits_imports_the_standard_library_alone() -> None:
    tree = ast.parse(Path(edits.__file__).read_text())
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert modules == {"collections.abc", "math", "typing"}
