"""The small JavaScript that authors write in labs and answer keys: compiled once, run with a budget.

    program = compile_program("data.ctrl[0] = -ctx.kp * data.qpos[0]", "statement", "q3.sim.controller")
    control = program.bind(Machine(model, data))
    control()

A text is parsed by tree-sitter's grammar and becomes Python code made only of node types and names of our own: no text
of an author is ever a Python name, an attribute or an import. A program reaches what `fields`, `runtime` and `methods`
list, and nothing else. Loops, calls, texts and arrays are bounded. Everything outside this package imports from here:
`values` and `texts` convert what programs give and take, `fields` lists what they reach.
"""

from grader.expressions import fields as fields
from grader.expressions import texts as texts
from grader.expressions import values as values
from grader.expressions.fields import DATA_RESULTS as DATA_RESULTS
from grader.expressions.fields import DATA_STATE as DATA_STATE
from grader.expressions.machine import Machine as Machine
from grader.expressions.program import Program as Program
from grader.expressions.program import Run as Run
from grader.expressions.program import compile_program as compile_program
from grader.expressions.syntax import ProgramKind as ProgramKind
from grader.expressions.values import UNDEFINED as UNDEFINED
from grader.expressions.values import Trouble as Trouble
from grader.expressions.values import Value as Value
from grader.expressions.values import Vector as Vector
from grader.expressions.values import to_boolean as to_boolean
from grader.expressions.values import to_number as to_number
