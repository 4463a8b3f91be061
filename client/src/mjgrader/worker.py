"""Runs a script over the visible trials, or judges what it returned: each in a process of its own, so that neither the
kernel nor the judge sees what a script changes. `python -m mjgrader.worker run|judge JOB RESULTS`: files of JSON."""

import base64
import builtins
import importlib
import json
import linecache
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

import mujoco
import numpy as np

from grader.exercises.driving import harness
from grader.exercises.judgement import list_counting
from grader.numerics.process import prepare
from mjgrader.judges import DRIVERS, JUDGES

STEPPERS = ("mj_step", "mj_step1", "mj_step2", "mj_Euler", "mj_implicit", "mj_RungeKutta")
"""Functions of MuJoCo that take a step, which some exercises forbid."""


OF_THE_JAIL = {"numpy", "scipy", "mujoco", "mjcourse", "__main__", *sys.stdlib_module_names}
"""What a script can import on the server."""


class Refused(Exception):
    """The script did what the exercise forbids."""


def run_job(job: Mapping[str, Any]) -> dict[str, Any]:
    """Runs the script of a job over its trials; returns the results, encoded, and how the script ended."""
    sys.path.insert(0, job["folder"])
    prepare()
    driver = DRIVERS.get(job["kind"])  # a kind that the course has installed itself runs on the server alone
    results: dict[str, Any] = {}

    def submit(name: str, value: Any) -> None:
        array = np.asarray(value)
        results[name] = [array.dtype.str, list(array.shape), base64.b64encode(array.tobytes()).decode()]

    if driver is not None:
        prepare_harness(driver)
    forbid = forbid_steps() if job["without_integrators"] else None
    refuse_imports(job["file"])
    try:
        student = load_script(job["source"], job["file"])
        if forbid:
            forbid()
        for trial in job["trials"] if driver is None else ():
            harness.function_of(student, trial["entries"][0])
        if driver is not None:
            harness.run(student, {"trials": job["trials"], "more": False}, submit)
    except Refused as error:
        return {"status": "forbidden", "why": str(error), "results": {}}
    except BaseException as error:
        frames = list_frames(error, job["file"])
        where = f" in line {frames[-1].lineno}" if frames else ""
        shown = [] if isinstance(error, SyntaxError) else traceback.format_list(frames)
        print("".join([*shown, *traceback.format_exception_only(type(error), error)]), file=sys.stderr)
        return {"status": "crashed", "why": f"{type(error).__name__}{where}: {error}{advise(error)}", "results": {}}
    return {"status": "returned", "why": "", "results": results}


def prepare_harness(driver: ModuleType) -> None:
    """Lets the harness of the jail run a driver that notes nothing."""
    harness.KIND = vars(driver)
    harness.GIVEN["kind_of"] = lambda error: "forbidden" if isinstance(error, Refused) else "crashed"
    harness.RECORDER.update(begin=lambda hidden: None, traced=lambda function: function, end=lambda: b"")
    if hasattr(driver, "before_import"):
        driver.before_import()


def list_frames(error: BaseException, file: str) -> list[traceback.FrameSummary]:
    """Returns the lines of the script in a traceback."""
    if isinstance(error, SyntaxError):
        return [traceback.FrameSummary(file, error.lineno or 0, "")]
    return [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]


def advise(error: object) -> str:
    """Returns what to do about a file that is not found, to end a sentence; else nothing."""
    if not any(sign in str(error) for sign in ("No such file or directory", "Error opening file")):
        return ""
    return " A script runs in an empty folder, as on the server: mjcourse.model_path finds the models."


def load_script(source: str, file: str) -> ModuleType:
    """Returns the script as a module. It is imported, not run as a program."""
    module = ModuleType("script")
    module.__file__ = Path(file).name  # without its folder, as on the server
    sys.modules["script"] = module
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    exec(compile(source, file, "exec"), vars(module))  # noqa: S102
    return module


