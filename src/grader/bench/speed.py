"""How near the numerics are to a loop in C, and how far ahead of the lesson's own scripts.

`python -m grader.bench.speed` prints the measurements as JSON. Every ratio is a median of pairs taken in turns in one
run, in CPU time, so that load on the machine cancels.
"""

import ctypes
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from grader.bench.timing import Paired, paired
from grader.bench.wheel_timer import profiling_timer, timer_is_known
from grader.numerics.process import prepare
from grader.numerics.rollout import simulate
from grader.numerics.scene import FULL_STATE, Scene
from grader.numerics.stepping import STEPS_MAX
from grader.numerics.threshold import certify
from grader.numerics.workspace import BARE_AFTER
from grader.settings import Settings

SOURCE = Path(__file__).with_name("step_loop.c")
PACKAGE = Path(mujoco.__file__).parent

SCENES = {"pendulum_servo": "horizontal", "double_pendulum": "release", "tumbling_box": "spun"}
"""The course's models as its learners have them, geoms and lights included, and the keyframe each starts from."""

INTEGRATORS = {"Euler": 0, "RK4": 1}
STEPS = 2000
TIMESTEP_S = 0.002

NO_COMPILER = "there is no C compiler (cc, gcc or clang) on this machine: the loop in C is not measured"
NO_HEADERS = "MuJoCo's headers or library are not in the Python package: the loop in C is not measured"

Work = Callable[[], bytes]
Loop = Callable[[int, int, int], None]


class NoLoop(Exception):
    """The loop in C cannot be built here; the message says why."""


def measure(budget_s: float = 0.4) -> dict[str, Any]:
    """All measurements as a plain dict, about `budget_s` of CPU time [s] for each ratio.

    `loop_in_c` is "measured", or why it is not; then the rows lack `ours_per_c`. `timer_on` tells whether the
    lesson's scripts ran with the wheel's profiling timer, as a student's do.
    """
    prepare()
    models = Settings().content / "models"
    texts = {name: (models / f"{name}.xml").read_text(encoding="utf-8") for name in SCENES}
    scenes = {name: in_use(Scene.from_xml(text, key=SCENES[name])) for name, text in texts.items()}
    with tempfile.TemporaryDirectory() as folder:
        try:
            loop, said = compiled_loop(Path(folder)), "measured"
        except NoLoop as why:
            loop, said = None, str(why)
        rows = [row(name, scenes[name], integrator, loop, budget_s) for name in scenes for integrator in INTEGRATORS]
        return {
            "loop_in_c": said,
            "timer_on": timer_is_known(),
            "steps": STEPS,
            "rows": rows,
            "certify": certifying(stiff(texts["pendulum_servo"]), budget_s),
        }


def compiled_loop(folder: Path) -> Loop:
    """step_loop.c compiled against the wheel's own library and loaded; NoLoop where that cannot be."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        raise NoLoop(NO_COMPILER)
    library = next(PACKAGE.glob("libmujoco.*"), None)
    if library is None or not (PACKAGE / "include" / "mujoco" / "mujoco.h").exists():
        raise NoLoop(NO_HEADERS)
    built = folder / "step_loop.so"
    command = [compiler, "-O2", "-shared", "-fPIC", f"-I{PACKAGE / 'include'}", str(SOURCE), str(library)]
    command += [f"-Wl,-rpath,{PACKAGE}", "-o", str(built)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        raise NoLoop(f"{compiler} could not build the loop in C: {done.stderr.strip().splitlines()[0]}")
    function = ctypes.CDLL(str(built)).step_loop
    function.argtypes = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int)
    function.restype = None
    loop: Loop = function
    return loop


def row(name: str, scene: Scene, integrator: str, loop: Loop | None, budget_s: float) -> dict[str, Any]:
    """One scene under one integrator: ours against C without skipping, the lesson's loop against ours with it."""
    code = INTEGRATORS[integrator]
    plain, skipping = ours(scene, code, skip=False), ours(scene, code, skip=True)
    lesson = lessons_loop(scene, code)
    ends = {plain(), skipping(), lesson()}
    ahead = paired(lesson, skipping, budget_s)
    measured: dict[str, Any] = {
        "scene": name,
        "integrator": integrator,
        "ours_us": 1e6 * ahead.yardstick_s / STEPS,
        "lesson_us": 1e6 * ahead.seconds / STEPS,
        "lesson_per_ours": summary(ahead),
    }
    if loop is not None:
        floor = loop_in_c(scene, code, loop)
        ends.add(floor())
        beside = paired(plain, floor, budget_s)
        measured |= {
            "c_us": 1e6 * beside.yardstick_s / STEPS,
            "unskipped_us": 1e6 * beside.seconds / STEPS,
            "ours_per_c": summary(beside),
        }
    return measured | {"bitwise_same": len(ends) == 1}


