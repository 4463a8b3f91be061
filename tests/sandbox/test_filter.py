"""The compiled filter, interpreted for both machines: what it answers to every call that the policy names."""

import errno
import struct
from collections.abc import Iterator

import pyseccomp as sc
import pytest

from grader.sandbox import policy
from grader.sandbox.locks import seccomp

# linux/audit.h, linux/seccomp.h
MACHINES = {sc.Arch.X86_64: 0xC000003E, sc.Arch.AARCH64: 0xC00000B7}
ALLOW, KILL = 0x7FFF0000, 0x80000000
EPERM, ENOSYS, ENOTTY, ENOMEM = (0x50000 | number for number in (errno.EPERM, errno.ENOSYS, errno.ENOTTY, errno.ENOMEM))
A_THREAD, NEW_USER, A_CHILD = seccomp.A_THREAD, 0x10000000, 17
BY_ARGUMENTS = [
    ("clone", (A_THREAD,), ALLOW),
    ("clone", (A_THREAD | NEW_USER,), ENOSYS),
    ("clone", (A_CHILD,), EPERM),
    ("clone3", (), ENOSYS),
    ("mmap", (0, 4096, 3, 0x22), ALLOW),
    ("mmap", (0, 4096, 7, 0x22), EPERM),  # writable and executable
    ("mmap", (0, 4096, 5, 0x22), EPERM),  # executable and anonymous
    ("mmap", (0, 4096, 5, 0x02), ALLOW),  # a library
    ("mmap", (0, 4096, 5, 0x01), ENOSYS),  # executable and shared
    ("mmap", (0, 4096, 3, 0x21), ENOMEM),
    ("mprotect", (0, 4096, 3), ALLOW),
    ("mprotect", (0, 4096, 5), EPERM),
    ("fcntl", (0, 1), ALLOW),
    ("prctl", (policy.PR_SET_NAME,), ALLOW),
    ("prctl", (4,), EPERM),
    ("prlimit64", (0, 1, 0), ALLOW),
    ("prlimit64", (0, 1, 1), EPERM),
    ("tgkill", (1, 1, 9), ALLOW),
    ("tgkill", (2, 2, 9), EPERM),
    ("ioctl", (), ENOTTY),
]


@pytest.fixture(params=MACHINES, ids=["x86_64", "aarch64"])
def machine(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture
def program(machine: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[bytes]:
    """The filter that the jail builds on that machine."""

    class Filter(sc.SyscallFilter):  # type: ignore[misc]
        def __init__(self, default: int) -> None:
            super().__init__(default)
            if machine != sc.system_arch():
                self.add_arch(machine)
                self.remove_arch(sc.system_arch())

    monkeypatch.setattr(sc, "SyscallFilter", Filter)
    seccomp.build_filter.cache_clear()
    yield seccomp.build_filter()
    seccomp.build_filter.cache_clear()


def answer(program: bytes, machine: int, number: int, arguments: tuple[int, ...] = ()) -> int:
    """Interpret classic BPF (linux/filter.h) over `struct seccomp_data`."""
    data = struct.pack("<iIQ6Q", number, machine, 0, *(arguments + (0,) * 6)[:6])
    instructions = list(struct.iter_unpack("<HBBI", program))
    value = at = 0
    while True:
        code, if_true, if_false, constant = instructions[at]
        at += 1
        match code:
            case 0x20:
                (value,) = struct.unpack_from("<I", data, constant)
            case 0x54:
                value &= constant
            case 0x06:
                return int(constant)
            case 0x05:
                at += constant
            case _:
                holds = {0x15: value == constant, 0x25: value > constant, 0x35: value >= constant}[code]
                at += if_true if holds else if_false


def test_every_call_is_answered_as_the_policy_says(program: bytes, machine: int) -> None:
    audit, tried = MACHINES[machine], 0
    for names, wanted in ((policy.ALLOWED, ALLOW), (policy.REFUSED, EPERM), (policy.KILLED, KILL)):
        for name in names:
            number = sc.resolve_syscall(machine, name)
            if number >= 0:  # negative where the machine has no such call
                assert answer(program, audit, number) == wanted, name
                tried += 1
    assert tried > 200

    for name, arguments, answered in BY_ARGUMENTS:
        assert answer(program, audit, sc.resolve_syscall(machine, name), arguments) == answered, (name, arguments)
    for foreign in (0x40000003, 0x40000028, *(audit for one, audit in MACHINES.items() if one != machine)):
        assert answer(program, foreign, 0) == KILL
