"""Simulates the episodes of a case, one control period at a time. The simulation is the grader's own, of the model with
the drawn numbers."""

import builtins
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grader.exercises.crashes import explain_error
from grader.exercises.episodes.parameters import Episode, EpisodesParameters, Problem
from grader.numerics.plant import Plant

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


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
    """What happened in one episode, a row for each control period: time [s], positions (nq,), velocities (nv,), the
    tracked sensor, its target, the sensors of goals, what was observed, the controls as they were asked for and as they
    acted, the power [W] (0 where no goal needs it), and the author's rewards. `is_over`: the author's program ended
    it."""

    episode: Episode
    time_s: Floats = field(default_factory=lambda: np.empty(0))
    qpos: Floats = field(default_factory=lambda: np.empty((0, 0)))
    qvel: Floats = field(default_factory=lambda: np.empty((0, 0)))
    tracked: Floats = field(default_factory=lambda: np.empty(0))
    target: Floats = field(default_factory=lambda: np.empty(0))
    sensors: dict[str, Floats] = field(default_factory=dict)
    observed: Floats = field(default_factory=lambda: np.empty((0, 0)))
    asked: Floats = field(default_factory=lambda: np.empty((0, 0)))
    applied: Floats = field(default_factory=lambda: np.empty((0, 0)))
    power_w: Floats = field(default_factory=lambda: np.empty(0))
    rewards: Floats = field(default_factory=lambda: np.empty(0))
    fault: Fault | None = None
    lost_at_s: float | None = None
    is_over: bool = False


class Seen(NamedTuple):
    """What is known at the begin of a control period: the time [s], the observation, which ends with the target where
    there is one, the state (qpos, qvel, act), and the target (0 or 1 numbers)."""

    time_s: float
    observed: Floats
    state: Floats
    target: Floats


NO_TARGET: Floats = np.empty(0)

Law = Callable[[float, Floats], Floats]
"""Returns the controls for time [s] and observation; for simulations without a script."""


