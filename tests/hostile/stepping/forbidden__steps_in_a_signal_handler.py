"""Sets a timer while it is imported, whose handler takes the step in the middle of the call."""

import signal

import mujoco

waiting = []


def handle(*_):
    while waiting:
        mujoco.mj_step(*waiting.pop())


signal.signal(signal.SIGVTALRM, handle)
signal.setitimer(signal.ITIMER_VIRTUAL, 0.001, 0.001)


def step(model, data):
    waiting.append((model, data))
    while waiting:
        pass
