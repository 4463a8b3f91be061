"""MJX on the CPU beside MuJoCo in C: the errors in single and double precision, and the CPU time of a step of one
trajectory in batches. JAX computes on threads of its own, so times are CPU times of the whole process. Needs the
packages of requirements-mjx.lock, in an environment of its own."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from time import process_time
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from grader.errors import Unprocessable
from grader.numerics.accuracy.convergence import measure_position_distance
from grader.numerics.accuracy.reference import solve_dop853
from grader.numerics.integrators import RK4
from grader.numerics.rollout import simulate
from grader.studies.bench.physics.peers import Array
from grader.studies.bench.physics.skip import Run
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import Measurement, Record, Records, Study, read_version, select_kind
from grader.studies.bench.timing import measure_pairs

SCENES = ("double_pendulum", "spinning_body")
BITS = (32, 64)
TIMESTEPS_S = (0.008, 0.004, 0.002, 0.001, 0.0005)
SAMPLE_S, SAMPLES = 0.032, 32
TIMES_S: Array = SAMPLE_S * np.arange(SAMPLES + 1, dtype=np.float64)
SIZES = (1, 128)
"""Trajectories of a batch."""

TIMED = SCENES[0]
"""The scene whose batches are timed; JAX compiles each for minutes."""

STEPS = 500
"""Steps of a timed run, those of `Run`, at 2 ms."""

BUDGET_S = {True: 0.1, False: 4.0}
"""CPU time of a comparison [s], by whether the run is quick."""


def load_mjx(bits: int) -> tuple[Any, Any]:
    """Returns JAX, set to a precision, and MJX. Raises Unprocessable where they are not installed."""
    if find_spec("jax") is None or find_spec("mujoco.mjx") is None:
        raise Unprocessable("the benchmark batches needs MJX: pip install -r requirements-mjx.lock")
    jax = import_module("jax")
    if jax.config.jax_enable_x64 != (bits == 64):
        jax.config.update("jax_enable_x64", bits == 64)
        jax.clear_caches()  # what was compiled for the other precision
    return jax, import_module("mujoco.mjx")


@cache
def build_stepping(name: str, bits: int) -> tuple[Any, Any, Callable[..., Any]]:
    """Returns MJX's model and data at the scene's start, and a function of model, data and a count that steps."""
    jax, mjx = load_mjx(bits)
    with load_scene(name).borrow(integrator=RK4.code, keep=False) as workspace:
        model, data = mjx.put_model(workspace.model), mjx.put_data(workspace.model, workspace.data)

    def advance(model: Any, data: Any, count: Any) -> Any:
        return jax.lax.fori_loop(0, count, lambda _step, state: mjx.step(model, state), data)

    return model, data, advance


@dataclass(frozen=True)
class Precision(Measurement):
    """MJX's RK4 on a scene, in numbers of so many bits."""

    timed = False
    scene: str
    bits: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures the largest position error at each timestep, beside that of MuJoCo in C."""
        jax, _ = load_mjx(self.bits)
        model, start, advance = build_stepping(self.scene, self.bits)
        compiled, scene = jax.jit(advance), load_scene(self.scene)
        truth, errors, ours = solve_dop853(scene, TIMES_S[1:]).qpos, [], []
        for timestep_s in TIMESTEPS_S[: 2 if quick else None]:
            stepped, data, rows = (
                model.replace(opt=model.opt.replace(timestep=jax.numpy.asarray(timestep_s))),
                start,
                [],
            )
            for _ in range(SAMPLES):
                data = compiled(stepped, data, round(SAMPLE_S / timestep_s))
                rows.append(np.asarray(data.qpos, dtype=np.float64))
            errors.append(measure_position_distance(scene, truth, np.array(rows)))
            run = simulate(
                scene, seconds=TIMES_S[-1], timestep_s=timestep_s, integrator=RK4.code, at_s=TIMES_S.tolist()
            )
            ours.append(measure_position_distance(scene, truth, run.qpos[1:]))
        return {"errors": errors, "mujoco": ours}


@dataclass(frozen=True)
class Batch(Measurement):
    """MJX's RK4 on many trajectories at once."""

    scene: str
    bits: int
    size: int

    def measure(self, quick: bool, done: Records) -> Record:
        """Measures the CPU time of a step of one trajectory over that of MuJoCo in C, in turns."""
        jax, _ = load_mjx(self.bits)
        model, start, advance = build_stepping(self.scene, self.bits)
        batch = jax.tree.map(lambda part: jax.numpy.stack([part] * self.size), start)
        compiled = jax.jit(jax.vmap(advance, in_axes=(None, 0, None)))

        def work() -> None:
            jax.block_until_ready(compiled(model, batch, STEPS))

        yardstick = Run(load_scene(self.scene), "RK4", chunk=STEPS)
        timed = asdict(measure_pairs(work, yardstick, BUDGET_S[quick], process_time))
        low, high = timed["interval"]
        return timed | {"ratio": timed["ratio"] / self.size, "interval": (low / self.size, high / self.size)}


def plan(quick: bool) -> Sequence[Measurement]:
    """Returns every scene in both precisions, then the batches of TIMED."""
    sizes = SIZES[: 1 if quick else None]
    precisions = [Precision(name, bits) for bits in BITS for name in SCENES]
    return [*precisions, *(Batch(TIMED, bits, size) for bits in BITS for size in sizes)]


def summarise(records: Records) -> Record:
    """Per scene and precision: the errors by timestep beside MuJoCo's, and the costs by size of the batch."""
    scenes: Record = {name: {str(bits): {} for bits in BITS} for name in SCENES}
    for key, record in select_kind(records, Precision).items():
        scenes[key.scene][str(key.bits)] |= {"errors": record["errors"], "mujoco": record["mujoco"], "batches": {}}
    for batch, record in select_kind(records, Batch).items():
        kept = {name: record[name] for name in ("ratio", "interval")}
        scenes[batch.scene][str(batch.bits)]["batches"][str(batch.size)] = kept
    return {
        "timesteps_s": TIMESTEPS_S,
        "packages": {name: read_version(name) for name in ("mujoco-mjx", "jax", "jaxlib")},
        "scenes": scenes,
    }


def draw(_records: Records, summary: Record) -> Figure:
    """Draws the errors over the timestep, and the costs over the size of the batch."""
    figure = Figure(figsize=(12, 4.4))
    left, right = figure.subplots(1, 2)
    for name, colour in zip(SCENES, ("#4477aa", "#ee6677"), strict=True):
        for bits, dash in zip(BITS, ("x:", "o-"), strict=True):
            record, label = summary["scenes"][name][str(bits)], f"{describe_scene(name)}, float{bits}"
            steps = [1e3 * h for h in TIMESTEPS_S[: len(record["errors"])]]
            left.plot(steps, record["errors"], dash, color=colour, label=label)
            sizes = [int(size) for size in record["batches"]]
            right.plot(sizes, [cost["ratio"] for cost in record["batches"].values()], dash, color=colour)
    left.set(xscale="log", yscale="log", xlabel="timestep [ms]", ylabel="largest position error [rad, m]")
    right.set(xscale="log", yscale="log", xlabel="trajectories of a batch", ylabel="CPU time over MuJoCo's in C")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure


STUDY = Study("batches", plan, summarise, {"batches": draw})
