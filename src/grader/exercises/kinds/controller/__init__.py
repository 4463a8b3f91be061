"""The `controller` kind closes a loop: it simulates in the grader's own process, and asks the student's function for
the controls at each step. Nothing hidden enters the jail."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from inspect import getsource
from typing import Any

import mujoco

from grader.domain.axes import Placed
from grader.exercises.episodes.films import record_films
from grader.exercises.episodes.judge import EpisodeOutcome, bound_luck, judge_records
from grader.exercises.episodes.parameters import EpisodesCase, Problem, check_names, pose_case
from grader.exercises.episodes.pictures import build_evidence
from grader.exercises.episodes.placing import place_episodes
from grader.exercises.episodes.simulating import list_constant_laws, simulate_law
from grader.exercises.film import Film
from grader.exercises.kind import Ask, DrawnCase, JudgedTrial, Judgement, Kind, Trial
from grader.exercises.kinds.controller import driver
from grader.exercises.kinds.controller.mistakes import name_the_mistake
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.kinds.controller.playing import play_case
from grader.questions.kinds.script import ScriptQuestion

PERIODS_REHEARSED = 20


class Controller(Kind[ControllerParameters, Problem, EpisodeOutcome]):
    """Judges a controller in closed loop: one trial for each case, of one or more episodes."""

    parameters = ControllerParameters
    driver = getsource(driver)
    plays = True
    mistakes_tell_size = False
    how = "The grader simulates, and calls your function for the controls at each step. It judges the motion."

    def build_trials(
        self, parameters: ControllerParameters, drawn: DrawnCase[EpisodesCase]
    ) -> Sequence[Trial[Problem]]:
        """Returns one trial, whose inputs are the model as it was written and no number of the case."""
        problem = pose_case(parameters, drawn)
        inputs = {
            "model": drawn.xml_as_written,
            "form": parameters.form,
            "nu": problem.model.nu,
            "entry": drawn.content.entry,
        }
        return [Trial(drawn.case.id, inputs, problem, cpu_s=parameters.cpu_s)]

    def rehearse(self, parameters: ControllerParameters, trial: Trial[Problem]) -> None:
        """Simulates the first periods of the case without control. Raises ValueError and KeyError."""
        check_names(parameters, trial.problem)
        _, law = list_constant_laws(trial.problem, has_target=False)[0]
        periods = min(PERIODS_REHEARSED, trial.problem.periods)
        if simulate_law(parameters, trial.problem, 0, law, periods).lost_at_s is not None:
            raise ValueError("the simulation blows up without any control: take a shorter timestep")

    def compile_model(self, parameters: ControllerParameters, trial: Trial[Problem]) -> mujoco.MjModel | None:
        """Returns the model that the student's function gets."""
        return trial.problem.model

    def play(self, parameters: ControllerParameters, trial: Trial[Problem], ask: Ask) -> Any:
        """Simulates every episode."""
        return play_case(parameters, trial.problem, ask)

    def judge(self, parameters: ControllerParameters, trial: Trial[Problem], results: Any) -> Judgement[EpisodeOutcome]:
        """Measures each goal, or counts the episodes that reach all."""
        return judge_records(parameters, trial.problem, results, hidden=trial.hidden)

    def name_mistake(
        self, parameters: ControllerParameters, judged: Sequence[JudgedTrial[Problem, EpisodeOutcome]]
    ) -> str | None:
        """Returns the sentence of the first mistake that explains what failed."""
        return name_the_mistake(parameters, judged)

    def build_pictures(
        self, parameters: ControllerParameters, visible: Sequence[JudgedTrial[Problem, EpisodeOutcome]]
    ) -> dict[str, Any]:
        """Returns charts of the motion and of the controls."""
        return build_evidence(parameters, visible)

    def record_films(
        self, parameters: ControllerParameters, trials: Sequence[Trial[Problem]], evidence: Mapping[str, Any],
        failed: Collection[str], *, timestep_s: float | None = None,
    ) -> Sequence[Film]:  # fmt: skip
        """Returns the run that the evidence keeps."""
        return record_films(trials, evidence)

    def place_on_axes(self, parameters: ControllerParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns what each goal measured, beside what is allowed."""
        return place_episodes(parameters, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ControllerParameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns a controller that does nothing."""
        zeros = f"[0.0] * {trials[0].problem.model.nu}"
        if parameters.form == "make":
            return {"no control": f"def {question.entry}(model):\n    return lambda t, observation: {zeros}\n"}
        return {"no control": f"def {question.entry}(model, data, *target):\n    return {zeros}\n"}

    def bound_luck(self, parameters: ControllerParameters, trials: Sequence[Trial[Problem]]) -> float | None:
        """Returns a bound of the chance that a law which looks at nothing succeeds in the share of episodes that must:
        0 if none succeeds in any of those that are simulated."""
        (trial,) = trials
        return bound_luck(parameters, trial.problem)
