"""The `rk4` kind of exercise: its faults, its plan, its verdict."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from pydantic import ValidationError

from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunReport
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import Fault, GraderError
from grader.grading.parameters import duplicate_faults, parameter_faults, read_parameters
from grader.grading.plan import ModelXml, Plan, driver_text
from grader.grading.rk4.diagnosis import name_the_mistake
from grader.grading.rk4.evidence import evidence_of
from grader.grading.rk4.outcomes import MUJOCO_ORDER, OrderOutcome, Outcome, judge_cases, judge_order
from grader.grading.rk4.parameters import Problem, Rk4Parameters, pose_problem, pose_run
from grader.grading.rk4.trajectories import mujocos
from grader.grading.rk4.truth import CASE_RTOL, solved

ORDER = 4.0


class Rk4Checker:
    """Judges steps of fourth-order Runge-Kutta methods."""

    def faults(self, question: CodeQuestion, model_xml: ModelXml, where: str) -> list[Fault]:
        """Parameters that are not understood, models that do not compile, or have no truth to converge to."""
        try:
            parameters = read_parameters(Rk4Parameters, question)
        except ValidationError as error:
            return parameter_faults(error, question, where)
        faults = duplicate_faults(parameters.cases, question, where)
        needs_truth = {0} if parameters.order else set()
        if parameters.accept != "mujoco":
            needs_truth = set(range(len(parameters.cases)))
        for index, case in enumerate(parameters.cases):
            try:
                run = pose_run(case, parameters.numbers, model_xml, [0, index])
                if index in needs_truth:
                    solved(run, (run.timestep_s,), CASE_RTOL)
            except (ValueError, KeyError, GraderError) as error:
                faults.append(Fault(where, f"{question.id}.check.cases.{index}", str(error.args[0])))
        return faults

    def plan(self, question: CodeQuestion, model_xml: ModelXml, seed: int) -> Plan[Problem]:
        """One run for every case and for every timestep of the order check."""
        problem = pose_problem(read_parameters(Rk4Parameters, question), model_xml, seed)
        models = list(dict.fromkeys(run.xml for run in problem.runs))
        runs = [
            {
                "model": models.index(run.xml),
                "timestep_s": run.timestep_s,
                "steps": run.steps,
                **{name: list(getattr(run, name)) for name in ("qpos", "qvel", "act", "ctrl")},
            }
            for run in problem.runs
        ]
        forces: list[dict[str, Any]] = [vars(run.force) for run in problem.runs]
        driver = driver_text("hidden_force") + "\n\n" + driver_text("rk4")
        return Plan(driver, {"entry": question.entry, "models": models, "runs": runs, "forces": forces}, problem)

    def judge(self, question: CodeQuestion, plan: Plan[Problem], report: RunReport) -> Verdict:
        """Hold every run against our own of the same case; name the mistake behind the wrong ones."""
        problem = plan.problem
        outcomes = judge_cases(problem, report.results)
        order = judge_order(problem, report.results)
        scale = question.points / (sum(o.case.points for o in outcomes) + (order.check.points if order else 0))
        findings = [case_finding(outcome, outcome.case.points * scale) for outcome in outcomes]
        if order:
            findings.append(order_finding(order, outcomes, order.check.points * scale))
        refused = (
            bytes(report.results["refused"].tobytes()).decode(errors="replace") if "refused" in report.results else ""
        )
        if refused:
            findings.append(refused_finding(refused))
        verdict = verdict_of(
            tuple(findings),
            diagnosis=diagnosis_of(problem, outcomes, order),
            evidence=evidence_of(outcomes, order),
        )
        if not refused or verdict.status is Status.INCORRECT:
            return verdict
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": findings[-1].message})


def case_finding(outcome: Outcome, points: float) -> Finding:
    """One case's outcome, without the numbers of the case."""
    return Finding(
        id=outcome.case.id,
        title=outcome.title,
        passed=outcome.right,
        points=points if outcome.right else 0.0,
        max_points=points,
        message=case_message(outcome),
        measured={name: shown(value) for name, value in outcome.difference.largest.items()},
        expected=f"at most {outcome.case.tolerance:g} from MuJoCo's RK4"
        + (", or as near to the truth as a fourth-order method" if outcome.may_converge else ""),
    )


