"""Runs a lab: the author's JSON on the model itself, without a window, recording frames."""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any

import mujoco
import numpy as np

from grader.domain.lab import LabConfig, OptionValue
from grader.errors import LabError, LabRefused
from grader.expressions import Machine, Program, Run, Value, Vector, to_boolean
from grader.labs.controls import Given, as_value, chosen_values
from grader.labs.programs import LabPrograms, Setter, lab_programs
from grader.labs.record import LabRun, describe_geom, drawn_geoms, noted
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.workspace import Workspace

SECONDS_DEFAULT = 3.0
SECONDS_MAX = 60.0
EVENTS_MAX = 1000
STEPS_MAX = 200_000
FRAMES_PER_SECOND = 60
WARNINGS_MAX = 100

Event = tuple[float, str]
"""A press of a button: the time [s] and the label."""


@dataclass(frozen=True)
class Variant:
    """The same lab, slightly different, for certificates.

    Another integrator, timesteps `finer` times smaller, every position of the start nudged by `nudge` [rad or m], a
    frame for every step.
    """

    integrator: int | None = None
    finer: int = 1
    nudge: float = 0.0
    every_step: bool = False


SAME = Variant()


@dataclass
class Running:
    """A run in progress. `elapsed` [s] is the lab's time; MuJoCo's own falls back when it resets the state."""

    workspace: Workspace
    programs: LabPrograms
    presses: deque[tuple[float, Program]]
    record: LabRun
    every_step: bool = False
    elapsed: float = 0.0

    def __post_init__(self) -> None:
        self.model, self.data = self.workspace.model, self.workspace.data
        self.machine = Machine(self.model, self.data)
        self.saved = np.empty(mujoco.mj_stateSize(self.model, FULL_STATE))
        self.shown: list[Run] = [program.bind(self.machine) for program in self.programs.shown]

    def start(self, values: Mapping[str, OptionValue]) -> None:
        """Controls, setup, controls with `init`; then the positions that belong to the state."""
        self._set(values, self.programs.setters)
        if self.programs.setup is not None:
            self.programs.setup.run(self.machine)
        self._set(values, [setter for setter in self.programs.setters if setter.control.init])
        self._forward()
        self.geoms = drawn_geoms(self.model)
        self.record.geoms = [describe_geom(self.model, geom) for geom in self.geoms]

    def _set(self, values: Mapping[str, OptionValue], setters: Sequence[Setter]) -> None:
        for setter in setters:
            for program in setter.programs:
                program.run(self.machine, as_value(values[setter.control.label]))

    def vary(self, variant: Variant) -> None:
        """Make this run the variant."""
        self.every_step = variant.every_step
        self.model.opt.timestep /= variant.finer
        if variant.integrator is not None:
            self.model.opt.integrator = variant.integrator
        if variant.nudge:
            step = np.full(self.model.nv, variant.nudge)
            mujoco.mj_integratePos(self.model, self.data.qpos, step, 1.0)
            self._forward()

    def _forward(self) -> None:
        self._call(mujoco.mj_forward)
        self._note_warnings()

    def _call(self, function: Callable[..., None], **options: int) -> None:
        """Call a function of MuJoCo on the model and the data."""
        try:
            function(self.model, self.data, **options)
        except mujoco.FatalError as error:
            raise LabError("lab", f"MuJoCo: {error}") from error

    def go(self, duration: float) -> None:
        """Step to the end, keeping about 60 frames a second."""
        each_step = self.programs.controller is not None or self.programs.stop is not None
        self._press()
        self._keep_frame()
        while self.elapsed < duration * (1 - 1e-9):
            h = float(self.model.opt.timestep)
            frame = 1 if self.every_step else max(1, round(1 / (FRAMES_PER_SECOND * h)))
            count = min(frame, _steps_until(duration, self.elapsed, h), self._steps_to_press(h))
            if self.record.steps + count > STEPS_MAX:
                raise LabRefused(f"{duration:g} s at this timestep take more than {STEPS_MAX} steps.")
            stopped = self._step_singly(count) if each_step else self._step_chunk(count, h)
            self._press()
            self._keep_frame()
            if stopped:
                return

    def _steps_to_press(self, h: float) -> int:
        return _steps_until(self.presses[0][0], self.elapsed, h) if self.presses else STEPS_MAX

    def _press(self) -> None:
        """Buttons whose time has come."""
        while self.presses and self.presses[0][0] <= self.elapsed + 1e-9:
            self.presses.popleft()[1].run(self.machine)

    def _step_chunk(self, count: int, h: float) -> bool:
        """Steps in C; where one warned, the chunk is done again step by step to learn which."""
        mujoco.mj_getState(self.model, self.data, self.saved, FULL_STATE)
        self._call(mujoco.mj_step, nstep=count)
        if self.workspace.counts.any():
            mujoco.mj_resetData(self.model, self.data)
            mujoco.mj_setState(self.model, self.data, self.saved, FULL_STATE)
            return self._step_singly(count)
        self.elapsed += count * h
        self.record.steps += count
        return False

    def _step_singly(self, count: int) -> bool:
        """Controller, step, stop condition; whether the condition ended the run."""
        p = self.programs
        controller = None if p.controller is None else p.controller.bind(self.machine)
        stop = None if p.stop is None else p.stop.bind(self.machine)
        for _ in range(count):
            if controller is not None:
                controller()
            h = float(self.model.opt.timestep)
            self._call(mujoco.mj_step, nstep=1)
            self._note_warnings()
            self.elapsed += h
            self.record.steps += 1
            if stop is not None and to_boolean(stop()):
                return True
        return False

    def _note_warnings(self) -> None:
        """Record what MuJoCo warned of."""
        self.record.warnings += noted(self.workspace.counts, self.elapsed)
        del self.record.warnings[WARNINGS_MAX:]

    def _keep_frame(self) -> None:
        self.record.duration_s = self.elapsed
        self.record.times.append(self.elapsed)
        self.record.poses.append((self.data.geom_xpos[self.geoms], self.data.geom_xmat[self.geoms]))
        self.record.rows.append([_kept(run()) for run in self.shown])

    def finish(self) -> None:
        """The lines whose height is an expression get it from the end of the run."""
        self.record.reference_lines = [
            list(map(self._reference_line, plot.refLines, programs))
            for plot, programs in zip(self.record.config.plots, self.programs.reference_lines, strict=True)
        ]

    def _reference_line(self, line: Any, program: Program | None) -> Any:
        if program is None:
            return line
        height = program.run(self.machine)
        y = height if isinstance(height, float) and isfinite(height) else None
        return {**line, "y": y} if isinstance(line, dict) else {"y": y}


