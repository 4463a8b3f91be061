"""Job and RunReport: what goes into the jail and what comes back out of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

SOURCE_BYTES_MAX = 256 * 1024


class Limits(BaseModel):
    """What a script may use. CPU time decides; wall time only ends a process that is stuck."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    cpu_s: float = Field(default=10.0, gt=0, le=120)
    wall_s: float = Field(default=60.0, gt=0, le=600)
    memory_mb: int = Field(default=512, ge=256, le=4096)
    output_kb: int = Field(default=64, ge=1, le=1024)


@dataclass(frozen=True)
class Job:
    """One script to run: `driver` is our source text, run in the jail around the student's module.

    The driver is executed BEFORE the student's module is imported, so that what it patches (its optional
    `prepare(inputs)` is called then) is what the student's `from mujoco import ...` finds. After the import its
    `run(student, inputs, submit)` is called: `student` is the module, `inputs` plain JSON, and
    `submit(name, array)` hands back one named array of numbers (text travels as uint8).
    """

    source: str
    driver: str
    inputs: Mapping[str, Any]
    limits: Limits = field(default_factory=Limits)
    filename: str = "submission.py"


class RunStatus(StrEnum):
    """How the script ended, by evidence from outside where there is any."""

    RETURNED = "returned"
    CRASHED = "crashed"
    TIMED_OUT = "timed_out"
    OUT_OF_MEMORY = "out_of_memory"
    OUTPUT_TOO_LARGE = "output_too_large"
    FORBIDDEN = "forbidden"


@dataclass(frozen=True)
class RunReport:
    """How a script ended and what it returned. `results` is a claim of the student's process, never evidence."""

    status: RunStatus
    reason: str = ""
    results: Mapping[str, NDArray[np.generic]] = field(default_factory=dict)
    stdout: str = ""
    stderr: str = ""
    cpu_s: float = 0.0
    wall_s: float = 0.0
