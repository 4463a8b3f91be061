"""What the trace of a `values` trial shows, and what a wrong function is told by it: in this process, without jail."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from exercises.test_values_exercise import folder
from grader.courses.rules.policy import limit_feedback
from grader.domain.run import RunReport, RunStatus
from grader.domain.verdict import Verdict
from grader.exercises import judge_exercise, plan_exercise
from grader.exercises.driving import harness, recorder
from grader.exercises.kinds.values.judging import driver
from grader.library import Library, load

HINGE = """<mujoco><worldbody><body><joint axis='0 1 0'/><inertial pos='0 0 -1' mass='1' diaginertia='1 1 1'/>
<site name='tip' pos='0 0 -2'/></body></worldbody></mujoco>"""
MODEL: dict[str, Any] = {
    "functions": [{"results": [{"name": "height", "unit": "m", "atol": 1e-9}]}],
    "cases": [
        {"id": "seen", "arguments": ["model", "data"], "xml": HINGE, "start": {"qpos": [0.4], "qvel": [3]}},
        {
            "id": "unseen",
            "hidden": True,
            "calls": 3,
            "arguments": ["model", "data"],
            "xml": HINGE,
            "start": {"qpos": [[0.2, 2]], "qvel": [[3, 6]]},
        },
    ],
}
HEIGHT = (
    "import mujoco\ndef two(model, data):\n    mujoco.mj_forward(model, data)\n    return data.site('tip').xpos[2]\n"
)
KINEMATICS = HEIGHT.replace("mj_forward", "mj_kinematics")

MOVED = """
import mujoco
def two(model, data):
    mujoco.mj_forward(model, data)
    return data.qpos[0] + 2 * data.qvel[0]
