"""Compiles and runs the small JavaScript that authors write in labs and answer keys.

A text is compiled once, and each run has a budget:

    program = compile_program("data.ctrl[0] = -ctx.kp * data.qpos[0]", "statement", "q3.sim.controller")
    control = program.bind(Machine(model, data))
    control()

A text is parsed by tree-sitter's grammar and becomes Python code made only of node types and names of our own: no text
of an author is ever a Python name, an attribute or an import. A program reaches what `fields`, `runtime` and `methods`
list, and nothing else. Loops, calls, texts and arrays are bounded. Everything outside this package imports from here:
`values` and `texts` convert what programs give and take, `fields` lists what they reach,
`syntax` reads texts.
"""

from grader.expressions import fields, texts, values
from grader.expressions.compiling import syntax
from grader.expressions.compiling.syntax import ProgramKind
from grader.expressions.fields import DATA_RESULTS, DATA_STATE
from grader.expressions.machine import Machine
from grader.expressions.program import Program, Run, compile_program
from grader.expressions.values import UNDEFINED, RunError, Value, Vector, to_boolean, to_number, to_numbers

__all__ = [
    "DATA_RESULTS", "DATA_STATE", "UNDEFINED", "Machine", "Program", "ProgramKind", "Run", "RunError", "Value",
    "Vector", "compile_program", "fields", "syntax", "texts", "to_boolean", "to_number",
    "to_numbers", "values",
]  # fmt: skip
