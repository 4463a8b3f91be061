"""The `rk4` kind: compares the student's Runge-Kutta steps with our own, under a force that only mj_forward applies."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import getsource
from typing import Any

from grader.domain.quiz import CodeQuestion
from grader.exercises.kind import DrawnCase, Intervals, Judged, Judgement, Kind, Results, Trial
from grader.exercises.kinds.rk4 import driver
from grader.exercises.kinds.rk4.judge import Outcome, accepted_states, judge_order, judge_run, prepare, rehearse
from grader.exercises.kinds.rk4.mistakes import lazy_steps, name_the_mistake
from grader.exercises.kinds.rk4.parameters import Problem, Rk4Case, Rk4Parameters, pose_case
from grader.exercises.kinds.rk4.pictures import evidence_of

ORDER = "order"
"""The id of the trial that measures the order of convergence."""


class Rk4(Kind[Rk4Parameters, Problem, Outcome]):
    """Judges steps of fourth-order Runge-Kutta methods: one trial for each case, and one for the order."""

    parameters = Rk4Parameters
    driver = getsource(driver)
    without_integrators = True
    mistakes_tell_size = False

    def trials(self, parameters: Rk4Parameters, drawn: DrawnCase[Rk4Case]) -> Sequence[Trial[Problem]]:
        """Returns one run of the student's step."""
        problem = pose_case(parameters, drawn)
        return [Trial(drawn.case.id, problem.inputs(), problem)]

    def further_trials(self, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]) -> Sequence[Trial[Problem]]:
        """Returns the runs of the first case at every timestep of the order check, as one trial."""
        if parameters.order is None:
            return []
        first, points = trials[0], parameters.order.points
        problem = replace(first.problem, asks_order=True)
        return [Trial(ORDER, problem.inputs(), problem, title="observed order", hidden=first.hidden, points=points)]

    def rehearse(self, parameters: Rk4Parameters, trial: Trial[Problem]) -> None:
        """Solves for the exact motion where the judgement needs it; raises ValueError if the scene has constraints."""
        rehearse(trial.problem)

    def prepare(self, parameters: Rk4Parameters, trial: Trial[Problem]) -> None:
        """Simulates and solves what every trajectory of the trial is compared with."""
        prepare(trial.problem)

    def judge(self, parameters: Rk4Parameters, trial: Trial[Problem], results: Results) -> Judgement[Outcome]:
        """Compares the runs with MuJoCo's RK4 and with the exact motion."""
        return (judge_order if trial.problem.asks_order else judge_run)(trial.problem, results)

    def mistake(self, parameters: Rk4Parameters, judged: Sequence[Judged[Problem, Outcome]]) -> str | None:
        """Returns the sentence of the wrong method that gives the student's trajectory of the first case."""
        return name_the_mistake(parameters.cases[0].id, judged)

    def pictures(self, parameters: Rk4Parameters, visible: Sequence[Judged[Problem, Outcome]]) -> dict[str, Any]:
        """Returns the difference against time, and the error against the timestep."""
        return evidence_of(visible)

    def lazy_answers(
        self, question: CodeQuestion, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns steps that ignore the model's dynamics."""
        return lazy_steps(question.entry)

    def accepted(self, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]) -> Sequence[Intervals]:
        """Returns the accepted velocities early in the run, when the hidden force has hardly acted."""
        return [accepted_states(trial.problem) for trial in trials]
