"""What a claim would be if it were measured wrongly: computed from the scene of the case, for each known mistake."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import mujoco
import numpy as np

from grader.domain.quantities import QuantityName
from grader.errors import LabRefused
from grader.exercises.kinds.claims.measuring import MeasuredClaim, list_points, read_series, read_value
from grader.exercises.kinds.claims.parameters import Claim, Experiment, Floats, Problem, compile_text
from grader.experiments.quantities import find_rises
from grader.experiments.regime import RegimeFailure
from grader.experiments.runs import SAME, LabRun, Variant, VerifyError
from grader.numerics.integrators import INTEGRATORS

EXPRS_MAX = 30
"""Most expressions that are read in place of the claim's own."""

ELEMENT = re.compile(r"data\.(qpos|qvel|sensordata)\[(\d+)\]")
NAMED = re.compile(r"lib\.(sensor|qpos|qvel)\((['\"])([^'\"]+)\2\)")
ENERGY = re.compile(r"lib\.energy\(\)\.(total|kinetic|potential)|data\.energy\[[01]\]")
PLACE = re.compile(r"(lib\.(?:body|site|geom)Pos\([^()]*\)|lib\.com\(\))\[(\d)\]")

ALIKE = 1e-6
"""How near numbers of two integrators are that are the same for a learner, relatively."""

MOMENTS = ("settling", "crossing")
"""Quantities that are counted from the start of a run."""

END = ("data.qpos", "data.qvel", "data.act")


@dataclass(frozen=True)
class Other:
    """A claim measured of another expression: its text, and how sentences call what it reads."""

    expr: str
    what: str


class Scene:
    """A failed claim in its case, and the runs at the model's own timestep that wrong values are read from. The script
    `steps` the model, and `subtracts` a smallest value from a largest, or has no call that does."""

    def __init__(
        self, problem: Problem, claim: Claim, measured: MeasuredClaim, all_right: tuple[Floats, ...], *, steps: bool,
        subtracts: bool,
    ) -> None:  # fmt: skip
        self.problem, self.claim, self.measured, self.all_right = problem, claim, measured, all_right
        self.steps, self.subtracts = steps, subtracts
        self._runs: dict[tuple[Experiment, Variant, tuple[str, ...]], tuple[LabRun, Floats]] = {}

    @property
    def right(self) -> Floats:
        """What the claim should be."""
        return self.measured.values

    @cached_property
    def timestep_s(self) -> float:
        """The model's own timestep [s]."""
        run, _ = self.run(list_points(self.problem, self.claim)[0][0], SAME, (self.claim.expr,))
        return run.duration_s / max(run.steps, 1)

    def run(self, experiment: Experiment, variant: Variant, exprs: tuple[str, ...]) -> tuple[LabRun, Floats]:
        """Returns a run and what expressions gave in it, each made once. Raises as `read_series`."""
        key = (experiment, variant, exprs)
        if key not in self._runs:
            self._runs[key] = read_series(experiment, exprs, variant)
        return self._runs[key]

    def read(
        self, claim: Claim | None = None, variant: Variant = SAME, x_scale: float = 1.0, **changes: object
    ) -> Floats | None:
        """Returns the numbers of the claim, or of another in its place; `changes` are those of its experiments, and the
        x of a curve are multiplied by `x_scale`. None where they cannot be measured."""
        claim = claim or self.claim
        try:
            return np.array(
                [
                    self.read_one(
                        claim,
                        replace(experiment, value=x_scale * experiment.value, **changes),  # type: ignore[arg-type]
                        variant,
                        at_s,
                    )
                    for experiment, at_s in list_points(self.problem, claim)
                ]
            )
        except (RegimeFailure, VerifyError, LabRefused, ValueError):
            return None

    def read_one(self, claim: Claim, experiment: Experiment, variant: Variant, at_s: float) -> float:
        """Returns one number of a claim."""
        run, series = self.run(experiment, variant, (claim.expr,))
        return read_value(claim, np.array(run.times), series[:, 0], at_s)

    def read_first(self, expr: str) -> Floats | None:
        """Returns the value of an expression at the begin of each run, as it is."""
        try:
            points = list_points(self.problem, self.claim)
            return np.array([self.run(experiment, SAME, (expr,))[1][0, 0] for experiment, _ in points])
        except (RegimeFailure, VerifyError, LabRefused, ValueError):
            return None

    def measure_as(self, name: QuantityName, **changes: object) -> Floats | None:
        """Returns the numbers of another quantity of the same runs."""
        band = {"band": None} if name != "settling" else {}
        return self.read(self.claim.model_copy(update={"quantity": name, **band, **changes}))

    def list_others(self) -> Iterator[tuple[str, Floats]]:
        """Yields what another joint, sensor or axis gives, with the words for it."""
        others = list_other_exprs(self.claim.expr, compile_text(self.problem.xml))
        exprs = tuple(quantity.expr for quantity in others)
        points = list_points(self.problem, self.claim)
        try:
            runs = [(self.run(experiment, SAME, exprs), at_s) for experiment, at_s in points] if exprs else []
        except (RegimeFailure, VerifyError, LabRefused):
            return
        for index, other in enumerate(others):
            yield (
                other.what,
                np.array(
                    [
                        read_value(self.claim, np.array(run.times), series[:, index], at_s)
                        for (run, series), at_s in runs
                    ]
                ),
            )

    def list_integrators(self) -> Iterator[tuple[str, Floats]]:
        """Yields what each other integrator gives at the model's own timestep, unless it is the same. Those that give
        the same number stand together."""
        own = self.read()
        found: list[tuple[list[str], Floats]] = []
        for integrator in INTEGRATORS:
            values = self.read(variant=Variant(integrator=integrator.code))
            if values is None or (own is not None and np.array_equal(values, own)):  # the setup may have chosen one
                continue
            alike = next((names for names, others in found if np.allclose(values, others, rtol=ALIKE)), None)
            if alike is None:
                found.append(([integrator.name], values))
            else:
                alike.append(integrator.name)
        for (first, *others), values in found:
            yield f"{first} gives" + (f", as {' and '.join(others)} here" if others else ""), values

    def list_crossings(self, seconds: float) -> list[Floats] | None:
        """Returns the moments of the upward crossings of the claim's level [s], in each run of so many seconds."""
        try:
            series = [
                (np.array(run.times), values[:, 0])
                for experiment, _ in list_points(self.problem, self.claim)
                for run, values in [self.run(replace(experiment, seconds=seconds), SAME, (self.claim.expr,))]
            ]
        except (RegimeFailure, VerifyError, LabRefused, ValueError):
            return None
        return [find_rises(times, values, self.claim) for times, values in series]

    def read_without_reset(self) -> Iterator[Floats]:
        """Yields what the claim is if its run begins where another one has ended: after its last step, or one more, as
        a loop over the time takes where rounding leaves it short of the end."""
        points = list_points(self.problem, self.claim)
        for more_s in (0.0, self.timestep_s):
            for before in self.list_earlier():
                values = self.read(setup=self.write_end(before, more_s))
                if values is not None:
                    yield values
                    if self.claim.quantity in MOMENTS:  # which data.time, running on, tells later
                        yield values + before.seconds * self.claim.scale
            if len({experiment for experiment, _ in points}) > 1:
                yield from self.read_chain([experiment for experiment, _ in points], more_s)

    def list_earlier(self) -> Iterator[Experiment]:
        """Yields the runs of the other claims, with another set-up, that come before."""
        own = self.problem.list_experiments(self.claim)
        for claim in self.problem.claims:
            if claim.name == self.claim.name:
                return
            (*_, last) = self.problem.list_experiments(claim)
            if last not in own:
                yield last

    def write_end(self, before: Experiment, more_s: float) -> str:
        """Returns the set-up of a run that begins where another one has ended, but for what its own set-up writes."""
        run, _ = self.run(replace(before, seconds=before.seconds + more_s), SAME, END)
        parts = [
            f"{name}[{index}] = {value!r}"
            for name, values in zip(END, run.rows[-1], strict=True)
            for index, value in enumerate(values if isinstance(values, list) else ())
        ]
        own = self.claim.setup
        return ";\n".join(filter(None, (*parts, own)))

    def read_chain(self, experiments: Sequence[Experiment], more_s: float) -> Iterator[Floats]:
        """Yields the numbers of a curve each of whose runs begins where the one before has ended."""
        values, setup = [], experiments[0].setup
        try:
            for experiment in experiments:
                one = replace(experiment, setup=setup)
                values.append(self.read_one(self.claim, one, SAME, 0.0))
                setup = self.write_end(one, more_s)
        except (RegimeFailure, VerifyError, LabRefused, ValueError):
            return
        yield np.array(values)


