"""What a position error leaves out: the errors of velocities, of the energy where motion, gravity and springs alone
store it, and of how far constraints are violated, each against the same reference."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import mujoco
import numpy as np
from matplotlib.figure import Figure

from grader.numerics.accuracy.convergence import fit_order, measure_position_distance
from grader.numerics.accuracy.reference import Method, build_rate, solve
from grader.numerics.integrators import BY_NAME, EULER
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.studies.bench.physics.peers import Array, make_exact
from grader.studies.bench.physics.precision import HORIZON_S, SAMPLE_TIMES_S, TIMESTEPS_S
from grader.studies.bench.physics.precision import SCENES as PRECISION
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import COLOURS, Measurement, Record, Records, Study, select_kind

SCENES = (*PRECISION, "closed_loop")
QUANTITIES = {"position": "rad, m", "velocity": "rad/s, m/s", "energy": "J", "violation": "rad, m"}
"""Each quantity and its unit."""

BEST: tuple[Method, float] = ("DOP853", 5e-14)
OTHER: dict[bool, tuple[Method, float]] = {False: ("DOP853", 5e-13), True: ("LSODA", 1e-12)}
"""Method and tolerance of the reference, and, by whether constraints may act, of what its own error is measured
against."""

LARGEST_FITTED_S = 0.004
"""Orders are fitted through errors at this timestep [s] and smaller ones."""

NOISE_FACTOR = 10
"""Errors below this many times the reference's own error say nothing about the order."""

DRAWN = ("double_pendulum", "spinning_body", "joint_limits", "cube", "closed_loop")
"""Scenes of the picture: between them they have every quantity."""


def list_quantities(scene: Scene) -> list[str]:
    """Returns the quantities that mean something on a scene: an energy without actuators and constraints, which store
    and add some of their own; a violation where constraints may act."""
    needed = {need.part for need in scene.needs if need.needed}
    quantities = ["position", "velocity"]
    if not needed & {"actuation", "constraints"}:
        quantities.append("energy")
    if "constraints" in needed:
        quantities.append("violation")
    return quantities


def solve_states(scene: Scene, method: Method, tolerance: float) -> Array:
    """Returns qpos and qvel at SAMPLE_TIMES_S by an adaptive solver, the constraint solver made exact."""
    with make_exact(scene).borrow(integrator=EULER.code, keep=False, skip=True) as workspace:
        model, data = workspace.model, workspace.data
        start = np.concatenate([data.qpos, data.qvel, data.act])
        rate, times = build_rate(workspace), SAMPLE_TIMES_S[1:]
        values = solve(rate, start, times, rtol=tolerance, atol=tolerance / 10, method=method)
    return np.vstack([start, values])[:, : model.nq + model.nv]


def read_energy_and_violation(scene: Scene, states: Array) -> tuple[Array, Array]:
    """Returns at each state, (n, nq + nv), the energy [J] and the largest violation of a constraint [rad, m]: how far a
    limit is exceeded, a contact penetrates or an equality is open; 0 where none is violated."""
    energies, violations = [], []
    with scene.borrow(integrator=EULER.code, keep=False, skip=False) as workspace:
        model, data = workspace.model, workspace.data
        model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
        for state in states:
            data.qpos[:], data.qvel[:] = state[: model.nq], state[model.nq :]
            mujoco.mj_forward(model, data)
            energies.append(float(data.energy.sum()))
            equal = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
            depths = np.where(equal, np.abs(data.efc_pos), -data.efc_pos)
            violations.append(float(depths.max(initial=0.0)))
    return np.array(energies), np.array(violations)


def measure_errors(scene: Scene, truth: Array, states: Array) -> Record:
    """Returns the largest difference at any sample in each quantity of the scene between two runs, (n, nq + nv)."""
    nq = int(scene.model.nq)
    energies, violations = zip(*(read_energy_and_violation(scene, array) for array in (truth, states)), strict=True)
    errors = {
        "position": measure_position_distance(scene, truth[:, :nq], states[:, :nq]),
        "velocity": float(np.abs(truth[:, nq:] - states[:, nq:]).max()),
        "energy": float(np.abs(energies[0] - energies[1]).max()),
        "violation": float(np.abs(violations[0] - violations[1]).max()),
    }
    return {name: errors[name] for name in list_quantities(scene)}


