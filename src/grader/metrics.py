"""What one process counts of itself, in Prometheus' terms. `monitoring.py` shows it, with the state of the queue.

Times are in seconds. Counters begin at zero with the process, as Prometheus expects it.
"""

import fcntl
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

from prometheus_client import Counter, Histogram, disable_created_metrics

FOLDER = "PROMETHEUS_MULTIPROC_DIR"
"""The variable that makes the Prometheus client keep what it counts in files of a folder, to add up processes."""

FOLDERS = "grader-metrics-"
"""How the names of such folders begin."""

# They would double the series: beside every counter and histogram, when it was made.
disable_created_metrics()  # type: ignore[no-untyped-call]

REQUESTS = Counter("grader_http_requests", "Requests answered.", ["method", "route", "status"])
REQUEST_S = Histogram(
    "grader_http_request_duration_seconds", "From the headers of a request to the end of its response.", ["route"],
    buckets=(0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 5.0),
)  # fmt: skip

VERDICTS = Counter("grader_verdicts", "Verdicts given: gradings, regrades and reviews.", ["status"])

WAITING_S = Histogram(
    "grader_job_waiting_seconds", "From handing in to the first try of a job.", ["topic"],
    buckets=(0.01, 0.05, 0.1, 0.5, 1.0, 5.0, 15.0, 60.0, 300.0, 1800.0),
)  # fmt: skip
RUNNING_S = Histogram(
    "grader_job_running_seconds", "One try of a job, such as grading a script.", ["topic"],
    buckets=(0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 15.0, 60.0, 300.0),
)  # fmt: skip
JOBS_FAILED = Counter("grader_job_failures", "Tries of jobs that failed through a fault of ours.", ["topic"])

GRADERS_BROKEN = Counter("grader_grading_process_breaks", "Grading processes that broke or ended, and are replaced.")


@contextmanager
def shared_folder() -> Iterator[str]:
    """A new folder for what several processes count, removed at the end; removes those that killed processes left.

    The lock of a folder is its owner's, and ends with it. Only a locked folder has files, so an empty one is left.
    """
    for left in Path(gettempdir()).glob(f"{FOLDERS}*"):
        with suppress(OSError), locked(left):  # it is in use, or another user's
            if any(left.iterdir()):
                shutil.rmtree(left)
    with TemporaryDirectory(prefix=FOLDERS) as folder, locked(Path(folder)):
        yield folder


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Holds the lock of a folder, which child processes do not inherit. Raises OSError if another process has it."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(descriptor)
