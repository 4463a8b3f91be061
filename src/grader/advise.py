"""Choose integrator and timestep for a model by the lesson's procedure, with measurements.

Start from implicitfast at 2 ms. Try RK4 at a quarter of the step if energy is conserved, and `discrete` if stiffness
limits the timestep. Raise the timestep until the error of the quantity exceeds the tolerance; check warnings after
every run. Unlike the lesson, it measures errors against a reference solution, so the start has to pass too.
"""

import time
from dataclasses import dataclass
from math import inf, isfinite, nan
from pathlib import Path

import mujoco
import numpy as np

from grader.errors import LabError, Unprocessable
from grader.expressions import Machine, compile_program
from grader.numerics.integrators import DISCRETE, IMPLICITFAST, INTEGRATORS, RK4, Integrator
from grader.numerics.linear import equilibrium, spectral_limit
from grader.numerics.measures import measure
from grader.numerics.process import prepare
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.selection import TIMESTEPS_S, Candidate, Quantity, Selection, check_question, named, select

START = (IMPLICITFAST, 0.002)
START_WORDS = "implicitfast at 2 ms, as the documentation recommends for most models"
QUARTER = (RK4, 0.0005)

TOLERANCE = 1e-3
SECONDS = 2.0

LIMIT_SPAN_S = (1e-4, 0.5)
"""Timesteps [s] between which the linear stability limit is sought."""


@dataclass(frozen=True)
class Row:
    """A candidate with its first warning and its costs, both relative to the start.

    `cost` is the ratio of evaluations of the forward dynamics, `cpu` of CPU time (None if not measured); `passes`
    tells whether the error meets the tolerance.
    """

    candidate: Candidate
    warning: str | None
    cost: float
    cpu: float | None
    passes: bool


@dataclass(frozen=True)
class Advice:
    """The table, the choice or None, the reason, the steps of the procedure, and the parts that may be skipped."""

    rows: tuple[Row, ...]
    choice: Candidate | None
    reason: str
    steps: tuple[str, ...]
    skips: tuple[str, ...]

    def __str__(self) -> str:
        """The advice as text for a terminal."""
        lines = [*self.steps, "", f"{'':22}{'error':>10}{'cost':>8}{'CPU':>8}  warnings"]
        lines += [_line(row, row.candidate == self.choice) for row in self.rows]
        chosen = named(self.choice) if self.choice else "none"
        lines += ["", f"choice: {chosen}", self.reason, "", "skipped, proved to change no bit of the result:"]
        return "\n".join(lines + [f"  {skip}" for skip in self.skips])


def advise(
    model: str | Path, quantity: str | None = None, tol: float | None = None, seconds: float | None = None
) -> Advice:
    """Measure a model and choose integrator and timestep; the run starts at the first keyframe, or else at qpos0.

    `model` is MJCF text or the path of a file; `quantity` an expression of the labs, by default all positions; `tol`
    its largest error, in its own unit (default 1e-3); `seconds` the length of the run (default 2 s). Raises
    Unprocessable for a model, tolerance or length that cannot be used and for an expression that fails, ContentError
    for one that does not compile.
    """
    try:
        scene = scene_of(model)
        measured = None if quantity is None else quantity_of(quantity, scene)
        tolerance = TOLERANCE if tol is None else tol
        return Request(scene, measured, tolerance, SECONDS if seconds is None else seconds).advise()
    except (ValueError, RuntimeError, LabError) as error:
        raise Unprocessable(str(error)) from error
    except mujoco.FatalError as error:
        raise Unprocessable(f"MuJoCo gave up on this model: {error}") from error


def scene_of(model: str | Path) -> Scene:
    """Compile MJCF text or a file; start at keyframe 0 if there is one. Raises ValueError if it does not compile."""
    prepare()
    if isinstance(model, str) and "<mujoco" in model:
        compiled = mujoco.MjModel.from_xml_string(model)
    else:
        path = Path(model)
        if not path.is_file():
            raise ValueError(f"there is no model {path}")
        compiled = mujoco.MjModel.from_xml_path(str(path))
    scene = Scene.of_model(compiled)
    return scene.at(key=0) if compiled.nkey else scene


