"""The `threshold` kind of exercise: its faults, its plan, its verdict."""

from collections.abc import Sequence

from pydantic import ValidationError

from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunReport
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import Fault, GraderError
from grader.grading.parameters import duplicate_faults, extremes, parameter_faults, read_parameters
from grader.grading.plan import ModelXml, Plan, driver_text
from grader.grading.threshold.claims import Bracket, NoLimit, read_claim, shown
from grader.grading.threshold.diagnosis import name_the_mistake
from grader.grading.threshold.evidence import evidence_of, expected_of
from grader.grading.threshold.parameters import Problem, ThresholdParameters, pose_problem
from grader.grading.threshold.truth import Judged, judge_claim

CERTIFIED = {
    Bracket: "Certified by simulating at both ends.",
    NoLimit: "Certified by simulating at the longest timestep, which is stable.",
}

SAME_EVERYWHERE = (
    "The function gave the same answer for every model, although their limits differ: an instructor will look at it. "
    "Measure the model you were given."
)


class ThresholdChecker:
    """Judges brackets of the largest stable timestep."""

    def faults(self, question: CodeQuestion, model_xml: ModelXml, where: str) -> list[Fault]:
        """Parameters that are not understood, models that do not compile, joints and numbers that are not there."""
        try:
            parameters = read_parameters(ThresholdParameters, question)
        except ValidationError as error:
            return parameter_faults(error, question, where)
        faults = duplicate_faults(parameters.cases, question, where)
        for index, case in enumerate(parameters.cases):
            try:
                pose_problem(parameters.model_copy(update={"cases": extremes(case)}), model_xml, 0)
            except (ValueError, KeyError, GraderError) as error:
                faults.append(Fault(where, f"{question.id}.check.cases.{index}", str(error.args[0])))
        return faults

    def plan(self, question: CodeQuestion, model_xml: ModelXml, seed: int) -> Plan[Problem]:
        """One call of the student's function for every model and integrator."""
        problem = pose_problem(read_parameters(ThresholdParameters, question), model_xml, seed)
        calls = [{"model": cell.model, "integrator": cell.code} for cell in problem.cells]
        inputs = {"entry": question.entry, "models": list(problem.models), "calls": calls}
        return Plan(driver_text("threshold"), inputs, problem)

    def judge(self, question: CodeQuestion, plan: Plan[Problem], report: RunReport) -> Verdict:
        """Certify every claim; name the mistake behind the wrong ones."""
        problem = plan.problem
        judged = [
            judge_claim(problem.parameters, cell, read_claim(report.results, index))
            for index, cell in enumerate(problem.cells)
        ]
        scale = question.points / sum(cell.points for cell in problem.cells)
        findings = [finding_of(problem, one, one.cell.points * scale) for one in judged]
        verdict = verdict_of(
            tuple(findings),
            diagnosis=diagnosis_of(problem, judged),
            evidence=evidence_of(problem, judged),
        )
        if not same_everywhere(judged):
            return verdict
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": SAME_EVERYWHERE})


def finding_of(problem: Problem, judged: Judged, points: float) -> Finding:
    """One cell's outcome; of a hidden one neither the claim nor the limit."""
    cell = judged.cell
    return Finding(
        id=cell.id,
        title=cell.title,
        passed=judged.right,
        points=points if judged.right else 0.0,
        max_points=points,
        message=f"{judged.why}." if judged.why else CERTIFIED[type(judged.claim)],
        measured=None if cell.hidden else shown(judged.claim),
        expected=None if cell.hidden else expected_of(problem, cell),
    )


def diagnosis_of(problem: Problem, judged: Sequence[Judged]) -> str | None:
    """The mistake by name; else what is wrong with the first wrong claim."""
    wrong = next((one for one in judged if not one.right), None)
    if wrong is None:
        return None
    return name_the_mistake(problem, judged) or f"{wrong.cell.title}: {wrong.why}."


def same_everywhere(judged: Sequence[Judged]) -> bool:
    """Whether the claims ignore the model: bit for bit the same for all, some of them wrong, and not all None."""
    by_model: dict[int, list[object]] = {}
    for one in judged:
        by_model.setdefault(one.cell.model, []).append(one.claim)
    answers = list(by_model.values())
    measured = any(isinstance(one.claim, Bracket) for one in judged)
    some_right = any(one.right and not isinstance(one.claim, NoLimit) for one in judged)
    return len(answers) > 1 and measured and some_right and all(answer == answers[0] for answer in answers)
