"""Runs a kind's driver for every trial, inside the jail: the visible trials first, then the hidden ones. The code of
this file is sent to the jail with that of the recorder and of the kind's driver; it imports nothing of the grader. The
jail defines two names: `kind_of(error)` tells how an exception ends a script ("crashed", "forbidden", "out_of_memory"),
and `hidden_inputs()` fetches the hidden trials, which the process does not know before. What it prints then is dropped.

An exception ends its trial alone: the result `raised` holds its name and line. SystemExit and its like, a refusal of
the jail, and lack of memory end the whole script: they are raised again.

Models come compiled where the inputs have them under `models`; `load_model` makes new ones.

The results `traces` and `hidden_traces` hold what the recorder noted in each trial. The driver finds among its names
`note`, which adds to the trace, `hidden`, which says whether the current trial is, and `show(value)`, the text of any
value. That of a kind that plays also finds `exchange(answer)`, which sends an answer and returns the next message, None
at the end of the trial, and `explain(error)`, which makes an exception of the student's an answer."""

import base64
import builtins
import contextlib
import difflib
import json
import os
import traceback
import types
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

Submit = Callable[[str, Any], None]

GIVEN: dict[str, Any] = {name: globals().get(name) for name in ("kind_of", "hidden_inputs", "exchange")}
RECORDER: dict[str, Any] = {"__name__": "recorder", "__builtins__": builtins}
KIND: dict[str, Any] = {"__name__": "kind", "__builtins__": builtins}
TEXT_CHARS_MAX = 1000

MODELS: dict[str, bytes] = {}
"""The states of compiled models, as pickle keeps them, by their MJCF text."""
STATE: dict[str, Any] = {"compiles": False, "student": None, "faults": 0, "plays": False, "asked": False, "over": False}
CHAIN_MAX = 10
"""Exceptions behind each other that are looked at."""
FAULTS_SHOWN = 3
"""Exceptions of steps that are written to stderr."""
compile_text = mujoco.MjModel.from_xml_string


def load(recorder: types.CodeType, driver: types.CodeType) -> None:
    """Executes the recorder and the kind's driver, before the student's module is imported."""
    exec(recorder, RECORDER)  # noqa: S102
    KIND.update(note=RECORDER["note"], load_model=load_model, show=show, exchange=exchange, explain=explain)
    exec(driver, KIND)  # noqa: S102
    if "before_import" in KIND:
        KIND["before_import"]()


def load_model(xml: str) -> mujoco.MjModel:
    """Returns a new model of an MJCF text. A text is compiled once, and its model loaded from then on; of a model that
    was loaded MuJoCo cannot save the text."""
    if STATE["compiles"]:
        return compile_text(xml)
    if xml not in MODELS:
        model = compile_text(xml)
        MODELS[xml] = model.__getstate__()
        return model
    model = mujoco.MjModel.__new__(mujoco.MjModel)
    model.__setstate__(MODELS[xml])  # as unpickling does; `from_binary_path` takes three times as long
    return model


def show(value: object) -> str:
    """Returns the text of a value that the student returned, and its type where it has none: Python prints no whole
    number of more than 4300 digits, and a `__repr__` of the student's may raise."""
    try:
        return repr(value)
    except Exception:
        return f"a value of type {type(value).__name__}"


def take_models(inputs: Mapping[str, Any]) -> None:
    """Keeps the states of compiled models of a part of the job. None in their place: every model is to be compiled."""
    models = inputs.get("models", {})
    STATE["compiles"] = STATE["compiles"] or models is None
    MODELS.update({xml: base64.b64decode(saved) for xml, saved in (models or {}).items()})


def watch_exceptions(catching: types.CodeType) -> None:
    """Executes the code that notes handled exceptions, whose `compile_source` compiles the student's module."""
    names = {"__name__": "catching", "__builtins__": builtins, "note": RECORDER["note"], "state": RECORDER["state"]}
    exec(catching, names)  # noqa: S102
    RECORDER["at_end"].append(names["finish"])
    globals()["compile_source"] = names["compile_source"]


def run(student: object, inputs: Mapping[str, Any], submit: Submit) -> None:
    """Called by the jail after the import: every trial, visible ones first."""
    STATE.update(student=student, plays=inputs.get("plays", False))
    take_models(inputs)
    attempt_all(student, inputs["trials"], submit, "traces")
    if not inputs["more"]:
        return
    hidden = GIVEN["hidden_inputs"]()
    nowhere = os.open(os.devnull, os.O_WRONLY)  # dropped output must not count against the limit
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    take_models(hidden)
    attempt_all(student, hidden["trials"], submit, "hidden_traces")


def attempt_all(student: object, trials: Sequence[Mapping[str, Any]], submit: Submit, name: str) -> None:
    """Runs trials, and submits their traces as one result: each behind the index of the trial and the size, as u32."""
    traces: list[bytes] = []
    for trial in trials:
        trace = attempt(student, trial, submit)
        traces += trial["index"].to_bytes(4, "little"), len(trace).to_bytes(4, "little"), trace
    if traces:
        submit(name, np.frombuffer(b"".join(traces), dtype=np.uint8))


