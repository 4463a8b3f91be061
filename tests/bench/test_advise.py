"""The lesson's procedure on the lesson's models."""

from pathlib import Path

import pytest

from grader.advise import DISCRETE, IMPLICITFAST, RK4, advise, loses_energy, scene_of
from grader.bench.scenes import scene_path, scene_text
from grader.errors import ContentError, Unprocessable


def test_energy_is_conserved_so_rk4_is_tried_and_wins() -> None:
    advice = advise(scene_path("double_pendulum"), "lib.sitePos('tip')[2]", tol=1e-3, seconds=0.5)
    assert advice.choice is not None
    assert advice.choice.integrator == RK4
    assert {row.candidate.integrator for row in advice.rows} == {IMPLICITFAST, RK4}
    quarter = next(r for r in advice.rows if (r.candidate.integrator, r.candidate.timestep_s) == (RK4, 0.0005))
    assert quarter.cost == pytest.approx(16), "four evaluations, four times as often: not the same cost"
    assert quarter.cpu is not None
    assert quarter.cpu > 4
    assert any("constraints" in skip for skip in advice.skips)


def test_stiffness_binds_so_discrete_is_tried_and_warnings_are_told() -> None:
    advice = advise(scene_text("stiff_servo"), "data.qpos[0]", tol=0.02, seconds=0.3)
    assert DISCRETE in {row.candidate.integrator for row in advice.rows}
    assert "7.33 ms" in "\n".join(advice.steps)
    warned = {row.candidate.timestep_s for row in advice.rows if row.warning}
    assert warned == {0.01, 0.02}
    assert advice.choice is not None
    assert advice.choice.error <= 0.02
    assert "beyond the procedure, RK4" in advice.reason


def test_the_choice_is_the_largest_passing_timestep() -> None:
    advice = advise(scene_text("servo"), "data.qpos[0]", tol=1e-2, seconds=0.5)
    assert advice.choice is not None
    passing = [row.candidate.timestep_s for row in advice.rows if row.passes]
    assert advice.choice.timestep_s == max(passing)


def test_none_is_an_answer_too() -> None:
    advice = advise(scene_text("servo"), tol=1e-6, seconds=0.2)
    assert advice.choice is None
    assert "choice: none" in str(advice)
    assert "none of the candidates" in advice.reason


def test_the_table_shows_what_was_measured() -> None:
    advice = advise(scene_text("servo"), tol=1e-2, seconds=0.2)
    lines = str(advice).splitlines()
    assert sum("implicitfast at" in line and " x" in line for line in lines) >= len(advice.rows)
    assert any(line.startswith("> ") for line in lines)


@pytest.mark.parametrize(
    ("model", "quantity", "tol", "seconds", "error"),
    [
        ("<mujoco>", None, None, None, Unprocessable),
        (Path("nowhere.xml"), None, None, None, Unprocessable),
        (scene_text("servo"), "data.qpos[", None, None, ContentError),
        (scene_text("servo"), "data.nothing", None, None, ContentError),
        (scene_text("servo"), "data.qpos[9]", None, None, Unprocessable),
        (scene_text("servo"), None, -1.0, None, Unprocessable),
        (scene_text("servo"), None, None, 0.0, Unprocessable),
    ],
)
def test_what_means_nothing_is_refused(
    model: str | Path, quantity: str | None, tol: float | None, seconds: float | None, error: type[Exception]
) -> None:
    with pytest.raises(error):
        advise(model, quantity, tol, seconds)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("<option", '<option density="1.2"'), "medium"),
        (('name="elbow" type="hinge"', 'name="elbow" type="hinge" damping="0.1"'), "damping"),
        (('name="elbow" type="hinge"', 'name="elbow" type="hinge" frictionloss="0.1"'), "friction loss"),
    ],
)
def test_what_can_lose_energy_is_told(change: tuple[str, str], why: str) -> None:
    assert loses_energy(scene_of(scene_text("double_pendulum"))) is None
    reason = loses_energy(scene_of(scene_text("double_pendulum").replace(*change)))
    assert reason is not None
    assert why in reason
