"""Runs programs as an ordinary user, where the tests themselves run as root."""

import os
import sys

NOBODY = 65534

BECOME = """
import os, sys
user, *command = sys.argv[1:]
os.setgroups([])
os.setgid(int(user))
os.setuid(int(user))
os.execvp(command[0], command)
"""


def as_user(user: int, *command: str) -> list[str]:
    """The command of a user by number; as it is where the tests are no root. Popen's own `user` would copy the whole
    address space of the test (fork), which Linux refuses once a part of it is larger than the memory: hundreds of
    models reserve 13 MB each, and use little of it."""
    if os.geteuid() != 0:
        return list(command)
    return [sys.executable, "-I", "-S", "-c", BECOME, str(user), *command]
