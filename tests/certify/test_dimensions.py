"""The unit of an expression is read from its text, where every part of it is known."""

import mujoco
import pytest

from grader.certify import certify_key
from grader.domain.verify import ByExpression, ByMeasurement
from grader.questions import NumberKey
from grader.questions.kinds.number.dimensions import explain_unit

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
        ("Math.sqrt(model.jnt_stiffness[0] / model.body_mass[1])", "Hz"),
        ("data.qvel[1]", "Hz"),
        ("Math.abs(data.qvel[1])", "rpm"),
        ("2 * Math.PI * Math.sqrt(model.body_mass[1] / model.jnt_stiffness[0])", "ms"),
        ("0.5 * model.body_mass[1] * data.qvel[0] * data.qvel[0]", "mJ"),
        ("model.body_mass[1] * data.qvel[0] * data.qvel[0] / 2", "mJ"),
        ("model.dof_damping[0] / (2 * Math.sqrt(model.body_mass[1] * model.jnt_stiffness[0]))", "%"),
        ("data.qpos[1] - Math.PI / 2", "deg"),
        ("2 * data.qvel[1]", "Hz"),
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
        ("Math.sqrt(model.jnt_stiffness[0] / model.body_mass[1])", "1/s"),
        ("1 / data.time", "Hz"),
        ("data.qvel[1] * 60 / (2 * Math.PI)", "rpm"),
        ("data.ncon", "Hz"),
        ("2 * Math.PI * Math.sqrt(model.body_mass[1] / model.jnt_stiffness[0])", "s"),
        ("2000 * Math.PI * Math.sqrt(model.body_mass[1] / model.jnt_stiffness[0])", "ms"),
        ("1000 * 2 * Math.PI * Math.sqrt(model.body_mass[1] / model.jnt_stiffness[0])", "ms"),
        ("500 * model.body_mass[1] * data.qvel[0] ** 2", "mJ"),
        ("100 * model.dof_damping[0] / (2 * Math.sqrt(model.body_mass[1] * model.jnt_stiffness[0]))", "%"),
        ("model.dof_damping[0] / (2 * Math.sqrt(model.body_mass[1] * model.jnt_stiffness[0]))", ""),
        ("data.qvel[1] * 30 / Math.PI", "rpm"),
        ("data.qvel[1] / Math.PI / 2", "Hz"),
        ("2 * Math.PI / data.time", "rad/s"),
        ("3.6 * data.qvel[0]", "km/h"),
        ("2 * Math.PI", "deg"),
        ("0.5 * model.body_mass[1] * data.qvel[0] ** 2", "J"),
        ("data.ctrl[0]", "N m"),
        ("data.qpos[0]", "K"),
        ("data.qpos[0", "m"),
        ("data.qvel[1] > 3 ? 1 : 2", "steps"),
        ("2", "s"),
    ],
)
def test_what_fits_or_is_not_known_passes(model: mujoco.MjModel, text: str, unit: str) -> None:
    assert explain_unit(text, model, unit) is None


@pytest.mark.parametrize(
    ("text", "unit", "fits"),
    [
        ("data.qpos[0]", "m", True),
        ("data.qpos[2]", "cm", False),
        ("data.qpos[3]", "cm", True),  # of a quaternion: not known
        ("data.qvel[1]", "mm/s", False),
        ("data.qvel[1]", "m/s", True),
        ("data.qvel[3]", "m/s", False),
        ("data.qvel[5]", "rad/s", True),
        ("data.qpos[7]", "deg", True),  # of the ball joint's quaternion
        ("data.qvel[8]", "deg/s", False),
        ("data.qvel[8]", "rad/s", True),
    ],
)
def test_elements_of_free_and_ball_joints_have_units(text: str, unit: str, *, fits: bool) -> None:
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body>"
        "<body><joint type='ball'/><geom size='1'/></body></worldbody></mujoco>"
    )
    assert (explain_unit(text, model, unit) is None) == fits


