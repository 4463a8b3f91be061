"""The programs of a lab, compiled once per config, with every fault of every one of them."""

import functools
import json
import re
from dataclasses import dataclass, field
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
    """Compiles one text after another and keeps the faults, whose keys begin with `where`."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []

    def demand(self, held: object, place: str, why: str) -> None:
        if not held:
            self.faults.append(Fault("", f"{self.where}.{place}", why))

    def program(self, text: str | None, kind: ProgramKind, place: str) -> Program | None:
        if text is None:
            return None
        try:
            return compile_program(text, kind, f"{self.where}.{place}")
        except ContentError as error:
            self.faults.extend(error.faults)
            return None

    def setter(self, control: Slider | Select, place: str) -> Setter:
        texts = {"apply": control.apply}
        if control.set is not None:
            self.demand(PATH.fullmatch(control.set), f"{place}.set", "is not a path such as model.opt.timestep")
            texts["set"] = f"{control.set} = value"
        if control.param is not None:
            self.demand(PARAMETER.fullmatch(control.param), f"{place}.param", "is not a name such as kp")
            texts["param"] = f"ctx.{control.param} = value"
        self.demand(
            any(text is not None for text in texts.values()), place, "changes nothing: give it set, apply or param"
        )
        found = [self.program(text, "statement", f"{place}.{key}") for key, text in texts.items()]
        return Setter(control, tuple(filter(None, found)))

    def shown(self, config: LabConfig) -> tuple[Program, ...]:
        texts = {f"readouts.{i}.expr": readout.expr for i, readout in enumerate(config.readouts)}
        for i, plot in enumerate(config.plots):
            texts |= {f"plots.{i}.traces.{j}.expr": trace.expr for j, trace in enumerate(plot.traces)}
        programs = [self.program(text, "expression", place) for place, text in texts.items()]
        return tuple(filter(None, [*programs, self.trail(config.trail)]))

    def trail(self, trail: Any) -> Program | None:
        """The point that leaves a trail: `{"site" | "body" | "geom": name}`, `{"expr"}`, or the name of a site."""
        named = {"site": trail} if isinstance(trail, str) else trail
        if not isinstance(named, dict):
            self.demand(trail in (None, True, False), "trail", 'is not a trail such as {"site": "tip"}')
            return None
        for kind in ("site", "body", "geom"):
            if isinstance(named.get(kind), str):
                return self.program(f"lib.{kind}Pos({json.dumps(named[kind])})", "expression", "trail")
        text = named.get("expr")
        self.demand(isinstance(text, str), "trail", "names no point: give site, body, geom or expr")
        return self.program(text, "expression", "trail.expr") if isinstance(text, str) else None

    def reference_line(self, line: Any, place: str) -> Program | None:
        """A line at a height that an expression gives: a text, or an object with `expr`."""
        if isinstance(line, dict):
            line, place = line.get("expr"), f"{place}.expr"
        return self.program(line, "expression", place) if isinstance(line, str) else None


@dataclass(frozen=True)
class _Lab:
    """A lab as the cache compares it: by its text, since a config holds what has no hash."""

    text: str
    config: LabConfig = field(compare=False)


def lab_programs(config: LabConfig, where: str = "lab") -> LabPrograms:
    """The programs of a lab, from memory where the same config was compiled before.

    Raises ContentError with the faults of all of them; keys begin with `where`, reasons with line and column.
    """
    return _compiled(_Lab(repr(config), config), where)


@functools.lru_cache(maxsize=COMPILED_MAX)
def _compiled(lab: _Lab, where: str) -> LabPrograms:
    config, c = lab.config, _Compiler(where)
    controls = [(f"controls.{i}", control) for i, control in enumerate(config.controls)]
    setup = c.program(config.setup, "statement", "setup")
    setters = tuple(c.setter(control, place) for place, control in controls if not isinstance(control, Button))
    pressed = {
        control.label: c.program(control.run, "statement", f"{place}.run")
        for place, control in controls
        if isinstance(control, Button)
    }
    made = LabPrograms(
        setup=setup,
        setters=setters,
        buttons={label: program for label, program in pressed.items() if program is not None},
        controller=c.program(config.controller, "statement", "controller"),
        stop=c.program(config.stopAt, "expression", "stopAt") if isinstance(config.stopAt, str) else None,
        shown=c.shown(config),
        reference_lines=tuple(
            tuple(c.reference_line(line, f"plots.{i}.refLines.{j}") for j, line in enumerate(plot.refLines))
            for i, plot in enumerate(config.plots)
        ),
    )
    if c.faults:
        raise ContentError(c.faults)
    return made
