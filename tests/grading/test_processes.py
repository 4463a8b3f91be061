"""Grading processes: what they cannot judge within their memory is the script's fault, and no other learner's."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.domain.verdict import Status, Verdict
from grader.errors import JailFault
from grader.grading.pipeline import TOO_LARGE
from grader.grading.process_main import JUDGING_BYTES_MAX
from grader.grading.processes import Graders, GradingProcess, ScriptJob
from grader.library import Library, load

pytestmark = pytest.mark.slow

QUESTION = {
    "kind": "code",
    "id": "count",
    "q": "How many?",
    "entry": "count",
    "check": {
        "kind": "values",
        "program": "count.py",
        "functions": [{"results": [{"name": "number"}], "residual": {"function": "miscounted", "atol": 1e-9}}],
        "cases": [{"id": "a", "arguments": [3]}],
    },
}
MISCOUNTED = """
import numpy as np

def miscounted(n, number):
    return np.ones(int(number)).sum() - n
"""
"""An author's program that takes as much memory as the script's result says."""


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    folder: Path = tmp_path_factory.mktemp("content")
    (folder / "quizzes").mkdir()
    (folder / "count.py").write_text(MISCOUNTED)
    (folder / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [QUESTION]}))
    return load(folder)


@pytest.fixture(scope="module")
def graders() -> Iterator[Graders]:
    with Graders(1, allow_t2=False) as graders:
        yield graders


def judge(graders: Graders, library: Library, number: float) -> Verdict:
    source = f"def count(n):\n    return {number!r}\n"
    return graders.judge(library, ScriptJob("q", "count", {"source": source}, 1))


def test_of_several_the_first_is_waited_for_and_another_judges_once_it_is_ready(library: Library) -> None:
    with Graders(2, allow_t2=False) as graders:
        first, second = graders._all
        assert first.jail and not second.jail and graders.alive == 2
        assert (
            second.judge(library, ScriptJob("q", "count", {"source": "def count(n):\n    return 3.0\n"}, 1)).points == 1
        )
        assert second.jail == first.jail == graders.jail


def test_a_process_that_has_not_begun_ends_with_its_handle() -> None:
    process = GradingProcess(allow_t2=False)
    process.close()
    assert not process.alive
    with pytest.raises(JailFault, match="broke"):
        process.wait_until_ready()


def test_results_too_large_to_judge_are_the_scripts_fault_and_cost_nobody_else(
    graders: Graders, library: Library
) -> None:
    assert judge(graders, library, 3.0).status is Status.CORRECT
    pids = graders.pids()
    verdict = judge(graders, library, float(JUDGING_BYTES_MAX // 6))
    assert (verdict.status, verdict.points, verdict.diagnosis) == (Status.OUT_OF_MEMORY, 0, TOO_LARGE)
    assert judge(graders, library, 3.0).status is Status.CORRECT
    assert graders.pids() == pids


def test_a_script_may_use_more_memory_than_a_grading_process(graders: Graders, library: Library) -> None:
    raw = {**QUESTION, "limits": {"memory_mb": 4096}}
    (library.root / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [raw]}))
    size = JUDGING_BYTES_MAX + (1 << 30)
    source = f"import mmap\n\ndef count(n):\n    mmap.mmap(-1, {size}, flags=mmap.MAP_PRIVATE)\n    return n\n"
    script = ScriptJob("q", "count", {"source": source}, 1)
    assert graders.judge(load(library.root), script).status is Status.CORRECT
