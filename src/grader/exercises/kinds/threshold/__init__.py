"""The `threshold` kind judges brackets of the largest stable timestep. It certifies a bracket by simulating at its
ends, and names the mistake in a search by the runs that the script made."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from inspect import getsource
from typing import Any

from grader.exercises.kind import DrawnCase, Intervals, JudgedTrial, Judgement, Kind, Results, Trial
from grader.exercises.kinds.threshold.judging import driver
from grader.exercises.kinds.threshold.judging.described import describe
from grader.exercises.kinds.threshold.judging.judge import Claim, judge_claim, read_claim
from grader.exercises.kinds.threshold.limits import describe_expected, find_accepted_ends
from grader.exercises.kinds.threshold.mistakes import name_the_mistake, write_lazy_scripts
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters, build_cells
from grader.exercises.kinds.threshold.pictures import build_evidence
from grader.exercises.parameters import Case
from grader.questions import Reveal
from grader.questions.kinds.script import ScriptQuestion


class Threshold(Kind[ThresholdParameters, Cell, Claim]):
    """Judges brackets of the largest stable timestep: one trial for each case and integrator."""

    parameters = ThresholdParameters
    driver = getsource(driver)
    how = (
        "A bracket is right when a run at its lower end is stable, and one at its upper end is not: MuJoCo warns "
        "within the horizon, or small motions about the equilibrium grow. A right None counts only if a limit of the "
        "same model is found under another integrator."
    )

    def build_trials(self, parameters: ThresholdParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[Cell]]:
        """Returns one call of the student's function for every integrator."""
        several = build_cells(parameters, drawn)
        return [
            Trial(
                id=f"{drawn.case.id}.{cell.integrator.name}",
                inputs={"model": drawn.xml, "integrator": cell.integrator.code, "again": cell is not several[-1]},
                problem=cell,
                title=cell.integrator.name,
            )
            for cell in several
        ]

    def describe_problem(
        self, reveal: Reveal | None, parameters: ThresholdParameters, trial: Trial[Cell]
    ) -> Mapping[str, Any]:
        """Returns the search, and the start and the equilibrium of the model."""
        return describe(parameters, trial.problem)

    def prepare(self, parameters: ThresholdParameters, trial: Trial[Cell]) -> None:
        """Compiles the scenes."""
        _ = trial.problem.scene, trial.problem.scene_as_written

    def judge(self, parameters: ThresholdParameters, trial: Trial[Cell], results: Results) -> Judgement[Claim]:
        """Certifies a claim by simulating at its ends."""
        claim = read_claim(results)
        judgement = judge_claim(parameters, trial.problem, claim)
        if trial.hidden:  # the runner drops them, and the expected limit takes a bisection
            return judgement
        return replace(judgement, measured=str(claim), expected=describe_expected(parameters, trial.problem))

    def name_mistake(self, parameters: ThresholdParameters, judged: Sequence[JudgedTrial[Cell, Claim]]) -> str | None:
        """Returns the sentence of the first wrong method that gives the student's claims."""
        return name_the_mistake(parameters, judged)

    def build_pictures(
        self, parameters: ThresholdParameters, visible: Sequence[JudgedTrial[Cell, Claim]]
    ) -> dict[str, Any]:
        """Returns the angle at both ends of each claim, and the stability line."""
        return build_evidence(parameters, visible)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]]
    ) -> Mapping[str, str]:
        """Returns scripts that give the right answers of one model for every model, or None for all."""
        return write_lazy_scripts(question.entry, parameters, trials)

    def list_accepted(self, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]]) -> Sequence[Intervals]:
        """Returns the accepted lower ends of a bracket of the allowed width, under every integrator."""
        return [[find_accepted_ends(parameters, trial.problem) for trial in trials]]
