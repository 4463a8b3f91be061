"""Which velocity moves which position: told where the trace shows it, and never of a step that is right or otherwise
wrong."""

from collections.abc import Callable, Iterator

import mujoco
import numpy as np
import pytest

from grader.exercises.driving import recorder
from grader.exercises.kinds.rk4.addresses import explain_misplaced, explain_quaternion_length
from grader.exercises.kinds.rk4.judging import driver
from grader.exercises.kinds.rk4.judging.run import Force, Run
from grader.exercises.kinds.rk4.rotations import build_turn
from grader.exercises.kinds.rk4.step_trace import Step, read_steps
from grader.exercises.kinds.rk4.tableau import CLASSICAL, Matrix
from grader.exercises.trace import read_trace

XML = """
<mujoco>
  <option gravity="{gravity}"/>
  <worldbody>
    <body pos="0 0 1"><freejoint/><geom type="box" size=".1 .2 .3" pos=".05 0 0"/>
      <body pos=".3 0 0"><joint name="a" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
        <body pos=".3 0 0"><joint name="b" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 .2 0 0"/></body>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
H = 0.01
TURNED = (0.0, 0.0, 1.0, 0.8, 0.0, 0.6, 0.0, 0.3, -0.4)
UPRIGHT = (0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FAST = (0.3, -0.2, 0.5, 1.0, -2.0, 3.0, 2.0, -1.0)
REST = (0.0,) * 8
STARTS = {
    "moving": (TURNED, FAST, "0 0 -9.81"),
    "at rest, weightless": (UPRIGHT, REST, "0 0 0"),
    "falling without a turn": (UPRIGHT, (0.4, 0.0, 0.0, *REST[3:]), "0 0 -9.81"),
    "turning in its place": (TURNED, (0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0), "0 0 0"),
    "both hinges alike": (TURNED, (*FAST[:6], 1.5, 1.5), "0 0 0"),
    "drifting, weightless": (UPRIGHT, (0.4, 0.1, 0.2, *REST[3:]), "0 0 0"),
}

Vector = np.ndarray[tuple[int], np.dtype[np.float64]]
Move = Callable[[mujoco.MjModel, Vector, Vector, float], Vector]
Misplaced = Callable[..., str | None]


def right(model: mujoco.MjModel, q: Vector, v: Vector, h: float) -> Vector:
    moved = q.copy()
    mujoco.mj_integratePos(model, moved, v, h)
    return moved


def by_hand(model: mujoco.MjModel, q: Vector, v: Vector, h: float) -> Vector:
    """The same, number by number."""
    moved = q.copy()
    moved[:3] += h * v[:3]
    mujoco.mju_mulQuat(moved[3:7], q[3:7], build_turn(h * v[3:6]))
    moved[7:] += h * v[6:]
    return moved


def step_of(move: Move, rows: Matrix = CLASSICAL) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    def step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        q, v, h = data.qpos.copy(), data.qvel.copy(), model.opt.timestep
        velocities, slopes = list[Vector](), list[Vector]()
        for row in rows:
            if slopes:
                data.qpos[:] = move(model, q, np.sum([a * k for a, k in zip(row, velocities, strict=False)], axis=0), h)
                data.qvel[:] = v + h * np.sum([a * k for a, k in zip(row, slopes, strict=False)], axis=0)
            if len(slopes) < len(rows) - 1:
                mujoco.mj_forward(model, data)
                velocities.append(data.qvel.copy())
                slopes.append(data.qacc.copy())

    return step


@pytest.fixture
def sentence() -> Iterator[Misplaced]:
    """Says what the addresses of a step show, from a trace of two steps without a probe, as in a hidden case."""
    originals, plain_note = (mujoco.mj_forward, mujoco.mj_forwardSkip), driver.note
    driver.before_import()
    driver.note = recorder.note

    def sentence(move: Move, start: str, rows: Matrix = CLASSICAL, *, hidden: bool = False) -> str | None:
        model, steps = traced(step_of(move, rows), start)
        return explain_misplaced(model, steps, rows, hidden=hidden)

    yield sentence
    mujoco.mj_forward, mujoco.mj_forwardSkip, driver.note = *originals, plain_note


def traced(step: driver.Step, start: str) -> tuple[mujoco.MjModel, list[Step]]:
    qpos, qvel, gravity = STARTS[start]
    nv, nq = len(qvel), len(qpos)
    still = Force((0.0,) * nv, ((0.0,) * nq,) * nv, ((0.0,) * nv,) * nv, (0.0,) * nv, 0.0)
    run = Run(XML.format(gravity=gravity), qpos, qvel, (), (), H, 2, still)
    inputs = {
        "taped": True,
        "model": run.xml,
        "start": {name: list(getattr(run, name)) for name in ("qpos", "qvel", "act", "ctrl")},
        "force": vars(still),
        "runs": [{"timestep_s": H, "steps": 2}],
    }
    recorder.state["left"] = recorder.BYTES_MAX
    recorder.begin(hidden=False)
    driver.trial([step], inputs, lambda *_: None)
    return run.scene().model, read_steps(read_trace(np.frombuffer(recorder.end(), np.uint8)), run)


EQUAL = [*CLASSICAL[:-1], (0.25,) * 4]
HEUN: Matrix = [(), (1.0,), (0.5, 0.5)]


@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("rows", [CLASSICAL, EQUAL, HEUN], ids=["classical", "equal weights", "heun"])
@pytest.mark.parametrize("move", [right, by_hand], ids=["mj_integratePos", "by hand"])
def test_a_step_that_moves_rightly_is_told_no_address(
    move: Move, rows: Matrix, start: str, sentence: Misplaced
) -> None:
    assert sentence(move, start, rows) is None


def with_part(part: Callable[[Vector, Vector, Vector, float], None]) -> Move:
    """The right move, then a mistake in a part of it."""

    def move(model: mujoco.MjModel, q: Vector, v: Vector, h: float) -> Vector:
        moved = right(model, q, v, h)
        part(moved, q, v, h)
        return moved

    return move


def at_other_dof(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[7] = q[7] + h * v[7]


def halves_swapped(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[:3] = q[:3] + h * v[3:6]


def in_body_axes(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    turned = np.zeros(3)
    mujoco.mju_rotVecQuat(turned, v[:3], q[3:7])
    moved[:3] = q[:3] + h * turned


def never_turns(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[3:7] = q[3:7]


def added_up(model: mujoco.MjModel, q: Vector, v: Vector, h: float) -> Vector:
    moved = q.copy()
    moved[: len(v)] += h * v
    return moved


MISTAKES: dict[str, tuple[Move, str]] = {
    "its place in data.qvel is jnt_dofadr": (with_part(at_other_dof), "moving"),
    "moves by its angular velocity": (with_part(halves_swapped), "moving"),
    "is in world axes already": (with_part(in_body_axes), "moving"),
    "A quaternion in data.qpos never changes": (with_part(never_turns), "moving"),
    "added to data.qpos number by number": (added_up, "moving"),
}


@pytest.mark.parametrize("said", MISTAKES)
def test_each_mistake_of_addresses_is_told(said: str, sentence: Misplaced) -> None:
    move, start = MISTAKES[said]
    assert said in (sentence(move, start) or "")


def half_a_hinge(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[7] = q[7] + h * v[6] / 2


def wrapped(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[7:] = np.mod(moved[7:] + np.pi, 2 * np.pi) - np.pi + 0.1


def hinge_rests(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[8] = q[8]


def drifts_otherwise(moved: Vector, q: Vector, v: Vector, h: float) -> None:
    moved[:3] = q[:3] + 0.9 * h * v[:3]


OTHERWISE = [half_a_hinge, wrapped, hinge_rests, drifts_otherwise]


@pytest.mark.parametrize("part", OTHERWISE)
@pytest.mark.parametrize("start", ["moving", "both hinges alike"])
def test_other_mistakes_in_the_same_numbers_are_told_no_address(
    part: Callable[..., None], start: str, sentence: Misplaced
) -> None:
    assert sentence(with_part(part), start) is None


def test_the_joint_of_a_hidden_case_is_not_numbered(sentence: Misplaced) -> None:
    told = sentence(with_part(at_other_dof), "moving", hidden=True)
    assert told
    assert not any(char.isdigit() for char in told)


@pytest.mark.usefixtures("sentence")
def test_quaternions_of_other_length_are_told_apart_from_those_of_length_one() -> None:
    def doubled(moved: Vector, q: Vector, v: Vector, h: float) -> None:
        moved[3:7] *= 2

    for move, said in ((with_part(doubled), True), (right, False)):
        assert bool(explain_quaternion_length(*traced(step_of(move), "moving"))) == said
