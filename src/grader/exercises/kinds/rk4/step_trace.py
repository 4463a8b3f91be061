"""The steps in a trace: at which states mj_forward was asked, and what it answered. They are claims."""

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from grader.exercises.kinds.rk4.judging.run import Run
from grader.exercises.trace import Note, Trace

Rows = NDArray[np.float64]

CALLS_MAX = 16
"""A step with more calls of mj_forward is not read; the driver does not note it."""

HEAD = 3
"""Numbers before the states: how many calls, whether the step is of the probe, the timestep [s]."""

LARGEST = 1e9
"""A step with a larger number is not read: it diverges, or is forged."""


@dataclass(frozen=True, eq=False)
class Step:
    """One step of the student's: the state before, n calls of mj_forward, the state after. time (n + 2,), qpos (n + 2,
    nq), qvel (n + 2, nv), act (n + 2, na): row 0 before the step, the last one after it, the others as the calls found
    them. ctrl (n + 1, nu): before the step and in the calls. qacc (n + 1, nv): before the step, where it is left over
    from earlier, and as the calls left it. rate (n, na) is act_dot, smooth (n, nv) qacc_smooth."""

    timestep_s: float
    probe: bool
    time: Rows
    qpos: Rows
    qvel: Rows
    act: Rows
    ctrl: Rows
    qacc: Rows
    rate: Rows
    smooth: Rows

    @property
    def calls(self) -> int:
        """The number of calls of mj_forward."""
        return len(self.rate)

    @property
    def ends_with_a_call(self) -> bool:
        """Whether the last call finds the state that the step leaves."""
        return all(np.array_equal(states[-2], states[-1]) for states in (self.qpos, self.qvel, self.act))

    def drop_last_call(self) -> "Step":
        """Returns the step as if its last call had not been made."""
        states, calls = [*range(self.calls), self.calls + 1], self.calls
        return Step(
            self.timestep_s, self.probe, self.time[states], self.qpos[states], self.qvel[states], self.act[states],
            ctrl=self.ctrl[:calls], qacc=self.qacc[:calls], rate=self.rate[: calls - 1], smooth=self.smooth[: calls - 1]
        )  # fmt: skip


def read_steps(trace: Trace, run: Run) -> list[Step]:
    """Returns the steps of a trace that can be read, those of the probe first: their slopes differ most."""
    steps = [step for note in trace.list_notes("step") if (step := read_step(note, run))]
    return sorted(steps, key=lambda step: not step.probe)


def read_step(note: Note, run: Run) -> Step | None:
    """Returns the step of a note; None if its numbers are not those of such a step of the run."""
    if len(note.numbers) < HEAD or not np.all(np.abs(note.numbers) < LARGEST):
        return None
    calls, probe, timestep = note.numbers[:HEAD].tolist()
    if calls not in range(CALLS_MAX + 1) or not 0 < timestep < 1:
        return None
    calls, numbers = int(calls), note.numbers[HEAD:]
    nq, nv, na, nu = map(len, (run.qpos, run.qvel, run.act, run.ctrl))
    asked, answer, state = 1 + nq + nv + na + nu, 2 * nv + na, 1 + nq + nv + na
    if len(numbers) != asked + nv + calls * (asked + answer) + state:
        return None
    before, middle, after = np.split(numbers, [asked + nv, len(numbers) - state])
    rows = middle.reshape(calls, asked + answer)
    states = np.vstack([before[:state], rows[:, :state], after])
    qacc, rate, smooth = np.split(rows[:, asked:], [nv, nv + na], axis=1)
    qpos, qvel, act = np.split(states[:, 1:], [nq, nq + nv], axis=1)
    return Step(
        timestep, bool(probe), states[:, 0], qpos, qvel, act,
        ctrl=np.vstack([before[state:asked], rows[:, state:asked]]), qacc=np.vstack([before[asked:], qacc]), rate=rate,
        smooth=smooth
    )  # fmt: skip


def compute_moves(model: mujoco.MjModel, origin: Rows, positions: Rows) -> Rows:
    """Returns the tangent vectors (n, nv) that lead from `origin` to each of the positions (n, nq)."""
    if model.nq == model.nv:
        return positions - origin
    turns = np.zeros((len(positions), model.nv))
    for turn, position in zip(turns, positions, strict=True):
        mujoco.mj_differentiatePos(model, turn, 1.0, origin, np.ascontiguousarray(position))
    return turns