@pytest.mark.parametrize(
    ("joints", "unit", "fits"),
    [("s", "mm/s", False), ("s", "m/s", True), ("h", "deg/s", False), ("h", "rad/s", True), ("sh", "mm/s", True)],
)
def test_the_velocities_of_joints_of_one_type_have_a_unit(joints: str, unit: str, *, fits: bool) -> None:
    types = "".join(f'<joint type="{"slide" if joint == "s" else "hinge"}"/>' for joint in joints)
    xml = f"<mujoco><worldbody><body>{types}<geom size='1'/></body></worldbody></mujoco>"
    assert (explain_unit("lib.norm(data.qvel)", mujoco.MjModel.from_xml_string(xml), unit) is None) == fits


def test_a_factor_of_a_formula_neither_certifies_nor_refutes_in_another_unit() -> None:
    spring = XML.replace('type="slide"', 'type="slide" stiffness="50"').replace('size="1"', 'size="1" mass="2"')
    expr = "2 * Math.PI * Math.sqrt(model.body_mass[1] / model.jnt_stiffness[0])"
    verify = ByExpression(by="expression", expr=expr, xml=spring)
    for answer in (1.2566, 1256.64):
        key = NumberKey(kind="numeric", text="", verify=verify, answer=answer, tolerance=0.01 * answer, unit="ms")
        certificate = certify_key(key, dict[str, str]().__getitem__)
        assert certificate is not None and (certificate.verdict, certificate.key) == ("cannot tell", "unit")
        assert "gives a value in s, and the unit is ms" in certificate.why


def test_a_key_in_another_unit_is_not_certified() -> None:
    verify = ByExpression(by="expression", expr="model.body_pos[5]", xml=XML.replace('"b"', '"b" pos="0 0 3"'))
    right, wrong, refuted, off = (
        certify_key(
            NumberKey(kind="numeric", text="", verify=verify, answer=answer, tolerance=0.1, unit=unit),
            dict[str, str]().__getitem__,
        )
        for answer, unit in ((3, "m"), (3, "deg"), (4, "m"), (4, "deg"))
    )
    assert right is not None and right.ok
    assert wrong is not None and (wrong.verdict, wrong.key) == ("cannot tell", "unit")
    assert refuted is not None and (refuted.verdict, refuted.key) == ("refuted", "answer")
    assert off is not None and (off.verdict, off.key) == ("cannot tell", "unit"), "4 deg are not refuted by 3 m"


@pytest.mark.parametrize(
    ("when", "unit", "fits"),
    [("period", "ms", True), ("period", "mm", False), ("frequency", "rad/s", True), ("frequency", "s", False),
     ("decay_rate", "1/s", True), ("crossings", "", True), ("crossings", "m", False)],
)  # fmt: skip
def test_what_is_read_from_moments_needs_a_unit_of_its_own(when: str, unit: str, fits: bool) -> None:
    swing = """<mujoco><option gravity="0 0 0"/><worldbody><body><joint type="slide" axis="1 0 0" stiffness="50"/>
    <geom size=".1" mass="2"/></body></worldbody></mujoco>"""
    raw = {"by": "measurement", "xml": swing, "setup": "data.qpos[0] = 0.1", "expr": "data.qpos[0]", "seconds": 2}
    verify = ByMeasurement.model_validate(raw | {"when": when})
    key = NumberKey(kind="numeric", text="", verify=verify, answer=1e6, tolerance=1, unit=unit)
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None
    assert (certificate.key == "unit") is not fits
    if not fits:
        assert "measures something else" in certificate.why


