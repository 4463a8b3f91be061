"""Choose integrator and timestep for a model by the lesson's procedure, with measurements.

The procedure starts from implicitfast at 2 ms, tries RK4 at a quarter of the step where energy is conserved and
`discrete` where stiffness limits the timestep, raises the timestep until the error of the quantity exceeds the
tolerance, and checks warnings after every run. Here it is where the search begins, not where it ends: all five
integrators are measured against a reference solution, and the cheapest that meets the tolerance is chosen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan
from pathlib import Path

import mujoco
import numpy as np

from grader.errors import LabError, Unprocessable
from grader.expressions import Machine, compile_program
from grader.numerics.integrators import IMPLICITFAST
from grader.numerics.process import prepare
from grader.numerics.scene import Scene, Values
from grader.numerics.stability.equilibrium import find_equilibrium
from grader.numerics.stability.limit import find_spectral_limit
from grader.numerics.visuals import compile_untextured
from grader.studies.advise.meter import Quantity
from grader.studies.advise.references import Say
from grader.studies.advise.selection import (
    QUARTER,
    START,
    TIMESTEPS_S,
    Candidate,
    QuantityStill,
    Selection,
    describe_error,
    describe_setting,
    select,
    write_error,
)

TOLERANCE = 1e-3
SECONDS = 2.0
BUDGET_S = 60.0

PERTURBATION_SEED = 0

LIMIT_SPAN_S = (1e-4, 0.5)
"""Timesteps [s] between which the linear stability limit is sought."""

CURE = "start it in motion with --key, --qpos, --qvel, --ctrl or --perturb, or give a smaller --tol"


@dataclass(frozen=True)
class RunStart:
    """The start of the run: a keyframe by name or index, parts of the state that replace its own, and a perturbation.
    Without a keyframe it is keyframe 0 if there is one, else qpos0. `perturb` [rad/s, m/s] adds to every velocity a
    number drawn from [-perturb, perturb] with a fixed seed."""

    key: int | str | None = None
    qpos: Values | None = None
    qvel: Values | None = None
    ctrl: Values | None = None
    perturb: float = 0.0

    def apply_to(self, scene: Scene) -> Scene:
        """The scene at this start. Raises Unprocessable for an unknown keyframe, or a part of the wrong length."""
        key = 0 if self.key is None and scene.model.nkey else self.key
        try:
            scene = scene.at(key=key, qpos=self.qpos, qvel=self.qvel, ctrl=self.ctrl)
        except (KeyError, ValueError) as error:
            raise Unprocessable(str(error.args[0])) from error
        if not 0 <= self.perturb < inf:
            raise Unprocessable(f"--perturb must be 0 or more and finite, not {self.perturb:g}")
        drawn = np.random.default_rng(PERTURBATION_SEED).uniform(-1, 1, scene.model.nv)
        return scene.at(qvel=scene.start.qvel + self.perturb * drawn) if self.perturb else scene


@dataclass(frozen=True)
class Advice:
    """The selection, the steps of the procedure with what they found, and the parts that may be skipped."""

    selection: Selection
    steps: tuple[str, ...]
    skips: tuple[str, ...]

    @property
    def choice(self) -> Candidate | None:
        """The chosen setting; None if none passes, or if it cannot be told."""
        return self.selection.best

    def __str__(self) -> str:
        """Returns the advice as text for a terminal."""
        lines = [*self.steps, *self.table(), "", f"choice: {self.describe_choice()}"]
        lines += [self.selection.reason, *([better] if (better := self.own_setting()) else [])]
        if self.skips:
            lines += ["", "skipped, proved to change no bit of the result:", *(f"  {skip}" for skip in self.skips)]
        return "\n".join(lines)

    def describe_choice(self) -> str:
        """Returns the chosen setting with the time until which it holds, or `none`."""
        until_s = self.selection.until_s
        part = "" if until_s is None else f", until {until_s:g} s"
        return "none" if self.choice is None else describe_setting(self.choice) + part

    def table(self) -> list[str]:
        """Returns a line for each measured setting, the cheapest first, with a key to its marks."""
        if not self.selection.candidates:
            return []
        start = next(c for c in self.selection.candidates if c.setting == START)
        names = [self.name(c) for c in self.selection.candidates]
        width, doubt = max(map(len, names)) + 2, self.selection.reference_error
        lines = ["", f"  {'':{width}}{'error':>10}{'cost':>10}{'CPU':>10}  warning"]
        for name, candidate in zip(names, self.selection.candidates, strict=True):
            error = "diverged" if candidate.error == inf else write_error(candidate.error, doubt, ".1e", "< ")
            cost = f"x{candidate.cost / start.cost:.3g}"
            cpu = f"x{candidate.cpu / start.cpu:.2f}" if start.cpu else ""
            mark = ">" if candidate == self.choice else "*" if candidate in self.selection.front else " "
            lines.append(f"{mark} {name:{width}}{error:>10}{cost:>10}{cpu:>10}  {candidate.warning or 'none'}")
        lines.append("> the choice   * no other setting is both cheaper and more accurate")
        lines.append(f"error: the largest, {self.describe_samples()}")
        if any(candidate.error < doubt for candidate in self.selection.candidates):
            lines.append(f"<: no larger than this, as the reference is uncertain by {doubt:.2g}")
        if any(candidate.confirms for candidate in self.selection.candidates):
            lines.append("(confirms): measured to confirm the smallest timestep, and no choice")
        lines.append(
            "cost: evaluations of the forward dynamics, CPU: time of one run, both relative to "
            f"{describe_setting(start)}"
        )
        return lines

    def name(self, candidate: Candidate) -> str:
        """Returns the setting in words; the model's own and one that is no choice are marked."""
        mark = " (the model's own)" if candidate == self.selection.own else " (confirms)" if candidate.confirms else ""
        return describe_setting(candidate) + mark

    def describe_samples(self) -> str:
        """Returns at which times runs are compared with the reference."""
        return f"compared every {1e3 * self.selection.interval_s:g} ms; what is faster than that may be missed"

    def own_setting(self) -> str | None:
        """What the choice saves over the model's own setting, or what it costs."""
        own, best = self.selection.own, self.choice
        if own is None or best is None or best == own:
            return None
        doubt = self.selection.reference_error
        error = "diverges" if own.error == inf else f"has {describe_error(own.error, doubt)}"
        ratio = own.cost / best.cost
        saves = f"costs {ratio:.3g} times as much" if ratio >= 1 else f"costs {1 / ratio:.3g} times less"
        return f"the model's own setting, {describe_setting(own)}, {error} and {saves}"


