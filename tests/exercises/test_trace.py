"""Traces: what the recorder notes in the jail, how little it may cost, and that a forged trace decides nothing."""

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from exercises.conftest import ROOT, model_xml, question
from grader.domain.run import RunReport, RunStatus
from grader.exercises import judge_exercise, plan_exercise
from grader.exercises.driving import catching, recorder
from grader.exercises.trace import NO_TRACE, HandledException, ReturnedValue, Trace, read_trace, read_traces

Run = Callable[..., RunReport]

SERVO = question("servo-threshold")
PROGRAMS = ROOT / "reference_solutions" / "1.3-exercises"


def raw_note(name: str, info: dict[str, Any], numbers: list[float]) -> bytes:
    text = json.dumps(info).encode()
    head = struct.pack("<B", len(name)) + name.encode() + struct.pack("<I", len(text)) + text
    return head + struct.pack(f"<I{len(numbers)}d", len(numbers), *numbers)


def as_result(raw: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.frombuffer(raw, np.uint8)


def use(trace: Trace) -> None:
    """Reads all that can be read of a trace."""
    assert all(isinstance(value, ReturnedValue) for value in trace.returned_values)
    assert all(isinstance(exception, HandledException) for exception in trace.handled_exceptions)
    assert trace.printed_text is None or isinstance(trace.printed_text, str)
    assert all(note.numbers.dtype == np.float64 for note in trace.notes)


NAMES = st.sampled_from(["returned", "handled", "printed", "step", "run"])
PLAIN = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.sampled_from(["", "a\u00fc"])
JSON = PLAIN | st.lists(PLAIN, max_size=3) | st.dictionaries(st.sampled_from("ab"), PLAIN, max_size=2)
KEYS = st.sampled_from(["type", "text", "shape", "items", "line", "clause", "times", "message", "x"])
NOTES = st.lists(
    st.tuples(NAMES, st.dictionaries(KEYS, JSON, max_size=4), st.lists(st.floats(), max_size=4)), max_size=5
)


@given(NOTES)
def test_what_is_written_is_read(notes: list[tuple[str, dict[str, Any], list[float]]]) -> None:
    trace = read_trace(as_result(b"".join(raw_note(*note) for note in notes)))
    assert not trace.cut
    assert [(note.name, note.info) for note in trace.notes] == [(name, info) for name, info, _ in notes]
    for note, (_, _, numbers) in zip(trace.notes, notes, strict=True):
        np.testing.assert_array_equal(note.numbers, numbers)
    use(trace)


@given(st.binary(max_size=200))
def test_any_bytes_are_a_trace(raw: bytes) -> None:
    use(read_trace(as_result(raw)))


@given(NOTES, st.data())
def test_a_damaged_trace_is_a_trace(notes: list[tuple[str, dict[str, Any], list[float]]], data: st.DataObject) -> None:
    raw = bytearray(b"".join(raw_note(*note) for note in notes) or b"\0")
    for _ in range(data.draw(st.integers(1, 3))):
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    use(read_trace(as_result(bytes(raw[: data.draw(st.integers(0, len(raw)))]))))


DAMAGED: dict[str, Any] = {
    "floats": np.zeros(3),
    "rows": np.zeros((2, 2), np.uint8),
    "long information": as_result(raw_note("run", {"x": "y" * 20_000}, [])),
    "deep information": as_result(b"\x03run" + struct.pack("<I", 6000) + b"[" * 6000 + struct.pack("<I", 0)),
    "a huge integer": as_result(b"\x03run" + struct.pack("<I", 5005) + b'{"x":' + b"9" * 4999 + b"}" + bytes(4)),
    "numbers beyond the end": as_result(b"\x03run" + struct.pack("<II", 0, 2**32 - 1)),
    "many notes": as_result(raw_note("run", {}, []) * 5000),
    "many numbers": as_result(raw_note("run", {}, [0.0] * 9000)),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_trace_that_cannot_be_read_to_its_end_is_cut(name: str) -> None:
    trace = read_trace(DAMAGED[name])
    use(trace)
    assert trace.cut


def test_no_result_is_no_trace() -> None:
    assert read_trace(None) is NO_TRACE


ODD = """
import contextlib

def answer(model):
    return model.timestep

def largest_stable_timestep(model, integrator):
    print("looking at", integrator)
    for _ in range(3):
        try:
            answer(model)
        except AttributeError:
            pass
    try:
        raise ValueError("no limit")
    except ValueError as error:
        print(error)
    finally:
        print("done")
    return [0.02, None]
"""


def traces_of(run: Run, source: str) -> list[Trace]:
    report = run(SERVO, source)
    assert report.status is RunStatus.RETURNED, report.reason
    trials = plan_exercise(SERVO, model_xml, 1).trials
    visible, hidden = read_traces(report.results["traces"]), read_traces(report.hidden_results["hidden_traces"])
    assert {*visible, *hidden} == {*range(len(trials))}
    return [(hidden if trial.hidden else visible)[index] for index, trial in enumerate(trials)]


def test_returned_handled_and_printed_are_noted(run: Run) -> None:
    visible, *_, hidden = traces_of(run, ODD)
    assert hidden.returned_values[0].items == visible.returned_values[0].items
    assert (visible.returned_values[0].type, visible.returned_values[0].shape) == ("list", (2,))
    assert visible.returned_values[0].items == ("float", "NoneType")
    assert visible.returned_values[0].numbers[0] == 0.02
    said = "'mujoco._structs.MjModel' object has no attribute 'timestep'"
    assert visible.handled_exceptions == [
        HandledException("AttributeError", line=5, clause=12, times=3, message=said),
        HandledException("ValueError", line=15, clause=16, times=1, message="no limit"),
    ]
    assert visible.printed_text == "looking at 0\nno limit\ndone\n"
    assert [exception.line for exception in hidden.handled_exceptions] == [5, 15]
    assert {exception.message for exception in hidden.handled_exceptions} == {""}
    assert hidden.printed_text == ""


IMPORTED = """
import mujoco
from mujoco import mj_step as step

def largest_stable_timestep(model, integrator):
    data = mujoco.MjData(model)
    before = step
    step(model, data)
    return [before.__name__ == "take_first_step", step is before]
"""


def test_a_run_steps_by_mujocos_own_function_however_the_script_named_it(run: Run) -> None:
    visible, *_ = traces_of(run, IMPORTED)
    assert visible.returned_values[0].numbers[:2] == (1.0, 0.0)
    (note,) = (note for note in visible.notes if note.name == "search")
    assert note.info["total"] == 1


@pytest.mark.parametrize(
    ("body", "type_", "shape"),
    [
        ("return None", "NoneType", ()),
        ("return float('nan')", "float", ()),
        ("return 10 ** 400", "int", ()),
        ("return '20 ms'", "str", ()),
        ("return np.zeros((2, 3))", "ndarray", (2, 3)),
        ("return np.float32(0.02)", "float32", ()),
        ("return {1: 2}", "dict", ()),
        ("return (object(), [1, 2])", "tuple", (2,)),
        ("return [0.1] * 10 ** 5", "list", (10**5,)),
    ],
)
def test_whatever_is_returned_is_described(body: str, type_: str, shape: tuple[int, ...], run: Run) -> None:
    source = f"import numpy as np\ndef largest_stable_timestep(model, integrator):\n    {body}\n"
    returned = traces_of(run, source)[0].returned_values[0]
    assert (returned.type, returned.shape) == (type_, shape)
    assert len(returned.numbers) <= recorder.NUMBERS_MAX


LOUD = """
def largest_stable_timestep(model, integrator):
    for i in range(2000):
        print("x" * 10, end="")
        try:
            exec(compile("\\n" * i + "raise KeyError(1)", __file__, "exec"))
        except KeyError:
            pass
    raise IndexError
"""


def test_a_trace_is_bounded_and_survives_a_crash(run: Run) -> None:
    report = run(SERVO, LOUD)
    visible, hidden = read_traces(report.results["traces"]), read_traces(report.hidden_results["hidden_traces"])
    assert {*visible, *hidden} == {*range(len(plan_exercise(SERVO, model_xml, 1).trials))}
    assert len(report.hidden_results["hidden_traces"]) <= len(hidden) * recorder.TRIAL_BYTES_MAX
    trace = visible[0]
    assert len(trace.handled_exceptions) == catching.HANDLED_MAX
    assert trace.printed_text is not None
    assert len(trace.printed_text) == recorder.PRINTED_CHARS_MAX


def test_notes_beyond_the_limits_are_dropped_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(recorder.state, "left", recorder.BYTES_MAX)
    sizes = []
    for _ in range(20):
        recorder.begin(hidden=False)
        while recorder.note("run", {"steps": 3}, np.zeros(100)):
            pass
        raw = recorder.end()
        sizes.append(len(raw))
        assert read_trace(as_result(raw)).cut
    assert max(sizes) <= recorder.TRIAL_BYTES_MAX + 100
    assert sum(sizes) <= recorder.BYTES_MAX + 20 * 100
    assert not recorder.note("run"), "no trial, no note"


def test_a_script_is_compiled_as_python_compiles_it() -> None:
    with pytest.raises(SyntaxError, match="invalid syntax"):
        catching.compile_source("try:\n  x = = 1\nexcept ValueError: pass", "a.py")
    with pytest.raises(SyntaxError, match="'return' outside function"):
        catching.compile_source("try:\n  return\nexcept ValueError: pass", "a.py")
    scope: dict[str, Any] = {}
    exec(catching.compile_source("try:\n  1 / 0\nexcept ZeroDivisionError:\n  'a'\nelse:\n  x = 1\n", "a.py"), scope)
    assert "x" not in scope


FORGED = [
    b"",
    b"\xff" * 500,
    raw_note("returned", {"type": "float"}, [1.0]),
    raw_note("step", {"calls": 4}, [0.0] * 100),
    raw_note("cut", {"dropped": 3}, []),
]


@pytest.mark.parametrize(
    ("id_", "program"),
    [
        ("servo-threshold", "correct__spectral_radius"),
        ("servo-threshold", "incorrect__half_a_second"),
        ("rk4-step", "partial__three_eighths_rule"),
        ("rk4-step", "correct__classical"),
        ("rk4-free-joint", "incorrect__four_moves"),
    ],
)
def test_a_forged_trace_decides_nothing(id_: str, program: str, run: Run) -> None:
    exercise, source = question(id_), (PROGRAMS / id_ / f"{program}.py").read_text()
    plan, report = plan_exercise(exercise, model_xml, 1), run(exercise, source)
    honest = judge_exercise(exercise, plan, report)
    assert honest.status == program.partition("__")[0]
    for raw in FORGED:
        forged = replace(
            report, results=with_trace(report.results, raw), hidden_results=with_trace(report.hidden_results, raw)
        )
        verdict = judge_exercise(exercise, plan, forged)
        assert (verdict.status, verdict.points) == (honest.status, honest.points)
        assert verdict.findings == honest.findings


def with_trace(results: Any, raw: bytes) -> dict[str, Any]:
    """Every trial's trace replaced."""
    (name,) = (name for name in results if name.endswith("traces"))
    traces = b"".join(struct.pack("<II", index, len(raw)) + raw for index in read_traces(results[name]))
    return {**results, name: as_result(traces)}