def refuse_imports(file: str) -> None:
    """Makes an import of what the server does not have fail in the script as it does there, and say why. Modules that
    import others are left alone."""

    def wrap(load: Callable[..., Any]) -> Callable[..., Any]:
        def load_module(name: str, *arguments: Any, **named: Any) -> Any:
            top = name.partition(".")[0]
            if top and top not in OF_THE_JAIL and sys._getframe(1).f_code.co_filename == file:
                refuse_import(top)
            return load(name, *arguments, **named)

        return load_module

    builtins.__import__ = wrap(builtins.__import__)
    importlib.import_module = wrap(importlib.import_module)


def refuse_import(name: str) -> None:
    """Raises ModuleNotFoundError for a module that is on this machine, and not on the server."""
    spec = PathFinder.find_spec(name)
    if spec is None:
        return
    origin = Path(spec.origin or next(iter(spec.submodule_search_locations or ()), ""))
    if {"site-packages", "dist-packages"} & {*origin.parts}:
        has = "NumPy, SciPy, MuJoCo and Python's standard library"
        raise ModuleNotFoundError(f"the server does not have {name}: a script can import {has}", name=name)
    raise ModuleNotFoundError(f"{name} is a file of yours: paste it into a cell, or into the script", name=name)


def forbid_steps() -> Callable[[], None]:
    """Wraps the functions of MuJoCo that step. Returns what forbids them, for the time after the import."""
    forbidden: list[bool] = []

    def wrap(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def step(*arguments: Any, **named: Any) -> Any:
            if forbidden:
                raise Refused(f"The function let MuJoCo take the step ({name}), which this exercise does not allow.")
            return function(*arguments, **named)

        return step

    for name in STEPPERS:
        setattr(mujoco, name, wrap(name, getattr(mujoco, name)))
    return lambda: forbidden.append(True)


def judge_job(job: Mapping[str, Any], run: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Returns one finding for each trial: `passed` is None where only the server judges."""
    arrays = {name: decode(*encoded) for name, encoded in run["results"].items()}
    judged = {trial["id"]: judge_trial(job["kind"], trial, select(arrays, trial["index"])) for trial in job["trials"]}
    counting = list_counting({name: one for name, one in judged.items() if not isinstance(one, str)})
    findings = []
    for trial in job["trials"]:
        one = judged[trial["id"]]
        finding = {"id": trial["id"], "title": trial["title"], "points": trial["points"], "raised": False}
        if isinstance(one, str):
            raised = "raised" in select(arrays, trial["index"])
            findings.append(finding | {"passed": False if raised else None, "message": one, "raised": raised})
            continue
        counts = trial["id"] in counting
        message = one.unmet if one.passed and not counts else one.message
        detail = "" if job["reveal"] == "direction" else one.detail
        findings.append(finding | {"passed": counts, "message": " ".join(filter(None, (message, detail)))})
    return findings


def judge_trial(kind: str, trial: Mapping[str, Any], results: Mapping[str, Any]) -> Any:
    """Returns the judgement on one trial, or a sentence where there is none."""
    if "raised" in results:
        said = json.loads(results["raised"].tobytes())
        line = f", in line {said['line']} of your script" if said["line"] else ""
        return f"{said['raised']}{line}.{advise(said['raised'])}"
    if trial["problem"] is None:
        if any(name.startswith("other") for name in results):
            return "Your function returned something that is not finite numbers; the server judges this case."
        return f"Your {'function runs' if results else 'script can be imported'}; the server judges this case."
    with np.errstate(all="ignore"):
        return JUDGES[kind](trial["inputs"], trial["problem"], results)


def select(arrays: Mapping[str, Any], index: int) -> dict[str, Any]:
    """Returns the results of one trial by the driver's own names."""
    prefix = f"t{index}_"
    return {name[len(prefix) :]: array for name, array in arrays.items() if name.startswith(prefix)}


def decode(dtype: str, shape: Sequence[int], text: str) -> Any:
    """Returns an array that `submit` has encoded."""
    return np.frombuffer(base64.b64decode(text), dtype=np.dtype(dtype)).reshape(shape)


def main(command: str, job: str, results: str) -> None:
    """Runs or judges, and writes what comes of it."""
    asked = json.loads(Path(job).read_text(encoding="utf-8"))
    place = Path(results)
    if command == "run":
        made: Any = run_job(asked)
    else:
        made = judge_job(asked, json.loads(place.read_text(encoding="utf-8")))
    place.write_text(json.dumps(made), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
