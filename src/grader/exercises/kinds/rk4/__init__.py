"""The `rk4` kind judges steps of Runge-Kutta methods. It compares the student's trajectories with our own, under a
force that only mj_forward applies, and names the mistake in a wrong step by its Butcher tableau."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from inspect import getsource
from typing import Any

import mujoco

from grader.domain.axes import Placed
from grader.exercises.film import Film
from grader.exercises.kind import DrawnCase, Intervals, JudgedTrial, Judgement, Kind, Mistake, Results, Trial
from grader.exercises.kinds.rk4.films import record_films
from grader.exercises.kinds.rk4.judging import driver
from grader.exercises.kinds.rk4.judging.described import describe
from grader.exercises.kinds.rk4.judging.judge import Rk4Outcome, judge_order, judge_run, list_accepted_states
from grader.exercises.kinds.rk4.judging.run import Problem
from grader.exercises.kinds.rk4.mistakes import name_the_mistake, write_lazy_steps
from grader.exercises.kinds.rk4.parameters import Rk4Case, Rk4Parameters, pose_case
from grader.exercises.kinds.rk4.pictures import build_evidence, describe_right_step
from grader.exercises.kinds.rk4.placing import place_steps
from grader.exercises.kinds.rk4.script_facts import CLAIMS, LANDMARKS
from grader.exercises.kinds.rk4.truth import build_truth, prepare, rehearse
from grader.numerics.scene import Scene
from grader.questions import Reveal
from grader.questions.kinds.script import ScriptQuestion

ORDER = "order"
"""The id of the trial that measures the order of convergence."""


class Rk4(Kind[Rk4Parameters, Problem, Rk4Outcome]):
    """Judges steps of fourth-order Runge-Kutta methods: one trial for each case, and one for the order."""

    parameters = Rk4Parameters
    driver = getsource(driver)
    how = (
        "Your function takes every step of a run, in which mujoco.mj_forward adds a small force that MuJoCo's own "
        "steps do not know. The states after each step are compared with those of MuJoCo's RK4 under the same force."
    )
    without_integrators = True
    mistakes_tell_size = False
    claims = CLAIMS
    landmarks = LANDMARKS

    def build_trials(self, parameters: Rk4Parameters, drawn: DrawnCase[Rk4Case]) -> Sequence[Trial[Problem]]:
        """Returns one run of the student's step."""
        problem = pose_case(parameters, drawn)
        return [Trial(drawn.case.id, problem.inputs(), problem)]

    def build_further_trials(
        self, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]
    ) -> Sequence[Trial[Problem]]:
        """Returns the runs of the first case at every timestep of the order check, as one trial."""
        if parameters.order is None:
            return []
        first, points = trials[0], parameters.order.points
        problem = replace(first.problem, asks_order=True)
        return [Trial(ORDER, problem.inputs(), problem, title="observed order", hidden=first.hidden, points=points)]

    def describe_inputs(self, trial: Trial[Problem]) -> Mapping[str, Any]:
        """Returns the inputs without the probe, and with no step taped."""
        return {name: value for name, value in trial.inputs.items() if name != "probe"} | {"taped": False}

    def describe_problem(
        self, reveal: Reveal | None, parameters: Rk4Parameters, trial: Trial[Problem]
    ) -> Mapping[str, Any]:
        """Returns the runs, with the exact motion where the judge compares with it."""
        return describe(trial.problem, build_truth(trial.problem))

    def compile_model(self, parameters: Rk4Parameters, trial: Trial[Problem]) -> mujoco.MjModel:
        """Returns the model of the case."""
        return Scene.from_xml(trial.problem.run.xml).model

    def rehearse(self, parameters: Rk4Parameters, trial: Trial[Problem]) -> None:
        """Solves for the exact motion where the judgement needs it; raises ValueError if the scene has constraints."""
        rehearse(trial.problem)

    def prepare(self, parameters: Rk4Parameters, trial: Trial[Problem]) -> None:
        """Simulates and solves what every trajectory of the trial is compared with."""
        prepare(trial.problem)

    def judge(self, parameters: Rk4Parameters, trial: Trial[Problem], results: Results) -> Judgement[Rk4Outcome]:
        """Compares the runs with MuJoCo's RK4 and with the exact motion."""
        return (judge_order if trial.problem.asks_order else judge_run)(
            trial.problem, build_truth(trial.problem), results
        )

    def name_mistake(
        self, parameters: Rk4Parameters, judged: Sequence[JudgedTrial[Problem, Rk4Outcome]]
    ) -> Mistake | None:
        """Returns the mistake in the student's step, with its line where the trace shows it."""
        return name_the_mistake(parameters.cases[0].id, judged)

    def describe_success(self, parameters: Rk4Parameters, judged: Sequence[JudgedTrial[Problem, Rk4Outcome]]) -> str:
        """Returns the distance from MuJoCo's RK4 in the first visible case, and the observed order."""
        return describe_right_step([trial.judgement.outcome for trial in judged if not trial.hidden])

    def build_pictures(
        self, parameters: Rk4Parameters, visible: Sequence[JudgedTrial[Problem, Rk4Outcome]]
    ) -> dict[str, Any]:
        """Returns the difference against time, and the error against the timestep."""
        return build_evidence(visible)

    def record_films(
        self, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any],
        failed: Collection[str], *, timestep_s: float | None = None,
    ) -> Sequence[Film]:  # fmt: skip
        """Returns the student's motion beside MuJoCo's."""
        return [*record_films(trials, evidence)] if timestep_s is None else ()

    def place_on_axes(self, parameters: Rk4Parameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns the distances from MuJoCo's RK4 beside their tolerances, and the observed order."""
        return place_steps(parameters, ORDER, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns steps that ignore the model's dynamics."""
        return write_lazy_steps(question.entry)

    def list_accepted(self, parameters: Rk4Parameters, trials: Sequence[Trial[Problem]]) -> Sequence[Intervals]:
        """Returns the accepted velocities early in the run, when the hidden force has hardly acted."""
        return [list_accepted_states(trial.problem) for trial in trials]
