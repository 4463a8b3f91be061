"""A judge that asks step by step: however hostile what a script's process answers, it ends with a status."""

import os
import re
import struct
import time

import pytest

from grader.domain.run import (
    ANSWER_BYTES_MAX,
    Channel,
    ChannelClosed,
    Job,
    Limits,
    MalformedAnswer,
    RunReport,
    RunStatus,
)
from grader.sandbox.jail import Jail

pytestmark = pytest.mark.jail

DRIVER = """
def run(student, inputs, submit):
    message = exchange(None)
    while message is not None:
        message = exchange(student.answer(message))
    submit("visible", [1.0])
    if inputs["more"]:
        hidden_inputs()
        message = exchange(None)
        while message is not None:
            message = exchange(student.answer(message))
"""
LIMITS = Limits(cpu_s=2, wall_s=2, memory_mb=256, output_kb=16)
ECHO = "def answer(message):\n    return message\n"


def talk(jail: Jail, source: str, steps: int = 3, *, asks: object = None, hidden: bool = False) -> RunReport:
    def play(channel: Channel) -> list[bytes]:
        answers: list[bytes] = []
        try:
            answers.extend(channel.ask(b"%d" % step) for step in range(steps))
            channel.end()
            if hidden:
                channel.wait_for_hidden()
                answers.append(channel.ask(b"secret"))
                channel.end()
        except ChannelClosed:
            answers.append(b"closed")
        return answers

    chosen = asks if callable(asks) else play
    more: dict[str, list[int]] = {"secrets": []} if hidden else {}
    return jail.run(Job(source, DRIVER, {"more": hidden}, LIMITS, hidden_inputs=more, talk=chosen))


def test_every_message_is_answered_in_order(jail: Jail) -> None:
    report = talk(jail, ECHO, 1000)
    assert report.status is RunStatus.RETURNED, report.reason
    assert report.talked == [b"%d" % step for step in range(1000)]
    assert report.results["visible"].tolist() == [1.0]


def test_judge_and_script_take_turns_on_one_core(jail: Jail) -> None:
    cores = os.sched_getaffinity(0)
    source = "import os\ndef answer(message):\n    return repr(os.sched_getaffinity(0)).encode()\n"
    report = talk(jail, source, asks=lambda channel: [channel.ask(b"x"), os.sched_getaffinity(0), channel.end()])
    theirs, ours, _ = report.talked
    assert theirs.decode() == repr(ours)
    assert len(ours) == 1 and os.sched_getaffinity(0) == cores


