"""The unit of an expression is read from its text, where every part of it is known."""

import mujoco
import pytest

from grader.certify import certify_key
from grader.certify.dimensions import explain_unit
from grader.domain.verify import ByExpression
from grader.questions import NumberKey

XML = """<mujoco><worldbody><body name="b"><joint name="s" type="slide"/><joint name="h" type="hinge"/>
<geom size="1"/></body></worldbody><actuator><position joint="h" kp="5"/></actuator></mujoco>"""


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("data.qpos[0]", "mm"),
        ("data.qpos[1]", "deg"),
        ("lib.deg(data.qpos[1])", "mm"),
        ("lib.deg(data.qpos[1])", "rad"),
        ("Math.abs(data.qvel[0])", "rad/s"),
        ("lib.energy().total", "W"),
        ("data.time", "ms"),
        ("lib.bodyPos('b')[2]", "deg"),
        ("Math.sqrt(model.actuator_gainprm[0] / model.body_inertia[3])", "m"),
        ("lib.qpos('h')", "m"),
    ],
)
def test_another_unit_is_told(model: mujoco.MjModel, text: str, unit: str) -> None:
    assert explain_unit(text, model, unit)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("data.qpos[0]", "m"),
        ("1000 * data.qpos[0]", "mm"),
        ("data.qpos[1] * 180 / Math.PI", "deg"),
        ("lib.deg(data.qpos[1])", "deg"),
        ("model.body_mass[1] * 9.81", "N"),
        ("2 * Math.PI * Math.sqrt(1 / 9.81)", "s"),
        ("Math.sqrt(model.jnt_stiffness[0] / model.body_mass[1]) / (2 * Math.PI)", "Hz"),
        ("0.5 * model.body_mass[1] * data.qvel[0] ** 2", "J"),
        ("data.ctrl[0]", "N m"),
        ("data.qpos[0]", "K"),
        ("data.qpos[0", "m"),
        ("data.qvel[1] > 3 ? 1 : 2", "steps"),
    ],
)
def test_what_fits_or_is_not_known_passes(model: mujoco.MjModel, text: str, unit: str) -> None:
    assert explain_unit(text, model, unit) is None


def test_a_key_in_another_unit_is_not_certified() -> None:
    verify = ByExpression(by="expression", expr="model.body_pos[5]", xml=XML.replace('"b"', '"b" pos="0 0 3"'))
    right, wrong = (
        certify_key(
            NumberKey(kind="numeric", text="", verify=verify, answer=3, tolerance=0.1, unit=unit),
            dict[str, str]().__getitem__,
        )
        for unit in ("m", "deg")
    )
    assert right is not None and right.ok
    assert wrong is not None and (wrong.verdict, wrong.key) == ("cannot tell", "unit")
