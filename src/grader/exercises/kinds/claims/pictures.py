"""The evidence of visible cases: a table of claims beside what we measured, and pictures of the runs and curves."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from grader.errors import LabRefused
from grader.exercises.kind import JudgedTrial
from grader.exercises.kinds.claims.judge import ClaimComparison, Outcome, to_json
from grader.exercises.kinds.claims.measuring import read_series
from grader.exercises.kinds.claims.naming import name_reading
from grader.exercises.kinds.claims.parameters import Axis, Floats, Problem, compile_text
from grader.experiments.regime import RegimeFailure
from grader.experiments.runs import SAME, VerifyError

POINTS_MAX = 300
CHARTS_MAX = 6
FIGURES = 5

HEIGHTS = frozenset({"final", "max", "min", "mean"})
"""Quantities that are values of what is drawn."""
MOMENTS = frozenset({"crossing", "settling"})
"""Quantities that are moments of it."""


def build_evidence(visible: Sequence[JudgedTrial[Problem, Outcome]]) -> dict[str, Any]:
    """Returns a table for each visible case, and charts of the claims: first of those that are wrong."""
    trials = [(trial.id, trial.problem, trial.judgement.outcome) for trial in visible if trial.judgement.outcome]
    every = [(case, problem, comparison) for case, problem, outcome in trials for comparison in outcome]
    shown = sorted(every, key=lambda each: not each[2].why)[:CHARTS_MAX]
    return {
        "tables": [build_table(case, outcome) for case, _, outcome in trials],
        "charts": [chart for case, problem, comparison in shown for chart in draw_claim(case, problem, comparison)],
    }


def build_table(case: str, outcome: Outcome) -> dict[str, Any]:
    """Returns the table of a case: each claim, what was measured, and how far they may differ."""
    return {
        "case": case,
        "title": "Claims and our own measurements",
        "head": ["Claim", "Unit", "Yours", "Measured", "Allowed difference"],
        "rows": [
            [
                comparison.claim.label,
                comparison.claim.unit,
                comparison.text if comparison.values is None else write_numbers(comparison.values),
                write_numbers(comparison.measured.values),
                f"{comparison.allowed:.2g}",
            ]
            for comparison in outcome
        ],
    }


def write_numbers(values: Floats) -> str:
    """Returns numbers to FIGURES figures, as they stand in a table."""
    return ", ".join(f"{value:.{FIGURES}g}" for value in values.tolist())


def draw_claim(case: str, problem: Problem, comparison: ClaimComparison) -> Iterator[dict[str, Any]]:
    """Yields the chart of a claim: a curve beside ours, or the run with what was claimed of it."""
    if comparison.claim.form == "curve":
        assert problem.axis is not None
        yield draw_curve(case, problem.axis, problem.x, comparison)
        return
    try:
        run, series = read_series(problem.list_experiments(comparison.claim)[0], [comparison.claim.expr], SAME)
    except (RegimeFailure, VerifyError, LabRefused):
        return
    name = name_reading(comparison.claim.expr, compile_text(problem.xml)) or comparison.claim.expr
    yield draw_run(case, np.array(run.times), series[:, 0], comparison, name)


def draw_curve(case: str, axis: Axis, x: Sequence[float], comparison: ClaimComparison) -> dict[str, Any]:
    """Returns a chart of a curve, with ours."""
    series = [build_series("measured", np.array(x), comparison.measured.values, points=True)]
    if comparison.values is not None:
        series.append(build_series("yours", np.array(x), comparison.values, points=True))
    return {
        "case": case,
        "title": comparison.claim.label,
        "x": {"label": label_axis(axis.label, axis.unit), "log": False},
        "y": {"label": label_axis(comparison.claim.label, comparison.claim.unit), "log": False},
        "series": series,
        "marks": [],
    }


def draw_run(case: str, times: Floats, values: Floats, comparison: ClaimComparison, name: str) -> dict[str, Any]:
    """Returns a chart of the run that a claim is about, with marks at what was claimed and measured. `name` is what the
    axis of the values is called."""
    every = max(1, -(-len(times) // POINTS_MAX))
    return {
        "case": case,
        "title": comparison.claim.label,
        "x": {"label": "time [s]", "log": False},
        "y": {"label": name, "log": False},
        "series": [build_series("", times[::every], values[::every], points=False)],
        "marks": list(build_marks(comparison)),
    }


def build_marks(comparison: ClaimComparison) -> Iterator[dict[str, Any]]:
    """Yields the marks at a claim and at what was measured, on the axis that they belong to."""
    at = "y" if comparison.claim.quantity in HEIGHTS else "x" if comparison.claim.quantity in MOMENTS else ""
    if not at:
        return
    yield {at: float(comparison.measured.values[0]) / comparison.claim.scale, "label": "measured"}
    if comparison.values is not None and comparison.why:
        yield from ({at: float(value) / comparison.claim.scale, "label": "yours"} for value in comparison.values)


def build_series(label: str, x: Floats, y: Floats, *, points: bool) -> dict[str, Any]:
    """Returns a line of a chart."""
    return {"label": label, "x": to_list(x), "y": to_list(y), "points": points}


def to_list(values: Floats) -> list[float]:
    """Returns numbers of seven figures."""
    shown = to_json(np.clip(values, -1e9, 1e9))
    return shown if isinstance(shown, list) else [shown]


def label_axis(label: str, unit: str) -> str:
    """Returns the label of an axis, with its unit if there is one."""
    return f"{label} [{unit}]" if unit else label