def case_message(outcome: Outcome) -> str:
    """One sentence."""
    if not len(outcome.student):
        return "The first step left the state not finite."
    if not outcome.keeps_time:
        return "data.time is not where it should be: advance it by model.opt.timestep in every step."
    if outcome.agrees:
        return f"Agrees with MuJoCo's RK4 to {outcome.difference.worst:.1e}{to_truth(outcome)}."
    if outcome.is_near_truth:
        return (
            f"Not MuJoCo's method (differs by {outcome.difference.worst:.1e}) but nearer to the truth: its error is "
            f"{outcome.error:.1e}, that of a fourth-order method."
        )
    if not outcome.difference.complete:
        return f"After step {len(outcome.student)} the state is no longer finite."
    return f"Departs from MuJoCo's RK4 at step {outcome.first_departure}, and by {outcome.difference.worst:.1e} in all."


def to_truth(outcome: Outcome) -> str:
    """The error against the truth of a visible case where both count."""
    if not outcome.may_converge or outcome.case.hidden:
        return ""
    return f"; both are {outcome.error:.1e} from the truth"


def order_finding(order: OrderOutcome, outcomes: Sequence[Outcome], points: float) -> Finding:
    """Fourth order, or the order of MuJoCo's own method where the student's agrees with it everywhere."""
    fourth = order.is_about(ORDER)
    as_mujoco = all(o.agrees for o in outcomes) and outcomes[0].may_converge and order.is_about(MUJOCO_ORDER)
    if order.slope is None:
        message = "The error against the exact motion shows no order: some run did not stay finite."
    elif fourth:
        message = f"The error shrinks with order {order.slope:.2f}: fourth order."
    elif as_mujoco:
        message = (
            f"The error shrinks with order {order.slope:.2f}, as that of MuJoCo 3.14.0's own RK4 does on rotations; "
            "a method of fourth order there is right too."
        )
    else:
        message = f"The error shrinks with order {order.slope:.2f}; a fourth-order method has 4."
    return Finding(
        id="order",
        title="observed order",
        passed=fourth or as_mujoco,
        points=points if fourth or as_mujoco else 0.0,
        max_points=points,
        message=message,
        measured=None if order.slope is None else round(order.slope, 3),
        expected=f"4 within {order.check.tolerance:g}",
    )


def refused_finding(refused: str) -> Finding:
    """What the guard refused, for an instructor to look at."""
    return Finding(
        id="guard",
        title="ways round",
        passed=None,
        points=0.0,
        max_points=0.0,
        message=f"The script tried what this exercise does not allow ({refused}): an instructor will look at it.",
    )


def diagnosis_of(problem: Problem, outcomes: Sequence[Outcome], order: OrderOutcome | None) -> str | None:
    """The mistake by name; else the hint of the first case that failed; else where the motion departs."""
    wrong = next((outcome for outcome in outcomes if not outcome.right), None)
    if wrong is None:
        return None
    if wrong is not outcomes[0]:
        return state_diagnosis(wrong) or wrong.case.hint or f"{wrong.title}: {case_message(wrong)}"
    named = name_the_mistake(problem, wrong.student)
    if named:
        return f"{named} It differs by {wrong.difference.worst:.1e}." if "Fourth order" in named else named
    slope = "" if order is None or order.slope is None else f" The observed order is {order.slope:.2f}."
    return case_message(wrong) + slope


def state_diagnosis(outcome: Outcome) -> str | None:
    """Parts of the state that stood still although they should have moved."""
    student, ours = outcome.student, mujocos(outcome.run)
    if not len(student):
        return None
    if outcome.case.time_matters and (student.time == student.time[0]).all():
        return "data.time stands still: set it at every stage, and advance it by model.opt.timestep in every step."
    if ours.act.size and (student.act == student.act[0]).all():
        return "data.act stands still: advance it with data.act_dot, as you advance qvel with qacc."
    return None


def shown(value: float) -> float | None:
    """A difference to three figures; None where the run ended early (JSON has no infinity)."""
    return float(f"{value:.3g}") if isfinite(value) else None
