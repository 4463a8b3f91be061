"""The parameters of a `values` exercise, and the calls that they define."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Annotated, Any, Literal, Self

import mujoco
import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from grader.domain.numbers import NotNegative, Positive, Value, WholeRange, WholeValue
from grader.exercises.kind import DrawnCase
from grader.exercises.kinds.values.judging.driver import Rows, call_function, compile_model, start_data
from grader.exercises.kinds.values.judging.problem import Call, RanTooLong
from grader.exercises.kinds.values.made_arguments import ARGUMENTS_MAX, make_arguments
from grader.exercises.parameters import (
    CASES_MAX,
    ELEMENTS_MAX,
    Case,
    ExerciseParameters,
    Start,
    Strict,
    Values,
    WrongInCase,
    WrongProgram,
    draw_exactly,
)
from grader.exercises.programs import Program, TooManyLines, limit_lines, load_program

Name = Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")

Size = Annotated[int, Field(ge=1, le=ELEMENTS_MAX)] | Annotated[str, Field(pattern=r"^argument [1-9]\d?$")]
"""A size of an array: a number, or an argument of the call: a whole number itself, an array by its length."""


class Result(Strict):
    """One result of a function. Its tolerance is `atol` [its unit] plus `rtol` times the largest expected element. If
    `field` is given, the result is not returned but left in that field of `data`. A result without a `shape` has the
    one of the author's; where a residual decides it is a number, or as large as its field."""

    name: str = Field(min_length=1)
    field: Literal["qpos", "qvel", "act", "ctrl", "qacc", "qfrc_applied", "time"] | None = None
    shape: tuple[Size, ...] | None = Field(default=None, max_length=4)
    unit: str = ""
    atol: NotNegative = 0.0
    rtol: NotNegative = Field(default=1e-9, lt=1)

    @model_validator(mode="after")
    def _check_tolerance(self) -> Self:
        if not self.atol + self.rtol:
            raise ValueError("give atol or rtol above 0: right programs differ by round-off")
        return self


class Residual(Strict):
    """A function of the author's program that gets a call's arguments, then its results, and must return about 0.
    Learners read the `title` of what it computes."""

    function: str = Name
    title: str | None = Field(default=None, min_length=1)
    atol: Positive
    unit: str = ""


