"""A fast check that no speed was lost: ratios, each with a stated floor, so that any machine can run it.

`python -m grader.bench.floors` prints every ratio with its floor and exits 1 where one is below. The floors are
generous: about two thirds of what a quiet machine measures, so that only a real loss falls below them.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass

from grader.bench.peers import over_mj_forward, python_loop
from grader.bench.precision import Stepping
from grader.bench.scenes import load_scene
from grader.bench.settings_grid import END_TIMES_S
from grader.bench.skip import Run, with_timer
from grader.bench.timing import Paired, paired
from grader.numerics.process import prepare
from grader.numerics.scene import Scene

BUDGET_S = 0.4

Work = Callable[[], object]


@dataclass(frozen=True)
class Floor:
    """`slow` must take at least `least` times the CPU time of `fast`."""

    name: str
    least: float
    slow: Callable[[], Work]
    fast: Callable[[], Work]


def skipping(scene: Scene) -> Run:
    """With every proven flag."""
    return Run(scene, bits=scene.flags)


def loop(name: str) -> Work:
    """The lesson's Python loop, RK4 at 2 ms."""
    run = python_loop(load_scene(name), "RK4")
    return lambda: run(0.002, END_TIMES_S)


def scipy(name: str) -> Work:
    """DOP853 over mj_forward to 1e-6."""
    run = over_mj_forward(load_scene(name), "DOP853")
    return lambda: run(1e-6, END_TIMES_S)


def bare(name: str, chunk: int) -> Work:
    """A run with nothing skipped and the timer off."""
    return Run(load_scene(name), chunk=chunk)


FLOORS = (
    Floor("timer off, servo", 1.2, lambda: with_timer(bare("servo", 1)), lambda: bare("servo", 1)),
    Floor("steps in C, servo", 1.1, lambda: bare("servo", 1), lambda: bare("servo", 50)),
    Floor("proven flags, servo", 1.12, lambda: bare("servo", 50), lambda: skipping(load_scene("servo"))),
    Floor("proven flags, sensed arm", 1.2, lambda: bare("sensed_arm", 50), lambda: skipping(load_scene("sensed_arm"))),
    Floor("proven flags, cube", 0.93, lambda: bare("cube", 50), lambda: skipping(load_scene("cube"))),
    Floor(
        "everything, double pendulum",
        1.8,
        lambda: with_timer(bare("double_pendulum", 1)),
        lambda: skipping(load_scene("double_pendulum")),
    ),
    Floor(
        "Python loop to our stepping, RK4",
        1.5,
        lambda: loop("double_pendulum"),
        lambda: Stepping(load_scene("double_pendulum"), "RK4", 0.002),
    ),
    Floor(
        "SciPy over mj_forward to our RK4 at 4 ms",
        2.0,
        lambda: scipy("double_pendulum"),
        lambda: Stepping(load_scene("double_pendulum"), "RK4", 0.004),
    ),
)


def measure(floor: Floor) -> Paired:
    """The ratio of one floor."""
    return paired(floor.slow(), floor.fast(), BUDGET_S)


def main() -> int:
    """Print every ratio; 1 where one is below its floor."""
    prepare()
    failed = 0
    for floor in FLOORS:
        found = measure(floor)
        below = found.ratio < floor.least
        failed += below
        band = f"{found.low:.2f} to {found.high:.2f}"
        print(f"{'BELOW' if below else 'ok':6}{floor.name:44}x{found.ratio:.2f} ({band}), floor x{floor.least:g}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