class EpisodeRun:
    """The simulation of one episode, and what is kept of it."""

    def __init__(self, parameters: EpisodesParameters, problem: Problem, index: int) -> None:
        self.parameters, self.problem, self.episode = parameters, problem, problem.episodes[index]
        self.plant = Plant(self.episode.scene)
        self._rng = np.random.default_rng(self.episode.seed)
        if problem.environment.reset is not None:
            problem.environment.begin(self.plant.model, self.plant.data, np.random.default_rng([self.episode.seed, 1]))
        self._track = self.plant.find_sensor(parameters.track)
        data, noise = self.plant.data, self.episode.noise
        self._state, self._sensors = (data.qpos, data.qvel, data.act), data.sensordata
        observed = {name: self.plant.find_reading(name) for name in parameters.observe}
        self._observed = tuple(observed.values())
        self._noise = np.array([noise.get(name, 0.0) for name, values in observed.items() for _ in values])
        self._is_noisy = bool(self._noise.any())
        self._has_target = parameters.has_target
        self._needs_power = any(goal.goal == "energy" for goal in parameters.goals)
        self._goals = {goal.sensor: self.plant.find_sensor(goal.sensor) for goal in parameters.goals if goal.sensor}
        self._goals_at = np.array([where.start for where in self._goals.values()], dtype=np.intp)
        self._load = self.episode.load and (self.plant.find_dof(self.episode.load[0]), *self.episode.load[1:])
        self._past = deque[tuple[Floats, Floats]](maxlen=self.episode.delay + 1)
        self._rows: list[tuple[Any, ...]] = []
        self.lost_at_s: float | None = None
        self.is_over = False

    def observe(self) -> Seen:
        """Returns what is known at the begin of a period; older by the delay of the episode, but for the time."""
        data, time_s = self.plant.data, float(self.plant.data.time)
        if self.problem.environment.observe is not None:
            readings = self.problem.environment.read_observation(self.plant.model, data)
        else:
            readings = np.concatenate(self._observed)
            if self._is_noisy:
                readings = readings + self._noise * self._rng.standard_normal(len(readings))
        self._past.append((readings, np.concatenate(self._state)))
        seen, state = self._past[0]
        self._target = self.episode.find_target(time_s)
        target = np.array([self._target]) if self._has_target else NO_TARGET
        self._seen = Seen(time_s, np.concatenate((seen, target)) if self._has_target else seen, state, target)
        return self._seen

    def apply(self, controls: Floats) -> bool:
        """Takes one control period; returns whether the run goes on."""
        plant, data, environment = self.plant, self.plant.data, self.problem.environment
        time_s = float(data.time)
        applied = plant.clip(controls)
        if self._load is not None:
            dof, force, from_s = self._load
            data.qfrc_applied[dof] = force if time_s >= from_s - 1e-9 else 0.0
        data.ctrl[:] = applied
        goals = self._sensors[self._goals_at]
        tracked = float(self._sensors[self._track][0])
        qpos, qvel, _ = self._state
        row = (time_s, qpos.copy(), qvel.copy(), tracked, self._target, goals)
        goes_on, power_w, reward = plant.advance(self.problem.steps), 0.0, 0.0
        if goes_on:
            power_w = plant.power_w if self._needs_power else 0.0
            if environment.reward is not None:
                reward = float(environment.reward(plant.model, data, applied))
            self.is_over = environment.terminated is not None and bool(environment.terminated(plant.model, data))
        else:
            self.lost_at_s = time_s
        self._rows.append((*row, self._seen.observed, np.array(controls), applied, power_w, reward))
        return goes_on and not self.is_over

    def finish(self, fault: Fault | None = None) -> Record:
        """Returns the record of what was run."""
        record = Record(self.episode, fault=fault, lost_at_s=self.lost_at_s, is_over=self.is_over)
        if self._rows:
            columns = [np.array(column) for column in zip(*self._rows, strict=True)]
            record.time_s, record.qpos, record.qvel, record.tracked, record.target, goals, *rest = columns
            record.observed, record.asked, record.applied, record.power_w, record.rewards = rest
            record.sensors = dict(zip((name for name in self._goals if name), goals.T, strict=True))
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
    return explain_error(what.rstrip(". "), f"{line}{when}")


def simulate_law(parameters: EpisodesParameters, problem: Problem, index: int, law: Law, periods: int) -> Record:
    """Returns the record of an episode under a law of ours, for at most some periods."""
    run = EpisodeRun(parameters, problem, index)
    for _ in range(periods):
        seen = run.observe()
        if not run.apply(law(seen.time_s, seen.observed)):
            break
    return run.finish()


def list_widths(parameters: EpisodesParameters, problem: Problem) -> dict[str, int]:
    """Returns how many numbers each observed name has, in order, and the target, if there is one."""
    plant = Plant(problem.episodes[0].scene)
    widths = {name: len(plant.find_reading(name)) for name in parameters.observe}
    return widths | ({"target": 1} if parameters.has_target else {})


def list_constant_laws(problem: Problem, *, has_target: bool) -> Sequence[tuple[str, Law]]:
    """Returns laws that look at nothing: no control, both ends and the middle of each range, and the target itself."""
    model = problem.model
    low, high = np.where(model.actuator_ctrllimited.astype(bool)[:, None], model.actuator_ctrlrange, [-1.0, 1.0]).T
    constants = {"no control": 0 * low, "the lowest": low, "the highest": high, "the middle": (low + high) / 2}
    laws = [(name, hold(controls)) for name, controls in constants.items()]
    if has_target:
        laws.append(("the target", lambda t, seen: np.full(model.nu, seen[-1])))
    return laws


def hold(controls: Floats) -> Law:
    """Returns the law of constant controls."""
    return lambda t, seen: controls
