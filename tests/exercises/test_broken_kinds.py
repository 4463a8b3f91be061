"""A kind of exercise that is not whole is refused with what it lacks; one that fails is named with its line."""

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from subprocess import CompletedProcess
from typing import Any, Literal

import numpy as np
import pytest

from grader.errors import PluginError
from grader.exercises import (
    Case,
    DrawnCase,
    ExerciseParameters,
    Intervals,
    Judgement,
    Kind,
    Measurement,
    Results,
    Trial,
)
from grader.exercises.running import planning
from grader.exercises.running.lacks import list_lacks
from grader.exercises.running.planning import GROUP, load_kind
from grader.grading.pipeline import Retries
from support.command_line import grader

DRIVER = """
import numpy as np

def trial(functions, inputs, submit):
    submit("y", np.asarray(functions[0](inputs["x"]), dtype=float))
"""


class Double(Kind[ExerciseParameters, float, Any]):
    """A whole kind, of which each of the others breaks one part."""

    parameters = ExerciseParameters
    driver = DRIVER
    needs_model = False

    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        x = drawn.rng.uniform() if drawn.case.hidden else 0.5
        return [Trial(drawn.case.id, {"x": x}, x)]

    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Results) -> Judgement[Any]:
        y: Any = results.get("y")
        right = y is not None and y.shape == () and abs(float(y) - 2 * trial.problem) < 1e-9
        return Judgement(right, "Right." if right else "Wrong.", None)

    def list_accepted(
        self, parameters: ExerciseParameters, trials: Sequence[Trial[float]]
    ) -> Sequence[Intervals] | None:
        return [[(2 * trials[0].problem - 1e-9, 2 * trials[0].problem + 1e-9)]]


class NoKind:
    parameters = ExerciseParameters


class NoParameters(Double):
    parameters = dict  # type: ignore[assignment]


class NoDriver(Kind[ExerciseParameters, float, Any]):
    parameters = ExerciseParameters
    build_trials, judge = Double.build_trials, Double.judge


class NoPython(Double):
    driver = "def trial(functions, inputs, submit)\n"


class NoTrial(Double):
    driver = "def run(functions, inputs, submit):\n    import pandas\n"


class ImportsGrader(Double):
    driver = f"from grader.exercises import Kind\nfrom . import judge\n{DRIVER}"


class NoPlay(Double):
    plays = True


class NoForm(Double):
    takes: Sequence[Any] = ("matlab",)


class NoMeasure(Double):
    measurement = Measurement("import numpy\n")


LACKS: dict[type[object], tuple[str, ...]] = {
    NoKind: ("derive it from grader.exercises.Kind",),
    NoParameters: ("set `parameters` to a model that derives from grader.exercises.ExerciseParameters",),
    NoDriver: ("set `driver` to the text of a module that defines trial(functions, inputs, submit)",),
    NoPython: ("correct the driver, which is no Python: expected ':'", "line 1"),
    NoTrial: ("define trial(functions, inputs, submit) in the driver", "remove the import of 'pandas' from the driver"),
    ImportsGrader: ("remove the import of 'grader' from the driver: the jail has NumPy", "remove the import of '.'"),
    NoPlay: ("define `play`, or leave `plays` out",),
    NoForm: ("set `takes` to a tuple of 'python'",),
    NoMeasure: ("define measure(inputs, results, submit) in the measurement",),
}


@pytest.mark.parametrize("kind", LACKS, ids=lambda kind: kind.__name__)
def test_a_kind_that_is_not_whole_is_refused_before_it_serves(kind: type[object]) -> None:
    with pytest.raises(PluginError) as raised:
        load_kind(EntryPoint("double", f"{__name__}:{kind.__name__}", GROUP))
    assert f"the exercise kind 'double' ({__name__}:{kind.__name__}) is not whole: " in str(raised.value)
    for lack in LACKS[kind]:
        assert lack in str(raised.value)


def test_our_own_kinds_are_whole() -> None:
    lacks = {point.name: [*list_lacks(point.load()())] for point in entry_points(group=GROUP)}
    assert set(lacks) >= {"rk4", "threshold", "values"}
    assert not any(lacks.values()), lacks
    assert [*list_lacks(Double())] == []


class BuildsNothing(Double):
    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return []


class BuildsArrays(Double):
    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial(drawn.case.id, {"x": np.ones(1)}, 0.5)]


