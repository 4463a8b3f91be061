"""Code that runs inside an audit hook, while other hooks take themselves for busy."""

import sys
import mujoco

waiting = []


def hook(event, about):
    if event == "go" and waiting:
        mujoco.mj_step(*waiting.pop())


sys.addaudithook(hook)


def step(model, data):
    waiting.append((model, data))
    sys.audit("go")
