"""What a job of the jail has beside its trials: the driver in compiled parts, and compiled models."""

import __future__

import base64
import marshal
from collections.abc import Mapping, Sequence
from functools import cache
from inspect import getsource
from typing import Any

import mujoco

from grader.exercises.driving import catching, harness, recorder
from grader.exercises.kind import Kind, Trial
from grader.exercises.parameters import ExerciseParameters

DRIVER = 'exec(codes["harness"])\nload(codes["recorder"], codes["kind"])\n'
"""The driver of every job."""

WATCH = 'watch_exceptions(codes["catching"])\n'
"""Follows in the driver of a script that has `except` clauses."""

SAVING = "mj_saveLastXML"
"""A function of MuJoCo that knows only what the jail has compiled itself."""

MODEL_BYTES_MAX = 1 << 20
"""The largest compiled model that is sent to the jail."""


@cache
def compile_code(source: str) -> bytes:
    """Returns the code object of a source, as `Job.codes` takes it. The jail runs the interpreter of this process, and
    compiling these sources there would cost every run milliseconds. Leaves out annotations and docstrings."""
    lean = __future__.annotations.compiler_flag
    return marshal.dumps(compile(source, "<driver>", "exec", lean, dont_inherit=True, optimize=2))


CATCHING = compile_code(getsource(catching))


def compile_driver(kind: str) -> Mapping[str, bytes]:
    """Returns the parts of the driver by name: the harness, which loads the recorder and the driver of a kind."""
    sources = {"harness": getsource(harness), "recorder": getsource(recorder), "kind": kind}
    return {name: compile_code(source) for name, source in sources.items()}


def save_models(
    kind: Kind[Any, Any, Any], parameters: ExerciseParameters, trials: Sequence[Trial[Any]]
) -> dict[str, str]:
    """Returns the compiled models of trials by their MJCF text, as pickle keeps them, in base64; large ones are left
    out. The jail alone loads them: MuJoCo does not check what it loads, and these are ours."""
    models = {trial.inputs.get("model"): kind.compile_model(parameters, trial) for trial in trials}
    return {
        xml: save_model(model)
        for xml, model in models.items()
        if xml and model is not None and mujoco.mj_sizeModel(model) <= MODEL_BYTES_MAX
    }


def save_model(model: mujoco.MjModel) -> str:
    """Returns the state of a model, as pickle keeps it, in base64."""
    return base64.b64encode(model.__getstate__()).decode()
