"""Finds the edit of the author's program that gives a student's results, and the edit of the student's program that
makes them right. Both run in the jail, within a counted number of lines."""

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from inspect import getsource
from itertools import islice
from typing import Any

import numpy as np

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.exercises.driving.embedding import compile_code
from grader.exercises.kind import Mistake
from grader.exercises.kinds.values.judging import driver
from grader.exercises.kinds.values.judging.driver import Rows
from grader.exercises.kinds.values.judging.judge import compare_residual, fits
from grader.exercises.kinds.values.mutants import bench, edits
from grader.exercises.kinds.values.student_call import StudentCall

CALLS_MAX = 4
"""Calls that an edited program is run on: wrong ones first."""
LINES_MAX = 200_000
"""Lines that all edits of a program may run: 0.3 s of CPU time. Counted, so that load changes no verdict."""
SOURCE_CHARS_MAX = 16_000
EDITS_MAX = 2_000
"""Edits of a program that gets any: one of 13,900 characters of our own has 741."""
NUMBERS_MAX = 2_000
"""Numbers of all results of the calls: more are not compared."""
ROUND_OFF = 1e-9
"""The largest difference of two results of the same formula, relative to the largest element."""
LIMITS = Limits(cpu_s=5, wall_s=20)

DRIVER = 'exec(codes["edits"])\nexec(codes["kind"])\nexec(codes["bench"])\n'

MISTAKES: Mapping[str, str] = {
    "sign": "one sign changed: what should be added is subtracted, or the other way round. Check each sign.",
    "negative": "one number of the wrong sign: check the sign of each number, and in which direction it counts.",
    "term": "one term left out: write the formula down, and look for each of its terms in your code.",
    "factor": "one factor left out: write the formula down, and look for each of its factors in your code.",
    "quotient": "one product in the place of a quotient, or the other way round: compare the units on both sides.",
    "order": "the two sides of one difference, quotient or product of matrices exchanged: check which comes first.",
    "power": "another power in one place: look for a square that is missing, or one too many.",
    "twice": "one number twice as large as it should be: look for a factor of 2 too many, or a missing 1/2.",
    "half": "one number half as large as it should be: look for a missing factor of 2, or a 1/2 too many.",
    "index": "one index or bound off by one: count from 0, and check where you start and end.",
    "comparison": "one comparison that is turned round, or that has `<` in the place of `<=`: check both sides of it.",
    "function": "another function in one place, such as sine for cosine: check which one belongs there.",
    "left out": "one function left out, such as a root or a conversion: check what each number is before it is used.",
    "degrees": "one angle converted to radians that is in radians already: leave it as it is.",
    "in degrees": "one angle in degrees where radians are needed: sine, cosine and tangent take radians.",
    "arguments": "two arguments of one function exchanged: check their order.",
    "transpose": "one matrix that is not transposed where it should be: check its rows and columns.",
    "field": "another field of model or data in one place, such as a frame's origin for a centre of mass: check each.",
    "call": "one call left out, such as one that computes what is read later: check what has to be called before.",
    "update": "one update left out: look for each of the changes in your code.",
    "statements": "two statements in the other order: check which value each of them should read, the old or the new.",
}
"""What follows the beginning of a sentence, by the kind of the edit. None says where the edit is, or what it changes:
that would be the author's program."""

REPAIRS: Mapping[str, str] = {
    "sign": "one sign", "negative": "the sign of a number", "term": "one term too many",
    "factor": "one factor too many", "comparison": "one comparison", "power": "one power",
    "quotient": "a product or quotient that should be the other", "index": "one index or bound",
    "order": "the order of one difference, quotient or product",
    "twice": "a number that is off by a factor of 2", "half": "a number that is off by a factor of 2",
    "function": "one function, such as sine for cosine", "left out": "one function too many",
    "degrees": "a conversion between degrees and radians", "in degrees": "a conversion between degrees and radians",
    "arguments": "the order of two arguments",
    "transpose": "one transpose too many", "field": "the field of model or data", "call": "one call too many",
    "update": "one update too many", "statements": "the order of two statements",
}  # fmt: skip
"""What the line of a student's program is wrong by, by the kind of the edit that mends it."""

ALIKE: Mapping[str, Sequence[str]] = {
    "sign": ("sign", "negative", "order"), "negative": ("sign", "negative", "order"), "twice": ("twice", "half"),
    "half": ("twice", "half"), "quotient": ("quotient", "order"), "index": ("index", "comparison"),
    "degrees": ("degrees", "in degrees"), "in degrees": ("degrees", "in degrees"),
}  # fmt: skip
"""Kinds of edits of which one mends what another of the author's program has shown."""

RunJob = Callable[[Job], RunReport]


@dataclass(frozen=True)
class EditedProgram:
    """The results of a program with one edit: of all calls, one array after the other, in one row."""

    kind: str
    line: int
    row: Rows


@cache
def compile_codes() -> Mapping[str, bytes]:
    """Returns the code of the job."""
    return {
        name: compile_code(getsource(module)) for name, module in (("edits", edits), ("kind", driver), ("bench", bench))
    }


@lru_cache(maxsize=32)  # of the author's programs, beside learners' own
def list_edits(source: str, entry: str) -> tuple[edits.Edit, ...]:
    """Returns every edit of a program, in the order of the jail; none of a program that is no Python, or too long."""
    if len(source) > SOURCE_CHARS_MAX:
        return ()
    try:
        tree = ast.parse(source)
        listed = tuple(islice(edits.make_edits(tree, edits.find_functions(tree, entry)), EDITS_MAX + 1))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return ()
    return listed if len(listed) <= EDITS_MAX else ()


