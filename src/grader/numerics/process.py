"""Sets this process up for MuJoCo, once."""

import functools

import mujoco


@functools.cache
def prepare() -> None:
    """Turn the wheel's profiling timer and MuJoCo's log off; repeating it costs nothing.

    Whatever compiles or steps a model calls this first. Warnings are still counted in `data.warning`; only their
    text goes nowhere, neither to stderr nor to MUJOCO_LOG.TXT. It clears every MuJoCo callback of the process, so
    callbacks of one's own are installed afterwards.
    """
    mujoco.mj_resetCallbacks()
    log = mujoco.MjLogConfig.get()
    log.logto_console = False
    log.logto_file = False
    log.set()
