"""The `threshold` kind judges brackets of the largest stable timestep. It certifies a bracket by simulating at its
ends, and names the mistake in a search by the runs that the script made."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from inspect import getsource
from typing import Any

import mujoco

from grader.domain.axes import Placed
from grader.exercises.film import Film
from grader.exercises.kind import DrawnCase, Intervals, JudgedTrial, Judgement, Kind, Results, Trial
from grader.exercises.kinds.threshold.films import record_films, record_timestep
from grader.exercises.kinds.threshold.judging import driver
from grader.exercises.kinds.threshold.judging.described import describe
from grader.exercises.kinds.threshold.judging.judge import Bracket, Claim, NoLimit, has_limit, judge_claim, read_claim
from grader.exercises.kinds.threshold.limits import describe_expected, find_accepted_ends
from grader.exercises.kinds.threshold.mistakes import describe_right_search, name_the_mistake, write_lazy_scripts
from grader.exercises.kinds.threshold.parameters import Cell, ThresholdParameters, build_cells
from grader.exercises.kinds.threshold.pictures import build_evidence
from grader.exercises.kinds.threshold.placing import place_brackets
from grader.exercises.kinds.threshold.script_facts import CLAIMS, LANDMARKS
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
    claims = CLAIMS
    landmarks = LANDMARKS

    def build_trials(self, parameters: ThresholdParameters, drawn: DrawnCase[Case]) -> Sequence[Trial[Cell]]:
        """Returns one call of the student's function for every integrator."""
        several = build_cells(parameters, drawn)
        return [
            Trial(
                id=f"{drawn.case.id}.{cell.integrator.name}",
                inputs={"model": drawn.xml, "integrator": cell.integrator.code},
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

    def compile_model(self, parameters: ThresholdParameters, trial: Trial[Cell]) -> mujoco.MjModel:
        """Returns the model of the case."""
        return trial.problem.scene.model

    def prepare(self, parameters: ThresholdParameters, trial: Trial[Cell]) -> None:
        """Compiles the scenes, finds the equilibrium, and simulates at the longest timestep."""
        cell = trial.problem
        _ = cell.scene, cell.scene_as_written, cell.rest
        has_limit(cell.scene, cell.integrator.code, parameters.search_s[1], parameters.horizon_s)

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

    def is_alike(
        self, parameters: ThresholdParameters, trial: Trial[Cell], one: Judgement[Claim], other: Judgement[Claim]
    ) -> bool:
        """Whether two brackets have a timestep in common, or both claim that there is no limit."""
        mine, its = one.outcome, other.outcome
        if isinstance(mine, Bracket) and isinstance(its, Bracket):
            return mine.low <= its.high and its.low <= mine.high
        return isinstance(mine, NoLimit) and isinstance(its, NoLimit)

    def describe_success(self, parameters: ThresholdParameters, judged: Sequence[JudgedTrial[Cell, Claim]]) -> str:
        """Returns how many simulations a visible search took, and how many a bisection needs."""
        return describe_right_search(parameters, [trial.trace for trial in judged if not trial.hidden])

    def build_pictures(
        self, parameters: ThresholdParameters, visible: Sequence[JudgedTrial[Cell, Claim]]
    ) -> dict[str, Any]:
        """Returns the angle at both ends of each claim, and the stability line."""
        return build_evidence(parameters, visible)

    def record_films(
        self, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]], evidence: Mapping[str, Any],
        failed: Collection[str], *, timestep_s: float | None = None,
    ) -> Sequence[Film]:  # fmt: skip
        """Returns the runs at the ends of the claims, and around the limits where the evidence has them; or at a
        timestep, where it has the limits."""
        if timestep_s is not None:
            return [*record_timestep(parameters, trials, evidence, failed, timestep_s)]
        return [*record_films(parameters, trials, evidence, failed)]

    def place_on_axes(self, parameters: ThresholdParameters, verdict: Mapping[str, Any]) -> Iterable[Placed]:
        """Returns each claimed bracket beside its limit."""
        return place_brackets(verdict)

    def write_lazy_answers(
        self, question: ScriptQuestion, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]]
    ) -> Mapping[str, str]:
        """Returns scripts that give the right answers of one model for every model, or None for all."""
        return write_lazy_scripts(question.entry, parameters, trials)

    def list_accepted(self, parameters: ThresholdParameters, trials: Sequence[Trial[Cell]]) -> Sequence[Intervals]:
        """Returns the accepted lower ends of a bracket of the allowed width, under every integrator."""
        return [[find_accepted_ends(parameters, trial.problem) for trial in trials]]
