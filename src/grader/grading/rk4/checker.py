"""The `rk4` kind of exercise: its faults, its plan, its verdict."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydantic import ValidationError

from grader.domain.quiz import CodeQuestion
from grader.domain.run import RunReport
from grader.domain.verdict import Finding, Status, Verdict, verdict_of
from grader.errors import Fault, GraderError
from grader.grading.parameters import duplicate_faults, extremes, parameter_faults, read_parameters
from grader.grading.plan import ModelXml, Plan, driver_text
from grader.grading.rk4.diagnosis import name_the_mistake
from grader.grading.rk4.evidence import evidence_of
from grader.grading.rk4.findings import case_finding, case_message, order_finding, refused_finding
from grader.grading.rk4.outcomes import Outcome, judge_cases, judge_order
from grader.grading.rk4.parameters import Problem, Rk4Parameters, pose_problem, pose_run
from grader.grading.rk4.trajectories import mujocos
from grader.grading.rk4.truth import CASE_RTOL, solved


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
                for end in extremes(case):
                    run = pose_run(end, parameters.numbers, model_xml, [0, index])
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
            findings.append(order_finding(order, outcomes[0], order.check.points * scale))
        refused = (
            bytes(report.results["refused"].tobytes()).decode(errors="replace") if "refused" in report.results else ""
        )
        if refused:
            findings.append(refused_finding(refused))
        verdict = verdict_of(
            tuple(findings),
            diagnosis=diagnosis_of(problem, outcomes, findings),
            evidence=evidence_of(outcomes, order),
        )
        if not refused or verdict.status is Status.INCORRECT:
            return verdict
        return verdict.model_copy(update={"status": Status.NEEDS_REVIEW, "diagnosis": findings[-1].message})


def diagnosis_of(problem: Problem, outcomes: Sequence[Outcome], findings: Sequence[Finding]) -> str | None:
    """The mistake by name; else the hint of the first case that failed; else where the motion departs, or the order."""
    order = next((finding for finding in findings if finding.id == "order"), None)
    wrong = next((outcome for outcome in outcomes if not outcome.right), None)
    if wrong is None:
        return order.message if order and not order.passed else None
    if wrong is not outcomes[0]:
        return state_diagnosis(wrong) or wrong.case.hint or f"{wrong.title}: {case_message(wrong)}"
    named = name_the_mistake(problem, wrong.student)
    if named:
        return f"{named} It differs by {wrong.difference.worst:.1e}." if "Fourth order" in named else named
    slope = "" if order is None or order.measured is None else f" The observed order is {order.measured:.2f}."
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
    if len(student) > 1 and np.any(np.all(student.qvel == student.qvel[0], axis=0)):
        return "Some velocities stand still: a model may have more joints than you move, so advance all of data.qvel."
    return None
