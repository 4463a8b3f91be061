"""What is said of an error: without noise, with an advice where one is known."""

import time

import mujoco
import pytest

from grader.exercises.crashes import explain_error

MODEL = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>")
DATA = mujoco.MjData(MODEL)


def said_of(*arguments: object) -> str:
    with pytest.raises(TypeError) as caught:
        mujoco.mj_step(*arguments)
    return explain_error(f"TypeError: {caught.value}", ", in line 4 of your script")


def test_arguments_of_a_binding_are_told_in_one_line() -> None:
    swapped = said_of(DATA, MODEL)
    assert swapped == (
        "TypeError: mj_step() was called with (MjData, MjModel); it takes (m, d, nstep), in line 4 of your script"
    )
    assert "called with (MjModel);" in said_of(MODEL)
    assert "None" in said_of(MODEL, None)


@pytest.mark.parametrize(
    ("message", "advice"),
    [
        ("ModuleNotFoundError: No module named 'pandas'", "pandas is not installed here"),
        ("AttributeError: 'int' object has no attribute 'opt'", "opt belongs to the model"),
        ("AttributeError: 'mujoco._structs.MjModel' object has no attribute 'qpos'", "qpos belongs to the data"),
        ("AttributeError: 'mujoco._structs.MjData' object has no attribute 'opt'", "opt belongs to the model"),
        ("AttributeError: 'mujoco._structs.MjData' object has no attribute 'warnings'", "did you mean warning?"),
        ("AttributeError: module 'mujoco' has no attribute 'mj_integratepos'", "did you mean mj_integratePos?"),
        ("TypeError: only 0-dimensional arrays can be converted to Python scalars", "take one number"),
        ("TypeError: only integer scalar arrays can be converted to a scalar index", "np.concatenate((a, b))"),
        ("TypeError: 'float' object cannot be interpreted as an integer", "whole numbers"),
        ("UnboundLocalError: cannot access local variable 's' where it is not associated", "write nonlocal s"),
        ("ValueError: operands could not be broadcast together with shapes (7,) (6,)", "mujoco.mj_integratePos moves"),
        ("ValueError: operands could not be broadcast together with shapes (1,) (6,)", "has 1 number, the other 6"),
        ("EOFError: EOF when reading a line", "nobody answers input()"),
        (
            "FileNotFoundError: [Errno 2] No such file or directory: 'a.txt'",
            "a script runs without the files beside it",
        ),
        ("_ArrayMemoryError: Unable to allocate 15.3 MiB for an array", "look for a list or an array that grows"),
        ("ValueError: ParseXML: Error opening file 'a/servo.xml'", 'mjcourse.model_path("servo")'),
        ("SyntaxError: invalid syntax (line 2: %matplotlib inline)", "a command of a notebook"),
        ("TypeError: f() takes 1 positional argument but 2 were given", "called with 2"),
        ("TypeError: f() missing 1 required positional argument: 'x'", "parameters of the starter"),
    ],
)
def test_an_advice_follows_the_place(message: str, advice: str) -> None:
    said = explain_error(message, ", in line 3 of your script")
    assert said.startswith(message.rstrip(".") + ", in line 3 of your script (")
    assert advice in said


@pytest.mark.parametrize(
    "message",
    [
        "KeyError: 'x'",
        "AttributeError: 'Thing' object has no attribute 'colour'",
        "AttributeError: 'mujoco._structs.MjData' object has no attribute 'colour'",
        "ZeroDivisionError: x",
    ],
)
def test_any_other_message_stays_as_it_is(message: str) -> None:
    assert explain_error(message) == message


REFUSED = "f(): incompatible function arguments."


@pytest.mark.cost
@pytest.mark.parametrize(
    ("start", "part"),
    [
        ("", REFUSED), ("", "1. ("), ("", "Invoked with: "), ("", "<a.b object at "), ("", "', '"),
        ("", f"{REFUSED}\n 1. (a) -> b\n"), (REFUSED, "1. (a) -> "), (f"{REFUSED} 1. (", "\n -> "),
        (f"{REFUSED} 1. (", "Invoked with: , in"), (f"{REFUSED} 1. ( Invoked with: ", "<a b, "),
    ],
)  # fmt: skip
def test_a_hostile_message_takes_linear_time(start: str, part: str) -> None:
    times = []
    for size in (500, 4000):
        text = start + part * (size // len(part))
        began = time.process_time()
        for _ in range(5):
            explain_error(text)
        times.append(time.process_time() - began)
    assert times[1] < 40 * max(times[0], 1e-4)


def test_a_module_that_is_not_imported_is_advised() -> None:
    said = explain_error("NameError: name 'np' is not defined", ", in line 6 of your script")
    assert said == "NameError: name 'np' is not defined, in line 6 of your script (add the line: import numpy as np)"
    assert "add" not in explain_error("NameError: name 'nq' is not defined")


@pytest.mark.parametrize(
    ("message", "told"),
    [
        ("; it defines run", "Rename run to step: the grader calls step"),
        ("; it defines a and b", "Define a function step: the grader calls step, and the script defines a and b"),
        ("", "Define a function step: the grader calls step"),
        (
            "; it is a method of the class Solver: define it outside of the class",
            "Define step outside of the class Solver: the grader calls step as a function",
        ),
    ],
)
def test_a_missing_function_is_told_by_what_to_do(message: str, told: str) -> None:
    assert explain_error(f"TypeError: the script defines no function step{message}") == told