def _steps_until(moment: float, elapsed: float, h: float) -> int:
    return max(1, ceil((moment - elapsed) / h - 1e-6))


def _kept(value: Value) -> Value:
    """A value that later steps do not change."""
    return value.values() if isinstance(value, Vector) else list(value) if isinstance(value, list) else value


def run_lab(
    config: LabConfig,
    xml: str,
    controls: Mapping[str, Given] | None = None,
    events: Sequence[Event] = (),
    seconds: float | None = None,
    *,
    variant: Variant = SAME,
    where: str = "lab",
) -> LabRun:
    """Run a lab from its start with these control values and button presses (time [s], label).

    Order: the keyframe, every control's value, `setup`, the controls with `init` once more. `controller` runs before
    every step. When MuJoCo resets a state that diverged, the run goes on from there, as in a browser, and the warning
    is recorded. Lasts `seconds`, else `stopAt`, else the widest plot, else 3 s. `where` names the lab in errors.

    Raises LabRefused for control values, events or lengths that are not allowed, LabError where an expression
    fails, ContentError where one cannot be compiled, ValueError where MuJoCo cannot compile the model.
    """
    began = time.perf_counter()
    programs, values = lab_programs(config, where), chosen_values(config, controls or {})
    duration = _duration(config, seconds)
    presses = _presses(programs, events, duration)
    used = {label: list(value) if isinstance(value, tuple) else value for label, value in values.items()}
    running = Running(start_workspace(config, xml), programs, presses, LabRun(config, used))
    running.start(values)
    running.vary(variant)
    prepared = time.perf_counter()
    running.go(duration)
    ran = time.perf_counter()
    running.finish()
    running.record.timing_ms = {"prepare": 1000 * (prepared - began), "run": 1000 * (ran - prepared)}
    return running.record


def lab_scene(config: LabConfig, xml: str, controls: Mapping[str, Given] | None = None) -> Scene:
    """The scene at the lab's start: the model as the controls made it, the state as `setup` left it."""
    running = Running(start_workspace(config, xml), lab_programs(config), deque(), LabRun(config, {}))
    running.start(chosen_values(config, controls or {}))
    data = running.data
    return Scene.of_model(running.model).at(qpos=data.qpos, qvel=data.qvel, act=data.act, ctrl=data.ctrl)


def start_workspace(config: LabConfig, xml: str) -> Workspace:
    """A model and a data of the lab's own, at its keyframe. Raises KeyError for an unknown keyframe."""
    scene = Scene.from_xml(xml)
    workspace = Workspace(scene.model)
    workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    if config.key is None:
        mujoco.mj_resetData(workspace.model, workspace.data)
    else:
        key = scene.id_of(mujoco.mjtObj.mjOBJ_KEY, config.key)
        mujoco.mj_resetDataKeyframe(workspace.model, workspace.data, key)
    return workspace


def _duration(config: LabConfig, seconds: float | None) -> float:
    """How long the lab runs [s]."""
    if seconds is not None:
        if not (isfinite(seconds) and 0 < seconds <= SECONDS_MAX):
            raise LabRefused(f"A lab runs for more than 0 and at most {SECONDS_MAX:g} seconds.")
        return seconds
    if isinstance(config.stopAt, float | int):
        return min(float(config.stopAt), SECONDS_MAX)
    windows = [plot.window for plot in config.plots if plot.window is not None]
    return min(max(windows, default=SECONDS_DEFAULT), SECONDS_MAX)


def _presses(programs: LabPrograms, events: Sequence[Event], duration: float) -> deque[tuple[float, Program]]:
    """The button presses in order of time."""
    if len(events) > EVENTS_MAX:
        raise LabRefused(f"At most {EVENTS_MAX} button presses fit into one run.")
    presses = []
    for at, label in events:
        if label not in programs.buttons:
            known = ", ".join(programs.buttons) or "none"
            raise LabRefused(f"There is no button {label[:80]!r} here; the buttons are: {known}.")
        if not 0 <= at <= duration:
            raise LabRefused(f"{label} must be pressed between 0 and {duration:g} seconds.")
        presses.append((float(at), programs.buttons[label]))
    return deque(sorted(presses, key=lambda press: press[0]))
