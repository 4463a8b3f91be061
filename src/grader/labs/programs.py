"""The programs of a lab, compiled once per config, with every fault of every one of them."""

import functools
import json
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import mujoco

from grader.domain.lab import Button, LabConfig, Select, Slider
from grader.errors import ContentError, Fault
from grader.expressions import Machine, Program, ProgramKind, compile_program

PATH = re.compile(r"(model|data|ctx)(\.[A-Za-z_][A-Za-z0-9_]*)+(\[[0-9]+\])?")
PARAMETER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
NUMBER = re.compile(r"\s*[0-9.]+\s*")
COMPILED_MAX = 256


@dataclass(frozen=True)
class LabPrograms:
    """Everything of a lab that runs. `setters` take the value of a slider or select to the model, the data or `ctx`.
    `shown` are the readouts, the traces of the plots and the trail, in this order."""

    setup: Program
    setters: tuple[tuple[Slider | Select, tuple[Program, ...]], ...]
    buttons: dict[str, Program]
    controller: Program | None
    stop: Program | None
    shown: tuple[Program, ...]
    reference_lines: tuple[tuple[Program | None, ...], ...]

    def __iter__(self) -> Iterator[Program]:
        """Yields every program."""
        yield self.setup
        for _, setters in self.setters:
            yield from setters
        yield from self.buttons.values()
        yield from filter(None, (self.controller, self.stop, *self.shown))
        yield from self._list_reference_lines()

    def _list_reference_lines(self) -> Iterator[Program]:
        for lines in self.reference_lines:
            yield from filter(None, lines)

    def show_derived(self) -> bool:
        """Whether something that MuJoCo derives from the state is shown."""
        return not all(program.reads_state_alone for program in (*self.shown, *self._list_reference_lines()))


def list_missing_elements(programs: Iterable[Program], xml: str) -> list[Fault]:
    """Returns a fault for every element of a field that a program names by a number and the model does not have, such
    as `data.qpos[70]`. Raises ValueError if MuJoCo cannot compile the model."""
    model = mujoco.MjModel.from_xml_string(xml)
    machine = Machine(model, mujoco.MjData(model))
    return [Fault("", program.where, why) for program in programs for why in program.list_missing_elements(machine)[:1]]


NOTHING = compile_program("", "statement", "")


class _Compiler:
    """Compiles one text after another and keeps the faults, whose keys begin with `where`."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.faults: list[Fault] = []

    def demand(self, held: object, place: str, why: str) -> None:
        if not held:
            self.faults.append(Fault("", f"{self.where}.{place}", why))

    def program(self, place: str, text: str, kind: ProgramKind = "expression") -> Program:
        """Returns the program of a text; one that does nothing where the text has a fault."""
        try:
            return compile_program(text, kind, f"{self.where}.{place}")
        except ContentError as error:
            self.faults.extend(error.faults)
            return NOTHING

    def condition(self, place: str, text: str) -> Program:
        self.demand(not NUMBER.fullmatch(text), place, f"{text!r} is always true: write a time without the quotes")
        return self.program(place, text)

    def setter(self, place: str, control: Slider | Select) -> tuple[Program, ...]:
        path, parameter = control.set, control.param
        self.demand(path is None or PATH.fullmatch(path), f"{place}.set", "is not a path such as model.opt.timestep")
        self.demand(parameter is None or PARAMETER.fullmatch(parameter), f"{place}.param", "is not a name such as kp")
        texts = {
            "apply": control.apply,
            "set": None if path is None else f"{path} = value",
            "param": None if parameter is None else f"ctx.{parameter} = value",
        }
        actions = {key: text for key, text in texts.items() if text is not None}
        self.demand(actions, place, "changes nothing: give it set, apply or param")
        return tuple(self.program(f"{place}.{key}", text, "statement") for key, text in actions.items())

    def shown(self, config: LabConfig) -> tuple[Program, ...]:
        texts = {f"readouts.{i}.expr": readout.expr for i, readout in enumerate(config.readouts)}
        for i, plot in enumerate(config.plots):
            texts |= {f"plots.{i}.traces.{j}.expr": trace.expr for j, trace in enumerate(plot.traces)}
        return tuple(self.program(place, text) for place, text in (texts | self.trail(config.trail)).items())

    def trail(self, trail: Any) -> dict[str, str]:
        """The point that leaves a trail: `{"site" | "body" | "geom": name}`, `{"expr"}`, or the name of a site."""
        named = {"site": trail} if isinstance(trail, str) else trail
        if not isinstance(named, dict):
            self.demand(trail in (None, True, False), "trail", 'is not a trail such as {"site": "tip"}')
            return {}
        for kind in ("site", "body", "geom"):
            if isinstance(named.get(kind), str):
                return {"trail": f"lib.{kind}Pos({json.dumps(named[kind])})"}
        text = named.get("expr")
        self.demand(isinstance(text, str), "trail", "names no point: give site, body, geom or expr")
        return {"trail.expr": text} if isinstance(text, str) else {}

    def reference_line(self, place: str, line: Any) -> Program | None:
        """Returns a line at a height that an expression gives: a text, or an object with `expr`."""
        if isinstance(line, dict):
            line, place = line.get("expr"), f"{place}.expr"
        return self.program(place, line) if isinstance(line, str) else None


@dataclass(frozen=True, eq=False)
class _Lab:
    """A lab as the cache compares it: by its identity, since a config holds what has no hash, and is long as a text.
    The cache keeps the config, so that no other can take its place in memory."""

    config: LabConfig

    def __hash__(self) -> int:
        return id(self.config)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Lab) and self.config is other.config


def compile_lab(config: LabConfig, where: str = "lab") -> LabPrograms:
    """Returns the programs of a lab, from memory where the same config was compiled before. Raises ContentError with
    the faults of all of them; keys begin with `where`, reasons with line and column."""
    return _compile(_Lab(config), where)


@functools.lru_cache(maxsize=COMPILED_MAX)
def _compile(lab: _Lab, where: str) -> LabPrograms:
    config, c = lab.config, _Compiler(where)
    controls = [(f"controls.{i}", control) for i, control in enumerate(config.controls)]
    programs = LabPrograms(
        setup=c.program("setup", config.setup or "", "statement"),
        setters=tuple(
            (control, c.setter(place, control)) for place, control in controls if not isinstance(control, Button)
        ),
        buttons={
            button.label: c.program(f"{at}.run", button.run, "statement")
            for at, button in controls
            if isinstance(button, Button)
        },
        controller=None if config.controller is None else c.program("controller", config.controller, "statement"),
        stop=c.condition("stopAt", config.stopAt) if isinstance(config.stopAt, str) else None,
        shown=c.shown(config),
        reference_lines=tuple(
            tuple(c.reference_line(f"plots.{i}.refLines.{j}", line) for j, line in enumerate(plot.refLines))
            for i, plot in enumerate(config.plots)
        ),
    )
    if c.faults:
        raise ContentError(c.faults)
    return programs
