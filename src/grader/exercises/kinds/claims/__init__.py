"""The `claims` kind: the student measures quantities of a model and returns them by name; each is measured again by us,
at ever shorter timesteps, with the machinery that certifies answer keys."""

from collections.abc import Iterable, Mapping, Sequence
from inspect import getsource
from typing import Any

import mujoco

from grader.domain.axes import Placed
from grader.exercises.kind import DrawnCase, Intervals, JudgedTrial, Judgement, Kind, Results, Trial
from grader.exercises.kinds.claims import driver
from grader.exercises.kinds.claims.judge import Outcome, judge_claims
from grader.exercises.kinds.claims.measuring import (
    Bench,
    find_ambiguity,
    measure_claims,
    measure_own,
    rehearse_claims,
)
from grader.exercises.kinds.claims.mistakes import name_the_mistake
from grader.exercises.kinds.claims.parameters import (
    ClaimsCase,
    ClaimsParameters,
    Floats,
    Problem,
    compile_text,
    pose_case,
)
from grader.exercises.kinds.claims.pictures import build_evidence
from grader.exercises.kinds.claims.placing import place_claims
from grader.exercises.parameters import WrongParameter
from grader.experiments.regime import RegimeFailure, explain_window
from grader.questions.kinds.script import ScriptQuestion


class Claims(Kind[ClaimsParameters, Problem, Outcome]):
    """Judges what a script has measured: one trial for each case, with a part for each claim."""

    parameters = ClaimsParameters
    driver = getsource(driver)
    how = "Your function gets the model and its start. The grader measures what it returns again, in runs of its own."

    def build_trials(self, parameters: ClaimsParameters, drawn: DrawnCase[ClaimsCase]) -> Sequence[Trial[Problem]]:
        """Returns one trial, whose inputs are the model, the start and x."""
        problem = pose_case(parameters, drawn)
        return [Trial(drawn.case.id, problem.inputs(), problem)]

    def rehearse(self, parameters: ClaimsParameters, trial: Trial[Problem]) -> None:
        """Measures every claim at the model's own timestep. Raises WrongParameter where that cannot be done."""
        rehearse_claims(trial.problem)

    def certify(self, parameters: ClaimsParameters, trial: Trial[Problem]) -> None:
        """Measures every claim at shorter timesteps too. Raises WrongParameter where one cannot be decided, is not in
        its unit, or is about more than its run."""
        from grader.exercises.kinds.claims.units import explain_unit_of_claim  # it parses; a verdict needs none of it

        model = compile_text(trial.problem.xml)
        for index, claim in enumerate(trial.problem.claims):
            if why := explain_unit_of_claim(claim, model):
                raise WrongParameter(f"claims.{index}.unit", why)
            if why := explain_window(claim.until, claim.seconds or trial.problem.seconds):
                raise WrongParameter(f"claims.{index}.until", why)
        for index, measured in enumerate(measure_claims(trial.problem)):
            if trouble := measured.trouble or find_ambiguity(trial.problem, index, measured):
                raise WrongParameter(*trouble)

    def prepare(self, parameters: ClaimsParameters, trial: Trial[Problem]) -> None:
        """Measures every claim."""
        measure_claims(trial.problem)

    def compile_model(self, parameters: ClaimsParameters, trial: Trial[Problem]) -> mujoco.MjModel | None:
        """Returns the model of the case."""
        return compile_text(trial.problem.xml)

    def judge(self, parameters: ClaimsParameters, trial: Trial[Problem], results: Results) -> Judgement[Outcome]:
        """Compares each claim with what we measured."""
        return judge_claims(trial.problem, results)

    def name_mistake(self, parameters: ClaimsParameters, judged: Sequence[JudgedTrial[Problem, Outcome]]) -> str | None:
        """Returns the sentence of the first mistake that explains a wrong claim in every case."""
        return name_the_mistake(judged)

    def build_pictures(
        self, parameters: ClaimsParameters, visible: Sequence[JudgedTrial[Problem, Outcome]]
    ) -> dict[str, Any]:
        """Returns a table of the claims, and charts."""
        return build_evidence(visible)

    def place_on_axes(self, parameters: ClaimsParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns each claim beside what was measured."""
        return place_claims(parameters, verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ClaimsParameters, trials: Sequence[Trial[Problem]]
    ) -> Mapping[str, str]:
        """Returns scripts that claim what is right in the first case, and 0."""
        (problem, *_) = [trial.problem for trial in trials]
        right = {
            claim.name: list_accepted_values(claim.form, measured.values)
            for claim, measured in zip(problem.claims, measure_claims(problem), strict=True)
        }
        zeros = {name: [0.0] * len(values) for name, values in right.items()}
        return {
            name: f"def {question.entry}(*arguments):\n    return {claims!r}\n"
            for name, claims in (("the numbers of the first case", right), ("0 for every claim", zeros))
        }

    def count_returned(self, trial: Trial[Problem]) -> int:
        """Returns the number of claims."""
        return len(trial.problem.claims)

    def list_accepted(
        self, parameters: ClaimsParameters, trials: Sequence[Trial[Problem]]
    ) -> Sequence[Intervals] | None:
        """Returns the intervals of right claims, from runs at the model's own timestep: all depend on one draw."""
        (trial,) = trials
        bench = Bench(trial.problem)
        intervals: list[tuple[float, float]] = []
        for index, claim in enumerate(trial.problem.claims):
            try:
                values = measure_own(bench, index)
            except RegimeFailure:
                return None
            around = claim.allow(values)
            intervals += [(value - around, value + around) for value in values.tolist()]
        return [intervals]


def list_accepted_values(form: str, values: Floats) -> list[float]:
    """Returns a right claim as numbers: both ends of an interval."""
    numbers: list[float] = values.tolist()
    return 2 * numbers if form == "interval" else numbers
