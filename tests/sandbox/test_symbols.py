"""After the removal of the integrators no function of MuJoCo's library moves a state, whatever its symbol."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).with_name("symbols.py")


def movers(folder: Path, *arguments: str) -> tuple[int, set[str]]:
    """How many functions were called, and the names of those that move a state; some write files where they run."""
    command = [sys.executable, str(SCRIPT), *arguments]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=300)
    count, *names = run.stdout.split()
    return int(count), set(names)


@pytest.mark.slow
def test_no_symbol_moves_a_state(tmp_path: Path) -> None:
    called, moving = movers(tmp_path, "removed")
    assert called > 1000
    assert moving == set()


def test_the_same_calls_move_a_state_where_the_integrators_are_kept(tmp_path: Path) -> None:
    expected = {"mj_step", "mj_step2", "mj_Euler", "mj_ipc", "advanceFinish"}
    assert movers(tmp_path, "kept", *expected, "mj_kinematics") == (6, expected)
