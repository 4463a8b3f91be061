"""The small JavaScript that authors write in labs and answer keys: compiled once, run with a budget.

    program = compile_program("data.ctrl[0] = -ctx.kp * data.qpos[0]", "statement", "q3.sim.controller")
    control = program.bind(Machine(model, data))
    control()

A text is parsed by tree-sitter's grammar and becomes Python code made only of node types and names of our own: no text
of an author is ever a Python name, an attribute or an import. A program reaches what `fields`, `functions` and
`methods` list, and nothing else. Loops, calls, texts and arrays are bounded. Everything outside this package imports
from here.
"""

from grader.expressions.fields import (
    DATA_RESULTS,
    DATA_STATE,
    MODEL_PARAMETERS,
    OPTION_SCALARS,
    OPTION_VECTORS,
)
from grader.expressions.machine import Machine
from grader.expressions.program import Program, Run, compile_program
from grader.expressions.syntax import ProgramKind
from grader.expressions.texts import number_to_string, to_fixed
from grader.expressions.values import (
    UNDEFINED,
    Trouble,
    Value,
    Vector,
    from_units,
    in_units,
    to_boolean,
    to_number,
    to_string,
)

__all__ = [
    "DATA_RESULTS",
    "DATA_STATE",
    "MODEL_PARAMETERS",
    "OPTION_SCALARS",
    "OPTION_VECTORS",
    "UNDEFINED",
    "Machine",
    "Program",
    "ProgramKind",
    "Run",
    "Trouble",
    "Value",
    "Vector",
    "compile_program",
    "from_units",
    "in_units",
    "number_to_string",
    "to_boolean",
    "to_fixed",
    "to_number",
    "to_string",
]
