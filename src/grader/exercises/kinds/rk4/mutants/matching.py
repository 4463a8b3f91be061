"""Finds the mutant, or the two, that take the student's steps."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from grader.exercises.kinds.rk4.judging.run import Force
from grader.exercises.kinds.rk4.mutants.catalogue import MUTANTS, RIGHT, Mutant, combine
from grader.exercises.kinds.rk4.mutants.program import Bench, StepProgram, list_states
from grader.exercises.kinds.rk4.step_trace import Step

STEPS_MAX = 1000
"""Steps of mutants that are taken for one verdict: 0.1 s of CPU time. Counted, so that load changes no verdict."""


@dataclass(frozen=True, eq=False)
class TakenSteps:
    """The student's steps of one trial, each with the force under which it was taken."""

    model: mujoco.MjModel
    steps: Sequence[tuple[Step, Force]]


@dataclass(frozen=True)
class Match:
    """The mutants that take the student's steps, one or two; none if the right step does. `explains_all`: those of
    every trial, not of the first alone."""

    mutants: tuple[Mutant, ...]
    explains_all: bool = True

    @property
    def is_tableau(self) -> bool:
        """Whether each is another Butcher tableau."""
        return all(mutant.is_tableau for mutant in self.mutants)

    @property
    def sentence(self) -> str:
        """What is wrong."""
        if len(self.mutants) == 1:
            return self.mutants[0].sentence
        first, second = (mutant.sentence for mutant in self.mutants)
        return f"Two things are wrong. First: {first} Second: {second}"


class StepComparison:
    """Compares programs with the student's steps in several trials. `calls` is how often the first step calls
    mj_forward, with and without a call in its last state: no program with another number takes it."""

    def __init__(self, trials: Sequence[TakenSteps]) -> None:
        self.trials = [(Bench(trial.model), trial.steps) for trial in trials]
        self.steps_left = STEPS_MAX
        first = trials[0].steps[0][0]
        states = list_states(trials[0].model, first)
        asks_at_end = np.array_equal(first.qpos[-2], first.qpos[-1]) and np.array_equal(first.qvel[-2], first.qvel[-1])
        self.calls = {len(states) - 1, len(states) - 1 + asks_at_end}

    def may_take(self, program: StepProgram) -> bool:
        """Whether a program calls mj_forward as often as the first step does."""
        return sum(program.calls) in self.calls

    def count_reached(self, program: StepProgram) -> tuple[int, bool]:
        """Returns how many states of the first step a program reaches, and whether it takes that step."""
        bench, steps = self.trials[0]
        self.steps_left -= 1
        return bench.follow(program, *steps[0])

    def takes(self, program: StepProgram, trials: int | None = None) -> bool:
        """Whether a program takes every step of the first trials, of all by default."""
        for bench, steps in self.trials[:trials]:
            if not program.calls[0] and bench.model.na:
                continue  # the first act_dot is that of an earlier call, which is not in the trace
            for step, force in steps:
                self.steps_left -= 1
                if not bench.follow(program, step, force)[1]:
                    return False
        return True


def find_match(trials: Sequence[TakenSteps], mutants: Sequence[Mutant] = MUTANTS) -> Match | None:
    """Returns the mutants that take every step of all trials; else the one that takes those of the first trial. None if
    no mutant does. Pairs begin with mutants that reach more states of the first step than the right step does; if
    there are none, with those that leave out a call."""
    compared = StepComparison(trials)
    if compared.takes(RIGHT):
        return Match(())
    ahead, _ = compared.count_reached(RIGHT)
    counts = [
        (candidate, *compared.count_reached(candidate.program))
        for candidate in mutants
        if compared.may_take(candidate.program)
    ]
    singles = [mutant for mutant, _, takes_first in counts if takes_first and compared.takes(mutant.program, 1)]
    differs = not compared.takes(RIGHT, 1)
    for mutant in singles:
        if compared.takes(mutant.program):
            return Match((mutant,))
    counts.sort(key=lambda pair: -pair[1])
    further = [mutant for mutant, reached, _ in counts if reached > ahead]
    firsts = further or [mutant for mutant, _, _ in counts if "calls" in mutant.changes]
    pairs = list_pairs(firsts, mutants)
    for first, second, program in pairs:
        if compared.steps_left <= 0:
            break
        if compared.may_take(program) and compared.takes(program):
            return Match(tuple(sorted((first, second), key=lambda one: (one.place[0] == "end", one.place))))
    return Match((singles[0],), explains_all=False) if singles and differs else None


def list_pairs(firsts: Sequence[Mutant], seconds: Sequence[Mutant]) -> Iterator[tuple[Mutant, Mutant, StepProgram]]:
    """Yields each of the first mutants with each of the second that can be combined with it."""
    for first in firsts:
        for second in seconds:
            program = combine(first, second)
            if second is not first and program is not None:
                yield first, second, program