def advise(
    model: str | Path, quantity: str | None = None, tol: float | None = None, seconds: float | None = None, *,
    start: RunStart | None = None, budget_s: float = BUDGET_S, progress: Say = lambda _: None,
) -> Advice:  # fmt: skip
    """Measure a model and choose integrator and timestep.

    `model` is MJCF text or the path of a file; `quantity` an expression of the labs, by default all positions; `tol`
    its largest error, in its own unit (default 1e-3); `seconds` the length of the run (default 2 s); `budget_s` the
    wall time after which it chooses the best setting measured so far. `progress` gets a line before each measurement.

    Raises Unprocessable for a model, tolerance, start or length that cannot be used, for an expression that fails, and
    where nothing moves by more than the tolerance; ContentError for an expression that does not compile.
    """
    if not budget_s >= 0:
        raise Unprocessable(f"--budget must be 0 s or more, not {budget_s:g}")
    try:
        scene = build_scene(model, start or RunStart())
        selection = select(
            scene,
            tolerance=TOLERANCE if tol is None else tol,
            seconds=SECONDS if seconds is None else seconds,
            quantity=None if quantity is None else compile_quantity(quantity, scene),
            budget_s=budget_s,
            progress=progress,
        )
        skips = (f"{need.part}: {need.reason}" for need in scene.needs if need.flag and not need.needed)
        return Advice(selection, describe_steps(scene, selection), tuple(skips))
    except QuantityStill as error:
        raise Unprocessable(f"{error}: {CURE}") from error
    except (ValueError, RuntimeError, LabError) as error:
        raise Unprocessable(str(error)) from error
    except mujoco.FatalError as error:
        raise Unprocessable(f"MuJoCo gave up on this model: {error}") from error


