"""Grading processes that go from one server of a test to the next: to start one, with its jail and the attacks on it,
takes more than a second of CPU time. Each server still judges in a process and a jail of its own while it runs."""

from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty

import pytest

from grader.grading.processes import Graders, GradingProcess

SPARES: dict[bool, list[GradingProcess]] = {False: [], True: []}
"""Idle processes, by whether they accept a machine without namespaces."""

SPARES_MAX = 2


def end_spares() -> None:
    """Ends the processes that nobody uses."""
    for spares in SPARES.values():
        while spares:
            spares.pop().close()


@contextmanager
def keeping_spares() -> Iterator[None]:
    """Within the block an idle process of graders that close is kept, and the next that start take it."""
    make, close = Graders._new, Graders.close

    def take(graders: Graders) -> GradingProcess:
        spares = SPARES[graders._allow_t2]
        while spares:
            if (spare := spares.pop()).alive:
                return spare
            spare.close()
        return make(graders)

    def keep(graders: Graders) -> None:
        spares, busy = SPARES[graders._allow_t2], list[GradingProcess]()
        idle = set(drain(graders))
        for place, process in enumerate(graders._all):
            keeps = place in idle and process.alive and len(spares) < SPARES_MAX
            (spares if keeps else busy).append(process)
        graders._all = busy
        close(graders)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Graders, "_new", take)
        patch.setattr(Graders, "close", keep)
        yield


def drain(graders: Graders) -> Iterator[int]:
    """The places of idle processes."""
    try:
        while True:
            yield graders._free.get_nowait()
    except Empty:
        return
