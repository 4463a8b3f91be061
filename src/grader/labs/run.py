"""Runs a lab: the author's JSON, on the model itself, headless."""

import time
from collections.abc import Mapping, Sequence
from math import isfinite

import mujoco

from grader.domain.lab import LabConfig
from grader.errors import Unprocessable
from grader.labs.controls import Given, chosen_values
from grader.labs.expressions import Program
from grader.labs.programs import LabPrograms, lab_programs
from grader.labs.record import LabRun
from grader.labs.running import SAME, Running, Variant
from grader.numerics.scene import Scene
from grader.numerics.workspace import Workspace

SECONDS_DEFAULT = 3.0
SECONDS_MAX = 60.0
EVENTS_MAX = 1000

Event = tuple[float, str]


def run_lab(
    config: LabConfig,
    xml: str,
    controls: Mapping[str, Given] | None = None,
    events: Sequence[Event] = (),
    seconds: float | None = None,
    *,
    variant: Variant = SAME,
    where: str = "lab",
) -> LabRun:
    """Run a lab from its start with these control values and button presses (time [s], label).

    Order: the keyframe, every control's value, `setup`, the controls with `init` once more. `controller` runs before
    every step. When MuJoCo resets a state that diverged, the run goes on from there, as in a browser, and the warning
    is recorded. Lasts `seconds`, else `stopAt`, else the widest plot, else 3 s. `where` names the lab in errors.

    Raises Unprocessable for control values, events or lengths that are not allowed, LabError where an expression
    fails, ContentError where one cannot be compiled, ValueError where MuJoCo cannot compile the model.
    """
    began = time.perf_counter()
    programs, values = lab_programs(config, where), chosen_values(config, controls or {})
    duration = _duration(config, seconds)
    presses = _presses(programs, events, duration)
    running = Running(start_workspace(config, xml), programs, presses)
    running.start(values)
    running.vary(variant)
    prepared = time.perf_counter()
    running.go(duration)
    ran = time.perf_counter()
    timing = {"prepare": 1000 * (prepared - began), "run": 1000 * (ran - prepared)}
    return running.finish(config, values, timing)


def lab_scene(config: LabConfig, xml: str, controls: Mapping[str, Given] | None = None) -> Scene:
    """The scene at the lab's start: the model as the controls made it, the state as `setup` left it."""
    running = Running(start_workspace(config, xml), lab_programs(config), [])
    running.start(chosen_values(config, controls or {}))
    data = running.data
    return Scene.of_model(running.model).at(qpos=data.qpos, qvel=data.qvel, act=data.act, ctrl=data.ctrl)


def start_workspace(config: LabConfig, xml: str) -> Workspace:
    """A model and a data of the lab's own, at its keyframe. Raises KeyError where there is no such keyframe."""
    scene = Scene.from_xml(xml)
    workspace = Workspace(scene.model)
    workspace.option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
    if config.key is None:
        mujoco.mj_resetData(workspace.model, workspace.data)
    else:
        key = scene.id_of(mujoco.mjtObj.mjOBJ_KEY, config.key)
        mujoco.mj_resetDataKeyframe(workspace.model, workspace.data, key)
    return workspace


def _duration(config: LabConfig, seconds: float | None) -> float:
    """How long the lab runs [s]."""
    if seconds is not None:
        if not (isfinite(seconds) and 0 < seconds <= SECONDS_MAX):
            raise Unprocessable(f"A lab runs for more than 0 and at most {SECONDS_MAX:g} seconds.")
        return seconds
    if isinstance(config.stopAt, float | int):
        return min(float(config.stopAt), SECONDS_MAX)
    windows = [plot.window for plot in config.plots if plot.window is not None]
    return min(max(windows, default=SECONDS_DEFAULT), SECONDS_MAX)


def _presses(programs: LabPrograms, events: Sequence[Event], duration: float) -> list[tuple[float, Program]]:
    """The button presses in order of time."""
    if len(events) > EVENTS_MAX:
        raise Unprocessable(f"At most {EVENTS_MAX} button presses fit into one run.")
    presses = []
    for at, label in events:
        if label not in programs.buttons:
            known = ", ".join(programs.buttons) or "none"
            raise Unprocessable(f"There is no button {label[:80]!r} here; the buttons are: {known}.")
        if not 0 <= at <= duration:
            raise Unprocessable(f"{label} must be pressed between 0 and {duration:g} seconds.")
        presses.append((float(at), programs.buttons[label]))
    return sorted(presses, key=lambda press: press[0])
