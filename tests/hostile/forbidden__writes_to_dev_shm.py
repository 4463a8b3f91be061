"""Shared memory as a file."""

open("/dev/shm/trap", "w")
