"""The course's models run three ways, bit for bit alike: by our rollouts, by the lesson's scripts, by a loop in C."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from grader.numerics.integrators import BY_NAME, EULER
from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.stepping import STEPS_MAX
from grader.numerics.workspace import BARE_AFTER
from grader.settings import Settings
from grader.studies.bench.physics.skip import STEPS, TIMESTEP_S, Run
from grader.studies.bench.timing import restore_timer

SOURCE = Path(__file__).with_name("step_loop.c")
PACKAGE = Path(mujoco.__file__).parent

SCENES = {"pendulum_servo": "horizontal", "double_pendulum": "release", "tumbling_box": "spun"}
"""The course's models as its learners have them, geoms and lights included, and the keyframe each starts from."""

Loop = Callable[[int, int, int], None]


class NoLoop(Exception):
    """The loop in C cannot be built here; the message says why."""


@cache
def compile_loop() -> Loop:
    """Compile step_loop.c against the wheel's own library and load it. Raises NoLoop without a compiler or headers."""
    compiler = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        raise NoLoop("there is no C compiler (cc, gcc or clang) on this machine")
    library = next(PACKAGE.glob("libmujoco.*"), None)
    if library is None or not (PACKAGE / "include" / "mujoco" / "mujoco.h").exists():
        raise NoLoop("MuJoCo's headers or library are not in the Python package")
    with TemporaryDirectory() as folder:
        built = Path(folder) / "step_loop.so"
        command = [compiler, "-O2", "-shared", "-fPIC", f"-I{PACKAGE / 'include'}", str(SOURCE), str(library)]
        command += [f"-Wl,-rpath,{PACKAGE}", "-o", str(built)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode:
            raise NoLoop(f"{compiler} could not build the loop in C: {done.stderr.strip().splitlines()[0]}")
        loop = ctypes.CDLL(str(built)).step_loop
    loop.argtypes, loop.restype = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int), None
    typed: Loop = loop
    return typed


class LoopInC(Run):
    """The same run by a loop in C, on the same library in the same process. Raises NoLoop."""

    def __call__(self) -> None:
        """All steps, in one call."""
        self.reset()
        compile_loop()(int(self.model._address), int(self.data._address), STEPS)


def read_model(model: str) -> str:
    """Returns the MJCF of one of the course's models."""
    return (Settings().content / "models" / f"{model}.xml").read_text(encoding="utf-8")


def load_course_scene(name: str) -> Scene:
    """Returns one of SCENES at its keyframe."""
    return warm_up(Scene.from_xml(read_model(name), key=SCENES[name]))


def warm_up(scene: Scene) -> Scene:
    """Returns the scene after so many steps that runs use its model without visuals, as they do in the service."""
    simulate(scene, steps=BARE_AFTER, timestep_s=TIMESTEP_S, integrator=EULER.code, every=STEPS_MAX)
    return scene


def make_rollout(scene: Scene, integrator: str, *, skip: bool) -> Callable[[], bytes]:
    """Returns a function that runs STEPS steps and returns the bytes of its last qpos and qvel."""
    code = BY_NAME[integrator].code

    def work() -> bytes:
        run = simulate(scene, steps=STEPS, timestep_s=TIMESTEP_S, integrator=code, every=STEPS_MAX, skip=skip)
        return np.concatenate([run.qpos[-1], run.qvel[-1]]).tobytes()

    return work


def make_lessons_run(scene: Scene, integrator: str) -> Run:
    """Returns the run by the loop of the lesson's `energy_error`, energy on; time it under the wheel's timer."""
    run = Run(scene, integrator, chunk=1)
    run.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    return run


def write_stiff_servo() -> str:
    """Returns the servo of the exercise, kp = 2000 and kv = 5, by replacing text as the lesson does."""
    return read_model("pendulum_servo").replace('kp="100" kv="5"', 'kp="2000" kv="5"')


@restore_timer()
def bisect_as_lesson() -> tuple[float, float]:
    """Largest stable timestep [s] of the stiff servo as a student finds it: try both ends, then halve."""
    text, low, high = write_stiff_servo(), 0.001, 0.05
    if not is_servo_stable(text, low) or is_servo_stable(text, high):
        raise ValueError("the limit does not lie between 1 and 50 ms")
    while high - low > 0.0005:
        middle = (low + high) / 2
        low, high = (middle, high) if is_servo_stable(text, middle) else (low, middle)
    return low, high


def is_servo_stable(text: str, timestep_s: float, seconds: float = 3.0) -> bool:
    """The lesson's function: compiles the model from its text, and reads the warning after every step."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.integrator, model.opt.timestep = EULER.code, timestep_s
    data = mujoco.MjData(model)
    data.qpos[0] = 1.0
    for _ in range(round(seconds / timestep_s)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            return False
    return True
