"""Job and RunReport: the input and the output of a run in the jail."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

SOURCE_BYTES_MAX = 256 * 1024
"""Largest script, model or file that is handed in."""

MODULE_BYTES_MAX = 2 * SOURCE_BYTES_MAX
"""Largest module that the jail imports: one that holds a model or a file in base64 is a third larger than that."""


def ignore(*_: object) -> None:
    """Listens to nothing."""


def never() -> bool:
    """Never."""
    return False


class ChannelClosed(Exception):
    """The script's process has ended, or a limit has ended it: nothing more can be asked."""


class MalformedAnswer(Exception):
    """The script's process has answered what no driver answers; raised by a talk, it ends the script."""


class Channel(Protocol):
    """Asks the driver of a running script, one message at a time."""

    def ask(self, message: bytes) -> bytes:
        """Sends a message and returns the answer, a claim of at most ANSWER_BYTES_MAX. Raises ChannelClosed."""

    def end(self) -> None:
        """Tells the driver that the messages of one trial end here: its `exchange` returns None."""

    def wait_for_hidden(self) -> None:
        """Waits until the driver has asked for the hidden inputs: what is asked from here on may be hidden. Raises
        ChannelClosed."""

    def limit(self, cpu_s: float) -> None:
        """Allows the script this much CPU time from now on [s], until the next call; never more than the job does."""

    def tell(self, name: str) -> None:
        """Tells the job's `heard` that the part of this name is done."""


ANSWER_BYTES_MAX = 64 * 1024
"""The longest answer over a channel."""


class Limits(BaseModel):
    """Resources that a script may use. CPU time is the limit; wall time ends a process that hangs."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cpu_s: float = Field(default=10.0, gt=0, le=120)
    wall_s: float = Field(default=60.0, gt=0, le=600)
    memory_mb: int = Field(default=512, ge=256, le=4096)
    output_kb: int = Field(default=64, ge=1, le=1024)


@dataclass(frozen=True)
class Job:
    """A script to run in the jail, with the source text of a driver that calls it. The driver is executed before the
    student's module is imported, so that the student's `from mujoco import ...` finds its patches. After the import its
    `run(student, inputs, submit)` is called: `student` is the module, `inputs` plain JSON, and `submit(name, array)`
    returns one named array of numbers (text as uint8). The inputs reach the process after the import. A driver that
    defines `compile_source(source, filename)` compiles the module itself.

    `codes` are code objects as `marshal` writes them, which the driver finds by name among its names, in `codes`.

    `hidden_inputs` reach it when the driver calls `hidden_inputs()`, a name that the jail defines. Output after that
    call is dropped, and results are kept apart. `late_inputs` returns what is added to them at that moment; it must
    not raise, and may wait a little.

    `without_integrators`: MuJoCo's integrators are removed from the process after the module has been imported, before
    the inputs reach it. Nothing steps a model from there on; the report counts the attempts. Where the jail
    `keeps_integrators` they stay. Models compile as before, except those with muscles, whose length range MuJoCo
    simulates: the driver must compile these at its top level, before the import.

    `sent` is called once the process has the script and works, `heard` with the name of every result as it arrives, but
    for those after the request for the hidden inputs; both in the thread of the run, which also asks `is_stopped`,
    several times a second, whether to end the script.

    `talk` is called with a channel to the driver once that has its inputs: the driver's `exchange(answer)` sends an
    answer, None at first, and returns the next message, None at the end of a trial. Time in which the script waits for
    `talk` is not counted. `talk` runs in the thread of the run; it lets ChannelClosed pass, or returns what it has."""

    source: str
    driver: str
    inputs: Mapping[str, Any]
    limits: Limits = field(default_factory=Limits)
    filename: str = "submission.py"
    without_integrators: bool = False
    hidden_inputs: Mapping[str, Any] = field(default_factory=dict)
    late_inputs: Callable[[], Mapping[str, Any]] = dict
    codes: Mapping[str, bytes] = field(default_factory=dict)
    sent: Callable[[], object] = ignore
    heard: Callable[[str], object] = ignore
    is_stopped: Callable[[], bool] = never
    talk: Callable[[Channel], object] | None = None


class RunStatus(StrEnum):
    """How the script ended, as observed from outside the process if possible."""

    RETURNED = "returned"
    CRASHED = "crashed"
    TIMED_OUT = "timed_out"
    OUT_OF_MEMORY = "out_of_memory"
    OUTPUT_TOO_LARGE = "output_too_large"
    FORBIDDEN = "forbidden"


@dataclass(frozen=True)
class RunReport:
    """How a script ended, and what it returned. `results` come from the student's process and prove nothing. `stepped`
    counts calls of MuJoCo's integrators after they were removed (see Job). Where it is above zero the script has tried
    to use them. A hostile script can keep it at zero, but cannot step."""

    status: RunStatus
    reason: str = ""
    results: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    hidden_results: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    """Results that arrived after the request for the hidden inputs."""
    stdout: str = ""
    stderr: str = ""
    cpu_s: float = 0.0
    wall_s: float = 0.0
    stepped: int = 0
    talked: Any = None
    """What the job's `talk` returned; None if it did not. Of all that is here only this is ours."""
