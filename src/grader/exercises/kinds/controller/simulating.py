"""Simulates the episodes of a case, and asks for the controls at each period. The simulation is the grader's own, of
the model with the drawn numbers; only what is observed leaves it."""

import builtins
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from grader.domain.run import ChannelClosed, MalformedAnswer
from grader.exercises.kind import Ask
from grader.exercises.kinds.controller.parameters import ControllerParameters, Episode, Problem
from grader.exercises.trace import is_line
from grader.numerics.plant import Plant

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
RAISED_CHARS_MAX = 300


@dataclass(frozen=True)
class Fault:
    """An exception of the student's function, as its process claims: what, and in which line. `step` counts the calls
    of the episode from 1; 0 is the begin."""

    what: str
    line: int | None
    episode: int
    step: int
    time_s: float


@dataclass(eq=False)
class Record:
    """What happened in one episode, a row for each control period: time [s], the tracked sensor, its target, the
    sensors of goals, what was observed, the controls as they were asked for and as they acted, the power [W]."""

    episode: Episode
    time_s: Floats = field(default_factory=lambda: np.empty(0))
    tracked: Floats = field(default_factory=lambda: np.empty(0))
    target: Floats = field(default_factory=lambda: np.empty(0))
    sensors: dict[str, Floats] = field(default_factory=dict)
    observed: Floats = field(default_factory=lambda: np.empty((0, 0)))
    asked: Floats = field(default_factory=lambda: np.empty((0, 0)))
    applied: Floats = field(default_factory=lambda: np.empty((0, 0)))
    power_w: Floats = field(default_factory=lambda: np.empty(0))
    fault: Fault | None = None
    lost_at_s: float | None = None


Law = Callable[[float, Floats, Floats], Floats]
"""Returns the controls for time [s], observation and state; for simulations without a student."""


def play_case(parameters: ControllerParameters, problem: Problem, ask: Ask) -> list[Record]:
    """Returns the records of all episodes. Raises MalformedAnswer and ChannelClosed."""
    return [
        play_episode(parameters, problem, index, lambda message: read_answer(ask(message), problem.model.nu))
        for index in range(len(problem.episodes))
    ]


def read_answer(answer: bytes, nu: int) -> Floats | tuple[str, int | None]:
    """Returns the controls, or the exception and its line. Raises MalformedAnswer for what no driver sends."""
    if answer[:1] == b"C" and len(answer) in (1, 1 + 8 * nu):
        controls = np.frombuffer(answer, "<f8", offset=1)
        if np.isfinite(controls).all():
            return controls
    if answer[:1] == b"X":
        try:
            said = json.loads(answer[1:])
            return str(said["raised"])[:RAISED_CHARS_MAX], said["line"] if is_line(said["line"]) else None
        except (ValueError, KeyError, TypeError, RecursionError):
            pass
    raise MalformedAnswer


def play_episode(
    parameters: ControllerParameters,
    problem: Problem,
    index: int,
    ask: Callable[[bytes], Floats | tuple[str, int | None]],
) -> Record:
    """Runs one episode to its end, to MuJoCo's first warning, or to an exception of the student's function."""
    run = EpisodeRun(parameters, problem, index)
    step = 0
    try:
        begun = ask(b"B")
        if isinstance(begun, tuple):
            return run.finish(Fault(*begun, index + 1, 0, 0.0))
        for step in range(1, problem.periods + 1):
            answer = ask(run.observe(step - 1))
            if isinstance(answer, tuple):
                return run.finish(Fault(*answer, index + 1, step, run.plant.data.time))
            if len(answer) != problem.model.nu:
                raise MalformedAnswer
            if not run.apply(answer):
                break
    except ChannelClosed as closed:
        several = f"episode {index + 1}, " if len(problem.episodes) > 1 else ""
        where = (
            f"{several}step {step} at t = {run.plant.data.time:.6g} s" if step else f"{several}before the first step"
        )
        closed.add_note(where)
        raise
    return run.finish()


