"""What MuJoCo does not compute of itself is no 0, and what it cannot linearise is told with its cure."""

from typing import Any

import mujoco
import numpy as np
import pytest

from grader.certify import certify_key
from grader.certify.certificate import Certificate
from grader.domain.verify import ByExpression, ByMeasurement, ByStage
from grader.experiments.runs import UNCOMPUTED
from grader.questions import NumberKey, OptionKey

FALLS = """<mujoco><worldbody><body name="b"><joint type="slide"/><geom size="1"/><site name="at"/></body></worldbody>
{more}</mujoco>"""


def certify(verify: ByExpression | ByMeasurement, answer: float = 0.0, unit: str = "") -> Certificate:
    key = NumberKey(kind="numeric", text="", verify=verify, answer=answer, tolerance=0.1, unit=unit)
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None
    return certificate


def measure(expr: str, more: str = "", **changes: Any) -> ByMeasurement:
    raw = {
        "by": "measurement",
        "xml": FALLS.format(more=more),
        "expr": expr,
        "seconds": 0.1,
        "setup": "data.qvel[0] = 3",
    }
    return ByMeasurement.model_validate(raw | changes)


@pytest.mark.parametrize("field", UNCOMPUTED)
def test_a_field_that_is_left_at_0_is_no_key(field: str) -> None:
    index = 11 if field.removeprefix("data.") in ("cacc", "cfrc_int", "cfrc_ext") else 0
    call, sensors = UNCOMPUTED[field]
    for verify in (
        measure(f"{field}[{index}]"),
        ByExpression(by="expression", expr=f"{field}[{index}]", xml=FALLS.format(more="")),
    ):
        certificate = certify(verify)
        assert (certificate.verdict, certificate.key) == ("cannot tell", "verify.expr")
        assert f"{call} fills" in certificate.why
    for sensor in sensors:
        at = 'body="b"' if "subtree" in sensor else 'objtype="body" objname="b"' if "frame" in sensor else 'site="at"'
        xml = FALLS.format(more=f"<sensor><{sensor} {at}/></sensor>")
        model = mujoco.MjModel.from_xml_string(xml)
        data = mujoco.MjData(model)
        data.qvel[0], data.xfrc_applied[1, 2] = 3, 5
        mujoco.mj_forward(model, data)
        filled = getattr(data, field.removeprefix("data."))
        assert np.any(filled) or field in ("data.subtree_angmom", "data.cfrc_ext")  # which are 0 here
        assert "fills" not in certify(measure(f"{field}[{index}]", f"<sensor><{sensor} {at}/></sensor>")).why


def test_a_field_that_the_author_has_filled_is_measured() -> None:
    expr = "[mj.mj_subtreeVel(model, data), data.subtree_linvel[5]][1]"
    assert certify(measure(expr, setup="data.qvel[0] = 3", timestep="given"), 3 - 0.981, "m/s").ok


DELAYED = '<actuator><motor joint="j" delay="0.01" nsample="10"/></actuator>'


def test_a_motion_with_delays_is_told_to_be_about_the_run() -> None:
    raw: dict[str, Any] = {
        "by": "measurement", "xml": FALLS.format(more=DELAYED).replace("<joint", '<joint name="j"'),
        "expr": "data.qvel[0]", "seconds": 0.1,
    }  # fmt: skip
    certificate = certify(ByMeasurement.model_validate(raw), -0.981)
    assert (certificate.verdict, certificate.regime["failed"]) == ("cannot tell", "linearised")
    assert '"timestep": "given"' in certificate.why
    assert certify(ByMeasurement.model_validate(raw | {"timestep": "given"}), -0.981).ok
    assert (
        certify(ByMeasurement.model_validate(raw | {"accept": "worked out by hand"}), -0.981).accepted
        == "worked out by hand"
    )


def test_a_unit_that_does_not_fit_is_accepted_for_a_reason() -> None:
    raw = {"by": "expression", "expr": "model.body_mass[1]", "xml": FALLS.format(more=""), "accept": "per thousand"}
    certificate = certify(ByExpression.model_validate(raw), 4188.79, "g")
    assert (certificate.verdict, certificate.accepted, certificate.remarks) == ("cannot tell", "per thousand", ())


@pytest.mark.parametrize("options", [("Kinematics", "Constraint solver"), ("mj_kinematics", "mj_collision")])
def test_options_that_name_no_stage_refute_nothing(options: tuple[str, ...]) -> None:
    def certify_stage(**changes: Any) -> Certificate | None:
        verify = ByStage.model_validate({"by": "stage", "fills": "xipos", "xml": FALLS.format(more="")} | changes)
        key = OptionKey(kind="mcq", text="", verify=verify, options=options, answer=0)
        return certify_key(key, dict[str, str]().__getitem__)

    certificate = certify_stage()
    assert certificate is not None and certificate.verdict == "cannot tell"
    assert "write verify.stages" in certificate.why
    named = certify_stage(stages=["mj_fwdPosition", None])
    assert named is not None and named.ok


@pytest.mark.parametrize(
    ("changes", "cure"),
    [
        ({"expr": "-data.qpos[0]", "when": "crossing", "level": -0.1}, "crossings go up"),
        ({"expr": "data.qpos[0]", "when": "decay_rate"}, "read from peaks"),
        ({"expr": "ctx.u", "controller": "ctx.u = data.qpos[0]", "when": "max"}, "set in setup"),
        ({"expr": "Math.sqrt(-1)"}, "mend expr"),
    ],
)
def test_what_a_run_has_not_is_told_with_its_cure(changes: dict[str, Any], cure: str) -> None:
    certificate = certify(measure(**changes))
    assert (certificate.verdict, certificate.key) == ("cannot tell", "verify.expr")
    assert cure in certificate.why