class Function(Strict):
    """A function that the student writes; `name` is by default the question's `entry`. It is judged against the
    function of the same name in the author's program, or by a `residual`."""

    name: str | None = Field(default=None, pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")
    results: tuple[Result, ...] = Field(min_length=1, max_length=8)
    residual: Residual | None = None


class Array(Strict):
    """An array argument: numbers and ranges in reading order, and its shape if it has more than one dimension."""

    array: Values = Field(min_length=1)
    shape: tuple[Annotated[int, Field(ge=1, le=ELEMENTS_MAX)], ...] | None = Field(default=None, max_length=8)

    @model_validator(mode="after")
    def _check_shape(self) -> Self:
        if self.shape is not None and prod(self.shape) != len(self.array):
            raise ValueError(f"shape {list(self.shape)} does not hold {len(self.array)} numbers")
        return self


class Integer(Strict):
    """A whole number, or the first and the last of a range."""

    integer: WholeValue


def choose_argument(argument: Any) -> str:
    """Returns how an argument is written: "name", "number" (or a range), "array" or "integer"."""
    if isinstance(argument, str | Array | Integer):
        return {str: "name", Array: "array", Integer: "integer"}[type(argument)]
    return ("integer" if "integer" in argument else "array") if isinstance(argument, Mapping) else "number"


Argument = Annotated[
    Annotated[Literal["model", "data"], Tag("name")]
    | Annotated[Value, Tag("number")]
    | Annotated[Array, Tag("array")]
    | Annotated[Integer, Tag("integer")],
    Discriminator(choose_argument),
]


class ArgumentsProgram(Strict):
    """The path of an author's program whose `function` makes the arguments of a call: it gets the case's model, or
    None, the drawn numbers by name, and a random generator of NumPy."""

    program: str = Field(min_length=1)
    function: str = Field(default="arguments", pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")


def choose_arguments(arguments: Any) -> str:
    """Returns how arguments are declared: by a "program", or each for itself."""
    return "program" if isinstance(arguments, Mapping | ArgumentsProgram) else "each"


Arguments = Annotated[
    Annotated[Annotated[tuple[Argument, ...], Field(max_length=ARGUMENTS_MAX)], Tag("each")]
    | Annotated[ArgumentsProgram, Tag("program")],
    Discriminator(choose_arguments),
]


class ValuesCase(Case):
    """Some `calls` of one `function` (by default the first), each with arguments and a start drawn anew."""

    function: str | None = None
    arguments: Arguments = ()
    start: Start = Start()
    calls: int = Field(default=1, ge=1, le=20)


class ValuesParameters(ExerciseParameters):
    """`program` is the path of the author's program in the content folder. The programs of `mistakes` define one
    or more of the functions; they run in the grader's own process."""

    program: str = Field(min_length=1)
    functions: tuple[Function, ...] = Field(min_length=1, max_length=20)
    cases: tuple[ValuesCase, ...] = Field(min_length=1, max_length=CASES_MAX)
    mistakes: tuple[WrongProgram, ...] = Field(default=(), max_length=50)


@dataclass(frozen=True, eq=False)
class Problem:
    """The calls of one trial. `independent`: no number of the model is drawn, so the calls share no draw. `text` is
    that of the author's program."""

    name: str
    function: Function
    xml: str
    calls: tuple[Call, ...]
    program: Program
    mistakes: tuple[tuple[Program, str], ...]
    independent: bool
    text: str = ""

    @property
    def results(self) -> list[dict[str, str | None]]:
        """Names and fields of the results, as the driver reads them."""
        return [{"name": result.name, "field": result.field} for result in self.function.results]

    def inputs(self) -> dict[str, Any]:
        """Returns the inputs of the driver."""
        return {"model": self.xml, "results": self.results, "calls": [call.inputs() for call in self.calls]}

    def list_shapes(self, call: Call) -> list[tuple[int, ...] | None]:
        """Returns the declared shape of each result; None where the author's result has it. Raises ValueError."""
        return [self.find_shape(result, call) for result in self.function.results]

    def find_shape(self, result: Result, call: Call) -> tuple[int, ...] | None:
        """Returns the shape of one result, as `list_shapes` does."""
        if result.shape is not None:
            shape = tuple(read_size(size, call.arguments) for size in result.shape)
            if prod(shape) > ELEMENTS_MAX:
                raise ValueError(f"{result.name} has {prod(shape)} numbers; at most {ELEMENTS_MAX} are taken")
            return shape
        if self.function.residual is None:
            return None
        model = compile_model(self.xml)
        return np.shape(getattr(start_data(model, call.start), result.field)) if model and result.field else ()

    def compute_results(
        self,
        call: Call,
        program: Program | None = None,
        change: Callable[[mujoco.MjModel], None] | None = None,
        times: int = 1,
    ) -> list[Rows] | str:
        """Returns the results of the program's function; `change` changes the model first."""
        model = compile_model(self.xml)
        if model is not None and change is not None:
            change(model)
        function = (self.program if program is None else program)[self.name]
        return call_function(function, model, call.inputs(), self.results, times)

    def compute_expected(self, call: Call) -> tuple[Rows, ...] | None:
        """Returns the author's results; None where a residual decides. Raises ValueError if the program has none."""
        if self.function.residual is not None:
            return None
        answer = self.compute_results(call)
        if isinstance(answer, str):
            names = ", ".join(result.name for result in self.function.results)
            raise ValueError(f"{self.name} of the author's program must give {names} as finite numbers, not {answer}")
        return tuple(answer)

    def compute_remainder(self, call: Call, values: tuple[Rows, ...]) -> Rows | None:
        """Returns the residual of the student's results; None if it is not finite. Raises what the residual raises."""
        assert self.function.residual is not None
        residual = self.program[self.function.residual.function]
        given = tuple(float(value) if value.ndim == 0 else value for value in values)

        def remaining(*arguments: object) -> object:
            return residual(*arguments, *given)

        model, results = compile_model(self.xml), [{"name": "residual", "field": None}]
        try:
            remainder = limit_lines(lambda: call_function(remaining, model, call.inputs(), results))
        except TooManyLines as error:
            raise RanTooLong(str(error)) from error
        return None if isinstance(remainder, str) else remainder[0]


def read_size(size: int | str, arguments: Sequence[Any]) -> int:
    """Returns a size of an array. Raises ValueError where it names no argument that is a size above 0."""
    if isinstance(size, int):
        return size
    place = int(size.split()[1])
    value = arguments[place - 1] if place <= len(arguments) else None
    count = len(value) if isinstance(value, list) else value
    if not isinstance(count, int) or count < 1:
        raise ValueError(f"`shape` names {size}, which must be an array or a whole number above 0")
    return count


def pose_case(parameters: ValuesParameters, drawn: DrawnCase[ValuesCase]) -> Problem:
    """Draws the calls of a case. Raises WrongParameter, ValueError or KeyError for parameters that cannot work."""
    case = drawn.case
    known = {function.name or drawn.content.entry: function for function in parameters.functions}
    name = case.function or next(iter(known))
    if name not in known:
        raise ValueError(f"`functions` has no function {name!r}; it has {', '.join(known)}")
    declared = () if isinstance(case.arguments, ArgumentsProgram) else case.arguments
    if not drawn.xml and ({"model", "data"} & {*map(str, declared)} or uses_data(known[name])):
        raise ValueError("give either `model` (a name in models/) or `xml` (MJCF text)")
    wanted = known[name].residual.function if known[name].residual else name  # type: ignore[union-attr]
    problem = Problem(
        name,
        known[name],
        drawn.xml,
        tuple(draw_call(drawn) for _ in range(case.calls)),
        load_program(parameters.program, drawn.content.text_of, "program", wanted),
        tuple(
            (load_program(mistake.program, drawn.content.text_of, f"mistakes.{index}.program"), mistake.sentence)
            for index, mistake in enumerate(parameters.mistakes)
        ),
        independent=not any(isinstance(value, tuple) for value in case.set.values()),
        text=drawn.content.text_of(parameters.program),
    )
    model = compile_model(problem.xml)
    if model is not None:
        check_start(model, problem.calls[0].start)
        start_data(model, problem.calls[0].start)
    return problem


def check_start(model: mujoco.MjModel, start: Mapping[str, Any]) -> None:
    """Raises WrongInCase for a part of the state that has another number of values in the model."""
    sizes = {"qpos": model.nq, "qvel": model.nv, "act": model.na, "ctrl": model.nu}
    for name, size in sizes.items():
        if start[name] is not None and len(start[name]) != size:
            raise WrongInCase(f"start.{name}", f"has {len(start[name])} numbers; data.{name} of the model has {size}")


def uses_data(function: Function) -> bool:
    """Whether a result is left in `data`."""
    return any(result.field for result in function.results)


def draw_call(drawn: DrawnCase[ValuesCase]) -> Call:
    """Draws the arguments and the start of one call. Raises WrongInCase where the author's program makes none."""
    declared, rng = drawn.case.arguments, drawn.rng
    if isinstance(declared, ArgumentsProgram):
        arguments = make_arguments(drawn, declared.program, declared.function)
    else:
        arguments = tuple(draw_argument(argument, rng) for argument in declared)
    return Call(arguments, drawn.case.start.draw(rng))


def draw_argument(argument: Argument, rng: np.random.Generator) -> Any:
    """Returns an argument as plain JSON."""
    if isinstance(argument, str):
        return argument
    if isinstance(argument, Integer):
        ends = argument.integer
        return int(rng.integers(ends[0], ends[1], endpoint=True)) if isinstance(ends, WholeRange) else ends
    if isinstance(argument, Array):
        return np.reshape([draw_exactly(value, rng) for value in argument.array], argument.shape or -1).tolist()
    return draw_exactly(argument, rng)
