"""The lesson's procedure for choosing integrator and timestep, as measurements on one's own model.

Start from implicitfast at 2 ms; try RK4 at a quarter of the step where energy is conserved, `discrete` where
stiffness binds; raise the timestep until the quantity is off by more than the tolerance; count warnings after every
run. Unlike the lesson, a change is measured against a reference solution, so the start itself has to pass too.
"""

import time
from dataclasses import dataclass
from math import inf, isfinite, nan
from pathlib import Path

import mujoco
import numpy as np

from grader.errors import LabError, Unprocessable
from grader.labs.expressions import compile_expression
from grader.labs.machine import Machine
from grader.numerics.linear import equilibrium
from grader.numerics.measures import measure
from grader.numerics.process import prepare
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.search import spectral_limit
from grader.numerics.selection import TIMESTEPS_S, Candidate, Quantity, Selection, check_question, named, select

IMPLICITFAST = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)
DISCRETE = int(mujoco.mjtIntegrator.mjINT_DISCRETE)

START = (IMPLICITFAST, 0.002)
START_WORDS = "implicitfast at 2 ms, as the documentation recommends for most models"
QUARTER = (RK4, 0.0005)

TOLERANCE = 1e-3
SECONDS = 2.0

LIMIT_SPAN_S = (1e-4, 0.5)
"""Where the limit for ever is sought."""


@dataclass(frozen=True)
class Row:
    """One run of the procedure: error against the reference (inf where it warned), cost in runs of the start."""

    candidate: Candidate
    warning: str | None
    cost: float
    cpu: float | None
    passes: bool


@dataclass(frozen=True)
class Advice:
    """The table, the choice (None where there is none, with the reason), and what may be skipped."""

    rows: tuple[Row, ...]
    choice: Candidate | None
    reason: str
    steps: tuple[str, ...]
    skips: tuple[str, ...]

    def __str__(self) -> str:
        """For a terminal: the steps of the procedure, the table, the choice, what is skipped and why."""
        lines = [*self.steps, "", f"{'':22}{'error':>10}{'cost':>8}{'CPU':>8}  warnings"]
        lines += [_line(row, row.candidate == self.choice) for row in self.rows]
        chosen = named(self.choice) if self.choice else "none"
        lines += ["", f"choice: {chosen}", self.reason, "", "skipped, proved to change no bit:"]
        return "\n".join(lines + [f"  {skip}" for skip in self.skips])


