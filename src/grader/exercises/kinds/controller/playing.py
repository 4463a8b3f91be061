"""Asks the student's function for the controls at each period of the simulation; only what is observed leaves it."""

from math import isfinite
from struct import pack

import numpy as np

from grader.domain.progress import TrialProgress
from grader.domain.run import ChannelClosed, MalformedAnswer
from grader.exercises.episodes.parameters import Problem
from grader.exercises.episodes.simulating import EpisodeRun, Fault, Floats, Record, Seen
from grader.exercises.kind import Ask
from grader.exercises.kinds.controller.parameters import ControllerParameters
from grader.exercises.trace import is_line
from grader.sandbox.cleaning import read_json

RAISED_CHARS_MAX = 300


def play_case(parameters: ControllerParameters, problem: Problem, ask: Ask) -> list[Record]:
    """Returns the records of all episodes. Raises MalformedAnswer and ChannelClosed."""
    episodes = len(problem.episodes)
    records = []
    for index in range(episodes):
        if episodes > 1:
            ask.tell(TrialProgress(index + 1, episodes, "episode"))
        records.append(play_episode(parameters, problem, index, ask))
    return records


def read_answer(answer: bytes, nu: int) -> Floats | tuple[str, int | None]:
    """Returns the controls, or the exception and its line. Raises MalformedAnswer for what no driver sends."""
    if answer[:1] == b"C" and len(answer) in (1, 1 + 8 * nu):
        controls = np.frombuffer(answer, "<f8", offset=1)
        if all(map(isfinite, controls.tolist())):  # of few numbers in half the time of NumPy's
            return controls
    if answer[:1] == b"X":
        try:
            crash = read_json(answer[1:])
            return str(crash["raised"])[:RAISED_CHARS_MAX], crash["line"] if is_line(crash["line"]) else None
        except (ValueError, KeyError, TypeError, RecursionError):
            pass
    raise MalformedAnswer


def play_episode(parameters: ControllerParameters, problem: Problem, index: int, ask: Ask) -> Record:
    """Runs one episode to its end, to MuJoCo's first warning, or to an exception of the student's function. Where it is
    the only one, tells each simulated second."""
    run, nu = EpisodeRun(parameters, problem, index), problem.model.nu
    seconds = round(parameters.duration_s)
    second = seconds if len(problem.episodes) > 1 else 0
    step = 0
    try:
        begun = read_answer(ask(b"B"), nu)
        if isinstance(begun, tuple):
            return run.finish(Fault(*begun, index + 1, 0, 0.0))
        for step in range(1, problem.periods + 1):
            answer = read_answer(ask(write_message(parameters.form, run.observe())), nu)
            if run.plant.data.time > second + 1 <= seconds:
                second += 1
                ask.tell(TrialProgress(second, seconds, "s"))
            if isinstance(answer, tuple):
                return run.finish(Fault(*answer, index + 1, step, run.plant.data.time))
            if len(answer) != nu:
                raise MalformedAnswer
            if not run.apply(answer):
                break
    except ChannelClosed as closed:
        several = f"episode {index + 1}, " if len(problem.episodes) > 1 else ""
        where = (
            f"{several}step {step} at t = {run.plant.data.time:.6g} s" if step else f"{several}before the first step"
        )
        closed.add_note(where)
        raise
    return run.finish()


def write_message(form: str, seen: Seen) -> bytes:
    """Returns the message that asks for the controls of a step."""
    parts = (seen.observed,) if form == "make" else (seen.state, seen.target)
    return b"".join((b"S", pack("<d", seen.time_s), *(part.tobytes() for part in parts)))
