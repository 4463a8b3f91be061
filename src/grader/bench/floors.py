"""A fast check that no speed was lost: ratios of CPU time, each with a floor, so that any machine can run it.

A ratio is the shortest time of one work over the shortest of the other, measured in turns: beside eight processes that
spin on two cores it stays within a few percent of a quiet machine's. One sample of the first work at a higher clock
frequency lowers it all the same, and disturbed pairs lower the median of the pairs: lost speed lowers both, each time.
So a floor is missed where both are below it in each of TURNS measurements.

`python -m grader.bench.floors [WORD]` prints every ratio (of the floors whose name contains WORD) beside its floor and
exits 1 where one is below.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from grader.bench.lines import LINES, speed
from grader.bench.loops import (
    SCENES,
    LoopInC,
    NoLoop,
    course_scene,
    in_use,
    lessons_bisection,
    lessons_run,
    ours,
    stiff_servo,
)
from grader.bench.models import beside_steps, scene_of
from grader.bench.peers import peers_of
from grader.bench.precision import END_TIMES_S, Stepping
from grader.bench.scenes import load_scene
from grader.bench.skip import Run
from grader.bench.timing import Paired, paired, profiling_timer
from grader.numerics.integrators import EULER
from grader.numerics.process import prepare
from grader.numerics.scene import Scene
from grader.numerics.trials import check_bracket

TURNS = 3
"""How often a ratio below its floor is measured before it counts as lost speed."""

ratio = partial(paired, budget_s=0.4)
"""The CPU time of the first work over that of the second: how many times faster the second is."""


@dataclass(frozen=True)
class Floor:
    """The ratio must be at least `least`; `source` says what that number rests on."""

    name: str
    measure: Callable[[], Paired]
    least: float
    source: str

    def held(self, found: Paired) -> bool:
        """Whether the ratio of the shortest times or the upper end of the median's interval reaches the floor."""
        return max(found.least, found.interval[1]) >= self.least


def rungs(name: str, slow: int, fast: int) -> Paired:
    """Two runs of a scene: 0 a Python loop as the wheel comes, 1 timer off, 2 steps in C, 3 with every proven flag."""
    scene = load_scene(name)
    loop = Run(scene, chunk=1)
    works = (profiling_timer()(loop), loop, Run(scene), Run(scene, bits=scene.flags))
    return ratio(works[slow], works[fast])


def peer_and_rk4(peer: str, setting: float, timestep_s: float) -> Paired:
    """A peer of the precision study over our RK4, on the double pendulum."""
    work = partial(peers_of(TWO)[peer].run, setting, END_TIMES_S)
    return ratio(work, Stepping(load_scene(TWO), "RK4", timestep_s))


def against_c(name: str, integrator: str) -> Paired:
    """A loop in C with nothing around it, over our rollout without skipping."""
    scene = course_scene(name)
    return ratio(LoopInC(scene, integrator), ours(scene, integrator, skip=False))


def against_the_lesson(name: str, integrator: str) -> Paired:
    """The lesson's loop, over our rollout."""
    scene = course_scene(name)
    return ratio(profiling_timer()(lessons_run(scene, integrator)), ours(scene, integrator, skip=True))


def bisection() -> Paired:
    """The lesson's bisection, over the two simulations that certify its bracket."""
    scene = in_use(Scene.from_xml(stiff_servo())).at(qpos=[1.0])
    certified = partial(check_bracket, scene, *lessons_bisection(), integrator=EULER.code)
    return ratio(lessons_bisection, certified)


TWO_THIRDS = "two thirds of docs/measured.md"
TWO = "double_pendulum"
COURSE = [(name, integrator) for name in SCENES for integrator in ("Euler", "RK4")]

# To add a floor, add a line. Floors are about two thirds of what a quiet machine measures: only a real loss is below.
FLOORS = [
    Floor("timer off, servo", lambda: rungs("servo", 0, 1), 1.2, TWO_THIRDS),
    Floor("steps in C, servo", lambda: rungs("servo", 1, 2), 1.1, TWO_THIRDS),
    Floor("flags, servo", lambda: rungs("servo", 2, 3), 1.12, TWO_THIRDS),
    Floor("flags, arm", lambda: rungs("sensed_arm", 2, 3), 1.2, TWO_THIRDS),
    Floor("flags, cube", lambda: rungs("cube", 2, 3), 0.93, "1.02, which is no loss"),
    Floor("all, double pendulum", lambda: rungs(TWO, 0, 3), 1.8, TWO_THIRDS),
    Floor("Python loop, RK4 at 2 ms", lambda: peer_and_rk4("Python loop, RK4", 0.002, 0.002), 1.5, TWO_THIRDS),
    Floor("SciPy to 1e-6, RK4 at 4 ms", lambda: peer_and_rk4("SciPy DOP853, mj_forward", 1e-6, 0.004), 2, TWO_THIRDS),
    *(Floor(f"C, {n}, {i}", partial(against_c, n, i), 0.85, "0.92 to 0.98 measured") for n, i in COURSE),
    *(Floor(f"lesson, {n}, {i}", partial(against_the_lesson, n, i), 1.8, "3 when quiet") for n, i in COURSE),
    *(Floor(f"line, {n}", partial(speed, n), LINES[n][-1], "by hand in Python; loops 2 x at most") for n in LINES),
    Floor(
        "reset, run without its steps",
        lambda: beside_steps(scene_of("pendulum_servo (course)"), 0.4),
        0.22,
        "0.31 measured; 0.15 with 12 us beside the steps",
    ),
    Floor("bisection to certificate", bisection, 20, "100 when quiet"),
]


def measured(floor: Floor) -> tuple[Paired, bool]:
    """The ratio, measured again while it is below the floor; and whether the floor held."""
    for _ in range(TURNS):
        found = floor.measure()
        if held := floor.held(found):
            break
    return found, held


def main(words: list[str]) -> int:
    """Print every ratio; return 1 where one is below its floor."""
    prepare()
    failed = 0
    for floor in FLOORS:
        if not all(word in floor.name for word in words):
            continue
        try:
            found, held = measured(floor)
        except NoLoop as why:
            print(f"{'-':6}{floor.name:32}not measured: {why}")
            continue
        failed += not held
        shown = f"x{found.least:.2f} (median {found.interval[0]:.2f} to {found.interval[1]:.2f})"
        print(f"{'ok' if held else 'BELOW':6}{floor.name:32}{shown:32}floor x{floor.least:g}: {floor.source}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
