"""The lesson's other lab: one scene under all five integrators."""

import json
from pathlib import Path

import mujoco
import pytest

from grader.domain.lab import SimLab, UnknownLab
from grader.errors import LabRefused
from grader.labs import lab_adapter
from grader.labs.kinds.integrators import check_integrators
from grader.labs.kinds.integrators.comparison import run_integrators
from grader.labs.kinds.integrators.lab import IntegratorsLab
from grader.numerics.integrators import INTEGRATORS
from grader.numerics.scene import Scene
from grader.questions import Quiz

ROOT = Path(__file__).parents[2]
XML = {name: (ROOT / f"models/{name}.xml").read_text() for name in ("double_pendulum", "pendulum")}


def lesson_lab() -> IntegratorsLab:
    lab = Quiz.model_validate(json.loads((ROOT / "quizzes/1.3-labs.json").read_text())).labs[0]
    assert isinstance(lab, IntegratorsLab)
    return lab


def test_all_five_run_from_one_state_and_the_single_step_methods_agree_bitwise() -> None:
    shown = run_integrators(lesson_lab(), XML["double_pendulum"], seconds=5)
    runs = {run.integrator: run for run in shown.runs}
    assert list(runs) == ["Euler", "RK4", "implicit", "implicitfast", "discrete"]
    euler = runs["Euler"].energy_error.tobytes()
    assert runs["implicitfast"].energy_error.tobytes() == runs["discrete"].energy_error.tobytes() == euler
    assert abs(runs["RK4"].energy_error[-1]) < 0.01
    assert all(run.cost_us > 0 and run.energy_error[0] == 0 for run in shown.runs)


@pytest.mark.parametrize("steps", [1, 7])
def test_the_energy_is_that_of_the_state_at_the_end(steps: int) -> None:
    lab, h = lesson_lab(), 0.02
    shown = run_integrators(lab, XML["double_pendulum"], timestep=h, seconds=steps * h)
    for run, integrator in zip(shown.runs, INTEGRATORS, strict=True):
        scene = Scene.from_xml(XML["double_pendulum"], key=lab.key)
        with scene.borrow(timestep_s=h, integrator=integrator.code) as workspace:
            workspace.model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_ENERGY)
            mujoco.mj_step(workspace.model, workspace.data, steps)
            mujoco.mj_forward(workspace.model, workspace.data)
            assert run.energy_j[-1] == workspace.data.energy.sum()
        assert run.energy_error[-1] != 0


def test_the_lesson_s_table_comes_out_within_the_band_that_chaos_leaves() -> None:
    shown = run_integrators(lesson_lab(), XML["double_pendulum"]).to_json()
    final = {run["name"]: run["final_error_percent"] for run in shown["integrators"]}
    # Source: the spread of the 20 s figures under nudges of 1e-15 rad.
    assert -13.5 < final["Euler"] < -8.7
    assert 12.4 < final["implicit"] < 39.1
    assert abs(final["RK4"]) < 0.01


def test_model_key_and_timestep_can_be_changed() -> None:
    lab = lesson_lab()
    pendulum = run_integrators(lab, XML["pendulum"], model="pendulum", key="horizontal", timestep=0.01, seconds=2)
    assert pendulum.energy == pytest.approx(9.81, abs=1e-9)
    assert run_integrators(lab, XML["pendulum"], model="pendulum", seconds=1).key == "horizontal"  # not at rest
    assert run_integrators(lab, XML["pendulum"], model="pendulum", key="", seconds=1).key is None
    assert pendulum.runs[0].steps == 200
    finer = run_integrators(lab, XML["double_pendulum"], timestep=0.0005, seconds=2)
    coarse = run_integrators(lab, XML["double_pendulum"], seconds=2)
    assert abs(finer.runs[0].energy_error[-1]) < abs(coarse.runs[0].energy_error[-1])


@pytest.mark.parametrize(
    "wrong",
    [
        {"model": "humanoid"},
        *({"timestep": value} for value in (1.0, 1e-9, 0.0)),
        *({"seconds": value} for value in (1e6, 0.0, 1e-4)),
    ],
)
def test_what_the_lab_does_not_offer_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(LabRefused):
        run_integrators(lesson_lab(), XML["double_pendulum"], **wrong)  # type: ignore[arg-type]


def test_the_lab_of_the_lesson_has_no_fault() -> None:
    lab = lesson_lab()
    assert check_integrators(lab, XML["double_pendulum"], "energy-drift") == []
    assert check_integrators(lab.model_copy(update={"key": 9}), XML["double_pendulum"], "x")[0].key == "x.key"
    assert check_integrators(lab.model_copy(update={"timestep": 5.0}), XML["double_pendulum"], "x")


def test_another_keyframe_starts_from_another_state() -> None:
    lab = lesson_lab()
    own = run_integrators(lab, XML["double_pendulum"], seconds=1).to_json()
    none = run_integrators(lab, XML["double_pendulum"], key="", seconds=1).to_json()
    assert (own["key"], own["keys"]) == ("release", ["release"])
    assert none["key"] is None
    assert none["energy"] != own["energy"]
    with pytest.raises(KeyError, match="release"):
        run_integrators(lab, XML["double_pendulum"], key="nowhere")


def test_models_may_have_labels_and_the_first_is_the_lab_s_own() -> None:
    text = '{"id": "five", "kind": "integrators", "models": [["pendulum", "One"], "double_pendulum"], "duration": 0.5}'
    lab = lab_adapter().validate_json(text, strict=True)
    assert isinstance(lab, IntegratorsLab)
    assert (lab.model, lab.seconds) == ("pendulum", 0.5)
    assert lab.offered == {"pendulum": "One", "double_pendulum": "double_pendulum"}
    assert {run.steps for run in run_integrators(lab, XML["pendulum"], timestep=0.01).runs} == {50}
    with pytest.raises(LabRefused, match="one of: pendulum, double_pendulum"):
        run_integrators(lab, XML["pendulum"], model="arm")


@pytest.mark.parametrize(
    ("keys", "kind"),
    [({"model": "m"}, SimLab), ({"kind": "simlab", "model": "m"}, SimLab), ({"kind": "x"}, UnknownLab)],
)
def test_a_lab_without_a_kind_runs_one_scene(keys: dict[str, str], kind: type) -> None:
    assert type(lab_adapter().validate_python({"id": "lab", **keys})) is kind
