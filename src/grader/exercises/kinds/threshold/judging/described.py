"""A trial as plain JSON, for the learner's own machine, and its judgement there."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from grader.exercises.judgement import Judgement, Results
from grader.exercises.kinds.threshold.judging.judge import Cell, SearchRange, judge_claim, read_claim
from grader.numerics.integrators import BY_NAME, Integrator
from grader.numerics.scene import Scene


@dataclass(frozen=True)
class DescribedSearch:
    """What is searched [s]."""

    search_s: tuple[float, float]
    horizon_s: float
    width_s: float
    integrators: tuple[str, ...]


@dataclass(frozen=True)
class DescribedCell:
    """One model under one integrator."""

    case: str
    integrator: Integrator
    scene: Scene
    rest: Scene | None


def describe(search: SearchRange, cell: Cell) -> dict[str, Any]:
    """Returns what judges claims about a cell, beside the inputs of its trial."""
    rest = cell.rest
    return {
        "search_s": list(search.search_s),
        "horizon_s": search.horizon_s,
        "width_s": search.width_s,
        "integrators": list(search.integrators),
        "case": cell.case,
        "integrator": cell.integrator.name,
        "start": cell.scene.start.qpos.tolist(),
        "rest": None if rest is None else {"qpos": rest.start.qpos.tolist(), "act": rest.start.act.tolist()},
    }


def judge(inputs: Mapping[str, Any], problem: Mapping[str, Any], results: Results) -> Judgement[Any]:
    """Judges a claim."""
    low, high = problem["search_s"]
    search = DescribedSearch((low, high), problem["horizon_s"], problem["width_s"], tuple(problem["integrators"]))
    model = Scene.from_xml(inputs["model"])
    rest = None if problem["rest"] is None else model.at(**problem["rest"], qvel=[0.0] * int(model.model.nv))
    cell = DescribedCell(problem["case"], BY_NAME[problem["integrator"]], model.at(qpos=problem["start"]), rest)
    return judge_claim(search, cell, read_claim(results))
