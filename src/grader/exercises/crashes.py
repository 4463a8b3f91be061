"""Says what an error of a student's script means, and what to do: the message without noise, and an advice. What the
script's process says of its own end is a claim, so that nothing here decides."""

import difflib
import re
from collections.abc import Callable, Sequence

import mujoco

from grader.exercises.explaining.script import ParsedScript
from grader.exercises.trace import Trace

MESSAGE_CHARS_MAX = 400

PACKAGES = "NumPy, SciPy, MuJoCo and Python's standard library"
"""What a script can import."""

OF_MODEL = frozenset({"opt", "nv", "nq", "nu", "body_mass", "actuator_gainprm", "actuator_biasprm", "stat", "joint"})
OF_DATA = frozenset({"qpos", "qvel", "qacc", "time", "ctrl", "act", "warning", "energy"})

SLIPS = frozenset(
    {
        *("AttributeError", "NameError", "UnboundLocalError", "TypeError", "IndexError", "KeyError", "ValueError"),
        *("ImportError", "ModuleNotFoundError", "ZeroDivisionError"),
    }
)
"""Exceptions of a slip in the script; an `except` clause that catches one hides it."""

Advise = Callable[[re.Match[str]], str]


def advise_on_attribute(match: re.Match[str]) -> str:
    """Advises on an attribute of the wrong object."""
    kind, name = match[1].rpartition(".")[2], match[2]
    if name in OF_MODEL and kind != "MjModel":
        return f"{name} belongs to the model: the arguments may be in the wrong order"
    if name in OF_DATA and kind != "MjData":
        return f"{name} belongs to the data: the arguments may be in the wrong order"
    return advise_on_spelling(name, getattr(mujoco, kind, None))


def advise_on_spelling(name: str, owner: object) -> str:
    """Advises on the name of an attribute that is misspelt; nothing where no other is like it."""
    matches = difflib.get_close_matches(
        name, [attribute for attribute in dir(owner) if not attribute.startswith("_")], n=1, cutoff=0.8
    )
    return f"did you mean {matches[0]}?" if owner is not None and matches else ""


def advise_on_lengths(first: int, second: int) -> str:
    """Advises on two arrays of different lengths: those of positions and velocities differ where a model has
    quaternions."""
    lengths = f"one array has {count_numbers(first)}, the other {count_numbers(second)}"
    if 0 < abs(first - second) < min(first, second):
        return (
            f"{lengths}; if they are qpos and qvel, a quaternion has four numbers in qpos and three in qvel: "
            "mujoco.mj_integratePos moves qpos by a velocity"
        )
    return lengths


def count_numbers(count: int) -> str:
    """`1 number`, `7 numbers`."""
    return f"{count} number{'' if count == 1 else 's'}"


IMPORTS = {"np": "import numpy as np", "numpy": "import numpy", "math": "import math", "mujoco": "import mujoco"}
"""The line that defines a name which scripts use without it."""

RULES: tuple[tuple[re.Pattern[str], Advise], ...] = (
    (
        re.compile(rf"NameError: name '({'|'.join(IMPORTS)})' is not defined"),
        lambda match: f"add the line: {IMPORTS[match[1]]}",
    ),
    (
        re.compile(r"No module named '([\w.]+)'"),
        lambda match: f"{match[1]} is not installed here; a script can import {PACKAGES}",
    ),
    (
        re.compile(r"UnboundLocalError: .*local variable '(\w+)'"),
        lambda match: (
            f"a function that assigns {match[1]} makes it its own: write nonlocal {match[1]} at its beginning, or "
            f"global {match[1]} if it belongs to the module"
        ),
    ),
    (
        re.compile(r"ValueError: operands could not be broadcast together with shapes \((\d+),\) \((\d+),\)"),
        lambda match: advise_on_lengths(int(match[1]), int(match[2])),
    ),
    (re.compile(r"'([\w.]+)' object has no attribute '(\w+)'"), advise_on_attribute),
    (re.compile(r"module 'mujoco' has no attribute '(\w+)'"), lambda match: advise_on_spelling(match[1], mujoco)),
    (
        re.compile(r"TypeError: only (?:length-1|size-1|0-dimensional) arrays can be converted to Python scalars"),
        lambda _: "math.sin and its like take one number; np.sin and its like take arrays as well",
    ),
    (
        re.compile(r"TypeError: only integer scalar arrays can be converted to a scalar index"),
        lambda _: "np.concatenate takes its arrays in one pair of brackets more: np.concatenate((a, b))",
    ),
    (
        re.compile(r"TypeError: 'float' object cannot be interpreted as an integer"),
        lambda _: "range() and the lengths of arrays are whole numbers: int(round(x)) makes one",
    ),
    (re.compile(r"EOFError: EOF when reading a line"), lambda _: "nobody answers input() here: write the value down"),
    (
        re.compile(r"(?:Error opening file|No such file or directory:) '([^']*?)\.xml'"),
        lambda match: f'use the model that you are given, or mjcourse.model_path("{match[1].rpartition("/")[2]}")',
    ),
    (
        re.compile(r"FileNotFoundError: .*No such file or directory: '"),
        lambda _: "a script runs without the files beside it: write into the script what it needs of them",
    ),
    (
        re.compile(r"Unable to allocate"),
        lambda _: "a script's memory is limited: look for a list or an array that grows in every step",
    ),
    (
        re.compile(r"ValueError: Error: repeated name '"),
        lambda _: (
            "the function is called for each case in the same process, and an MjSpec keeps what was added to it: make "
            "a new one in each call"
        ),
    ),
    (
        re.compile(r"SyntaxError: .*\(line \d+: ([%!][^)]*)\)"),
        lambda match: f"{match[1]} is a command of a notebook, not Python: delete that line",
    ),
    (
        re.compile(r"(\w+)\(\) takes (?:from )?.*positional arguments? but (\d+) (?:was|were) given"),
        lambda match: f"it is called with {match[2]}: keep the parameters of the starter",
    ),
    (
        re.compile(r"(\w+)\(\) missing \d+ required positional argument"),
        lambda _: "keep the parameters of the starter, in their order",
    ),
)