SENSED = """<mujoco><worldbody><body name="b"><joint name="s" type="slide"/><joint name="h"/><geom size="1"/>
<site name="at"/></body></worldbody><actuator><motor joint="h"/></actuator>
<sensor><jointpos name="place" joint="s"/><jointpos name="angle" joint="h"/><jointvel name="turning" joint="h"/>
<framepos name="where" objtype="body" objname="b"/><gyro name="gyro" site="at"/>
<jointactuatorfrc name="torque" joint="h"/>
<framequat name="quat" objtype="body" objname="b"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    ("text", "unit", "fits"),
    [
        ("data.sensordata[0]", "m", True),
        ("data.sensordata[0]", "mm", False),
        ("data.sensordata[1]", "deg", False),
        ("lib.deg(data.sensordata[1])", "deg", True),
        ("lib.sensor('angle')", "rad", True),
        ("lib.sensor('angle')", "deg", False),
        ("lib.sensor('turning')", "rpm", False),
        ("data.sensordata[5]", "mm", False),  # the third of `where`
        ("1000 * lib.sensor('where')[2]", "mm", True),
        ("data.sensordata[6]", "deg/s", False),
        ("data.sensordata[9]", "N", False),
        ("data.sensordata[9]", "N m", True),
        ("data.qfrc_actuator[1]", "mN m", False),
        ("data.qfrc_actuator[1]", "N m", True),
        ("data.sensordata[10]", "mm", True),  # of a quaternion: not known
        ("lib.sensor('none')", "mm", True),
    ],
)
def test_a_sensor_has_the_unit_of_its_type(text: str, unit: str, fits: bool) -> None:
    assert (explain_unit(text, mujoco.MjModel.from_xml_string(SENSED), unit) is None) == fits


DRIVEN = """<mujoco><worldbody><site name="a"/><body name="b" pos="0 0 1"><joint name="s" type="slide"/>
<geom size="1"/><site name="c"/><body><joint name="h"/><geom size="1"/></body></body></worldbody>
<tendon><spatial name="cable"><site site="a"/><site site="c"/></spatial>
<fixed name="turns"><joint joint="h" coef="2"/></fixed>
<fixed name="both"><joint joint="h" coef="2"/><joint joint="s" coef="2"/></fixed></tendon>
<actuator><motor name="m0" joint="s"/><motor name="m1" joint="h" gear="9"/><motor name="m2" tendon="cable"/>
<motor name="m3" tendon="both"/><motor name="m4" site="c"/></actuator>
<sensor><tendonpos name="long" tendon="cable"/><tendonvel name="turn" tendon="turns"/>
<actuatorfrc name="torque" actuator="m1"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    ("text", "unit", "fits"),
    [
        ("1.2 - data.qpos[0]", "m", True),
        ("1.2 - data.qpos[0]", "mm", False),
        ("(-3) + lib.deg(data.qpos[1])", "rad", False),
        ("1000 * data.qpos[0] - 7.3", "mm", True),
        ("Math.max(data.qpos[1], 0)", "deg", False),
        ("data.qpos[1] > 0 ? data.qpos[1] : 0.7", "deg", False),
        ("data.qpos[1] > 0 ? data.qpos[1] : data.qpos[0]", "deg", True),  # not known
        ("lib.norm([data.xpos[3], data.xpos[4]])", "mm", False),
        ("lib.norm([data.xpos[3], data.qvel[0]])", "mm", True),
        ("data.ten_length[0]", "mm", False),
        ("data.ten_length[1]", "deg", False),
        ("data.ten_length[2]", "deg", True),
        ("data.ten_velocity[1]", "rpm", False),
        ("data.ten_length[3]", "mm", True),  # there is none
        ("data.actuator_length[1]", "deg", False),
        ("data.actuator_velocity[0]", "mm/s", False),
        ("data.actuator_force[0]", "kN", False),
        ("data.actuator_force[1]", "N", False),
        ("data.actuator_force[2]", "N", True),
        ("data.actuator_force[3]", "kN", True),
        ("data.actuator_force[4]", "kN", True),
        ("lib.sensor('long')", "mm", False),
        ("lib.sensor('turn')", "rad/s", True),
        ("lib.sensor('torque')", "kN m", False),
        ("lib.massMatrix()[0][0]", "g", False),
        ("lib.massMatrix()[1][1]", "kg m^2", True),
        ("lib.massMatrix()[0][1]", "g", True),
        ("lib.massMatrix()[7][7]", "g", True),
    ],
)
def test_sums_tendons_and_actuators_have_units(text: str, unit: str, *, fits: bool) -> None:
    assert (explain_unit(text, mujoco.MjModel.from_xml_string(DRIVEN), unit) is None) == fits


def test_a_mass_that_is_written_as_a_number_is_told_the_field_of_the_model(model: mujoco.MjModel) -> None:
    why = explain_unit("0.5 * 3 * data.qvel[0] ** 2", model, "J")
    assert why is not None and "model.body_mass[1]" in why
