"""After the removal of the integrators no function of MuJoCo's library moves a state, whatever its symbol."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("symbols.py")


def movers(*arguments: str) -> tuple[int, set[str]]:
    """How many functions were called, and the names of those that move a state."""
    command = [sys.executable, str(SCRIPT), *arguments]
    count, *names = subprocess.run(command, capture_output=True, text=True, check=True, timeout=300).stdout.split()
    return int(count), set(names)


@pytest.mark.slow
def test_no_symbol_moves_a_state() -> None:
    called, moving = movers("removed")
    assert called > 1000
    assert moving == set()


def test_the_same_calls_move_a_state_where_the_integrators_are_kept() -> None:
    expected = {"mj_step", "mj_step2", "mj_Euler", "mj_ipc", "advanceFinish"}
    assert movers("kept", *expected, "mj_kinematics") == (6, expected)
