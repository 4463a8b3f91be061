"""The programs of a lab, compiled once per config, with every fault of every one of them."""

import re
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass
from threading import Lock
from typing import Any

from grader.domain.lab import Button, LabConfig, Select, Slider
from grader.errors import ContentError, Fault
from grader.expressions import Program, ProgramKind, compile_program

PATH = re.compile(r"(model|data|ctx)(\.[A-Za-z_][A-Za-z0-9_]*)+(\[[0-9]+\])?")
PARAMETER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
COMPILED_MAX = 256


@dataclass(frozen=True)
class Setter:
    """A slider or select with the programs that take its value to the model, the data or `ctx`."""

    control: Slider | Select
    programs: tuple[Program, ...]


@dataclass(frozen=True)
class LabPrograms:
    """Everything of a lab that runs. `shown` are the readouts, the traces of the plots and the trail, in this order."""

    setup: Program | None
    setters: tuple[Setter, ...]
    buttons: dict[str, Program]
    controller: Program | None
    stop: Program | None
    shown: tuple[Program, ...]
    reference_lines: tuple[tuple[Program | None, ...], ...]


class _Compiler:
    """Compiles one text after another and keeps the faults."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def program(self, text: str | None, kind: ProgramKind, *place: str | int) -> Program | None:
        if text is None:
            return None
        try:
            return compile_program(text, kind, ".".join(map(str, place)))
        except ContentError as error:
            self.faults.extend(error.faults)
            return None

    def setter(self, control: Slider | Select, *place: str | int) -> Setter:
        texts = [("apply", control.apply)]
        if control.set is not None:
            self._demand(PATH.fullmatch(control.set), "is not a path such as model.opt.timestep", *place, "set")
            texts.append(("set", f"{control.set} = value"))
        if control.param is not None:
            self._demand(PARAMETER.fullmatch(control.param), "is not a name such as kp", *place, "param")
            texts.append(("param", f"ctx.{control.param} = value"))
        found = [self.program(text, "statement", *place, key) for key, text in texts if text is not None]
        self._demand(found, "changes nothing: give it set, apply or param", *place)
        return Setter(control, tuple(program for program in found if program is not None))

    def _demand(self, held: object, why: str, *place: str | int) -> None:
        if not held:
            self.faults.append(Fault("", ".".join(map(str, place)), why))


_compiled: OrderedDict[str, LabPrograms] = OrderedDict()
_lock = Lock()


def lab_programs(config: LabConfig, where: str = "lab") -> LabPrograms:
    """The programs of a lab, from memory where the same config was compiled before.

    Raises ContentError with the faults of all of them; keys begin with `where`, reasons with line and column.
    """
    key = f"{where}\n{config!r}"
    with _lock:
        if key in _compiled:
            _compiled.move_to_end(key)
            return _compiled[key]
    made = _compile(config, where)
    with _lock:
        _compiled[key] = made
        while len(_compiled) > COMPILED_MAX:
            _compiled.popitem(last=False)
    return made


def _compile(config: LabConfig, where: str) -> LabPrograms:
    c = _Compiler()
    numbered = list(enumerate(config.controls))
    made = LabPrograms(
        setup=c.program(config.setup, "statement", where, "setup"),
        setters=tuple(
            c.setter(control, where, "controls", i) for i, control in numbered if not isinstance(control, Button)
        ),
        buttons={
            control.label: program
            for i, control in numbered
            if isinstance(control, Button)
            and (program := c.program(control.run, "statement", where, "controls", i, "run"))
        },
        controller=c.program(config.controller, "statement", where, "controller"),
        stop=c.program(config.stopAt, "expression", where, "stopAt") if isinstance(config.stopAt, str) else None,
        shown=tuple(program for program in _shown(c, config, where) if program is not None),
        reference_lines=tuple(
            tuple(_reference_line(c, line, where, "plots", i, "refLines", j) for j, line in enumerate(plot.refLines))
            for i, plot in enumerate(config.plots)
        ),
    )
    if c.faults:
        raise ContentError(c.faults)
    return made


def _shown(c: _Compiler, config: LabConfig, where: str) -> Iterator[Program | None]:
    for i, readout in enumerate(config.readouts):
        yield c.program(readout.expr, "expression", where, "readouts", i, "expr")
    for i, plot in enumerate(config.plots):
        for j, trace in enumerate(plot.traces):
            yield c.program(trace.expr, "expression", where, "plots", i, "traces", j, "expr")
    yield _trail(c, config.trail, where, "trail")


def _reference_line(c: _Compiler, line: Any, *place: str | int) -> Program | None:
    """A line at a height that an expression gives: a text, or an object with `expr`."""
    if isinstance(line, dict):
        return c.program(line["expr"], "expression", *place, "expr") if isinstance(line.get("expr"), str) else None
    return c.program(line, "expression", *place) if isinstance(line, str) else None


def _trail(c: _Compiler, trail: Any, *place: str | int) -> Program | None:
    """The point that leaves a trail: `{"site" | "body" | "geom": name}`, `{"expr"}`, or the name of a site."""
    named = {"site": trail} if isinstance(trail, str) else trail
    if not isinstance(named, dict):
        if trail not in (None, True, False):
            c.faults.append(Fault("", ".".join(map(str, place)), 'is not a trail such as {"site": "tip"}'))
        return None
    for kind in ("site", "body", "geom"):
        if isinstance(named.get(kind), str):
            name = named[kind].replace("\\", "\\\\").replace("'", "\\'").replace("\n", "\\n")
            return c.program(f"lib.{kind}Pos('{name}')", "expression", *place)
    if isinstance(named.get("expr"), str):
        return c.program(named["expr"], "expression", *place, "expr")
    c.faults.append(Fault("", ".".join(map(str, place)), "names no point: give site, body, geom or expr"))
    return None
