"""Runs a lab: the author's JSON on the model itself, without a window, recording frames."""

import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from math import ceil, isfinite

import mujoco
import numpy as np

from grader.domain.lab import SECONDS_MAX, LabConfig, OptionValue, Select, Slider
from grader.errors import LabError, LabRefused
from grader.expressions import UNDEFINED, Machine, Program, Run, Value, Vector, to_boolean
from grader.labs.controls import Wish, choose_values, to_value
from grader.labs.lengths import CPU_S_MAX, check_cpu, check_steps, choose_length_s
from grader.labs.probes import probe_motion
from grader.labs.programs import LabPrograms, compile_lab
from grader.labs.pulls import Pull, Puller, check_pulls
from grader.labs.record import LabRun
from grader.numerics.drawing import list_drawn_geoms, list_overlays
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import derive_copy, derives_last_stage, take_warnings
from grader.numerics.workspace import Workspace

EVENTS_MAX = 1000
FRAMES_PER_SECOND = 60
FRAMES_PER_CHECK = 16
"""Frames after which the CPU time is read: with a frame for every step, reading it takes a third of a run."""
CLOSE_UP_FRAMES = 120
TRACED = 64
"""Moments at which the state of a run from a nudged start is kept."""
WARNINGS_MAX = 100

Event = tuple[float, str]
"""A press of a button: the time [s] and the label."""


@dataclass(frozen=True)
class Variant:
    """The same lab, slightly different, for certificates. Another integrator, timesteps `finer` times smaller, every
    position and velocity of the start nudged by about `nudge` [rad or m, and per s], each by another amount that `seed`
    draws: a shift of all alike changes no distance, and a seed repeats a certificate; with `every_step` a frame for
    every step, without poses. Up to `close_up_s` [s] there are CLOSE_UP_FRAMES frames, or one for every step. The
    motion is linearised at `probes` moments, until MuJoCo resets it. With `as_stepped` derived quantities are shown as
    mj_step left them, also where they belong to RK4's last stage; with `derived` they are those of the state at which a
    step ends, where every integrator but RK4 leaves those of the state at which it began."""

    integrator: int | None = None
    finer: float = 1
    nudge: float = 0.0
    seed: int = 0
    every_step: bool = False
    close_up_s: float = 0.0
    probes: int = 0
    as_stepped: bool = False
    derived: bool = False


SAME = Variant()