NO_FUNCTION = re.compile(
    r"TypeError: the script defines no function (\w+)"
    r"(?:; it defines (\w+(?: and \w+)*)|; it is a method of the class (\w+))?"
)
"""What the harness says where the function that it calls is missing: its name, and what there is in its place."""


def explain_error(message: str, place: str = "") -> str:
    """Returns the message of an error without the noise of bindings, its place, and an advice where one is known."""
    if missing := NO_FUNCTION.match(message):
        return explain_missing_function(*missing.groups())
    message = shorten_binding_error(message)
    advices = (advise(match) for pattern, advise in RULES if (match := pattern.search(message)))
    advice = next(filter(None, advices), "")
    return f"{message.rstrip('. ')}{place} ({advice})" if advice else f"{message}{place}"


def explain_missing_function(name: str, others: str | None, owner: str | None) -> str:
    """Says what to do where the script lacks the function that the grader calls."""
    if owner:
        return f"Define {name} outside of the class {owner}: the grader calls {name} as a function"
    if others and " " not in others:
        return f"Rename {others} to {name}: the grader calls {name}"
    return f"Define a function {name}: the grader calls {name}" + (
        f", and the script defines {others}" if others else ""
    )


def shorten_binding_error(message: str) -> str:
    """Returns a message of pybind11 about arguments in one line: what was given, and what the function takes. A script
    chooses its messages, so that the time must not grow faster than their length."""
    before, refused, after = message.partition("(): incompatible ")
    supported, invoked, tail = after.partition("Invoked with: ")
    is_about_arguments = supported.startswith(("function arguments.", "constructor arguments."))
    _, first, signature = supported.partition("1. ")
    if not (is_about_arguments and refused and first and invoked):
        return " ".join(message.split())[:MESSAGE_CHARS_MAX]
    called = re.match(r"\w*", before[::-1])
    name = called[0][::-1] if called else ""
    signature = signature.partition("\n")[0].partition(" -> ")[0].strip().removeprefix("(").removesuffix(")")
    arguments = tail.partition("\n")[0].partition(", in line ")[0]
    parts = re.split(r", (?![^<]*>)(?![^\[]*\])", arguments[:MESSAGE_CHARS_MAX])
    takes = [part.split(":")[0].strip() for part in re.split(r",\s*(?=\w+:)", signature[:MESSAGE_CHARS_MAX])]
    summary = f"{name}() was called with ({', '.join(map(shorten_type, parts))}); it takes ({', '.join(takes)})"
    return " ".join((before.removesuffix(name) + summary + tail[len(arguments) :]).split())


def shorten_type(text: str) -> str:
    """Returns the name of the type in `<mujoco._structs.MjData object at 0x...>`; other values as they are."""
    match = re.match(r"<(?:[\w.]+\.)?(\w+) object at", text)
    return match[1] if match else text.strip()[:40]


def explain_hidden_slip(traces: Sequence[Trace]) -> str | None:
    """Returns the sentence of a slip in the script that an `except` clause hid in all of these trials, or None."""
    slips = [
        next((exception for exception in trace.handled_exceptions if exception.type in SLIPS), None) for trace in traces
    ]
    first = next(iter(slips), None)
    if first is None or any(slip is None or slip.line != first.line for slip in slips):
        return None
    message = f" ({first.message})" if first.message else ""
    return (
        f"Line {first.line} raised {add_article(first.type)}{message}, and the `except` in line {first.clause} hid it. "
        f"Mend line {first.line}, and catch nothing that you do not expect."
    )


GENERATOR = "A call of your function runs nothing of it, since it holds `yield`: return the result with `return`."
COROUTINE = "A call of your function runs nothing of it, since it is an `async def`: write `def`."


def explain_unrun(traces: Sequence[Trace], script: ParsedScript) -> str | None:
    """Returns the sentence of a script whose function returned in all of these trials what still has to be run."""
    types = {value.type for trace in traces for value in trace.returned_values[:1]}
    if types <= {"coroutine", "async_generator"} and types and script.has_coroutine:
        return COROUTINE
    return GENERATOR if types == {"generator"} and script.has_yield else None


def add_article(name: str) -> str:
    """Returns the name with its article."""
    return f"{'an' if name[:1].upper() in tuple('AEIOU') or name[:2] == 'Mj' else 'a'} {name}"
