"""Results that no honest script sends, at every kind's judge: never points, an exception or a warning."""

import importlib.util
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from exercises.conftest import ROOT
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Status
from grader.exercises import Plan, judge_exercise, load_kinds, plan_exercise
from grader.exercises.kinds.rk4.judging.quaternions import find_quaternions
from grader.library import Library, load
from grader.questions.kinds.script import ScriptQuestion
from grader.sandbox.jail import Jail
from support.content import PASSED
from support.kinds import install_kinds

HERE = Path(__file__).parent
Forge = Callable[[NDArray[Any]], Any]
Array = NDArray[np.generic]

WORDS = ScriptQuestion.model_validate(
    {
        "kind": "code",
        "id": "words",
        "q": "?",
        "entry": "backwards",
        "check": {"kind": "exact-text", "cases": [{"id": "a", "word": "one"}, {"id": "b", "hidden": True}]},
    }
)
RIGHT = {
    "servo-threshold": "1.3-exercises/servo-threshold/correct__spectral_radius.py",
    "rk4-step": "1.3-exercises/rk4-step/correct__classical.py",
    "rk4-free-joint": "1.3-exercises/rk4-free-joint/correct__rotation_vector.py",
    "rotor-acceleration": "motion/rotor-acceleration/correct__as_the_author.py",
    "pendulum-step": "motion/pendulum-step/correct__numpy.py",
}
DECIDES = {
    "servo-threshold": ["claim"],
    "rk4-step": ["q", "v"],
    "rk4-free-joint": ["q", "v"],
    "rotor-acceleration": ["r"],
    "pendulum-step": ["r"],
    "words": ["text"],
}
"""The beginnings of the names of results that decide every trial."""

FORGED: Mapping[str, Forge] = {
    "zeros": np.zeros_like,
    "ones": np.ones_like,
    "negative zeros": lambda array: -np.zeros(array.shape),
    "inf": lambda array: np.full(array.shape, np.inf),
    "nan": lambda array: np.full(array.shape, np.nan),
    "huge": lambda array: np.full(array.shape, 1e308),
    "huge of both signs": lambda array: np.where(np.arange(array.size).reshape(array.shape) % 2, 1e308, -1e308),
    "overflows when squared": lambda array: np.full(array.shape, 1e200),
    "denormal": lambda array: np.full(array.shape, 5e-324),
    "integers": lambda array: np.round(np.nan_to_num(array)).astype(np.int64),
    "truth values": lambda array: np.ones(array.shape, dtype=bool),
    "complex": lambda array: array.astype(np.complex128),
    "objects": lambda array: array.astype(object),
    "texts": lambda array: array.astype(str),
    "single precision": lambda array: array.astype(np.float32),
    "empty": lambda array: np.empty(0, array.dtype),
    "empty rows": lambda array: np.empty((0, *array.shape[1:]), array.dtype),
    "empty with axes": lambda array: np.empty((*array.shape, 0), array.dtype),
    "0-d": lambda array: np.zeros((), array.dtype),
    "another axis in front": lambda array: np.zeros((1, *array.shape), array.dtype),
    "another axis behind": lambda array: np.zeros((*array.shape, 1), array.dtype),
    "a column": lambda array: np.zeros((3000, 1), array.dtype),
    "a row": lambda array: np.zeros((1, 3000), array.dtype),
    "the first row alone": lambda array: array.reshape(-1)[:1].astype(np.int32),
    "the first row throughout": lambda array: np.broadcast_to(array[:1], array.shape) if array.ndim == 2 else 0 * array,
}


@cache
def load_content(name: str) -> Library:
    return load(ROOT if "1.3" in name else HERE / "values", passed=PASSED)


def find_exercise(id_: str) -> tuple[ScriptQuestion, Library]:
    if id_ == "words":
        return WORDS, load_content("motion")
    library = load_content(RIGHT[id_])
    question = library.question(RIGHT[id_].partition("/")[0], id_)
    assert isinstance(question, ScriptQuestion)
    return question, library


@pytest.fixture(scope="module", autouse=True)
def plugin() -> Iterator[None]:
    """The kind of another package, as if it were installed."""
    spec = importlib.util.spec_from_file_location("exact_text", HERE / "plugin" / "exact_text.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    kinds = {**load_kinds(), "exact-text": module.ExactText()}
    with pytest.MonkeyPatch.context() as patch:
        install_kinds(patch, **kinds)
        yield


@pytest.fixture(scope="module")
def honest(jail: Jail) -> Callable[[str], tuple[ScriptQuestion, Plan, RunReport]]:
    """What a right script sends."""

    @cache
    def honest(id_: str) -> tuple[ScriptQuestion, Plan, RunReport]:
        question, library = find_exercise(id_)
        plan = plan_exercise(question, library.model_xml, 1, library.text)
        script = "def backwards(word):\n    return word[::-1]\n"
        if id_ in RIGHT:
            script = (library.root / "reference_solutions" / RIGHT[id_]).read_text()
        report = jail.run(plan.build_job(script, question.limits))
        assert judge_exercise(question, plan, report).status is Status.CORRECT
        return question, plan, report

    return honest


def forge(report: RunReport, beginnings: tuple[str, ...], change: Callable[[str, Array], Any]) -> RunReport:
    """A report whose results are changed where the name behind the number of the trial begins so."""

    def forged(results: Mapping[str, Array]) -> dict[str, Any]:
        return {
            name: change(name, array) if name.partition("_")[2].startswith(beginnings) else array
            for name, array in results.items()
        }

    return replace(report, results=forged(report.results), hidden_results=forged(report.hidden_results))


@pytest.mark.parametrize("what", FORGED)
@pytest.mark.parametrize("id_", DECIDES)
def test_a_forged_result_earns_nothing_and_breaks_nothing(
    id_: str, what: str, honest: Callable[[str], tuple[ScriptQuestion, Plan, RunReport]]
) -> None:
    question, plan, report = honest(id_)
    for beginnings in {tuple(DECIDES[id_]), *((decide,) for decide in DECIDES[id_])}:

        def change(name: str, array: Array) -> Any:
            return FORGED[what](array)

        verdict = judge_exercise(question, plan, forge(report, beginnings, change))
        assert (verdict.points, verdict.status) == (0, Status.INCORRECT), beginnings


@pytest.mark.parametrize("length", [0.0, 5e-324, 1e-200, 1e-3, 1e160, 1e300])
def test_a_quaternion_without_a_sensible_length_is_like_no_other(
    length: float, honest: Callable[[str], tuple[ScriptQuestion, Plan, RunReport]]
) -> None:
    question, plan, report = honest("rk4-free-joint")

    def change(name: str, array: Array) -> Array:
        changed = np.array(array, dtype=np.float64)
        trial = plan.trials[int(name[1 : name.index("_")])]
        for quaternion in find_quaternions(trial.problem.run.scene().model):
            changed[:, quaternion.qpos : quaternion.qpos + 4] *= length
        return changed

    verdict = judge_exercise(question, plan, forge(report, ("q",), change))
    assert (verdict.points, verdict.status) == (0, Status.INCORRECT)


def test_a_claim_of_an_exception_may_be_nested_as_deep_as_it_likes() -> None:
    question, library = find_exercise("words")
    plan = plan_exercise(question, library.model_xml, 1, library.text)
    raised = {f"t{index}_raised": np.frombuffer(b"[" * 200_000, np.uint8) for index in (0, 1)}
    report = RunReport(RunStatus.RETURNED, results=raised, hidden_results=raised)
    assert judge_exercise(question, plan, report).status is Status.CRASHED