def attempt(student: object, trial: Mapping[str, Any], submit: Submit) -> bytes:
    """Runs one trial, whose results are named t<index>_<name>; returns its trace."""
    index = trial["index"]

    def submit_result(name: str, value: Any) -> None:
        numbers = np.asarray(value)
        if numbers.dtype.kind == "f" and not np.isfinite(numbers).all():  # the grader would refuse all results
            raise ValueError(f"the result {name} holds a number that is not finite (nan or inf)")
        submit(f"t{index}_{name}", numbers)

    KIND["hidden"] = trial["hidden"]
    STATE.update(asked=False, over=False)
    RECORDER["begin"](trial["hidden"])
    try:
        functions = tuple(RECORDER["traced"](function_of(student, name)) for name in trial["entries"])
        KIND["trial"](functions, trial["inputs"], submit_result)
    except BaseException as error:
        if ends_the_script(error):
            raise
        submit_result("raised", np.frombuffer(account(error, student, trial["hidden"]), dtype=np.uint8))
        if STATE["plays"]:
            leave_trial()
    trace: bytes = RECORDER["end"]()
    return trace


def function_of(student: object, name: str) -> Callable[..., Any]:
    """Returns a function of the student's module. Raises TypeError if there is none of that name."""
    attribute = getattr(student, name, None)
    if not callable(attribute):
        raise TypeError(f"the script defines no function {name}{instead_of(student, name)}")
    function: Callable[..., Any] = attribute
    return function


def instead_of(student: object, name: str) -> str:
    """Returns what the script defines in place of a function, to end a sentence."""
    defined = {key: value for key, value in vars(student).items() if not key.startswith("_")}
    for key, value in defined.items():
        if isinstance(value, type) and name in vars(value):
            return f"; it is a method of the class {key}: define it outside of the class"
    own = [
        key for key, value in defined.items() if getattr(value, "__module__", "") == getattr(student, "__name__", "")
    ]
    near = difflib.get_close_matches(name, own, n=1) or own[:3]
    return f"; it defines {' and '.join(near)}" if near else ""


def ends_the_script(error: BaseException) -> bool:
    """Whether an exception ends the whole script, not its trial alone."""
    if not isinstance(error, Exception):
        return True
    return bool(GIVEN["kind_of"](error) != "crashed")


def built_in(error: BaseException) -> type[BaseException]:
    """Returns the nearest built-in class of an exception."""
    builtin: type[BaseException] = next(cls for cls in type(error).__mro__ if vars(builtins).get(cls.__name__) is cls)
    return builtin


def exchange(answer: bytes | None) -> bytes | None:
    """Sends an answer of the driver's, unless it is None, and returns the next message, None at the trial's end."""
    message: bytes | None = GIVEN["exchange"](answer)
    STATE["asked"], STATE["over"] = True, message is None
    return message


def leave_trial() -> None:
    """Answers with nothing, which says that the trial has raised, until it ends."""
    if not STATE["asked"]:
        exchange(None)
    while not STATE["over"]:
        exchange(b"")


def explain(error: BaseException) -> bytes:
    """Returns an exception of a step as JSON, for a driver that goes on after it; raises it again if it ends the
    script. The text of the first ones in visible trials goes to stderr."""
    if ends_the_script(error):
        raise error
    STATE["faults"] += 1
    return account(error, STATE["student"], KIND["hidden"], shown=STATE["faults"] <= FAULTS_SHOWN)


def account(error: BaseException, student: object, hidden: bool, *, shown: bool = True) -> bytes:
    """Returns an exception and its line in the student's file as JSON, or else its place in the driver; of a visible
    trial, writes it to stderr too."""
    file = getattr(student, "__file__", "")
    frames: list[traceback.FrameSummary] = []
    for cause in chain(error):
        frames = frames or [frame for frame in traceback.extract_tb(cause.__traceback__) if frame.filename == file]
    what = built_in(error).__name__
    if not hidden:
        with contextlib.suppress(Exception):  # the student's own __str__
            told = traceback.TracebackException(type(error), error, None)
            told.__notes__ = None  # what `add_note` added, which would be the last line
            what = [*told.format_exception_only()][-1].strip()
            lines = ["Traceback (most recent call last):\n", *traceback.format_list(frames), f"{what}\n"] * shown
            os.write(2, "".join(lines).encode("utf-8", "backslashreplace"))
    line = frames[-1].lineno if frames else None
    claim = {"raised": what[:TEXT_CHARS_MAX], "line": line}
    return json.dumps(claim if frames else claim | {"place": find_place(error)}).encode()


def chain(error: BaseException) -> list[BaseException]:
    """Returns an exception, and those that a driver may have caught before it raised this one."""
    errors = [error]
    while (before := errors[-1].__cause__ or errors[-1].__context__) is not None and len(errors) < CHAIN_MAX:
        errors.append(before)
    return errors


def find_place(error: BaseException) -> str:
    """Returns where in the kind's driver an exception was raised, to end a sentence."""
    places = [(frame, line) for frame, line in traceback.walk_tb(error.__traceback__) if frame.f_globals is KIND]
    return f" ({places[-1][0].f_code.co_name}, line {places[-1][1]} of the driver)" if places else ""