def quantity_of(expression: str, scene: Scene) -> Quantity:
    """Compile a lab expression, such as `data.qpos[0]` or `lib.sitePos('tip')[2]`, into a function of (model, data).

    Raises ContentError if it does not compile, ValueError if its value at the start is not a finite number.
    """
    program = compile_program(expression, "expression", "--quantity")

    def value(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        found = program.run(Machine(model, data))
        return float(found) if isinstance(found, int | float) and not isinstance(found, bool) else nan

    with scene.borrow(keep=False) as workspace:
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(workspace.model, workspace.data)
        at_start = value(workspace.model, workspace.data)
    if not isfinite(at_start):
        raise ValueError(f"{expression} is not a finite number at the start of the run")
    return value


@dataclass(frozen=True)
class Request:
    """A scene, a quantity (None: all positions), its tolerance, and the length of the run [s]."""

    scene: Scene
    quantity: Quantity | None
    tolerance: float
    seconds: float

    def select(self, integrators: list[Integrator]) -> Selection:
        """Select the cheapest setting of these integrators."""
        return select(
            self.scene,
            tolerance=self.tolerance,
            seconds=self.seconds,
            quantity=self.quantity,
            integrators=integrators,
        )

    def advise(self) -> Advice:
        """Follow the procedure. Raises ValueError as `check_question` does."""
        check_question(self.tolerance, self.seconds)
        integrators, steps = [IMPLICITFAST], [f"1. start: {START_WORDS}"]
        loss = loses_energy(self.scene)
        if loss is None:
            integrators.append(RK4)
            steps.append("2. energy is conserved: RK4 is tried, also at a quarter of the step (0.5 ms)")
        else:
            steps.append(f"2. RK4 is not tried, energy may not be conserved: {loss}")
        stiff = binding_stiffness(self.scene, self.seconds)
        if stiff is None:
            steps.append("3. discrete is not tried: implicitfast showed no instability up to 20 ms")
        else:
            integrators.append(DISCRETE)
            steps.append(f"3. discrete is tried: {stiff}")
        steps.append(f"4. the timestep is raised until the error exceeds {self.tolerance:g} within {self.seconds:g} s")
        found = self.select(integrators)
        rows = tuple(self.row(candidate, found) for candidate in found.candidates)
        remarks = (found.reason, unmoved(self), quarter_cost(rows), beyond(self, found, integrators))
        return Advice(rows, found.best, "\n".join(filter(None, remarks)), tuple(steps), skips_of(self.scene))

    def row(self, candidate: Candidate, found: Selection) -> Row:
        """Add the first warning, and CPU time for the start, its quarter step and the best candidate."""
        setting = (candidate.integrator, candidate.timestep_s)
        cpu = None
        if setting in (START, QUARTER) or candidate == found.best:
            cpu = cpu_ratio(self.scene, setting, self.seconds)
        passes = candidate.error + found.reference_error <= self.tolerance
        return Row(candidate, self.warning(candidate), candidate.cost * START[1], cpu, passes)

    def warning(self, candidate: Candidate) -> str | None:
        """The first warning of a run and its time, or None."""
        run = simulate(
            self.scene,
            seconds=self.seconds,
            timestep_s=candidate.timestep_s,
            integrator=candidate.integrator.code,
            every=100_000,
        )
        return None if run.warning is None else f"{run.warning.name} after {run.steps * run.timestep_s:.3g} s"


def loses_energy(scene: Scene) -> str | None:
    """A reason why energy may not be conserved, or None if the model has nothing that could change it."""
    for need in scene.needs:
        if need.needed and need.part in ("everything", "dampers", "fluid", "actuation", "constraints"):
            return need.reason
    return None


def binding_stiffness(scene: Scene, seconds: float) -> str | None:
    """Return why a timestep of the range is unstable under implicitfast, or None.

    Tries the linear stability limit at the equilibrium first, then looks for a warning. Instability at the shortest
    timestep does not count: it belongs to the equilibrium or the motion, not to the timestep.
    """
    if not scene.model.nhistory and equilibrium(scene) is not None:  # MuJoCo cannot linearise delays
        low_s, high_s = LIMIT_SPAN_S
        limit_s = spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=IMPLICITFAST.code)
        if limit_s is not None and low_s < limit_s <= max(TIMESTEPS_S):
            return f"implicitfast is unstable above its linear stability limit of {1e3 * limit_s:.3g} ms"
    for timestep_s in TIMESTEPS_S:
        run = simulate(scene, seconds=seconds, timestep_s=timestep_s, integrator=IMPLICITFAST.code, every=100_000)
        if run.warning is not None:
            if timestep_s == min(TIMESTEPS_S):
                return None
            return f"implicitfast at {1e3 * timestep_s:g} ms warned with {run.warning.name}"
    return None


