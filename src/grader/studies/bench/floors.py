"""A fast check that no speed was lost: ratios of CPU time, each with a floor, so that any machine can run it.

A ratio is the shortest time of one work over the shortest of the other, measured in turns: beside eight processes that
spin on two cores it stays within a few percent of a quiet machine's. One sample of the first work at a higher clock
frequency lowers it all the same, and disturbed pairs lower the median of the pairs: lost speed lowers both, each time.
So a floor is missed where both are below it in each of TURNS measurements.

`python -m grader.studies.bench.floors [WORD]` prints every ratio (of the floors whose name contains WORD) beside its
floor and exits 1 where one is below.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from grader.numerics.integrators import EULER
from grader.numerics.process import prepare
from grader.numerics.scene import Scene
from grader.numerics.stability.trials import check_bracket
from grader.studies.bench.physics.lines import LINES, measure_speed
from grader.studies.bench.physics.loops import (
    SCENES,
    LoopInC,
    NoLoop,
    bisect_as_lesson,
    load_course_scene,
    make_lessons_run,
    make_rollout,
    warm_up,
    write_stiff_servo,
)
from grader.studies.bench.physics.models import load_model_scene, measure_overhead, measure_recording
from grader.studies.bench.physics.peers import find_peers
from grader.studies.bench.physics.precision import END_TIMES_S, Stepping
from grader.studies.bench.physics.skip import Run
from grader.studies.bench.scenes import load_scene
from grader.studies.bench.service.script import compare_with_bare
from grader.studies.bench.timing import TimeRatio, measure_pairs, restore_timer

TURNS = 3
"""How often a ratio below its floor is measured before it counts as lost speed."""

ratio = partial(measure_pairs, budget_s=0.4)
"""The CPU time of the first work over that of the second: how many times faster the second is."""


@dataclass(frozen=True)
class Floor:
    """The ratio must be at least `least`; `source` says what that number rests on."""

    name: str
    measure: Callable[[], TimeRatio]
    least: float
    source: str

    def held(self, ratio: TimeRatio) -> bool:
        """Whether the ratio of the shortest times or the upper end of the median's interval reaches the floor."""
        return max(ratio.least, ratio.interval[1]) >= self.least


def measure_rungs(name: str, slow: int, fast: int) -> TimeRatio:
    """Two runs of a scene: 0 a Python loop as the wheel comes, 1 timer off, 2 steps in C, 3 with every proven flag."""
    scene = load_scene(name)
    loop = Run(scene, chunk=1)
    works = (restore_timer()(loop), loop, Run(scene), Run(scene, bits=scene.flags))
    return ratio(works[slow], works[fast])


def measure_peer(peer: str, setting: float, timestep_s: float) -> TimeRatio:
    """Measures a peer of the precision study over our RK4, on the double pendulum."""
    work = partial(find_peers(TWO)[peer].run, setting, END_TIMES_S)
    return ratio(work, Stepping(load_scene(TWO), "RK4", timestep_s))


def measure_c_loop(name: str, integrator: str) -> TimeRatio:
    """Measures a loop in C with nothing around it, over our rollout without skipping."""
    scene = load_course_scene(name)
    return ratio(LoopInC(scene, integrator), make_rollout(scene, integrator, skip=False))


def measure_lesson(name: str, integrator: str) -> TimeRatio:
    """Measures the lesson's loop, over our rollout."""
    scene = load_course_scene(name)
    return ratio(restore_timer()(make_lessons_run(scene, integrator)), make_rollout(scene, integrator, skip=True))


def measure_bisection() -> TimeRatio:
    """Measures the lesson's bisection, over the two simulations that certify its bracket."""
    scene = warm_up(Scene.from_xml(write_stiff_servo())).at(qpos=[1.0])
    certified = partial(check_bracket, scene, *bisect_as_lesson(), integrator=EULER.code)
    return ratio(bisect_as_lesson, certified)


def measure_model_recording(name: str) -> TimeRatio:
    """Measures mujoco.rollout, over our runs that keep every step."""
    return measure_recording(load_model_scene(name), 0.4)


