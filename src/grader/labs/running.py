"""A lab's run in progress: its start, its steps, its frames."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil, isfinite
from typing import Any

import mujoco
import numpy as np
from mujoco import mjtWarning

from grader.domain.lab import LabConfig, OptionValue, Plot
from grader.errors import LabError, Unprocessable
from grader.labs.controls import as_value
from grader.labs.expressions import Program
from grader.labs.machine import Machine
from grader.labs.poses import Floats, describe_geom, drawn_geoms, quaternions
from grader.labs.programs import LabPrograms
from grader.labs.record import LabRun, Warned
from grader.labs.values import Value, Vector, to_boolean
from grader.numerics.scene import FULL_STATE
from grader.numerics.workspace import Workspace

STEPS_MAX = 200_000
FRAMES_PER_SECOND = 60
WARNINGS_MAX = 100


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
    presses: list[tuple[float, Program]]
    every_step: bool = False
    elapsed: float = 0.0
    steps: int = 0
    warnings: list[Warned] = field(default_factory=list)
    times: list[float] = field(default_factory=list)
    poses: list[tuple[Floats, Floats]] = field(default_factory=list)
    rows: list[list[Value]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.model, self.data = self.workspace.model, self.workspace.data
        self.machine = Machine(self.model, self.data)
        self.saved = np.empty(mujoco.mj_stateSize(self.model, FULL_STATE))
        p = self.programs
        self.shown = [*p.readouts, *(t for plot in p.traces for t in plot), *([p.trail] if p.trail else [])]

    def start(self, values: Mapping[str, OptionValue]) -> None:
        """Controls, setup, controls with `init`; then the positions that belong to the state."""
        for setter in self.programs.setters:
            for program in setter.programs:
                program.run(self.machine, as_value(values[setter.control.label]))
        if self.programs.setup is not None:
            self.programs.setup.run(self.machine)
        for setter in self.programs.setters:
            for program in setter.programs if setter.control.init else ():
                program.run(self.machine, as_value(values[setter.control.label]))
        self._forward()
        self.geoms = drawn_geoms(self.model)
        self.described = tuple(describe_geom(self.model, geom) for geom in self.geoms)

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
        try:
            mujoco.mj_forward(self.model, self.data)
        except mujoco.FatalError as error:
            raise LabError(f"lab: MuJoCo: {error}") from error
        self._note_warnings()

    def go(self, duration: float) -> None:
        """Step to the end, keeping about 60 frames a second."""
        each_step = self.programs.controller is not None or self.programs.stop is not None
        self._press()
        self._keep_frame()
        while self.elapsed < duration * (1 - 1e-9):
            h = float(self.model.opt.timestep)
            frame = 1 if self.every_step else max(1, round(1 / (FRAMES_PER_SECOND * h)))
            count = min(frame, _steps_until(duration, self.elapsed, h), self._steps_to_press(h))
            if self.steps + count > STEPS_MAX:
                raise Unprocessable(f"{duration:g} s at this timestep take more than {STEPS_MAX} steps.")
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
            self.presses.pop(0)[1].run(self.machine)

    def _step_chunk(self, count: int, h: float) -> bool:
        """Steps in C; where one warned, the chunk is done again step by step to learn which."""
        mujoco.mj_getState(self.model, self.data, self.saved, FULL_STATE)
        self._step(count)
        if self.workspace.counts.any():
            mujoco.mj_resetData(self.model, self.data)
            mujoco.mj_setState(self.model, self.data, self.saved, FULL_STATE)
            return self._step_singly(count)
        self.elapsed += count * h
        self.steps += count
        return False

    def _step_singly(self, count: int) -> bool:
        """Controller, step, stop condition; whether the condition ended the run."""
        controller, stop = self.programs.controller, self.programs.stop
        for _ in range(count):
            if controller is not None:
                controller.run(self.machine)
            h = float(self.model.opt.timestep)
            self._step(1)
            self._note_warnings()
            self.elapsed += h
            self.steps += 1
            if stop is not None and to_boolean(stop.run(self.machine)):
                return True
        return False

    def _step(self, count: int) -> None:
        try:
            mujoco.mj_step(self.model, self.data, nstep=count)
        except mujoco.FatalError as error:
            raise LabError(f"lab: MuJoCo: {error}") from error

    def _note_warnings(self) -> None:
        """Record and clear the counters, which MuJoCo leaves at 1 after it reset the state."""
        counts = self.workspace.counts
        if counts.any():
            for kind in np.flatnonzero(counts):
                if len(self.warnings) < WARNINGS_MAX:
                    name = mjtWarning(int(kind)).name.removeprefix("mjWARN_")
                    self.warnings.append(Warned(name, self.elapsed))
            counts[:] = 0

    def _keep_frame(self) -> None:
        self.times.append(self.elapsed)
        self.poses.append((self.data.geom_xpos[self.geoms], self.data.geom_xmat[self.geoms]))
        self.rows.append([_kept(program.run(self.machine)) for program in self.shown])

    def finish(self, config: LabConfig, values: Mapping[str, OptionValue], timing_ms: dict[str, float]) -> LabRun:
        """The run as it is told."""
        columns = [tuple(column) for column in zip(*self.rows, strict=True)]
        readouts, rest = columns[: len(config.readouts)], columns[len(config.readouts) :]
        traces = []
        for plot in config.plots:
            traces.append(tuple(rest[: len(plot.traces)]))
            rest = rest[len(plot.traces) :]
        matrices = np.array([xmat for _, xmat in self.poses]).reshape(-1, 9)
        shape = (len(self.poses), len(self.geoms))
        return LabRun(
            config=config,
            controls={label: list(v) if isinstance(v, tuple) else v for label, v in values.items()},
            geoms=self.described,
            time_s=np.array(self.times),
            positions=np.array([xpos for xpos, _ in self.poses]).reshape(*shape, 3),
            orientations=quaternions(matrices).reshape(*shape, 4),
            readouts=tuple(readouts),
            traces=tuple(traces),
            reference_lines=tuple(
                self._reference_lines(plot, programs)
                for plot, programs in zip(config.plots, self.programs.reference_lines, strict=True)
            ),
            trail=rest[0] if self.programs.trail else None,
            warnings=tuple(self.warnings),
            duration_s=self.elapsed,
            steps=self.steps,
            timing_ms=timing_ms,
        )

    def _reference_lines(self, plot: Plot, programs: tuple[Program | None, ...]) -> tuple[Any, ...]:
        return tuple(map(self._reference_line, plot.refLines, programs))

    def _reference_line(self, line: Any, program: Program | None) -> Any:
        """A line whose height is an expression gets it from the end of the run."""
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
