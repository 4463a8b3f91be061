"""What several tests measure of runs."""

from collections.abc import Sequence

import mujoco

from grader.numerics.accuracy.convergence import Distance, measure_distance
from grader.numerics.accuracy.reference import Reference
from grader.numerics.rollout import Rollout, simulate
from grader.numerics.scene import Scene, Vector
from grader.numerics.stepping import Stepper
from grader.studies.advise.measures import measure_quantity


def energy(scene: Scene, rollout: Rollout) -> Vector:
    """Potential plus kinetic energy at every kept state [J], (n,), with the start's controls."""

    def total(model: mujoco.MjModel, data: mujoco.MjData) -> float:
        mujoco.mj_energyPos(model, data)
        mujoco.mj_energyVel(model, data)
        return float(data.energy[0] + data.energy[1])

    return measure_quantity(scene, rollout, total)


def errors(
    scene: Scene,
    reference: Reference,
    timesteps_s: Sequence[float],
    *,
    integrator: int | None = None,
    stepper: Stepper | None = None,
) -> list[Distance]:
    """Distance to `reference` at its times, at each timestep [s], each of which must divide those times."""
    times = reference.time - scene.start.time_s
    runs = (
        simulate(scene, seconds=float(times[-1]), timestep_s=h, integrator=integrator, at_s=times, stepper=stepper)
        for h in timesteps_s
    )
    return [measure_distance(scene, run, reference) for run in runs]