class LabSimulation:
    """A run in progress. `elapsed` [s] is the lab's time; MuJoCo's own falls back when it resets the state. It begins
    with the keyframe, the controls, `setup`, and the controls with `init` once more."""

    def __init__(self, programs: LabPrograms, config: LabConfig, xml: str, values: Mapping[str, OptionValue]) -> None:
        scene = Scene.from_xml(xml, key=config.key)
        workspace = Workspace(scene.model)
        self.programs = programs
        self.model, self.data, self.counts = workspace.model, workspace.data, workspace.counts
        self.warned = workspace.warned
        self.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_setState(self.model, self.data, scene.start_vector, FULL_STATE)
        self.machine, self.saved = Machine(self.model, self.data), scene.start_vector.copy()
        self.own_shown, self.shown_machine = self._bind_shown(self.machine), self.machine
        self.shown = self.own_shown
        self.refreshed: tuple[list[Run], Machine] | None = None
        self.presses: deque[tuple[float, Program]] = deque()
        self.pullers: list[Puller] = []
        self.every_step, self.close_up_s, self.elapsed = False, 0.0, 0.0
        self.as_stepped, self.derived = False, False
        self.shows_derived = programs.show_derived()
        self.overlays = list_overlays(config.over_the_scene)
        self.probe_times: list[float] = []
        self.traced_times: deque[float] = deque()
        self.record = LabRun(config, {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()})
        self._set(values, lambda _: True)
        programs.setup.run(self.machine)
        self._set(values, lambda control: control.init)
        self._forward()
        drawn = list_drawn_geoms(self.model)
        self.geoms, self.record.geoms = list(drawn), list(drawn.values())

    def _bind_shown(self, machine: Machine) -> list[Run]:
        return [program.bind(machine) for program in self.programs.shown]

    @cached_property
    def _controller(self) -> Run | None:
        return None if self.programs.controller is None else self.programs.controller.bind(self.machine)

    @cached_property
    def _stop(self) -> Run | None:
        return None if self.programs.stop is None else self.programs.stop.bind(self.machine)

    def _shows_copy(self) -> bool:
        """Whether what is shown is a copy of the data: after RK4, which leaves derived quantities of its last stage,
        and of no state of the run, and where the variant asks for it. A certificate that shows none of them needs no
        copy."""
        is_other = self.derived or derives_last_stage(self.model)
        return not self.as_stepped and (self.shows_derived or not self.every_step) and is_other

    def _refresh(self, shows_copy: bool) -> None:
        """Choose the data that is shown: the run's own, or a copy that is derived again from its state. The run itself
        goes on unchanged."""
        self.shown, self.shown_machine = self.own_shown, self.machine
        if not shows_copy:
            return
        if self.refreshed is None:
            machine = Machine(self.model, mujoco.MjData(self.model))
            machine.ctx, machine.budget = self.machine.ctx, self.machine.budget
            self.refreshed = self._bind_shown(machine), machine
        self.shown, self.shown_machine = self.refreshed
        self.record.rederived = self.shows_derived
        self._call(partial(derive_copy, copy=self.shown_machine.data))

    def _set(self, values: Mapping[str, OptionValue], wanted: Callable[[Slider | Select], bool]) -> None:
        for control, programs in self.programs.setters:
            for program in programs if wanted(control) else ():
                program.run(self.machine, to_value(values[control.label]))

    def vary(self, variant: Variant) -> None:
        """Make this run the variant."""
        self.every_step, self.close_up_s = variant.every_step, variant.close_up_s
        self.as_stepped, self.derived = variant.as_stepped, variant.derived
        self.model.opt.timestep /= variant.finer
        if variant.integrator is not None:
            self.model.opt.integrator = variant.integrator
        if variant.nudge:
            moved, sped = variant.nudge * np.random.default_rng(variant.seed).standard_normal((2, self.model.nv))
            mujoco.mj_integratePos(self.model, self.data.qpos, moved, 1.0)
            self.data.qvel += sped
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
        last = time.thread_time() + CPU_S_MAX
        self._press()
        self._keep_frame()
        if self._needs_steps_alone():
            self._go_each_step(duration, last)
            return
        while self.elapsed < duration * (1 - 1e-9):
            if len(self.record.times) % FRAMES_PER_CHECK == 0:
                check_cpu(duration, last)
            h = float(self.model.opt.timestep)
            frame = 1 if self.every_step else max(1, round(self._frame_s() / h))
            count = min(frame, max(1, ceil((self._find_next_moment(duration) - self.elapsed) / h - 1e-6)))
            check_steps(duration, self.record.steps + count)
            is_single = each_step or bool(self._list_pulling())
            stopped = self._step_singly(count) if is_single else self._step_chunk(count, h)
            self._press()
            self._keep_frame()
            if stopped:
                return

    def pull(self, pulls: Sequence[Pull]) -> None:
        """Pulls bodies in the run that begins. Raises LabRefused."""
        check_pulls(pulls)
        self.pullers = [Puller(self.model, self.data, self.geoms, pull) for pull in pulls]

    def _list_pulling(self) -> list[Puller]:
        """Returns what pulls in the next step."""
        now = self.elapsed + 1e-9
        return [puller for puller in self.pullers if puller.pull.begin <= now < puller.pull.end]

    def _find_next_moment(self, duration: float) -> float:
        """Returns when a button is pressed next, a pull begins or ends, or else the run ends [s]."""
        ends = (moment for puller in self.pullers for moment in (puller.pull.begin, puller.pull.end))
        coming = [moment for moment in ends if moment > self.elapsed + 1e-9]
        return min([duration, *coming, *(at for at, _ in list(self.presses)[:1])])

    def _needs_steps_alone(self) -> bool:
        """Whether a frame is kept of every step, and nothing happens between steps but the controller and probes."""
        return self.every_step and not (self.presses or self.pullers) and self.programs.stop is None

    def _go_each_step(self, duration: float, last: float) -> None:
        """Do what `go` does where steps stand alone, in a quarter of the time: certificates run this most."""
        controller, model, data, warned = self._controller, self.model, self.data, self.warned
        option, times, rows, step = model.opt, self.record.times, self.record.rows, mujoco.mj_step
        end, elapsed, steps = duration * (1 - 1e-9), self.elapsed, self.record.steps
        shows_copy = self._shows_copy()
        while elapsed < end:
            if steps % FRAMES_PER_CHECK == 0:
                check_cpu(duration, last)
                check_steps(duration, steps + 1)
            if controller is not None:
                controller()
                shows_copy = self._shows_copy()
            h = option.timestep
            try:
                step(model, data)
            except mujoco.FatalError as error:
                raise LabError("lab", f"MuJoCo: {error}") from error
            if any(warned):
                self.elapsed = elapsed
                self._note_warnings()
            elapsed += h
            steps += 1
            if self.probe_times and self.probe_times[0] <= elapsed + 1e-9:
                self._probe(elapsed)
            if self.traced_times and self.traced_times[0] <= elapsed + 1e-9:
                self._trace(elapsed)
            if shows_copy or self.shown is not self.own_shown:
                self._refresh(shows_copy)
            times.append(elapsed)
            rows.append(self._read_row())
        self.elapsed = self.record.duration_s = elapsed
        self.record.steps = steps

    def _frame_s(self) -> float:
        """Returns the time between two frames [s]."""
        ordinary = 1 / FRAMES_PER_SECOND
        return min(ordinary, self.close_up_s / CLOSE_UP_FRAMES) if self.elapsed < self.close_up_s else ordinary

    def _press(self) -> None:
        """Buttons whose time has come."""
        while self.presses and self.presses[0][0] <= self.elapsed + 1e-9:
            self.presses.popleft()[1].run(self.machine)
            self._forward()

    def _step_chunk(self, count: int, h: float) -> bool:
        """Steps in C; where one warned, the chunk is done again step by step to learn which."""
        mujoco.mj_getState(self.model, self.data, self.saved, FULL_STATE)
        self._call(mujoco.mj_step, nstep=count)
        if self.counts.any():
            mujoco.mj_resetData(self.model, self.data)
            mujoco.mj_setState(self.model, self.data, self.saved, FULL_STATE)
            return self._step_singly(count)
        self.elapsed += count * h
        self.record.steps += count
        return False

    def _step_singly(self, count: int) -> bool:
        """Controller, step, stop condition; whether the condition ended the run."""
        controller, stop, pulling = self._controller, self._stop, self._list_pulling()
        for _ in range(count):
            if controller is not None:
                controller()
            for puller in pulling:
                puller.apply()
            h = float(self.model.opt.timestep)
            self._call(mujoco.mj_step, nstep=1)
            for puller in reversed(pulling):
                puller.release()
            self._note_warnings()
            self.elapsed += h
            self.record.steps += 1
            if stop is not None and to_boolean(stop()):
                return True
        return False

    def _note_warnings(self) -> None:
        """Record what MuJoCo warned of."""
        self.record.warnings += take_warnings(self.counts, self.elapsed)
        del self.record.warnings[WARNINGS_MAX:]

    def _keep_frame(self) -> None:
        self.record.duration_s = self.elapsed
        self._probe(self.elapsed)
        self._trace(self.elapsed)
        self.record.times.append(self.elapsed)
        self._refresh(self.record.steps > 0 and self._shows_copy())
        if not self.every_step:  # a certificate draws no geoms
            data = self.shown_machine.data
            self.record.poses.append((data.geom_xpos[self.geoms], data.geom_xmat[self.geoms]))
            for name, drawn in self.overlays:
                self.record.overlays.setdefault(name, []).append(drawn(self.model, data))
        self.record.rows.append(self._read_row())

    def _probe(self, elapsed: float) -> None:
        """Probes the motion where a time for it has come; after a warning it is another motion."""
        if due := [moment for moment in self.probe_times if moment <= elapsed + 1e-9]:
            del self.probe_times[: len(due)]
            if not self.record.warnings:
                self.record.probes.append(probe_motion(self.model, self.data))

    def _trace(self, elapsed: float) -> None:
        """Keeps the state where a moment for it has come."""
        while self.traced_times and self.traced_times[0] <= elapsed + 1e-9:
            self.traced_times.popleft()
            self.record.states.append(np.concatenate((self.data.qpos, self.data.qvel)))

    def _read_row(self) -> list[Value]:
        """Returns what is shown, each as `_value`."""
        row: list[Value] = []
        for index, run in enumerate(self.shown):
            try:
                value = run()
            except LabError as error:
                value = self._note_failure(index, error)
            row.append(value if type(value) is float else _copy_value(value))
        return row

    def _value(self, index: int, run: Run) -> Value:
        """Says what is shown; undefined where it cannot be computed, which does not end the run."""
        try:
            return _copy_value(run())
        except LabError as error:
            return self._note_failure(index, error)

    def _note_failure(self, index: int, error: LabError) -> Value:
        """Count a failure of what is shown; return undefined in its place."""
        first, times = self.record.failed.get(index, (error, 0))
        self.record.failed[index] = (first, times + 1)
        return UNDEFINED

    def finish(self) -> None:
        """The lines whose height is an expression get it from the end of the run."""
        lines = count(len(self.shown))
        for plot, programs in zip(self.record.config.plots, self.programs.reference_lines, strict=True):
            drawn = [
                line
                if program is None
                else (line if isinstance(line, dict) else {})
                | {"y": _measure_height(self._value(next(lines), program.bind(self.shown_machine)))}
                for line, program in zip(plot.refLines, programs, strict=True)
            ]
            self.record.reference_lines.append(drawn)


