"""How much of the jail this machine can hold."""

from enum import StrEnum


class Tier(StrEnum):
    """Chosen at start, never lowered while running. What holds less than T2 refuses to start."""

    T0 = "T0"  # every layer
    T1 = "T1"  # without a delegated cgroup
    T2 = "T2"  # without namespaces: limits, Landlock and seccomp alone, no scratch directory; only when asked for
