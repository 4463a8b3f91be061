"""Beyond smooth scenes: a fast ball and a thin wall, a box started inside the floor, a wheel and its stop. Each run is
classified by its outcome; the first one that warned is kept with what MuJoCo's reset did to it."""

from collections.abc import Callable
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from grader.numerics.integrators import BY_NAME
from grader.numerics.scene import Scene
from grader.numerics.stepping import find_first_warning
from grader.studies.bench.physics.grid import Plane, to_grid, to_rows
from grader.studies.bench.scenes import describe_scene, load_scene
from grader.studies.bench.study import Measurement, Record, Records

WALL_FAR = 0.505
"""Position of the wall's far face [m]."""

FLOOR_HALF = 0.1
"""Half the side of the box [m]: its height at rest."""

LAUNCHED = 2 * FLOOR_HALF
"""A box that was at rest inside the floor and whose centre then rises by its own side was thrown out."""

STEPS_MIN = 40
WARNED = "warned"

FINE, PUSHED, LOST, RESET = "#e8f1e4", "#ffcf56", "#d9827a", "#7b3fa0"


@dataclass
class Trace:
    """One run up to its end or its first warning: the coordinate by step, and whether a constraint force acted. `reset`
    says which warning, and what time [s] and qpos the user's loop reads after it."""

    coordinate: list[float]
    touched: bool = False
    reset: Record | None = None


@dataclass(frozen=True, kw_only=True)
class Case(Plane):
    """Runs over one parameter: how to start, how long [s], which coordinate of qpos decides, and what it may show.
    `outcomes` gives the colour of each possible outcome."""

    coordinate: int
    start: Callable[[Scene, float], Scene]
    seconds: Callable[[float], float]
    judge: Callable[[Trace], str]
    outcomes: dict[str, str]

    def outcome(self, trace: Trace) -> str:
        """Returns the word for how a run ended."""
        return WARNED if trace.reset else self.judge(trace)

    def follow(self, start: Scene, value: float, integrator: str, timestep_s: float) -> Trace:
        """Step from `start` until the end, or the first warning and the reset that comes with it."""
        steps = max(STEPS_MIN, round(self.seconds(value) / timestep_s))
        with start.borrow(timestep_s=timestep_s, integrator=BY_NAME[integrator].code) as workspace:
            model, data = workspace.model, workspace.data
            trace = Trace([float(data.qpos[self.coordinate])])
            for _ in range(steps):
                before_s = float(data.time)
                mujoco.mj_step(model, data)
                warning = find_first_warning(workspace)
                if warning is not None:
                    after: Record = {"time_after_s": float(data.time), "qpos_after": data.qpos.round(6).tolist()}
                    trace.reset = {"warning": warning.name, "warned_at_s": before_s} | after
                    break
                trace.touched = trace.touched or data.nefc > 0
                trace.coordinate.append(float(data.qpos[self.coordinate]))
        return trace


def judge_ball(trace: Trace) -> str:
    """Where the ball ended: before the wall, or beyond it with or without having touched it."""
    if trace.coordinate[-1] < WALL_FAR:
        return "stopped"
    return "pushed through" if trace.touched else "tunnelled"


def judge_box(trace: Trace) -> str:
    """Whether the box settled, was thrown out, or fell through."""
    if max(trace.coordinate) > FLOOR_HALF + LAUNCHED:
        return "launched"
    return "settled" if trace.coordinate[-1] > FLOOR_HALF / 2 else "sunk"


def judge_wheel(trace: Trace) -> str:
    """Whether the wheel bounced between its stops without gaining speed, or was kicked."""
    steps = np.abs(np.diff(trace.coordinate))
    return "kicked" if steps.max() > 1.05 * steps[0] else "stopped"


CASES = {
    "ball": Case(
        scene="ball_and_wall", parameter="speed [m/s]", span=(1, 100), timestep_span_s=(1e-4, 2e-2), coordinate=0,
        start=lambda scene, speed: scene.at(qvel=[speed, 0, 0, 0, 0, 0]), seconds=lambda speed: 1 / speed,
        judge=judge_ball, outcomes={"stopped": FINE, "pushed through": PUSHED, "tunnelled": LOST, WARNED: RESET},
    ),
    "box": Case(
        scene="box_in_floor", parameter="depth [m]", span=(0.001, 0.09), timestep_span_s=(2e-4, 4e-2), coordinate=2,
        start=lambda scene, depth: scene.at(qpos=[0, 0, FLOOR_HALF - depth, 1, 0, 0, 0]), seconds=lambda _depth: 1.0,
        judge=judge_box, outcomes={"settled": FINE, "launched": PUSHED, "sunk": LOST, WARNED: RESET},
    ),
    "wheel": Case(
        scene="joint_stop", parameter="speed [rad/s]", span=(0.5, 200), timestep_span_s=(2e-4, 4e-2), coordinate=0,
        start=lambda scene, speed: scene.at(qvel=[speed]), seconds=lambda speed: 1.5 / speed + 0.1,
        judge=judge_wheel, outcomes={"stopped": FINE, "kicked": PUSHED, WARNED: RESET},
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Collision(Measurement):
    """The outcomes of one case over a size x size grid of (timestep, parameter), and the first run that warned."""

    timed = False
    case: str
    integrator: str

    def measure(self, quick: bool, done: Records) -> Record:
        """Follow a run at every point."""
        case, reset = CASES[self.case], None
        scene, outcomes = load_scene(case.scene), list(case.outcomes)
        timesteps_s, values = case.ticks(13 if quick else 33)
        starts = [(value, case.start(scene, value)) for value in values]
        grid: list[list[int]] = []
        for timestep_s in timesteps_s:
            grid.append([])
            for value, start in starts:
                trace = case.follow(start, value, self.integrator, timestep_s)
                grid[-1].append(outcomes.index(case.outcome(trace)))
                if trace.reset and reset is None:
                    reset = {"timestep_s": timestep_s, "parameter": value} | trace.reset
        return {"outcomes": to_rows(grid), "names": outcomes, "reset": reset}


def summarise_case(records: Records, case: str) -> Record:
    """Shares of the outcomes under each integrator, and what the first warned run went through."""
    summaries = {}
    for integrator in BY_NAME:
        record = records[Collision(case, integrator)]
        grid = to_grid(record["outcomes"])
        shares = {name: float((grid == number).mean()) for number, name in enumerate(record["names"])}
        summaries[integrator] = {"shares": shares, "reset": record["reset"]}
    return summaries


def draw_cases(records: Records, _summary: Record) -> Figure:
    """Draws three cases by five integrators."""
    figure = Figure(figsize=(15, 9))
    panels = figure.subplots(len(CASES), len(BY_NAME))
    for line, (name, case) in zip(panels, CASES.items(), strict=True):
        for axes, integrator in zip(line, BY_NAME, strict=True):
            case.draw(axes, to_grid(records[Collision(name, integrator)]["outcomes"]), case.outcomes.values())
            axes.set_title(f"{describe_scene(case.scene)}: {integrator}")
        line[0].set_ylabel("h [ms]")
        handles = [Patch(color=colour, label=outcome) for outcome, colour in case.outcomes.items()]
        line[-1].legend(handles=handles, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
    return figure
