"""The lesson's own content: the knowledge check and the three models."""

from pathlib import Path

import mujoco
import pytest

from grader.domain.verdict import Status
from grader.labs import run_lab
from grader.library import Library
from grader.questions import grade_answer, kind_of
from support.content import load_content

ROOT = Path(__file__).parents[2]
MODELS = ("pendulum", "pendulum_servo", "double_pendulum")
MOTOR = '<motor name="torque" joint="hinge" ctrlrange="-3 3"/>'


@pytest.fixture(scope="module")
def library() -> Library:
    return load_content()


def test_the_content_of_this_repository_loads_without_a_warning(library: Library) -> None:
    assert library.warnings == ()
    assert [question.kind for question in library.quiz("1.3-check").questions] == ["mcq", "numeric", "predict", "open"]


@pytest.mark.parametrize(
    ("question", "answer", "status"),
    [
        ("q1", "1", Status.CORRECT),
        ("q1", 0, Status.INCORRECT),
        ("q2", "0.005 s", Status.CORRECT),
        ("q2", "0.005", Status.INCORRECT),
        ("q2", "5 kg", Status.INVALID_ANSWER),
        ("q3", "discrete", Status.CORRECT),
        ("q3", 3, Status.INCORRECT),
        ("q4", "Stability first.", Status.NEEDS_REVIEW),
    ],
)
def test_the_knowledge_check_is_graded(library: Library, question: str, answer: object, status: Status) -> None:
    assert grade_answer(library.question("1.3-check", question), answer).status is status


@pytest.mark.parametrize(
    ("integrator", "timestep_s", "is_stable"),
    [("Euler", 0.0065, True), ("Euler", 0.007, False), ("implicitfast", 0.0072, True), ("implicitfast", 0.0075, False),
     ("discrete", 0.01, True)],
)  # fmt: skip
def test_the_sentences_on_wrong_integrators_are_true(
    library: Library, integrator: str, timestep_s: float, is_stable: bool
) -> None:
    lab = kind_of(library.question("1.3-check", "q3")).lab(library.question("1.3-check", "q3"))
    assert lab is not None
    stepped = lab.model_copy(update={"setup": f"{lab.setup}; model.opt.timestep = {timestep_s}", "controls": ()})
    code = {"Euler": 0, "implicitfast": 3, "discrete": 4}[integrator]
    stiff = "model.actuator_gainprm[0] = 20000; model.actuator_biasprm[1] = -20000"
    config = stepped.model_copy(update={"setup": f"{stepped.setup}; {stiff}; model.opt.integrator = {code}"})
    assert run_lab(config, library.model_xml("pendulum_servo"), None, (), 5.0).stable is is_stable


@pytest.mark.parametrize("name", MODELS)
def test_everything_in_a_model_is_named_and_nothing_that_is_seen_collides(library: Library, name: str) -> None:
    model = mujoco.MjModel.from_xml_string(library.model_xml(name))
    counts = {
        mujoco.mjtObj.mjOBJ_BODY: model.nbody,
        mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_GEOM: model.ngeom,
        mujoco.mjtObj.mjOBJ_SITE: model.nsite,
        mujoco.mjtObj.mjOBJ_LIGHT: model.nlight,
        mujoco.mjtObj.mjOBJ_CAMERA: model.ncam,
        mujoco.mjtObj.mjOBJ_ACTUATOR: model.nu,
        mujoco.mjtObj.mjOBJ_KEY: model.nkey,
    }
    for kind, count in counts.items():
        assert all(mujoco.mj_id2name(model, kind, index) for index in range(count))
    assert not model.geom_contype.any() and not model.geom_conaffinity.any()
    assert model.nkey == 1 and not model.dof_damping.any()


def test_the_inertia_about_the_pivot_is_as_the_lesson_says(library: Library) -> None:
    for name in ("pendulum", "pendulum_servo"):
        model = mujoco.MjModel.from_xml_string(library.model_xml(name))
        assert model.dof_M0[0] == pytest.approx(0.2501, rel=1e-14)


def test_the_lessons_script_can_swap_the_motor_for_a_servo(library: Library) -> None:
    text = library.model_xml("pendulum")
    assert text.count(MOTOR) == 1
    swapped = text.replace(MOTOR, '<position name="servo" joint="hinge" kp="100" kv="5"/>')
    servo, ours = (mujoco.MjModel.from_xml_string(xml) for xml in (swapped, library.model_xml("pendulum_servo")))
    for model in (servo, ours):
        assert model.actuator_gainprm[0, 0] == 100 and tuple(model.actuator_biasprm[0, :3]) == (0, -100, -5)
    assert (servo.body_mass == ours.body_mass).all() and (servo.body_ipos == ours.body_ipos).all()
