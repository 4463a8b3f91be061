"""The lesson's procedure on the lesson's models."""

from pathlib import Path

import pytest

from grader import advise as procedure
from grader.advise import advise, loses_energy, scene_of
from grader.bench.scenes import scene_path, scene_text
from grader.errors import ContentError, Unprocessable
from grader.numerics.integrators import DISCRETE, IMPLICITFAST, RK4
from numerics.models import DELAY, RUNAWAY, TWO_FREE_BODIES, hinge

pytestmark = pytest.mark.slow


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
        (scene_text("servo"), None, None, 2e7, Unprocessable),
        (scene_text("servo"), None, None, float("inf"), Unprocessable),
        (TWO_FREE_BODIES.replace("<mujoco>", '<mujoco><size memory="20K"/>'), None, None, 3.0, Unprocessable),
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


def test_energy_is_a_quantity(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(procedure, "cpu_ratio", lambda *_: 1.0)
    advice = advise(scene_path("double_pendulum"), "lib.energy().total", tol=1e-3, seconds=0.2)
    assert min(row.candidate.error for row in advice.rows if row.candidate.integrator == IMPLICITFAST) > 1e-5
    assert "never changes" not in advice.reason


@pytest.mark.parametrize(("quantity", "said"), [("model.body_mass[1]", "never changes"), (None, "nothing moves")])
def test_an_error_of_what_never_changes_says_nothing(quantity: str | None, said: str) -> None:
    assert said in advise(hinge(), quantity, seconds=0.02).reason


def test_a_run_that_warns_at_once_is_not_called_still() -> None:
    """Of a run that ends within ten steps only its start is kept."""
    scene = scene_of(scene_text("stiff_servo").replace('kp="20000"', 'kp="2e8"')).at(qpos=[1.0])
    assert procedure.unmoved(procedure.Request(scene, None, 1e-3, 1.0)) is None


@pytest.mark.parametrize(("model", "said"), [(RUNAWAY, "without bound"), (DELAY, "delay")])
def test_what_cannot_be_told_is_said(model: str, said: str) -> None:
    advice = advise(model, seconds=1.0)
    assert (advice.choice, advice.rows) == (None, ())
    assert f"cannot tell: {'the motion' if model is RUNAWAY else 'a delay'}" in advice.reason
    assert said in advice.reason


@pytest.mark.parametrize("damping", ["0", "0.1"])
def test_what_is_unstable_in_truth_is_no_fault_of_the_step(damping: str) -> None:
    upright = hinge(f"damping='{damping}'").replace("0 0 -0.5", "0 0 0.5")
    assert procedure.binding_stiffness(scene_of(upright).at(qpos=[0.1]), 0.2) is None
    assert procedure.binding_stiffness(scene_of(RUNAWAY), 1.0) is None
