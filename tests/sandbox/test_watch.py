"""The order in which the supervisor answers a child, with this test in the place of child and keeper."""

import json
import os
import select
import socket
import subprocess
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from grader.domain.run import Job
from grader.sandbox.watch import Watch
from grader.sandbox.zygote import Child

PARTS = [lambda: b"first", lambda: b"visible", lambda: b"hidden"]
PATIENCE_S = 0.5
"""Long enough to see what should not arrive; where it arrives, it takes a millisecond."""


class Played:
    """A child whose ends the test holds; the process that is watched sleeps."""

    def __init__(self) -> None:
        zygote: Any = None
        self.child, theirs = Child.open(zygote)
        self.job, self.stdout, self.stderr, self.results, status = theirs
        self.keeper = socket.socket(fileno=status)
        self.sleeper = subprocess.Popen(["sleep", "60"])
        self.child.pid, self.child.pidfd = self.sleeper.pid, os.pidfd_open(self.sleeper.pid)
        for descriptor in (self.child.job, self.child.stdout, self.child.stderr, self.child.results):
            os.set_blocking(descriptor, False)

    def hears(self) -> bytes:
        """What has arrived on the job's channel, after a while."""
        heard = b""
        while select.select([self.job], [], [], PATIENCE_S)[0] and (read := os.read(self.job, 1 << 16)):
            heard += read
        return heard

    def end(self) -> None:
        """Dies, and lets the keeper report it."""
        self.keeper.send(json.dumps({"ended": 9, "cpu_s": 0.0, "stepped": 0}).encode())
        self.sleeper.kill()
        self.sleeper.wait()


@pytest.fixture
def played() -> Iterator[Played]:
    one = Played()
    yield one
    one.keeper.close()
    ours = (one.child.job, one.child.stdout, one.child.stderr, one.child.results, one.child.pidfd)
    for descriptor in (one.job, one.stdout, one.stderr, one.results, *(d for d in ours if d >= 0)):
        os.close(descriptor)
    one.child.status.close()


@pytest.mark.slow
def test_no_inputs_are_sent_before_the_integrators_are_removed(played: Played) -> None:
    watch = Watch(played.child, Job("", "", {}), PARTS, without_integrators=True)
    run = threading.Thread(target=watch.run)
    run.start()
    try:
        assert played.hears().endswith(b"first")
        os.write(played.results, b"WW")  # both requests at once
        assert json.loads(played.keeper.recv(1000)) == {"remove": "integrators"}
        assert played.hears() == b""
        played.keeper.send(b"removed")
        heard = played.hears()
        assert heard.index(b"visible") < heard.index(b"hidden")
    finally:
        played.end()
        run.join()
