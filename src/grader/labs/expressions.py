"""The small JavaScript of lab configs: parsed once when content is loaded, then run as Python closures.

A program reaches what fields.py, functions.py and methods.py list, and nothing else; no text of an author is ever
evaluated by Python or used as an attribute's name.
"""

from dataclasses import dataclass
from typing import Literal

import mujoco

from grader.errors import ContentError, Fault, LabError
from grader.labs import statements, terms  # noqa: F401  they register the nodes that they compile
from grader.labs.blocks import compile_body
from grader.labs.dispatch import compile_term
from grader.labs.machine import Machine
from grader.labs.scope import Code, Scope
from grader.labs.syntax import Refused, expression_of, parse
from grader.labs.values import UNDEFINED, Trouble, Value

Kind = Literal["expression", "statement"]


@dataclass(frozen=True)
class Program:
    """A compiled text. `where` names it in errors, such as `q3.sim.controls[0].apply`."""

    text: str
    where: str
    code: Code
    slots: int

    def run(self, machine: Machine, value: Value = UNDEFINED) -> Value:
        """The value of an expression (of a statement: undefined). Raises LabError with line and column."""
        machine.begin(self.slots)
        machine.value = value
        try:
            return self.code(machine)
        except Trouble as trouble:
            line, column = trouble.at or (1, 1)
            raise LabError(f"{self.where}: line {line}, column {column}: {trouble}") from trouble
        except mujoco.FatalError as error:
            raise LabError(f"{self.where}: MuJoCo: {error}") from error
        except RecursionError as error:
            raise LabError(f"{self.where}: line 1, column 1: nested too deep") from error


def compile_expression(text: str, kind: Kind, where: str) -> Program:
    """Compile an expression or a list of statements.

    Raises ContentError with a fault whose key is `where` and whose reason begins with line and column.
    """
    try:
        source = parse(text, kind)
        scope = Scope(source)
        code = compile_body(scope, source.root) if kind == "statement" else compile_term(scope, expression_of(source))
    except Refused as refused:
        raise ContentError([Fault("", where, str(refused))]) from refused
    return Program(text, where, code, scope.counter[0])