"""
ARRAYS: dict[str, Any] = {
    "functions": [{"results": [{"name": "unit", "atol": 1e-9}]}],
    "cases": [
        {"id": "seen", "arguments": [{"array": [3, 4, 0]}]},
        {"id": "unseen", "hidden": True, "calls": 3, "arguments": [{"array": [[1, 2], [1, 2], [3, 5]]}]},
    ],
}
UNIT = "import numpy as np\ndef two(v):\n    return v / np.linalg.norm(v) + v / 10\n"


@pytest.fixture
def grade(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Verdict]:
    monkeypatch.setattr(driver, "note", recorder.note)
    monkeypatch.setattr(driver, "show", harness.show)

    def grade(source: str, program: str, check: dict[str, Any]) -> Verdict:
        library = load(folder(tmp_path, program, **check))
        scope: dict[str, Any] = {}
        exec(source, scope)
        return graded(library, scope["two"], source)

    return grade


def graded(library: Library, function: Callable[..., object], source: str = "") -> Verdict:
    """Runs the trials as the harness does."""
    asked: Any = library.question("q", "two")
    plan = plan_exercise(asked, library.model_xml, 1, library.text)
    results: dict[str, Any] = {}
    traces = b""
    recorder.state["left"] = recorder.BYTES_MAX
    for index, trial in enumerate(plan.trials):
        recorder.begin(trial.hidden)
        submitted: dict[str, Any] = {}
        driver.trial([recorder.traced(function)], trial.inputs, submitted.__setitem__)
        results |= {f"t{index}_{name}": np.asarray(value) for name, value in submitted.items()}
        trace = recorder.end()
        traces += struct.pack("<II", index, len(trace)) + trace
    results["traces"] = results["hidden_traces"] = np.frombuffer(traces, np.uint8)
    report = RunReport(RunStatus.RETURNED, results=results, hidden_results=results)
    return judge_exercise(asked, plan, report, source=source)


OFF = "import numpy as np\ndef two(v):\n    w = v / np.linalg.norm(v) + v / 10\n    return {}\n"
RETURNS = "def two(v):\n    return {}\n"
TOLD = [
    (MOVED, MODEL, MOVED.replace("mj_forward(", "mj_step("), "calls mj_step, which advances data by a timestep"),
    (HEIGHT, MODEL, "def two(model, data):\n    return data.site('tip').xpos[2]\n", "never calls mj_forward"),
    (KINEMATICS, MODEL, "def two(model, data):\n    return 0\n", "Call mujoco.mj_kinematics(model, data) first"),
    (UNIT, ARRAYS, "def two(v):\n    v /= (v @ v) ** 0.5\n    return v + v / 10\n", "changes argument 1 in place"),
    (UNIT, ARRAYS, RETURNS.format("v[:2]"), "unit is an array of shape (2,) where an array of shape (3,) is asked for"),
    (UNIT, ARRAYS, RETURNS.format("float(v[0])"), "unit is a single number where an array of shape (3,) is asked for"),
    (UNIT, ARRAYS, RETURNS.format("f'{v} m'"), "returns a text"),
    (UNIT, ARRAYS, RETURNS.format("abs"), "returns a function, which it does not call"),
    (UNIT, ARRAYS, RETURNS.format("{'x': v}"), "returns a dict with other keys"),
    (UNIT, ARRAYS, RETURNS.format("{'unit': v, 'x': 1}"), "returns a dict with other keys"),
    (UNIT, ARRAYS, RETURNS.format("{'unit': float('nan')}"), "a dict in which not every value is a finite number"),
    (UNIT, ARRAYS, RETURNS.format("{'unit': 'v'}"), "a dict in which not every value is a finite number"),
    (UNIT, ARRAYS, RETURNS.format("v * float('nan')"), "Your result is nan"),
    (UNIT, ARRAYS, RETURNS.format("10**5000"), "Your result is a whole number too large for a float"),
    (UNIT, ARRAYS, "def two(v):\n    yield v\n", "since it holds `yield`"),
    (UNIT, ARRAYS, "def two(v):\n    return (x for x in v)\n", "a generator, whose values are not computed yet"),
    (UNIT, ARRAYS, OFF.format("np.round(w, 2)"), "unit is rounded to 2 decimals"),
    (UNIT, ARRAYS, OFF.format("w + 0.25"), "unit is off by the same amount in every result"),
    (UNIT, ARRAYS, OFF.format("1.5 * w"), "unit is 1.5 times what it should be in every result"),
]


@pytest.mark.parametrize(("program", "check", "source", "said"), TOLD, ids=[said for *_, said in TOLD])
def test_what_the_trace_shows_is_told(
    program: str, check: dict[str, Any], source: str, said: str, grade: Callable[..., Verdict]
) -> None:
    verdict = grade(source, program, check)
    assert verdict.status != "correct"
    assert said in (verdict.diagnosis or "")


@pytest.mark.parametrize(
    "value", ["np.round(v, 2)", "w.astype(np.float32)", "np.round(w)", "w + v", "0 * v", "w + w**2"]
)
def test_results_that_are_off_in_no_even_way_are_told_no_pattern(value: str, grade: Callable[..., Verdict]) -> None:
    verdict = grade(OFF.format(value), UNIT, ARRAYS)
    assert verdict.status == "incorrect"
    assert not any(word in (verdict.diagnosis or "") for word in ("rounded", "same amount", "times what"))


@pytest.mark.parametrize("body", ["math.cos(data.qpos[0])", "data.qvel[0] * 0.5"])
def test_nobody_is_sent_to_a_function_that_the_exercise_does_not_need(body: str, grade: Callable[..., Verdict]) -> None:
    program = f"import math\ndef two(model, data):\n    return {body}\n"
    verdict = grade("def two(model, data):\n    return 0\n", program, MODEL)
    assert "mj_" not in (verdict.diagnosis or "")
    assert "same results for every call" in (verdict.diagnosis or "")


def test_a_wrong_result_is_judged_where_a_residual_over_data_decides(grade: Callable[..., Verdict]) -> None:
    program = "def missed(model, data, q):\n    return q - data.qpos[0]\n"
    functions = [{"results": [{"name": "q"}], "residual": {"function": "missed", "atol": 1e-6}}]
    verdict = grade("def two(model, data):\n    return 0\n", program, {**MODEL, "functions": functions, "luck": 1})
    assert (verdict.status, verdict.points) == ("incorrect", 0)


@pytest.mark.parametrize(
    ("returned", "said"),
    [
        ("0.0, np.degrees(data.qpos[0])", "second is in degrees: give it in radians."),
        ("0.0, 0.5 * data.qpos[0]", "second is half of what it should be"),
        ("0.1, -data.qpos[0]", ""),
        ("np.degrees(np.pi), np.degrees(data.qpos[0])", ""),
    ],
)
def test_a_result_that_satisfies_the_residual_once_it_is_mended_is_told_how(
    returned: str, said: str, grade: Callable[..., Verdict]
) -> None:
    program = "def missed(model, data, first, second):\n    return abs(first) + abs(second - data.qpos[0])\n"
    functions = [{"results": [{"name": "first"}, {"name": "second"}], "residual": {"function": "missed", "atol": 1e-6}}]
    source = f"import numpy as np\ndef two(model, data):\n    return {returned}\n"
    verdict = grade(source, program, {**MODEL, "functions": functions, "luck": 1})
    assert verdict.points == 0
    assert (verdict.diagnosis or "").startswith(said)
    assert said or "second" not in (verdict.diagnosis or "")


CONTROL: dict[str, Any] = {**MODEL, "functions": [{"results": [{"name": "torque", "field": "qfrc_applied"}]}]}
HOLDS = (
    "import mujoco\ndef two(model, data):\n    mujoco.mj_forward(model, data)\n"
    "    data.qfrc_applied[:] = data.qfrc_bias\n"
)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("return data.qfrc_bias", "your function returns a value: write into data.qfrc_applied in place instead"),
        ("torque = data.qfrc_bias", "data is left as it was: write into data.qfrc_applied in place, as in"),
    ],
)
def test_who_leaves_data_as_it_was_is_told_where_to_write(body: str, said: str, grade: Callable[..., Verdict]) -> None:
    """The field is 0 after every call: that is not a result which ignores its arguments."""
    source = f"import mujoco\ndef two(model, data):\n    mujoco.mj_forward(model, data)\n    {body}\n"
    assert said in (grade(source, HOLDS, CONTROL).diagnosis or "")


HEAVIER = "def two(model, scale):\n    model.body_mass[:] *= scale\n    return model.body_mass.sum()\n"
SCALED: dict[str, Any] = {
    "functions": [{"results": [{"name": "mass"}]}],
    "cases": [
        {"id": "seen", "arguments": ["model", 2], "xml": HINGE},
        {"id": "unseen", "hidden": True, "calls": 3, "arguments": ["model", [1.5, 3]], "xml": HINGE},
    ],
}


def test_who_changes_what_the_author_s_program_changes_is_not_blamed_for_it(grade: Callable[..., Verdict]) -> None:
    verdict = grade(HEAVIER.replace("*=", "/="), HEAVIER, SCALED)
    assert verdict.status == "incorrect"
    assert "in place" not in (verdict.diagnosis or "")


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("mujoco.mj_forward(model, data)\n    return 0 * data.qpos[0]", "a term with their masses is missing"),
        ("return 9.81 * model.body_mass[0] * data.qpos[0]", "count the others from body 1"),
    ],
)
def test_only_who_reads_masses_is_told_to_count_bodies(body: str, said: str, grade: Callable[..., Verdict]) -> None:
    program = "def two(model, data):\n    return 9.81 * model.body_mass[1] * data.qpos[0] + data.qvel[0]\n"
    source = f"import mujoco\ndef two(model, data):\n    {body} + data.qvel[0]\n"
    assert said in (grade(source, program, MODEL).diagnosis or "")


def test_the_author_s_sentence_comes_before_all_others(grade: Callable[..., Verdict], tmp_path: Path) -> None:
    (tmp_path / "programs").mkdir()
    (tmp_path / "programs" / "far.py").write_text("def two(v):\n    return v * 0 + 0.5\n")
    check = {**ARRAYS, "mistakes": [{"program": "programs/far.py", "sentence": "Half of what?"}]}
    assert grade("def two(v):\n    return [0.5, 0.5, 0.5]\n", UNIT, check).diagnosis == "Half of what?"


def test_too_many_values_are_counted(grade: Callable[..., Verdict]) -> None:
    verdict = grade("def two(a, b):\n    return a, b, 0\n", "def two(a, b):\n    return a + b, a * b\n", {})
    assert verdict.diagnosis == ("Your function returns 3 values, not 2: return sum and product as numbers or arrays.")


def test_what_a_right_function_does_to_its_input_is_no_mistake(grade: Callable[..., Verdict]) -> None:
    source = "def two(v):\n    n = (v @ v) ** 0.5\n    w = v / n + v / 10\n    v[:] = 0\n    return w\n"
    assert grade(source, UNIT, ARRAYS).status == "correct"


def test_what_was_used_and_changed_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    notes: list[Any] = []
    monkeypatch.setattr(driver, "note", lambda *note: notes.append(note))
    scope: dict[str, Any] = {}
    exec(HEIGHT.replace("    return", "    model.opt.gravity[2] = data.qpos[0] = 0\n    return"), scope)
    call = {"arguments": ["model", "data"], "start": dict.fromkeys(("key", "qvel", "act", "ctrl")) | {"qpos": [1]}}
    inputs = {"calls": [call], "model": HINGE, "results": [{"name": "height", "field": None}]}
    driver.trial([scope["two"]], inputs, lambda *_: None)
    assert notes == [("used", {"functions": ["mj_forward"], "changed": ["model.opt.gravity", "data.qpos"]})]


def test_where_only_the_direction_is_told_no_number_leaks(grade: Callable[..., Verdict]) -> None:
    """The same wrong function gets the same words whatever the author's program gives."""
    source = "def two(a, b):\n    return a + b + 1.25, a * b\n"
    shown = set()
    for program in ("2 * (a + b + 1.25)", "-(a + b + 1.25)", "a - 7.7"):
        verdict = grade(source, f"def two(a, b):\n    return {program}, a * b\n", {})
        told = json.loads(limit_feedback(verdict, "direction").model_dump_json())
        shown.add(json.dumps(told["findings"]) + json.dumps(told["evidence"]) + str(told["diagnosis"]))
        assert "sum is off by" in json.dumps(limit_feedback(verdict, "size").model_dump(mode="json")["findings"])
    assert len(shown) == 1
    assert "sum is wrong." in next(iter(shown))