def advise(
    model: str | Path, quantity: str | None = None, tol: float | None = None, seconds: float | None = None
) -> Advice:
    """Measure a model and choose; the run begins at its first keyframe, or at qpos0 where there is none.

    `model` is MJCF text or the path of a file; `quantity` an expression of the labs, by default all positions; `tol`
    its largest error, in its own unit (default 1e-3); `seconds` the length of the run (default 2 s). Raises
    Unprocessable where the model or a number means nothing or the expression fails, ContentError where it is none.
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
    """Compile MJCF text, or a file with what it includes; begin at keyframe 0."""
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
    """A lab expression, such as `data.qpos[0]` or `lib.sitePos('tip')[2]`, as a function of (model, data).

    Raises ContentError where it cannot be compiled, ValueError where at the start it is no finite number.
    """
    program = compile_expression(expression, "expression", "--quantity")

    def value(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        found = program.run(Machine(model, data))
        return float(found) if isinstance(found, int | float) and not isinstance(found, bool) else nan

    with scene.borrow(keep=False) as workspace:
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(workspace.model, workspace.data)
        at_start = value(workspace.model, workspace.data)
    if not isfinite(at_start):
        raise ValueError(f"{expression} is no finite number at the start of the run")
    return value


@dataclass(frozen=True)
class Request:
    """What is asked: a scene, a quantity (None: all positions), its tolerance, and the length of the run [s]."""

    scene: Scene
    quantity: Quantity | None
    tolerance: float
    seconds: float

    def select(self, integrators: list[int]) -> Selection:
        """The cheapest setting of these integrators, with all their errors."""
        return select(
            self.scene,
            tolerance=self.tolerance,
            seconds=self.seconds,
            quantity=self.quantity,
            integrators=integrators,
        )

    def advise(self) -> Advice:
        """Walk the procedure. Raises ValueError for a tolerance or length that means nothing."""
        check_question(self.tolerance, self.seconds)
        integrators, steps = [IMPLICITFAST], [f"1. start: {START_WORDS}"]
        why_not = loses_energy(self.scene)
        if why_not is None:
            integrators.append(RK4)
            steps.append("2. energy is conserved: RK4 is tried, also at a quarter of the step (0.5 ms)")
        else:
            steps.append(f"2. RK4 is not tried, energy need not be conserved: {why_not}")
        stiff = binding_stiffness(self.scene, self.seconds)
        if stiff is None:
            steps.append("3. discrete is not tried: nothing shows that 20 ms are too long for implicitfast")
        else:
            integrators.append(DISCRETE)
            steps.append(f"3. discrete is tried: {stiff}")
        steps.append(f"4. the timestep is raised until the error passes {self.tolerance:g} within {self.seconds:g} s")
        found = self.select(integrators)
        rows = tuple(self.row(candidate, found) for candidate in found.candidates)
        remarks = (found.reason, unmoved(self), quarter_cost(rows), beyond(self, found, integrators))
        return Advice(rows, found.best, "\n".join(filter(None, remarks)), tuple(steps), skips_of(self.scene))

    def row(self, candidate: Candidate, found: Selection) -> Row:
        """A candidate with its warnings, counted in a run of its own, and CPU time where it matters."""
        setting = (candidate.integrator, candidate.timestep_s)
        cpu = None
        if setting in (START, QUARTER) or candidate == found.best:
            cpu = cpu_ratio(self.scene, setting, self.seconds)
        passes = candidate.error + found.reference_error <= self.tolerance
        return Row(candidate, self.warning(candidate), candidate.cost * START[1], cpu, passes)

    def warning(self, candidate: Candidate) -> str | None:
        """The first warning and its time; None for a clean run."""
        run = simulate(
            self.scene,
            seconds=self.seconds,
            timestep_s=candidate.timestep_s,
            integrator=candidate.integrator,
            every=100_000,
        )
        return None if run.warning is None else f"{run.warning.name} after {run.steps * run.timestep_s:.3g} s"


def loses_energy(scene: Scene) -> str | None:
    """Why energy need not be conserved, from what the scene provably lacks; None where it must be."""
    for need in scene.needs:
        if need.needed and need.part in ("everything", "dampers", "fluid", "actuation", "constraints"):
            return need.reason
    return None


def binding_stiffness(scene: Scene, seconds: float) -> str | None:
    """What shows that a step within the range is too long for implicitfast: the limit for ever, or a warning.

    What happens already at the shortest step is no fault of the step: the equilibrium or the motion is like that.
    """
    if not scene.model.nhistory and equilibrium(scene) is not None:  # MuJoCo cannot linearise delays
        low_s, high_s = LIMIT_SPAN_S
        limit_s = spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=IMPLICITFAST)
        if limit_s is not None and low_s < limit_s <= max(TIMESTEPS_S):
            return f"implicitfast is unstable for ever above {1e3 * limit_s:.3g} ms at the equilibrium"
    for timestep_s in TIMESTEPS_S:
        run = simulate(scene, seconds=seconds, timestep_s=timestep_s, integrator=IMPLICITFAST, every=100_000)
        if run.warning is not None:
            if timestep_s == min(TIMESTEPS_S):
                return None
            return f"implicitfast at {1e3 * timestep_s:g} ms warned with {run.warning.name}"
    return None


def cpu_ratio(scene: Scene, setting: tuple[int, float], seconds: float, rounds: int = 5) -> float:
    """CPU time of a setting over that of the start: the least of a few turns each, taken alternately."""
    times: dict[tuple[int, float], float] = {}
    for _ in range(rounds):
        for integrator, timestep_s in (START, setting):
            begin = time.thread_time()
            simulate(scene, seconds=seconds, timestep_s=timestep_s, integrator=integrator, every=100_000)
            spent = time.thread_time() - begin
            times[integrator, timestep_s] = min(spent, times.get((integrator, timestep_s), inf))
    return times[setting] / times[START]


def unmoved(request: Request) -> str | None:
    """That the quantity is the same number all along, so that no error of it says anything."""
    integrator, timestep_s = START
    run = simulate(request.scene, seconds=request.seconds, timestep_s=timestep_s, integrator=integrator, every=10)
    values = run.qpos if request.quantity is None else measure(request.scene, run, request.quantity)
    if run.diverged_at_step is not None or np.any(values != values[0]):
        return None
    what = "nothing moves" if request.quantity is None else "the quantity never changes"
    return f"{what}: an error of 0 says nothing"


def quarter_cost(rows: tuple[Row, ...]) -> str | None:
    """What RK4 at a quarter of the step really cost: four evaluations, four times as often."""
    quarter = next((r for r in rows if (r.candidate.integrator, r.candidate.timestep_s) == QUARTER), None)
    if quarter is None or quarter.cpu is None:
        return None
    return f"RK4 at a quarter of the step cost {quarter.cpu:.1f} times the start"


def beyond(request: "Request", found: Selection, tried: list[int]) -> str | None:
    """What the procedure did not try and would have been cheaper."""
    if not found.candidates:
        return None
    others = [int(kind) for kind in mujoco.mjtIntegrator.__members__.values() if int(kind) not in tried]
    best = request.select(others).best
    if best is None or (found.best is not None and best.cost >= found.best.cost):
        return None
    saved = "" if found.best is None else f", {found.best.cost / best.cost:.3g} times cheaper"
    return f"beyond the procedure, {named(best)} would do with an error of {best.error:.2g}{saved}"


def skips_of(scene: Scene) -> tuple[str, ...]:
    """Parts of the engine that the scene provably does not need, with the proof."""
    return tuple(f"{need.part}: {need.reason}" for need in scene.needs if need.flag and not need.needed)


def _line(row: Row, chosen: bool) -> str:
    error = "diverged" if row.candidate.error == inf else f"{row.candidate.error:.1e}"
    cpu = "" if row.cpu is None else f"x{row.cpu:.2f}"
    mark = ">" if chosen else "+" if row.passes else " "
    return f"{mark} {named(row.candidate):20}{error:>10}{f'x{row.cost:g}':>8}{cpu:>8}  {row.warning or '0'}"