def summary(found: Paired) -> dict[str, float]:
    """Median and the band of the middle 80 %."""
    return {"median": found.ratio, "low": found.low, "high": found.high, "pairs": found.pairs}


def ours(scene: Scene, integrator: int, *, skip: bool) -> Work:
    """A rollout of STEPS steps; the bytes of its last state."""

    def work() -> bytes:
        run = simulate(scene, steps=STEPS, timestep_s=TIMESTEP_S, integrator=integrator, every=STEPS_MAX, skip=skip)
        return np.concatenate([run.qpos[-1], run.qvel[-1]]).tobytes()

    return work


def last_state(data: mujoco.MjData) -> bytes:
    """The bits by which runs are compared."""
    return np.concatenate([data.qpos, data.qvel]).tobytes()


def own_copy(scene: Scene, integrator: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """A model and a data as a script has them."""
    with scene.borrow(timestep_s=TIMESTEP_S, integrator=integrator, keep=False) as workspace:
        return workspace.model, workspace.data


def loop_in_c(scene: Scene, integrator: int, loop: Loop) -> Work:
    """The same steps by the loop in C, on the same library in the same process."""
    model, data = own_copy(scene, integrator)
    addresses = int(model._address), int(data._address)

    def work() -> bytes:
        mujoco.mj_resetData(model, data)
        mujoco.mj_setState(model, data, scene.start_vector, FULL_STATE)
        loop(*addresses, STEPS)
        return last_state(data)

    return work


def lessons_loop(scene: Scene, integrator: int) -> Work:
    """The same steps by the loop of the lesson's `energy_error`: energy on, and the timer as the wheel installs it."""
    model, data = own_copy(scene, integrator)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)

    def work() -> bytes:
        with profiling_timer():
            mujoco.mj_resetData(model, data)
            mujoco.mj_setState(model, data, scene.start_vector, FULL_STATE)
            for _ in range(STEPS):
                mujoco.mj_step(model, data)
        return last_state(data)

    return work


def certifying(text: str, budget_s: float) -> dict[str, Any]:
    """Two simulations of a claimed bracket against the lesson's own bisection for the same answer."""
    scene = in_use(Scene.from_xml(text)).at(qpos=[1.0])
    low, high = lessons_bisection(text)
    holds = certify(scene, low, high, integrator=0).holds
    found = paired(lambda: lessons_bisection(text), lambda: certify(scene, low, high, integrator=0), budget_s)
    return {
        "bracket_ms": [1000 * low, 1000 * high],
        "holds": holds,
        "certify_us": 1e6 * found.yardstick_s,
        "bisection_us": 1e6 * found.seconds,
        "bisection_per_certify": summary(found),
    }


def stiff(servo: str) -> str:
    """The servo of the exercise, kp = 2000 and kv = 5, by replacing text as the lesson does."""
    return servo.replace('kp="100" kv="5"', 'kp="2000" kv="5"')


def in_use(scene: Scene) -> Scene:
    """The scene after so many steps that it has its model without visuals, as one that the service knows."""
    simulate(scene, steps=BARE_AFTER, timestep_s=TIMESTEP_S, integrator=0, every=STEPS_MAX)
    return scene


def lessons_bisection(text: str) -> tuple[float, float]:
    """Largest stable timestep [s] as a student writes it with the lesson's function: try both ends, then halve."""
    low, high = 0.001, 0.05
    with profiling_timer():
        if not lessons_servo_is_stable(text, low) or lessons_servo_is_stable(text, high):
            raise ValueError("the limit does not lie between 1 and 50 ms")
        while high - low > 0.0005:
            middle = (low + high) / 2
            low, high = (middle, high) if lessons_servo_is_stable(text, middle) else (low, middle)
    return low, high


def lessons_servo_is_stable(text: str, timestep_s: float, seconds: float = 3.0) -> bool:
    """The lesson's function: the model from its text, and a look at the warning after every step."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator, model.opt.timestep = 0, timestep_s
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(seconds / timestep_s)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
    return True


if __name__ == "__main__":
    json.dump(measure(float(sys.argv[1]) if len(sys.argv) > 1 else 0.4), sys.stdout, indent=1)
    print()
