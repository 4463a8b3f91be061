"""Runs variants of a policy over episodes of every case, within a counted number of control periods: load changes no
verdict."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from grader.exercises.episodes.goals import measure_goal
from grader.exercises.episodes.judge import EpisodeOutcome, find_failed
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import simulate_law
from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.policy.parameters import PolicyParameters
from grader.exercises.kinds.policy.variants import Variant

EPISODES_TRIED = 4
"""Failed episodes of each failed case in which a variant must reach the goals, but for the share that the case lets
fail. Of each other case it must reach them in one episode."""

PERIODS_MAX = 40_000
"""Control periods that are simulated to find a mistake, of at most STEPS_FREE steps each; a longer one counts more."""

STEPS_FREE = 20


@dataclass(frozen=True)
class EpisodeSample:
    """Episodes of a case that a variant is run over, and how many of them it may fail."""

    problem: Problem
    places: Sequence[int]
    failed_max: int


class Bench:
    """The episodes of a failed policy, those of failed cases first, and the control periods that are left."""

    def __init__(self, parameters: PolicyParameters, judged: Sequence[JudgedTrial[Problem, EpisodeOutcome]]) -> None:
        self.parameters, self.left = parameters, PERIODS_MAX
        ordered = sorted(judged, key=lambda trial: trial.judgement.passed)
        self.samples = [choose_episodes(trial) for trial in ordered]

    def works(self, variant: Variant) -> bool:
        """Whether a variant works in every case; False once no control period is left."""
        return all(self._works_in(sample, variant) for sample in self.samples)

    def _works_in(self, sample: EpisodeSample, variant: Variant) -> bool:
        problem, failed = change_period(sample.problem, variant.period), 0
        for place in sample.places:
            self.left -= round(problem.periods * max(1.0, problem.steps / STEPS_FREE))
            if self.left < 0:
                return False
            record = simulate_law(self.parameters, problem, place, lambda _, seen: variant.act(seen), problem.periods)
            goals = self.parameters.goals
            failed += bool(find_failed(goals, [measure_goal(goal, record) for goal in goals]))
            if failed > sample.failed_max:
                return False
        return True


def choose_episodes(judged: JudgedTrial[Problem, EpisodeOutcome]) -> EpisodeSample:
    """Returns the first failed episodes of a failed case, and the first that succeeded of another."""
    problem, failed = judged.problem, judged.judgement.outcome.failed
    if judged.judgement.passed:
        return EpisodeSample(problem, [i for i, goals in enumerate(failed) if not goals][:1], 0)
    places = [i for i, goals in enumerate(failed) if goals][:EPISODES_TRIED]
    return EpisodeSample(problem, places, int(len(places) * (1 - problem.case.share) + 1e-9))


def change_period(problem: Problem, factor: float) -> Problem:
    """Returns the problem with a control period that is longer by a factor."""
    steps = round(problem.steps * factor)
    return replace(problem, steps=steps, periods=max(2, round(problem.periods / factor)))