class BuildsOneId(Double):
    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial("same", {"x": 0.5}, 0.5)]


class BuildRaises(Double):
    def build_trials(self, parameters: ExerciseParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[float]]:
        return [Trial(drawn.case.id, {"x": drawn.case.word}, 0.5)]  # type: ignore[attr-defined]


class CertifyRaises(Double):
    def certify(self, parameters: ExerciseParameters, trial: Trial[float]) -> None:
        raise RuntimeError("no reference")


class AcceptsNoList(Double):
    def list_accepted(
        self, parameters: ExerciseParameters, trials: Sequence[Trial[float]]
    ) -> Sequence[Intervals] | None:
        return [(0.0, 1.0)]  # type: ignore[list-item]


class AcceptRaises(Double):
    def list_accepted(
        self, parameters: ExerciseParameters, trials: Sequence[Trial[float]]
    ) -> Sequence[Intervals] | None:
        return [[(0.0, 1 / 0)]]


class JudgesNone(Double):
    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Results) -> Judgement[Any]:
        return None  # type: ignore[return-value]


class JudgeRaises(Double):
    def judge(self, parameters: ExerciseParameters, trial: Trial[float], results: Results) -> Judgement[Any]:
        return Judgement(bool(results["z"]), "", None)


class DrawsNoChart(Double):
    def build_pictures(self, parameters: ExerciseParameters, visible: Any) -> dict[str, Any]:
        return {"charts": [{"case": "a", "series": [{"x": [1], "y": "high"}]}], "own": 1, "tables": []}


class DrawsNothing(Double):
    def build_pictures(self, parameters: ExerciseParameters, visible: Any) -> dict[str, Any]:
        return []  # type: ignore[return-value]


class DriverRaises(Double):
    driver = DRIVER.replace('inputs["x"]', 'inputs["gone"]')


class DriverRaisesWhenHidden(Double):
    driver = DRIVER.replace("    submit(", "    if hidden: raise LookupError\n    submit(")


class DriverRaisesAtOnce(Double):
    driver = f"{DRIVER}\nhalf = 1 / 0\n"


Key = Literal["w.check", "w.check.cases.0", "w.check.luck", "correct"]

FAILS: dict[type[Double], tuple[Key, str]] = {
    BuildsNothing: ("w.check.cases.0", "its build_trials must return one at least"),
    BuildsArrays: ("w.check.cases.0", "whose `inputs` are no plain JSON: Object of type ndarray"),
    BuildsOneId: ("w.check", "several trials with the id 'same'"),
    BuildRaises: (
        "w.check.cases.0",
        "the kind fails: AttributeError: 'Case' object has no attribute 'word' (test_broken_kinds.py, line ",
    ),
    CertifyRaises: ("w.check.cases.0", "the kind fails: RuntimeError: no reference (test_broken_kinds.py, line "),
    AcceptsNoList: ("w.check", "list_accepted must return a list of lists of intervals, such as [[(0.9, 1.1)"),
    AcceptRaises: ("w.check", "the kind fails: ZeroDivisionError: division by zero (test_broken_kinds.py, line "),
    JudgesNone: ("correct", "graded grader_fault (TypeError: judge must return a Judgement, not None)"),
    DriverRaises: (
        "correct",
        "the driver of the exercise kind 'double' raises KeyError: 'gone' (trial, line 5 of the driver)",
    ),
    DriverRaisesWhenHidden: ("correct", "raises LookupError (trial, line 5 of the driver)"),
    DriverRaisesAtOnce: ("correct", "the driver of the exercise kind 'double' raises ZeroDivisionError: division by"),
    DrawsNoChart: ("correct", "the kind builds pictures that no page can draw: charts.0.series.0.y: must be "),
    DrawsNothing: ("correct", "the kind builds pictures that no page can draw: must be an object, not list; mend"),
    JudgeRaises: ("correct", "graded grader_fault (KeyError: 'z' (test_broken_kinds.py, line "),
}


Fault = dict[str, str]
RIGHT = {"correct__sum": "def w(x):\n    return x + x\n"}


