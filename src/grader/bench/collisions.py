"""Beyond smooth scenes: a fast ball and a thin wall, a box started inside the floor, a wheel and its stop.

Every run says what became of the scene, and what MuJoCo's warning and silent reset did to it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np

from grader.bench.journal import Record, Task
from grader.bench.scenes import load_scene
from grader.bench.settings_grid import INTEGRATORS
from grader.numerics.scene import Scene
from grader.numerics.stepping import first_warning
from grader.numerics.workspace import Workspace

WALL_NEAR, WALL_FAR = 0.495, 0.505
"""Faces of the wall [m]."""

BALL_RADIUS = 0.02
FLOOR_HALF = 0.1
"""Half the side of the box [m]: its height at rest."""

LAUNCHED = 2 * FLOOR_HALF
"""A box that was at rest inside the floor and whose centre then rises by its own side was thrown out."""


@dataclass(frozen=True)
class Case:
    """A family of runs over one parameter: how to start, how long, and how to name the end."""

    scene: str
    parameter: str
    unit: str
    span: tuple[float, float]
    timestep_span_s: tuple[float, float]
    start: Callable[[Scene, float], Scene]
    seconds: Callable[[float], float]
    outcome: Callable[["Trace"], str]
    outcomes: tuple[str, ...]


@dataclass
class Trace:
    """What one run went through, by step: coordinate, whether there was a contact or limit force; and the warning."""

    coordinate: list[float]
    touched: bool
    warning: str | None
    warned_at_s: float | None
    time_after_s: float | None
    qpos_after: list[float] | None


def ball_outcome(trace: Trace) -> str:
    """Where the ball ended: before the wall, beyond it with or without ever having touched it."""
    if trace.warning:
        return "warned"
    if trace.coordinate[-1] < WALL_FAR:
        return "stopped"
    return "pushed through" if trace.touched else "tunnelled"


def box_outcome(trace: Trace) -> str:
    """Whether the box settled, was thrown out, or fell through."""
    if trace.warning:
        return "warned"
    if max(trace.coordinate) > FLOOR_HALF + LAUNCHED:
        return "launched"
    return "settled" if trace.coordinate[-1] > FLOOR_HALF / 2 else "sunk"


def wheel_outcome(trace: Trace) -> str:
    """Whether the wheel bounced between its stops without ever gaining speed, or was kicked."""
    if trace.warning:
        return "warned"
    steps = np.abs(np.diff(trace.coordinate))
    return "kicked" if steps.max() > 1.05 * steps[0] else "stopped"


def ball_start(scene: Scene, speed: float) -> Scene:
    """At the origin, flying towards the wall at `speed` [m/s]."""
    return scene.at(qvel=[speed, 0, 0, 0, 0, 0])


def box_start(scene: Scene, depth: float) -> Scene:
    """At rest, its lower face `depth` [m] inside the floor."""
    return scene.at(qpos=[0, 0, FLOOR_HALF - depth, 1, 0, 0, 0])


def wheel_start(scene: Scene, speed: float) -> Scene:
    """At 0 rad, turning towards its stop at `speed` [rad/s]."""
    return scene.at(qvel=[speed])


CASES = {
    "ball": Case(
        "ball_and_wall",
        "speed",
        "m/s",
        (1, 100),
        (1e-4, 2e-2),
        ball_start,
        lambda speed: 1 / speed,
        ball_outcome,
        ("stopped", "pushed through", "tunnelled", "warned"),
    ),
    "box": Case(
        "box_in_floor",
        "depth",
        "m",
        (0.001, 0.09),
        (2e-4, 4e-2),
        box_start,
        lambda _depth: 1.0,
        box_outcome,
        ("settled", "launched", "sunk", "warned"),
    ),
    "wheel": Case(
        "joint_stop",
        "speed",
        "rad/s",
        (0.5, 200),
        (2e-4, 4e-2),
        wheel_start,
        lambda speed: 1.5 / speed + 0.1,
        wheel_outcome,
        ("stopped", "kicked", "warned"),
    ),
}

COORDINATE = {"ball": 0, "box": 2, "wheel": 0}
STEPS_MIN = 40


def follow(scene: Scene, case: str, integrator: int, timestep_s: float, seconds: float) -> Trace:
    """Step by step until the end, or the first warning and the reset that comes with it."""
    steps = max(STEPS_MIN, round(seconds / timestep_s))
    with scene.borrow(timestep_s=timestep_s, integrator=integrator) as workspace:
        return _follow(workspace, COORDINATE[case], steps)


def _follow(workspace: Workspace, address: int, steps: int) -> Trace:
    model, data = workspace.model, workspace.data
    coordinate, touched = [float(data.qpos[address])], False
    for _ in range(steps):
        before = float(data.time)
        mujoco.mj_step(model, data)
        if workspace.counts.any():
            warning = first_warning(workspace)
            assert warning is not None
            return Trace(coordinate, touched, warning.name, before, float(data.time), data.qpos.round(6).tolist())
        touched = touched or data.nefc > 0
        coordinate.append(float(data.qpos[address]))
    return Trace(coordinate, touched, None, None, None, None)


def case_task(name: str, integrator: str, size: int) -> Task:
    """Outcomes over a size x size grid of (timestep, parameter), and the first warned run in full."""
    case = CASES[name]

    def measure() -> Record:
        scene, code = load_scene(case.scene), INTEGRATORS[integrator]
        starts = [(float(v), case.start(scene, float(v))) for v in np.geomspace(*case.span, size)]
        rows, reset = [], None
        for timestep_s in np.geomspace(*case.timestep_span_s, size):
            row = ""
            for value, start in starts:
                trace = follow(start, name, code, float(timestep_s), case.seconds(value))
                row += str(case.outcomes.index(case.outcome(trace)))
                if trace.warning and reset is None:
                    reset = {"timestep_s": float(timestep_s), "parameter": value} | reset_of(trace)
            rows.append(row)
        return {"outcomes": rows, "names": list(case.outcomes), "reset": reset}

    return Task(f"case/{name}/{integrator}", measure)


def reset_of(trace: Trace) -> Record:
    """What a warning did: which, when, and the time and state that the user's loop reads next."""
    return {
        "warning": trace.warning,
        "warned_at_s": trace.warned_at_s,
        "time_after_s": trace.time_after_s,
        "qpos_after": trace.qpos_after,
    }


def collision_tasks(quick: bool) -> list[Task]:
    """Three cases under five integrators."""
    size = 13 if quick else 33
    return [case_task(name, integrator, size) for name in CASES for integrator in INTEGRATORS]