TWO_THIRDS = "two thirds of docs/measured.md"
TWO = "double_pendulum"
COURSE = [(name, integrator) for name in SCENES for integrator in ("Euler", "RK4")]

SCRIPTS = [
    ("servo-threshold", "whole_runs_in_one_call", "child", 0.4, "0.53 measured, 0.43 before models came compiled"),
    ("servo-threshold", "whole_runs_in_one_call", "judge", 0.75, "1.2 measured, 0.84 before workspaces were shared"),
    ("rk4-step", "classical", "child", 0.48, "0.65 measured, 0.51 with a force of more calls"),
]
"""A right answer, what of its grading is measured beside its bare function, and the floor."""

# To add a floor, add a line. Floors are about two thirds of what a quiet machine measures: only a real loss is below.
FLOORS = [
    Floor("timer off, servo", lambda: measure_rungs("servo", 0, 1), 1.2, TWO_THIRDS),
    Floor("steps in C, servo", lambda: measure_rungs("servo", 1, 2), 1.1, TWO_THIRDS),
    Floor("flags, servo", lambda: measure_rungs("servo", 2, 3), 1.12, TWO_THIRDS),
    Floor("flags, arm", lambda: measure_rungs("sensed_arm", 2, 3), 1.2, TWO_THIRDS),
    Floor("flags, cube", lambda: measure_rungs("cube", 2, 3), 0.93, "1.02, which is no loss"),
    Floor("all, double pendulum", lambda: measure_rungs(TWO, 0, 3), 1.8, TWO_THIRDS),
    Floor("Python loop, RK4 at 2 ms", lambda: measure_peer("Python loop, RK4", 0.002, 0.002), 1.5, TWO_THIRDS),
    Floor("SciPy to 1e-6, RK4 at 4 ms", lambda: measure_peer("SciPy DOP853, mj_forward", 1e-6, 0.004), 2, TWO_THIRDS),
    *(Floor(f"C, {n}, {i}", partial(measure_c_loop, n, i), 0.85, "0.92 to 0.98 measured") for n, i in COURSE),
    *(Floor(f"lesson, {n}, {i}", partial(measure_lesson, n, i), 1.8, "3 when quiet") for n, i in COURSE),
    *(
        Floor(f"line, {n}", partial(measure_speed, n), LINES[n][-1], "by hand in Python; loops 2 x at most")
        for n in LINES
    ),
    Floor(
        "reset, run without its steps",
        lambda: measure_overhead(load_model_scene("pendulum_servo (course)"), 0.4),
        0.22,
        "0.31 measured; 0.15 with 12 us beside the steps",
    ),
    *(
        Floor(f"mujoco.rollout, {n}", partial(measure_model_recording, n), 0.75, "0.95 to 1.6; 0.2 step by step")
        for n in ("pendulum_servo (course)", "cube")
    ),
    Floor("bisection to certificate", measure_bisection, 20, "100 when quiet"),
    *(
        Floor(f"script, {part}, {program[:14]}", partial(compare_with_bare, exercise, program, part), least, why)
        for exercise, program, part, least, why in SCRIPTS
    ),
]


def measure_floor(floor: Floor) -> tuple[TimeRatio, bool]:
    """Measures the ratio, again while it is below the floor; returns it, and whether the floor held."""
    for _ in range(TURNS):
        ratio = floor.measure()
        if held := floor.held(ratio):
            break
    return ratio, held


def main(words: list[str]) -> int:
    """Print every ratio; return 1 where one is below its floor."""
    prepare()
    failed = 0
    for floor in FLOORS:
        if not all(word in floor.name for word in words):
            continue
        try:
            ratio, held = measure_floor(floor)
        except NoLoop as why:
            print(f"{'-':6}{floor.name:32}not measured: {why}")
            continue
        failed += not held
        shown = f"x{ratio.least:.2f} (median {ratio.interval[0]:.2f} to {ratio.interval[1]:.2f})"
        print(f"{'ok' if held else 'BELOW':6}{floor.name:32}{shown:32}floor x{floor.least:g}: {floor.source}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