def run_edits(
    source: str, calls: Sequence[StudentCall], shapes: Sequence[tuple[int, ...]], run: RunJob, kinds: Sequence[str] = ()
) -> list[EditedProgram]:
    """Returns the results of a program with each edit of some kinds, of all by default. Raises JailFault."""
    problem = calls[0].problem
    known = list_edits(source, problem.name)
    if not known:
        return []
    inputs = {
        "source": source, "entry": problem.name, "results": problem.results, "kinds": [*kinds], "lines_max": LINES_MAX,
        "shapes": [list(shape) for shape in shapes],
        "calls": [call.comparison.call.inputs() | {"model": call.problem.xml} for call in calls],
    }  # fmt: skip
    report = run(Job("", DRIVER, inputs, LIMITS, codes=compile_codes()))
    if report.status is not RunStatus.RETURNED:
        return []
    which, rows = report.results.get("which"), report.results.get("rows")
    if which is None or rows is None or rows.ndim != 2 or len(rows) != len(which) or rows.dtype != np.float64:
        return []
    numbers: Any = rows
    return [
        EditedProgram(*known[index], row)
        for index, row in zip(which.tolist(), numbers, strict=True)
        if isinstance(index, int) and 0 <= index < len(known)
    ]


def list_values(calls: Sequence[StudentCall]) -> list[Rows]:
    """Returns the student's results of some calls."""
    return [value for call in calls for value in call.comparison.answer.values or ()]


def is_same_row(row: Rows, values: Sequence[Rows]) -> bool:
    """Whether a row holds these results, but for round-off."""
    at = 0
    for value in values:
        part = row[at : at + value.size]
        at += value.size
        largest = float(np.max(np.abs(value), initial=0.0))
        if part.size != value.size or np.any(np.abs(part - value.ravel()) > ROUND_OFF * largest):
            return False
    return at == row.size


def name_edit(calls: Sequence[StudentCall], source: str, run: RunJob) -> Mistake | None:
    """Returns the mistake of the edit of the author's program that gives the student's results in every call, with the
    line of the student's program whose edit of the same kind mends the visible ones; else the edit of the student's
    program that does. None if no edit does. Raises JailFault."""
    edit = find_shown_edit(calls, run)
    visible = [call for call in calls if not call.hidden]
    repair = find_repair(visible, source, run, ALIKE.get(edit, [edit]) if edit else [])
    if edit:
        return Mistake(
            f"Your results are those of a right program with {MISTAKES[edit]}", repair.line if repair else None
        )
    if repair is None:
        return None
    why = next(call.comparison.why for call in visible if call.comparison.why)
    return Mistake(
        f"{why} One small change in line {repair.line} of your script mends every visible case: look there for "
        f"{REPAIRS[repair.kind]}.",
        repair.line,
    )


def find_shown_edit(calls: Sequence[StudentCall], run: RunJob) -> str | None:
    """Returns the kind of the edit of the author's program that gives the student's results in every call; None if none
    does, or results cannot be compared. Raises JailFault."""
    chosen = sorted(calls, key=lambda call: not call.comparison.why)[:CALLS_MAX]
    if any(call.comparison.answer.values is None or call.comparison.expected is None for call in chosen):
        return None
    values = list_values(chosen)
    shapes = [value.shape for value in values]
    if shapes != list_expected_shapes(chosen) or sum(value.size for value in values) > NUMBERS_MAX:
        return None
    edited = run_edits(chosen[0].problem.text, chosen, shapes, run)
    return next((edit.kind for edit in edited if is_same_row(edit.row, values)), None)


def list_expected_shapes(calls: Sequence[StudentCall]) -> list[tuple[int, ...]]:
    """Returns the shapes of the right results."""
    return [right.shape for call in calls for right in call.comparison.expected or ()]


def find_repair(visible: Sequence[StudentCall], source: str, run: RunJob, kinds: Sequence[str]) -> EditedProgram | None:
    """Returns the edit of the student's program that makes every visible call right; None if none does, or edits of one
    kind in several lines. Hidden calls are left out: which edit is told could tell their numbers. Raises JailFault."""
    chosen = sorted(visible, key=lambda call: not call.comparison.why)[:CALLS_MAX]
    if not source or not chosen or not chosen[0].comparison.why:
        return None
    shapes = [
        shape or () if right is None else right.shape
        for call in chosen
        for shape, right in zip(
            call.problem.list_shapes(call.comparison.call),
            call.comparison.expected or [None] * len(call.problem.results),
            strict=True,
        )
    ]
    mending = [edit for edit in run_edits(source, chosen, shapes, run, kinds) if is_right(edit.row, chosen, shapes)]
    order = list(dict.fromkeys([*kinds, *MISTAKES]))  # of what mends alike, that which is most likely meant
    first = min((edit.kind for edit in mending), key=order.index, default="")
    likely = [edit for edit in mending if edit.kind == first]
    return likely[0] if len({edit.line for edit in likely}) == 1 else None


def is_right(row: Rows, calls: Sequence[StudentCall], shapes: Sequence[tuple[int, ...]]) -> bool:
    """Whether a row holds right results of every call."""
    parts = np.split(row, np.cumsum([int(np.prod(shape)) for shape in shapes])[:-1])
    values = [part.reshape(shape) for part, shape in zip(parts, shapes, strict=True)]
    for call in calls:
        count = len(call.problem.results)
        mine, values = values[:count], values[count:]
        compared = call.comparison
        if compared.expected is None:
            if compare_residual(call.problem, compared.call, compared.answer, tuple(mine)).why:
                return False
        elif not all(map(fits, call.problem.function.results, mine, compared.expected)):
            return False
    return True
