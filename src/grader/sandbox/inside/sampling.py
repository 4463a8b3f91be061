"""Samples where a script spends its time, once half of its limit is used up: a script that is in time pays nothing. A
timer of CPU time, and one of wall time for scripts that wait, raise a signal some tens of times; its handler counts the
innermost line of the student's file, and sees which calls go on all the time. For about one interval mj_step and
mj_forward are counted as well. What was seen is sent twice before the end, as the array `where` of JSON text: a claim,
like all that this process sends."""

import contextlib
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from types import FrameType
from typing import Any

START = 0.5
"""The share of a limit after which the sampling begins."""
SAMPLES = 50
"""Samples until the limit is reached."""
SEND_AT = (20, 40)
"""After so many samples of one timer what was seen is sent."""
TOLD_MAX = 8
COUNTED = ("mj_step", "mj_forward")


class Sampler:
    """Counts lines of the file `filename`; `send` writes one array, and must not be interrupted by itself."""

    def __init__(self, filename: str, send: Callable[[str, bytes], None]) -> None:
        self.filename, self.send = filename, send
        self.lines: Counter[int] = Counter()
        self.outer: Counter[int] = Counter()
        """Lines of the outermost call in the student's file: where the innermost lines are called from."""
        self.stays: int | None = None
        self.ticks: Counter[int] = Counter()
        self.sent = 0
        self.rates: dict[str, float] = {}
        self.counting: dict[str, tuple[Any, list[int]]] = {}
        self.since = 0.0
        self.count_s_min = 0.0
        """Shortest time in which calls are counted [s]: on a busy machine two signals may come at once."""

    def start(self, cpu_s: float, wall_s: float) -> None:
        """Sets both timers."""
        self.count_s_min = (1 - START) * cpu_s / SAMPLES / 2
        timers = ((signal.SIGPROF, signal.ITIMER_PROF, cpu_s), (signal.SIGALRM, signal.ITIMER_REAL, wall_s))
        for number, timer, limit_s in timers:
            signal.signal(number, self.sample)
            signal.setitimer(timer, START * limit_s, (1 - START) * limit_s / SAMPLES)

    def sample(self, number: int, frame: FrameType | None) -> None:
        """Counts the line that is running; called by the signal, between two instructions of the script."""
        with contextlib.suppress(Exception):
            own = list(self.own_frames(frame))
            if own:
                self.lines[own[0].f_lineno] += 1
                self.outer[own[-1].f_lineno] += 1
                self.stays = find_staying(own)
            self.ticks[number] += 1
            if number == signal.SIGPROF and self.ticks[number] == 1:
                self.begin_counting()
            elif self.counting and time.process_time() >= self.since + self.count_s_min:
                self.end_counting()
            if self.ticks[number] in SEND_AT:
                self.tell()

    def own_frames(self, frame: FrameType | None) -> Iterator[FrameType]:
        """Yields the frames of the student's file, the innermost first."""
        while frame is not None:
            if frame.f_code.co_filename == self.filename:
                yield frame
            frame = frame.f_back

    def begin_counting(self) -> None:
        """Counts calls of MuJoCo's functions from here to the next sample."""
        mujoco: Any = sys.modules["mujoco"]
        for name in COUNTED:
            plain, calls = getattr(mujoco, name), [0]

            def counted(*arguments: Any, plain: Any = plain, calls: list[int] = calls, **named: Any) -> Any:
                calls[0] += 1
                return plain(*arguments, **named)

            self.counting[name] = counted, calls
            setattr(mujoco, name, counted)
            counted.__wrapped__ = plain  # type: ignore[attr-defined]
        self.since = time.process_time()

    def end_counting(self) -> None:
        """Restores the functions, and notes how often each was called in a second of CPU time."""
        mujoco: Any = sys.modules["mujoco"]
        taken_s = time.process_time() - self.since
        for name, (counted, calls) in self.counting.items():
            if getattr(mujoco, name) is counted:  # else the driver or the script has exchanged it, and the count lacks
                setattr(mujoco, name, counted.__wrapped__)
                self.rates[name] = calls[0] / taken_s
        self.counting.clear()

    def tell(self) -> None:
        """Sends what was seen so far."""
        summary = {"lines": self.lines.most_common(TOLD_MAX), "samples": self.lines.total(), "rates": self.rates}
        summary |= {"outer": self.outer.most_common(TOLD_MAX), "stays": self.stays}
        self.send(f"where{self.sent}", json.dumps(summary).encode())
        self.sent += 1


def find_staying(own: Sequence[FrameType]) -> int | None:
    """Returns the line of the innermost call that has gone on since the first sample; None at the first sample. Where
    all calls of that time have ended, a new first sample begins. A frame is marked by its local trace function, which
    nothing calls unless the script traces itself."""
    for frame in own:
        if frame.f_trace is mark_frame:
            return frame.f_lineno
    for frame in own:
        frame.f_trace = mark_frame
    return None


def mark_frame(*_: object) -> Any:
    """Marks a frame."""
    return mark_frame
