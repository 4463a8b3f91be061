"""Programs: a text is parsed and compiled once, bound to a machine, and then called like a Python function."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import mujoco

from grader.errors import ContentError, Fault, LabError
from grader.expressions.compiling.code import UNPLACED, ValueKind, finish_code
from grader.expressions.compiling.paths import BINDERS, bind_vector
from grader.expressions.compiling.scope import Frame, Scope
from grader.expressions.compiling.statements import Compiler
from grader.expressions.compiling.syntax import START, ProgramKind, Source, SyntaxRefused
from grader.expressions.machine import Machine
from grader.expressions.runtime import NAMES
from grader.expressions.values import UNDEFINED, RunError, Value

FILE = "<expression>"
PASSES_MAX = 4
"""After so many attempts to learn what is known of the variables, nothing is taken to be known."""

COMPILED_MAX = 256
"""Programs that are kept: labs which differ in their start alone, such as the draws of a case, share their others."""

STATE = {f"data.{name}" for name in ("time", "qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat")}
APART = ("model.", "Math.")
"""The paths of the state, and how those begin that have nothing to do with it."""

FAILURES = (RunError, mujoco.FatalError, RecursionError)

Run = Callable[..., Value]


class Program:
    """A compiled text. `where` names it in errors, such as `q3.sim.controls[0].apply`. With `reads_state_alone` it
    reads nothing that MuJoCo derives from the state, and changes nothing. Raises SyntaxRefused."""

    def __init__(self, source: Source, where: str) -> None:
        self.source, self.where = source, where
        tree = source.tree()
        kinds: dict[str, ValueKind] | None = {}
        for attempt in range(PASSES_MAX + 1):
            compiler = Compiler(kinds if attempt < PASSES_MAX else None)
            module = compiler.program(Scope(Frame()), tree)
            if kinds == compiler.variable_kinds:
                break
            kinds = compiler.variable_kinds
        finish_code(module)
        space: dict[str, Any] = {"__builtins__": {}, **NAMES}
        exec(compile(module, FILE, "exec"), space)  # noqa: S102  nodes and names of our own only, see code.finish
        self.make = space["make"]
        self.needs, self.places = tuple(compiler.needs), compiler.places
        self.elements = tuple(compiler.elements)
        self.reads_state_alone = not compiler.writes and all(
            kind == "ctx" or path in STATE or path.startswith(APART) for kind, path in self.needs
        )

    def bind(self, machine: Machine) -> Run:
        """Returns the function `(value=undefined) -> value` that evaluates the program on this machine. A statement
        gives undefined, or what it returns. The function raises LabError with line and column. The machine does not
        keep it: it would be kept by its own functions, with megabytes of data, until Python looks for such circles."""
        values = [BINDERS[kind](machine, path) for kind, path in self.needs]
        run: Run = self.make(machine, machine.budget, machine.ctx, FAILURES, self._failed, *values)
        return run

    def run(self, machine: Machine, value: Value = UNDEFINED) -> Value:
        """Evaluate the program once."""
        return self.bind(machine)(value)

    def list_missing_elements(self, machine: Machine) -> list[str]:
        """Says, with line and column, which elements the text names that no field of this model has."""
        missing = []
        for path, index, point in dict.fromkeys(self.elements):
            size = len(bind_vector(machine, path))
            if not index < size:
                has = f"has {size} elements, from 0 to {size - 1}" if size else "has no elements in this model"
                missing.append(self.source.placed(point, f"there is no {path}[{index:g}]: {path} {has}"))
        return missing

    def _failed(self, error: Exception) -> LabError:
        """Returns the error as it leaves the program, with the innermost place that its traceback names."""
        point, trace = START, error.__traceback__
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == FILE and trace.tb_lineno > UNPLACED:
                point = self.places[trace.tb_lineno - UNPLACED - 1]
            trace = trace.tb_next
        why = "nested too deep" if isinstance(error, RecursionError) else str(error)
        if isinstance(error, mujoco.FatalError):
            why = f"MuJoCo: {error}"
        failure = LabError(self.where, self.source.placed(point, why))
        failure.__cause__ = error
        return failure


@lru_cache(maxsize=COMPILED_MAX)
def compile_program(text: str, kind: ProgramKind, where: str) -> Program:
    """Compile an expression or a list of statements, once. Raises ContentError with a fault whose key is `where` and
    whose reason begins with line and column."""
    source = Source(text, kind)
    try:
        return Program(source, where)
    except SyntaxRefused as refused:
        raise ContentError([Fault("", where, source.placed(refused.point, str(refused)))]) from refused
