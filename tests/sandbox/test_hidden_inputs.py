"""Hidden inputs: they reach the script's process late, and nothing that the script says afterwards tells of them."""

import pytest

from grader.domain.run import Job, Limits, RunReport, RunStatus
from grader.sandbox.jail import Jail

SECRET = "0.8371"
DRIVER = """
def run(student, inputs, submit):
    submit("visible", [student.answer(inputs["x"])])
    for x in hidden_inputs()["xs"]:
        submit("hidden", [student.answer(x)])
"""
LIMITS = Limits(cpu_s=2, wall_s=5, memory_mb=256, output_kb=16)


def run(jail: Jail, source: str, *, without_integrators: bool = False) -> RunReport:
    return jail.run(
        Job(
            source,
            DRIVER,
            {"x": 1.5},
            LIMITS,
            without_integrators=without_integrators,
            hidden_inputs={"xs": [float(SECRET)]},
        )
    )


@pytest.mark.parametrize("without_integrators", [False, True])
def test_what_is_printed_of_hidden_inputs_is_not_kept(jail: Jail, without_integrators: bool) -> None:
    source = (
        "import sys\nprint('imported')\ndef answer(x):\n    print(x)\n    print(x, file=sys.stderr)\n    return 2 * x"
    )
    report = run(jail, source, without_integrators=without_integrators)
    assert (report.status, report.stdout, report.stderr) == (RunStatus.RETURNED, "imported\n1.5\n", "1.5\n")
    assert list(report.results) == ["visible"]
    assert report.hidden_results["hidden"].tolist() == [2 * float(SECRET)]


def test_the_moments_at_which_results_arrive_after_the_hidden_inputs_are_not_told(jail: Jail) -> None:
    held_back = "os.write(3, b'A\\x02t0B\\x00' + struct.pack('<I', 1) + b'x')"
    source = f"import os, struct\ndef answer(x):\n    if x != 1.5:\n        {held_back}\n    return x"
    heard: list[str] = []
    report = jail.run(Job(source, DRIVER, {"x": 1.5}, LIMITS, hidden_inputs={"xs": [0.25]}, heard=heard.append))
    assert [*report.hidden_results] == ["t0", "hidden"]
    assert heard == ["visible"]


@pytest.mark.parametrize(
    "line",
    [
        "os.write(saved, str(x).encode())",
        "os.write(3, b'A\\x06stolenB\\x01' + struct.pack('<I', 6) + struct.pack('<I', 6) + str(x).encode()[:6])",
        "os.write(3, struct.pack('<cBH', b'E', 1, 6) + str(x).encode()) and os._exit(0)",
        "raise SystemExit(str(x))",
        "raise MemoryError(str(x))",
        "raise PermissionError(1, str(x))",
        "raise ValueError(x)",
        "os.kill(os.getpid(), 11)",
        "print(x, flush=True) or time.sleep(60)",
        "sys.stdout.write('x' * 100_000 + str(x))",
    ],
)
def test_hidden_inputs_do_not_leave_the_process(jail: Jail, line: str) -> None:
    source = f"""
import os, struct, sys, time
saved = os.dup(1)
def answer(x):
    if x != 1.5:
        {line}
    return x
"""
    report = run(jail, source)
    assert SECRET not in report.stdout + report.stderr + report.reason
    assert all(SECRET.encode() not in array.tobytes() for array in report.results.values())


@pytest.mark.parametrize(
    "line",
    [
        "os.write(3, b'A' + bytes([len(name)]) + name + b'Z')",
        "os.write(3, (b'A' + bytes([len(name)]) + name + b'B\\x00' + struct.pack('<I', 1) + b'x') * 2)",
        "os._exit(83)",
    ],
)
def test_neither_broken_frames_nor_exit_codes_tell_of_hidden_inputs(jail: Jail, line: str) -> None:
    source = f"""
import os, struct
def answer(x):
    if x != 1.5:
        name = b'h' + str(x)[2:].encode()
        {line}
    return x
"""
    report = run(jail, source)
    assert report.status is RunStatus.CRASHED
    assert report.reason and "83" not in report.reason


def test_a_script_that_asks_for_them_early_loses_its_own_output(jail: Jail) -> None:
    source = """
import json, os, struct
os.write(3, b"WW")
def part():
    size = struct.unpack("<I", os.read(4, 4))[0]
    return os.read(4, size).decode()
print(part(), part(), flush=True)
os._exit(0)
"""
    report = run(jail, source)
    assert report.status is RunStatus.CRASHED
    assert SECRET not in report.stdout + report.stderr + report.reason


def test_a_script_that_never_asks_does_not_get_them(jail: Jail) -> None:
    source = """
import select, os
def answer(x):
    return float(x == 1.5 and bool(select.select([4], [], [], 0.3)[0]))
"""
    report = run(jail, source)
    assert report.results["visible"].tolist() == [0.0]


def test_what_is_printed_before_is_kept_when_the_script_is_killed_later(jail: Jail) -> None:
    source = "print('kept')\ndef answer(x):\n    while x != 1.5:\n        print(x)\n    return x"
    report = run(jail, source)
    assert report.status in (RunStatus.TIMED_OUT, RunStatus.OUTPUT_TOO_LARGE)
    assert report.stdout == "kept\n"