def _measure_height(value: Value) -> float | None:
    return value if isinstance(value, float) and isfinite(value) else None


def _copy_value(value: Value) -> Value:
    """Returns a value that later steps do not change."""
    if type(value) is float:
        return value
    return list(value) if isinstance(value, list | Vector) else value


def run_lab(
    config: LabConfig, xml: str, controls: Mapping[str, Wish] | None = None, events: Sequence[Event] = (),
    seconds: float | None = None, *, pulls: Sequence[Pull] = (), variant: Variant = SAME, where: str = "lab",
) -> LabRun:  # fmt: skip
    """Run a lab from its start with these control values, button presses (time [s], label) and pulls.

    Order: the keyframe, every control's value, `setup`, the controls with `init` once more. `controller` runs before
    every step. When MuJoCo resets a state that diverged, the run goes on from there, as in a browser, and the warning
    is recorded. Lasts `seconds`, else as `choose_length_s` says. What is shown and fails is undefined, and noted in
    `failed`. `where` names the lab in errors.

    Raises LabRefused for control values, events, pulls or lengths that are not allowed, LabError where another
    expression fails, ContentError where one cannot be compiled, ValueError where MuJoCo cannot compile the model.
    """
    began = time.perf_counter()
    programs, values = compile_lab(config, where), choose_values(config, controls or {})
    if seconds is not None and not (isfinite(seconds) and 0 < seconds <= SECONDS_MAX):
        raise LabRefused(f"A lab runs for more than 0 and at most {SECONDS_MAX:g} seconds.")
    duration = choose_length_s(config) if seconds is None else seconds
    presses = _sort_presses(programs, events, duration)
    running = LabSimulation(programs, config, xml, values)
    running.presses, running.record.seconds = presses, duration
    running.vary(variant)
    running.pull(pulls)
    running.probe_times = [duration * i / variant.probes for i in range(variant.probes)]
    if variant.nudge:
        running.traced_times.extend(duration * (i + 1) / TRACED for i in range(TRACED))
    prepared = time.perf_counter()
    running.go(duration)
    ran = time.perf_counter()
    running.finish()
    running.record.timing_ms = {"prepare": 1000 * (prepared - began), "run": 1000 * (ran - prepared)}
    return running.record


def build_lab_scene(config: LabConfig, xml: str, controls: Mapping[str, Wish] | None = None) -> Scene:
    """Returns the scene at the lab's start: the model as the controls made it, the state as `setup` left it."""
    data = (running := LabSimulation(compile_lab(config), config, xml, choose_values(config, controls or {}))).data
    return Scene.from_model(running.model).at(qpos=data.qpos, qvel=data.qvel, act=data.act, ctrl=data.ctrl)


def _sort_presses(programs: LabPrograms, events: Sequence[Event], duration: float) -> deque[tuple[float, Program]]:
    """Returns the button presses in order of time."""
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
