"""A lock that somebody waits for."""

import fcntl

with open("x", "w") as file:
    fcntl.flock(file, fcntl.LOCK_EX)
