"""Prints the functions of MuJoCo's library that move a state: `python symbols.py kept|removed [NAME ...]`.

Every function of the symbol table that is written in C is called, exported or not: a script reaches any address of the
library with ctypes. Each call has a process of its own, since most functions crash on arguments that they do not
expect.
A change of time, position or velocity counts as a move if it is of the size of a step: a reset is larger, and so is
what a function leaves that takes the model's memory for something else.
"""

import ctypes
import os
import resource
import signal
import sys
from pathlib import Path

import mujoco
import numpy as np

from grader.sandbox.inside import integrators

XML = """
<mujoco>
  <option timestep="0.002"/>
  <worldbody><body><joint axis="0 1 0"/><geom size=".1" pos="0 0 -.5"/></body></worldbody>
</mujoco>
"""
QPOS, QVEL, TIME = 0.7, -1.3, 0.6
STEP_MAX = 0.5
"""The largest change that counts as a step; the start is farther than that from the reference state."""

UNMOVED, MOVED = 0, 7


def call(address: int, model: mujoco.MjModel, data: mujoco.MjData) -> int:
    """Calls a function in a child process, its further arguments 0. Returns the exit code, negative for a signal."""
    if not (child := os.fork()):
        for stream in (0, 1, 2):
            os.dup2(os.open(os.devnull, os.O_RDWR), stream)
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (1, 1))
        signal.setitimer(signal.ITIMER_REAL, 5.0)
        qpos, qvel = data.qpos, data.qvel
        before = np.array([data.time, *qpos, *qvel])
        function = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p, *[ctypes.c_size_t] * 4)(address)
        function(model._address, data._address, 0, 0, 0, 0)
        change = np.abs(np.array([data.time, *qpos, *qvel]) - before)
        os._exit(MOVED if change.any() and (change < STEP_MAX).all() else UNMOVED)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def print_movers(removed: bool, only: frozenset[str]) -> None:
    """Prints the name of each function that moves a state, in this process with or without the integrators."""
    pages = integrators.find_integrators()
    names = dict(integrators.read_symbols(Path(pages.library)))
    base = integrators._find_address("mj_step") - names["mj_step"][0]
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    data.time, data.qpos[:], data.qvel[:] = TIME, QPOS, QVEL
    mujoco.mj_forward(model, data)
    if removed:
        writable, readable = pages.open()
        pages.lay_over(readable)
        pages.remove(writable)
    called = [name for name in names if not name.startswith("_Z") and (not only or name in only)]
    print(len(called), *(name for name in called if call(base + names[name][0], model, data) == MOVED))


if __name__ == "__main__":
    print_movers(sys.argv[1] == "removed", frozenset(sys.argv[2:]))