@dataclass(frozen=True)
class Truth(Measurement):
    """The reference of a scene."""

    timed = False
    scene: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Solves twice; the own errors are their distance. Reads the largest violation of the solution."""
        scene, (best, other) = load_scene(self.scene), solve_both(self.scene)
        _, violations = read_energy_and_violation(scene, best)
        return {"own_errors": measure_errors(scene, best, other), "largest_violation": float(violations.max())}


@cache
def solve_both(name: str) -> tuple[Array, Array]:
    """Returns the solutions of a scene by BEST and by OTHER."""
    scene = load_scene(name)
    best, other = (solve_states(scene, *setting) for setting in (BEST, OTHER["violation" in list_quantities(scene)]))
    return best, other


@dataclass(frozen=True)
class Runs(Measurement):
    """A scene under an integrator at all timesteps."""

    timed = False
    scene: str
    integrator: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Returns the errors by quantity and timestep, None where MuJoCo warned, and a digest of each run's bits."""
        scene, (truth, _) = load_scene(self.scene), solve_both(self.scene)
        errors: Record = {name: [] for name in list_quantities(scene)}
        digests = []
        for timestep_s in TIMESTEPS_S[: 4 if quick else None]:
            run = simulate(
                scene, seconds=HORIZON_S, timestep_s=timestep_s, integrator=BY_NAME[self.integrator].code,
                at_s=SAMPLE_TIMES_S.tolist(),
            )  # fmt: skip
            digests.append(hashlib.sha256(run.states.tobytes()).hexdigest()[:12])
            warned = run.diverged_at_step is not None
            run_errors = {} if warned else measure_errors(scene, truth, np.hstack([run.qpos, run.qvel]))
            for name, own in errors.items():
                own.append(run_errors.get(name))
        return {"errors": errors, "digests": digests}


def plan(_quick: bool) -> Sequence[Measurement]:
    """Returns every reference, then every integrator on every scene."""
    return [*map(Truth, SCENES), *(Runs(name, kind) for name in SCENES for kind in BY_NAME)]


def summarise(records: Records) -> Record:
    """Per scene: the reference's own errors, and by integrator the errors of each quantity, orders and digests."""
    return {
        "horizon_s": HORIZON_S,
        "timesteps_s": TIMESTEPS_S,
        "scenes": {name: summarise_scene(records, name) for name in SCENES},
    }


def summarise_scene(records: Records, scene: str) -> Record:
    """Everything that the table and the sentences need about one scene."""
    truth = records[Truth(scene)]
    runs = {key.integrator: record for key, record in select_kind(records, Runs).items() if key.scene == scene}
    return {
        "own_errors": truth["own_errors"],
        "largest_violation": truth["largest_violation"],
        "errors": {kind: run["errors"] for kind, run in runs.items()},
        "orders": {
            kind: {name: summarise_order(own, truth["own_errors"][name]) for name, own in run["errors"].items()}
            for kind, run in runs.items()
        },
        "digests": {kind: run["digests"] for kind, run in runs.items()},
    }


def summarise_order(errors: Sequence[float | None], own_error: float) -> Record | None:
    """Returns the order with its 95 % interval through the errors above NOISE_FACTOR times the reference's own, from
    LARGEST_FITTED_S down; None for fewer than three."""
    least, settings = NOISE_FACTOR * max(own_error, 1e-15), zip(TIMESTEPS_S, errors, strict=False)
    used = [(h, e) for h, e in settings if h <= LARGEST_FITTED_S and e is not None and e > least]
    if len(used) < 3:
        return None
    fit = fit_order(*zip(*used, strict=True))
    return {"order": fit.order, "interval": [fit.low, fit.high]}


def draw(_records: Records, summary: Record) -> Figure:
    """Draws each quantity's error over the timestep, a row a quantity, a column a scene."""
    figure = Figure(figsize=(14, 9))
    rows = [name for name in QUANTITIES if name != "position"]
    for row, panels in zip(rows, figure.subplots(len(rows), len(DRAWN)), strict=True):
        for axes, name in zip(panels, DRAWN, strict=True):
            scene = summary["scenes"][name]
            if row not in scene["own_errors"]:
                axes.axis("off")
                continue
            for kind, errors in scene["errors"].items():
                for quantity, dash in ((row, "o-"), ("position", ":")):
                    values = np.array(errors[quantity], dtype=float)
                    steps = [1e3 * h for h in TIMESTEPS_S[: len(values)]]
                    label = kind if quantity == row else "position (dotted)"
                    axes.plot(steps, values, dash, color=COLOURS[kind], ms=3, lw=1, label=label)
            axes.set(xscale="log", yscale="log", title=f"{describe_scene(name)}: {row} [{QUANTITIES[row]}]")
            axes.set_xlabel("timestep [ms]")
    handles = dict(zip(*reversed(figure.axes[0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=6, frameon=False)
    return figure


STUDY = Study("quantities", plan, summarise, {"quantities": draw})