def list_other_exprs(expr: str, model: mujoco.MjModel) -> list[Other]:
    """Returns the expressions that read another joint, sensor or axis in place of the one that `expr` reads first."""
    quantities = [
        *_replace_elements(expr, model),
        *_replace_names(expr, model),
        *_replace_axes(expr),
        *_replace_energy(expr),
    ]
    return [quantity for quantity in quantities if quantity.expr != expr][:EXPRS_MAX]


def _replace_elements(expr: str, model: mujoco.MjModel) -> Iterator[Other]:
    match = ELEMENT.search(expr)
    if match is None:
        return
    field = match[1]
    sizes = {"qpos": model.nq, "qvel": model.nv, "sensordata": model.nsensordata}
    others = [field] if field == "sensordata" else [field, {"qpos": "qvel", "qvel": "qpos"}[field]]
    for name in others:
        for index in range(sizes[name]):
            text = f"data.{name}[{index}]"
            yield Other(expr.replace(match[0], text), text)


def _replace_names(expr: str, model: mujoco.MjModel) -> Iterator[Other]:
    match = NAMED.search(expr)
    if match is None:
        return
    function = match[1]
    is_sensor = function == "sensor"
    count, get = (model.nsensor, model.sensor) if is_sensor else (model.njnt, model.joint)
    names = [get(index).name for index in range(count)]
    what = "the sensor" if is_sensor else "the joint"
    for name in filter(None, names):
        yield Other(expr.replace(match[0], f"lib.{function}('{name}')"), f"{what} {name}")
    if not is_sensor:
        other = {"qpos": "qvel", "qvel": "qpos"}[function]
        word = "the velocity" if other == "qvel" else "the position"
        yield Other(expr.replace(match[0], f"lib.{other}('{match[3]}')"), f"{word} of {match[3]}")


def _replace_energy(expr: str) -> Iterator[Other]:
    match = ENERGY.search(expr)
    for name in ("kinetic", "potential", "total") if match is not None else ():
        yield Other(expr.replace(match[0], f"lib.energy().{name}"), f"the {name} energy")  # type: ignore[index]


def _replace_axes(expr: str) -> Iterator[Other]:
    match = PLACE.search(expr)
    if match is None:
        return
    for index, axis in enumerate("xyz"):
        yield Other(expr.replace(match[0], f"{match[1]}[{index}]"), f"the axis {axis}")
