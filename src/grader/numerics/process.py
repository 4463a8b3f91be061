"""Prepares this process for MuJoCo, once."""

import functools

import mujoco


@functools.cache
def prepare() -> None:
    """Turn off the profiling timer of the Python wheel, and MuJoCo's log. Later calls do nothing. Call this before a
    model is compiled or stepped. Warnings are still counted in `data.warning`, but their text is not written to stderr
    or MUJOCO_LOG.TXT. Clears all MuJoCo callbacks of the process: install your own afterwards."""
    mujoco.mj_resetCallbacks()
    log = mujoco.MjLogConfig.get()
    log.logto_console = False
    log.logto_file = False
    log.set()
