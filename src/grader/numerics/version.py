"""What depends on the version of MuJoCo. The course pins 3.14.0; the grader works with 4.0.0 as well. Source: MuJoCo's
change log, version 4.0.0. The tests measure every fact on the version that is installed."""

import mujoco

INSTALLED: str = mujoco.__version__

NEWEST_TESTED = (4, 0, 0)
"""The newest MuJoCo under which the test suite runs (`make test MUJOCO=4.0.0`)."""

RK4_ORDER_ON_ROTATIONS = 2 if mujoco.mj_version() < 4_000_000 else 4
"""The order of MuJoCo's RK4 on free and ball joints: 4.0.0 corrects the velocities of the stages, 3.14.0 does not."""


def parse_version(text: str) -> tuple[int, ...]:
    """Returns the numbers of a version such as "4.0.0". Raises ValueError for any other text."""
    return tuple(int(part) for part in text.split("."))


def warn_of_newer(installed: int = mujoco.mj_version()) -> str | None:
    """Returns a warning where a MuJoCo, numbered as by `mj_version`, is newer than every one tested, else None."""
    version = (installed // 1_000_000, installed // 1000 % 1000, installed % 1000)
    if version <= NEWEST_TESTED:
        return None
    running, tested = (".".join(map(str, numbers)) for numbers in (version, NEWEST_TESTED))
    return (
        f"MuJoCo {running} is newer than {tested}, the newest that was tested: verdicts and answer keys may differ. "
        "Run `grader check`, or install the MuJoCo of requirements-all.lock."
    )