def cpu_ratio(scene: Scene, setting: tuple[Integrator, float], seconds: float, rounds: int = 5) -> float:
    """CPU time of a setting over that of the start: minima over `rounds` runs each, taken alternately."""
    times: dict[tuple[Integrator, float], float] = {}
    for _ in range(rounds):
        for integrator, timestep_s in (START, setting):
            begin = time.thread_time()
            simulate(scene, seconds=seconds, timestep_s=timestep_s, integrator=integrator.code, every=100_000)
            spent = time.thread_time() - begin
            times[integrator, timestep_s] = min(spent, times.get((integrator, timestep_s), inf))
    return times[setting] / times[START]


def unmoved(request: Request) -> str | None:
    """A remark if the quantity is constant over the run, so that its error carries no information."""
    integrator, timestep_s = START
    run = simulate(request.scene, seconds=request.seconds, timestep_s=timestep_s, integrator=integrator.code, every=10)
    values = run.qpos if request.quantity is None else measure(request.scene, run, request.quantity)
    if run.diverged_at_step is not None or np.any(values != values[0]):
        return None
    what = "nothing moves" if request.quantity is None else "the quantity never changes"
    return f"{what}: an error of 0 carries no information"


def quarter_cost(rows: tuple[Row, ...]) -> str | None:
    """A remark on the CPU time of RK4 at a quarter of the step: four evaluations a step, four times as many steps."""
    quarter = next((r for r in rows if (r.candidate.integrator, r.candidate.timestep_s) == QUARTER), None)
    if quarter is None or quarter.cpu is None:
        return None
    return f"RK4 at a quarter of the step cost {quarter.cpu:.1f} times the start"


def beyond(request: "Request", found: Selection, tried: list[Integrator]) -> str | None:
    """A remark on a cheaper setting of an integrator that the procedure did not try."""
    if not found.candidates:
        return None
    others = [integrator for integrator in INTEGRATORS if integrator not in tried]
    best = request.select(others).best
    if best is None or (found.best is not None and best.cost >= found.best.cost):
        return None
    saved = "" if found.best is None else f", {found.best.cost / best.cost:.3g} times cheaper"
    return f"beyond the procedure, {named(best)} also passes, with an error of {best.error:.2g}{saved}"


def skips_of(scene: Scene) -> tuple[str, ...]:
    """Parts of the engine that the scene provably does not need, each with the reason."""
    return tuple(f"{need.part}: {need.reason}" for need in scene.needs if need.flag and not need.needed)


def _line(row: Row, chosen: bool) -> str:
    error = "diverged" if row.candidate.error == inf else f"{row.candidate.error:.1e}"
    cpu = "" if row.cpu is None else f"x{row.cpu:.2f}"
    mark = ">" if chosen else "+" if row.passes else " "
    return f"{mark} {named(row.candidate):20}{error:>10}{f'x{row.cost:g}':>8}{cpu:>8}  {row.warning or '0'}"