def run_check(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    kind: type[Double],
    scripts: Mapping[str, str] = RIGHT,
    **changes: Any,
) -> CompletedProcess[str]:
    """`grader check` of an exercise of a kind, as if it were installed."""
    monkeypatch.setattr("grader.grading.pipeline.COMMAND_RETRIES", Retries(tries=2, pause_s=0.01))
    kinds = {**planning.load_kinds(), "double": kind()}
    for module in ("planning", "runner", "authored", "lazy"):
        monkeypatch.setattr(f"grader.exercises.running.{module}.load_kinds", lambda: kinds)
    for module in ("grader.exercises.rehearsing", "grader.exercises.luck", "grader.exercises"):
        monkeypatch.setattr(f"{module}.load_kinds", lambda: kinds)
    cases = [{"id": "a"}, {"id": "b", "hidden": True}]
    question = {"id": "w", "kind": "code", "entry": "w", "q": "Double it."}
    question["check"] = {"kind": "double", "cases": cases, **changes}  # type: ignore[assignment]
    (folder / "quizzes").mkdir()
    (folder / "models").mkdir()
    (folder / "quizzes/q.json").write_text(json.dumps({"id": "q", "title": "Q", "questions": [question]}))
    programs = folder / "reference_solutions/q/w"
    programs.mkdir(parents=True)
    for name, text in scripts.items():
        (programs / f"{name}.py").write_text(text)
    return grader("check", str(folder), "--again", "--json")


def check(
    folder: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Double], *given: Any, **changes: Any
) -> list[Fault]:
    """The faults that it finds."""
    faults: list[Fault] = json.loads(run_check(folder, monkeypatch, kind, *given, **changes).stdout)["faults"]
    return faults


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("kind", FAILS, ids=lambda kind: kind.__name__)
def test_a_kind_that_fails_is_named_with_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Double]
) -> None:
    key, why = FAILS[kind]
    faults = check(tmp_path, monkeypatch, kind)
    told = [fault["why"] for fault in faults if fault["key"] == key]
    assert any(why in one for one in told), faults
    assert not any("name the file grader_fault" in one for one in told)


@pytest.mark.slow
@pytest.mark.process
def test_the_traceback_of_a_fault_is_logged_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripts = {**RIGHT, "correct__product": "def w(x):\n    return 2 * x\n"}
    done = run_check(tmp_path, monkeypatch, JudgesNone, scripts)
    assert done.stdout.count("graded grader_fault (TypeError: judge must return a Judgement") == 2
    assert done.stderr.count("grading failed") == 1, done.stderr


class Catches(Double):
    driver = """
import numpy as np

def trial(functions, inputs, submit):
    try:
        y = functions[0](inputs["x"])
    except Exception:
        raise RuntimeError("it does not work")
    submit("y", np.asarray(y, dtype=float))
"""


THEIRS = {
    **RIGHT,
    "crashed__returns_a_text": "def w(x):\n    return 'two'\n",
    "crashed__breaks_what_the_driver_uses": "import numpy\nnumpy.asarray = None\ndef w(x):\n    return 2 * x\n",
    "crashed__raises": "def w(x):\n    return 1 / 0\n",
    "crashed__ends": "import os\nos._exit(1)\n",
    "crashed__has_another_name": "def v(x):\n    return 2 * x\n",
    "crashed__breaks_the_harness": "import sys\nsys._getframe(1).f_globals.clear()\n\n\ndef w(x):\n    return 2 * x\n",
}
"""Scripts that make a driver raise, or seem to."""


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("kind", [Double, Catches])
def test_what_a_script_makes_a_driver_raise_is_the_scripts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Double]
) -> None:
    assert check(tmp_path, monkeypatch, kind, THEIRS) == []


@pytest.mark.slow
@pytest.mark.process
def test_a_script_that_exits_runs_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scripts = {**RIGHT, "crashed__exits": "def w(x):\n    return 2 * x\n\n\nraise SystemExit(0)\n"}
    done = run_check(tmp_path, monkeypatch, Double, scripts)
    assert json.loads(done.stdout)["faults"] == []
    assert "called exit()" not in done.stderr, "a second run was needed"


@pytest.mark.slow
@pytest.mark.process
def test_a_kind_that_declares_its_cases_keeps_their_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Cases(ExerciseParameters):
        cases: tuple[Case, ...]

    class Unlimited(Double):
        parameters = Cases

    (fault,) = check(tmp_path, monkeypatch, Unlimited, cases=[{"id": f"c{i}"} for i in range(51)])
    assert (fault["key"], fault["why"]) == ("w.check.cases", "must have 1 to 50 cases")
