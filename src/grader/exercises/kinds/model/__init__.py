"""The `model` kind: the answer is a model, as MJCF or as a program that makes it. It is compiled and simulated in a
process of the jail of its own, and compared with the author's reference."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from inspect import getsource
from typing import Any

from grader.domain.axes import Placed
from grader.domain.run import Job, Limits, RunReport
from grader.exercises.kind import DrawnCase, JudgedTrial, Judgement, Kind, Measurement, Mistake, Results, Trial
from grader.exercises.kinds.model import driver, measuring
from grader.exercises.kinds.model.judge import ModelOutcome, judge_model, require_values
from grader.exercises.kinds.model.matching import agree
from grader.exercises.kinds.model.mistakes import find_mistake, name_plain_mistake
from grader.exercises.kinds.model.parameters import ModelCase, ModelParameters, Problem, pose_case
from grader.exercises.kinds.model.pictures import build_scenes
from grader.exercises.kinds.model.placing import place_goals
from grader.questions.kinds.script import ScriptQuestion

EMPTY = "<mujoco/>"
BALL = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


class Model(Kind[ModelParameters, Problem, ModelOutcome]):
    """Judges a model: one trial for each case, with a finding for each goal."""

    parameters = ModelParameters
    driver = getsource(driver)
    takes = ("python", "mjcf")
    measurement = Measurement(getsource(measuring), Limits(cpu_s=3, wall_s=20, memory_mb=512), cpu_s_all=6)
    needs_model = False
    how = "The grader compiles your model, simulates it, and compares it with the author's."

    def build_trials(self, parameters: ModelParameters, drawn: DrawnCase[ModelCase]) -> Sequence[Trial[Problem]]:
        """Returns one trial, whose inputs are the numbers that a program's function gets."""
        problem = pose_case(parameters, drawn)
        arguments = [drawn.numbers[name] for name in parameters.numbers if name in drawn.numbers]
        return [Trial(drawn.case.id, {"arguments": arguments}, problem, measured=problem.measured)]

    def rehearse(self, parameters: ModelParameters, trial: Trial[Problem]) -> None:
        """Evaluates every expression where the case begins. Raises WrongInCase where the reference has no value."""
        require_values(trial.problem)

    def judge(self, parameters: ModelParameters, trial: Trial[Problem], results: Results) -> Judgement[ModelOutcome]:
        """Compares what was measured."""
        return judge_model(trial.problem, results)

    def name_mistake(
        self, parameters: ModelParameters, judged: Sequence[JudgedTrial[Problem, ModelOutcome]]
    ) -> Mistake | None:
        """Returns why the model cannot be compiled, or which element it lacks."""
        return name_plain_mistake(judged)

    def name_mistake_by_runs(
        self, parameters: ModelParameters, judged: Sequence[JudgedTrial[Problem, ModelOutcome]],
        run: Callable[[Job], RunReport],
    ) -> Mistake | None:  # fmt: skip
        """Returns the mistake whose variant of the reference does what the student's model does."""
        return find_mistake(judged, run)

    def is_alike(
        self,
        parameters: ModelParameters,
        trial: Trial[Problem],
        one: Judgement[ModelOutcome],
        other: Judgement[ModelOutcome],
    ) -> bool:
        """Whether two models do the same in a case."""
        mine, its = one.outcome, other.outcome
        if mine.error or its.error:
            return mine.error == its.error
        return all(
            agree(each[part], another[part])
            for each, another in zip(mine.goals, its.goals, strict=True)
            for part in ("same", "within")
        )

    def build_pictures(
        self, parameters: ModelParameters, visible: Sequence[JudgedTrial[Problem, ModelOutcome]]
    ) -> dict[str, Any]:
        """Returns the geoms of both models."""
        return build_scenes(visible)

    def place_on_axes(self, parameters: ModelParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns how many goals are met."""
        return place_goals(parameters, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ModelParameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns models without what was asked for; of a program that gets numbers, one that ignores them."""
        models = {"an empty model": EMPTY, "a ball": BALL}
        if question.takes == "mjcf":
            return models
        if any(trial.inputs["arguments"] for trial in trials):
            seen = next((candidate for candidate in trials if not candidate.hidden), trials[0])
            models["one model for all numbers"] = seen.problem.reference
        return {name: f"def {question.entry}(*numbers):\n    return {xml!r}\n" for name, xml in models.items()}

    def bound_luck(self, parameters: ModelParameters, trials: Sequence[Trial[Problem]]) -> float | None:
        """Returns 0: a model is no number that could be guessed. A program that ignores its numbers is graded."""
        return 0.0