def build_scene(model: str | Path, start: RunStart) -> Scene:
    """Compile MJCF text or a file, and set its start. Raises ValueError if it does not compile."""
    prepare()
    text = isinstance(model, str) and "<mujoco" in model
    if not text and not Path(model).is_file():
        raise ValueError(f"there is no model {model}")
    return start.apply_to(Scene.from_model(compile_untextured(model if text else Path(model))))


def compile_quantity(expression: str, scene: Scene) -> Quantity:
    """Compile a lab expression, such as `data.qpos[0]` or `lib.sitePos('tip')[2]`, into a function of (model, data).
    Raises ContentError if it does not compile, ValueError if its value at the start is not a finite number."""
    program = compile_program(expression, "expression", "--quantity")

    def evaluate(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        value = program.run(Machine(model, data))
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else nan

    with scene.borrow(keep=False) as workspace:
        workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        mujoco.mj_forward(workspace.model, workspace.data)
        at_start = evaluate(workspace.model, workspace.data)
    if not isfinite(at_start):
        raise ValueError(f"{expression} is not a finite number at the start of the run")
    return evaluate


def describe_steps(scene: Scene, selection: Selection) -> tuple[str, ...]:
    """Returns the steps of the lesson's procedure, each with what the measurements say."""
    measured = {c.setting: c for c in selection.candidates}
    first, quarter = (_describe_error(measured.get(s), selection.reference_error) for s in (START, QUARTER))
    loss = find_energy_loss(scene)
    conserved = "energy is conserved" if loss is None else f"energy may not be conserved ({loss})"
    stiff = find_binding_stiffness(scene, selection.candidates)
    return (
        f"1. start from {START[0].name} at {1e3 * START[1]:g} ms{first}",
        f"2. {conserved}; {QUARTER[0].name} at a quarter of the step{quarter}",
        f"3. {stiff}: discrete may take larger steps" if stiff else "3. no stiffness limits the timestep up to 20 ms",
        "4. every integrator: from the largest timestep down to one that passes",
    )


def _describe_error(candidate: Candidate | None, doubt: float) -> str:
    if candidate is None:
        return ""
    return ": it diverges" if candidate.error == inf else f": its error is {write_error(candidate.error, doubt)}"


def find_energy_loss(scene: Scene) -> str | None:
    """Returns a reason why energy may not be conserved, or None if the model has nothing that could change it."""
    for need in scene.needs:
        if need.needed and need.part in ("everything", "dampers", "fluid", "actuation", "constraints"):
            return need.reason
    return None


def find_binding_stiffness(scene: Scene, candidates: Sequence[Candidate]) -> str | None:
    """Return why a timestep of the range is unstable under implicitfast, or None. Reads the linear stability limit at
    the equilibrium of a scene without constraints first, then the warnings of the measured runs. Instability at the
    shortest timestep belongs to the equilibrium or the motion, and does not count."""
    constrained = any(need.needed and need.part == "constraints" for need in scene.needs)
    if not (constrained or scene.model.nhistory) and find_equilibrium(scene) is not None:
        low_s, high_s = LIMIT_SPAN_S
        limit_s = find_spectral_limit(scene, low_s=low_s, high_s=high_s, integrator=IMPLICITFAST.code)
        if limit_s is not None and low_s < limit_s <= max(TIMESTEPS_S):
            return f"implicitfast is unstable above its linear stability limit of {1e3 * limit_s:.3g} ms"
    own = [c for c in candidates if c.integrator is IMPLICITFAST]
    warned = min((c for c in own if c.warning), key=lambda c: c.timestep_s, default=None)
    if warned is None or warned.timestep_s == min(c.timestep_s for c in own):
        return None
    return f"{describe_setting(warned)} warned: {warned.warning}"