class EpisodeRun:
    """The simulation of one episode, and what is kept of it."""

    def __init__(self, parameters: ControllerParameters, problem: Problem, index: int) -> None:
        self.parameters, self.problem, self.episode = parameters, problem, problem.episodes[index]
        self.plant = Plant(self.episode.scene)
        self._track = self.plant.find_sensor(parameters.track)
        self._observed = {name: self.plant.find_sensor(name) for name in parameters.observe}
        self._goals = {goal.sensor: self.plant.find_sensor(goal.sensor) for goal in parameters.goals if goal.sensor}
        self._load = self.episode.load and (self.plant.find_dof(self.episode.load[0]), *self.episode.load[1:])
        self._rng = np.random.default_rng(self.episode.seed)
        self._past: list[tuple[Floats, Floats]] = []
        self._rows: list[tuple[float, float, float, Floats, Floats, Floats, Floats, float]] = []
        self.lost_at_s: float | None = None

    def observe(self, step: int) -> bytes:
        """Returns the message that asks for the controls of a step, counted from 0."""
        data, time_s = self.plant.data, float(self.plant.data.time)
        readings = [
            data.sensordata[where]
            + self.episode.noise.get(name, 0.0) * self._rng.standard_normal(where.stop - where.start)
            for name, where in self._observed.items()
        ]
        state = np.concatenate((data.qpos, data.qvel, data.act))
        self._past.append((np.concatenate(readings), state))
        seen, state = self._past[max(0, len(self._past) - 1 - self.episode.delay)]
        target = np.array([self.episode.find_target(time_s)] * self.parameters.has_target)
        self._seen = np.concatenate((seen, target))
        rest = self._seen if self.parameters.form == "make" else np.concatenate((state, target))
        return b"S" + np.concatenate(([time_s], rest)).astype("<f8").tobytes()

    def apply(self, controls: Floats) -> bool:
        """Takes one control period; returns whether the run goes on."""
        plant, data = self.plant, self.plant.data
        time_s = float(data.time)
        applied = plant.clip(controls)
        if self._load is not None:
            dof, force, from_s = self._load
            data.qfrc_applied[dof] = force if time_s >= from_s - 1e-9 else 0.0
        data.ctrl[:] = applied
        goals = np.array([data.sensordata[where][0] for where in self._goals.values()])
        row = (time_s, float(data.sensordata[self._track][0]), self.episode.find_target(time_s), goals)
        goes_on = plant.advance(self.problem.steps)
        self._rows.append((*row, self._seen, np.array(controls), applied, plant.power_w if goes_on else 0.0))
        if not goes_on:
            self.lost_at_s = time_s
        return goes_on

    def finish(self, fault: Fault | None = None) -> Record:
        """Returns the record of what was run."""
        record = Record(self.episode, fault=fault, lost_at_s=self.lost_at_s)
        if self._rows:
            time_s, tracked, target, goals, observed, asked, applied, power_w = zip(*self._rows, strict=True)
            record.time_s, record.tracked, record.target = (np.array(one) for one in (time_s, tracked, target))
            record.observed, record.asked, record.applied = (np.array(one) for one in (observed, asked, applied))
            record.power_w = np.array(power_w)
            record.sensors = dict(zip((name for name in self._goals if name), np.array(goals).T, strict=True))
        return record


def describe_fault(fault: Fault, *, hidden: bool, several: bool) -> str:
    """Returns the sentence of an exception; of a hidden episode only the name of a built-in exception and a line, as
    the script chooses the rest."""
    known = isinstance(vars(builtins).get(fault.what), type)
    what = fault.what if not hidden or known else "An exception"
    line = f", in line {fault.line} of your script" if fault.line is not None else ""
    if hidden:
        return f"{what}{line}"
    episode = f" of episode {fault.episode}" if several else ""
    when = (
        f", at t = {fault.time_s:.4g} s (step {fault.step}{episode})"
        if fault.step
        else f", before the first step{episode}"
    )
    return f"{what.rstrip('. ')}{line}{when}"


def simulate_law(parameters: ControllerParameters, problem: Problem, index: int, law: Law, periods: int) -> Record:
    """Returns the record of an episode under a law of ours, for at most some periods."""
    run = EpisodeRun(parameters, problem, index)
    for step in range(periods):
        run.observe(step)
        controls = law(float(run.plant.data.time), run._seen, run.plant.data.qpos)
        if not run.apply(controls):
            break
    return run.finish()


def list_constant_laws(problem: Problem, *, has_target: bool) -> Sequence[tuple[str, Law]]:
    """Returns laws that look at nothing: no control, both ends and the middle of each range, and the target itself."""
    model = problem.model
    low, high = np.where(model.actuator_ctrllimited.astype(bool)[:, None], model.actuator_ctrlrange, [-1.0, 1.0]).T
    constants = {"no control": 0 * low, "the lowest": low, "the highest": high, "the middle": (low + high) / 2}
    laws = [(name, hold(controls)) for name, controls in constants.items()]
    if has_target:
        laws.append(("the target", lambda t, seen, q: np.full(model.nu, seen[-1])))
    return laws


def hold(controls: Floats) -> Law:
    """Returns the law of constant controls."""
    return lambda t, seen, q: controls