def test_large_messages_and_answers_pass_whole(jail: Jail) -> None:
    large = bytes(range(256)) * (ANSWER_BYTES_MAX // 256)
    report = talk(jail, ECHO, asks=lambda channel: [channel.ask(large) == large for _ in range(20)] + [channel.end()])
    assert (report.status, report.talked) == (RunStatus.RETURNED, [True] * 20 + [None])


def test_what_is_printed_of_a_hidden_message_is_not_kept(jail: Jail) -> None:
    source = (
        "import sys\ndef answer(m):\n    print(m.decode(), flush=True)\n    print(m, file=sys.stderr)\n    return m"
    )
    report = talk(jail, source, 1, hidden=True)
    assert (report.status, report.talked) == (RunStatus.RETURNED, [b"0", b"secret"])
    assert "secret" not in report.stdout + report.stderr
    assert report.stdout == "0\n"


FORGES = "import os, struct\ndef frame(b, size=None):\n    return b'C' + struct.pack('<I', size or len(b)) + b\n"
FORGED = "not asked|cannot be used"
"""An answer too many is noticed when it arrives before the next question, else when one is left at the end."""


@pytest.mark.parametrize(
    ("source", "status", "why"),
    [
        ("import time\ndef answer(m):\n    time.sleep(60)", RunStatus.TIMED_OUT, "still waiting"),
        ("def answer(m):\n    while True: pass", RunStatus.TIMED_OUT, "CPU time"),
        ("import os\ndef answer(m):\n    os._exit(0)", RunStatus.CRASHED, "ended its own process"),
        ("def answer(m):\n    raise SystemExit", RunStatus.CRASHED, r"called exit\(\)"),
        ("def answer(m):\n    return m * 70000", RunStatus.CRASHED, "answered what it was not asked"),
        (f"{FORGES}def answer(m):\n    os.write(3, frame(m))\n    return m", RunStatus.CRASHED, FORGED),
        (f"{FORGES}os.write(3, frame(b'early') * 2)\n{ECHO}", RunStatus.CRASHED, FORGED),
        (f"{FORGES}def answer(m):\n    os.write(3, b'zzz')\n    return m", RunStatus.TIMED_OUT, "still waiting"),
        (f"{FORGES}def answer(m):\n    os.write(3, frame(m, 9))\n    return m", RunStatus.TIMED_OUT, "still waiting"),
        (f"{FORGES}def answer(m):\n    while True: os.write(3, frame(m, 2 ** 32 - 1))", RunStatus.CRASHED, FORGED),
        (f"{FORGES}def answer(m):\n    while True: os.write(3, b'A' * 60000)", RunStatus.OUTPUT_TOO_LARGE, "sent back"),
        ("def answer(m):\n    while True: print('x' * 1000)", RunStatus.OUTPUT_TOO_LARGE, "printed"),
        ("import socket\ndef answer(m):\n    socket.socket()", RunStatus.FORBIDDEN, "may not"),
        ("def answer(m):\n    return bytearray(1 << 30)", RunStatus.OUT_OF_MEMORY, "Memory"),
        ("import os\ndef answer(m):\n    os.close(4)\n    return m", RunStatus.CRASHED, ""),
        ("import os\ndef answer(m):\n    os.close(3)\n    return m", RunStatus.CRASHED, ""),
        ("import os\nos.read(4, 1 << 16)\ndef answer(m):\n    return m", RunStatus.TIMED_OUT, "still waiting"),
        ("import os\nos.write(3, b'WWWW')\ndef answer(m):\n    return m", RunStatus.CRASHED, FORGED),
        (f"{FORGES}os.write(3, b'E' + struct.pack('<BH', 0, 0))\n{ECHO}", RunStatus.TIMED_OUT, "still waiting"),
    ],
)  # fmt: skip
def test_a_hostile_script_gets_a_status_in_time(jail: Jail, source: str, status: RunStatus, why: str) -> None:
    started = time.monotonic()
    report = talk(jail, source)
    assert report.status is status, report.reason
    assert re.search(why, report.reason), report.reason
    assert time.monotonic() - started < 20


def test_the_time_that_the_judge_takes_is_not_the_scripts(jail: Jail) -> None:
    def slow(channel: Channel) -> int:
        for _ in range(3):
            channel.ask(b"1")
            time.sleep(1)  # together longer than LIMITS.wall_s
        channel.end()
        return 3

    report = talk(jail, ECHO, asks=slow)
    assert (report.status, report.talked) == (RunStatus.RETURNED, 3)


def test_an_answer_that_the_judge_cannot_read_ends_the_script(jail: Jail) -> None:
    def strict(channel: Channel) -> None:
        channel.ask(b"1")
        raise MalformedAnswer

    report = talk(jail, ECHO, asks=strict)
    assert (report.status, report.talked) == (RunStatus.CRASHED, None)


def test_a_case_may_take_less_time_than_the_job(jail: Jail) -> None:
    def limited(channel: Channel) -> None:
        channel.limit(0.2)
        channel.ask(b"1")

    started = time.monotonic()
    report = talk(jail, "def answer(m):\n    while True: pass", asks=limited)
    assert (report.status, "one case" in report.reason) == (RunStatus.TIMED_OUT, True)
    assert report.cpu_s < 1 < 10 > time.monotonic() - started


def test_a_fault_of_the_judge_is_raised_and_leaves_the_jail_usable(jail: Jail) -> None:
    def broken(channel: Channel) -> None:
        channel.ask(b"1")
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        talk(jail, ECHO, asks=broken)
    assert talk(jail, ECHO).status is RunStatus.RETURNED


def test_without_a_talk_nothing_behind_an_answer_is_read(jail: Jail) -> None:
    driver = "def run(student, inputs, submit):\n    submit('x', [1.0])"
    source = "import os\nos.write(3, b'C' + %r + b'x')" % struct.pack("<I", 1)  # noqa: UP031
    report = jail.run(Job(source, driver, {}, LIMITS))
    assert (report.status, report.talked) == (RunStatus.TIMED_OUT, None)
