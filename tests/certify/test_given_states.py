"""A number about the discretisation that mj_step leaves one step late: the state's own number is right too."""

from typing import Any

import pytest

from grader.certify import Certificate, certify_key
from grader.domain.verify import ByMeasurement
from grader.questions import NumberKey

FALL = """<mujoco><option timestep="0.01"/><worldbody><body name="b" pos="0 0 1"><joint type="slide" axis="0 0 1"/>
<geom size=".01" mass="1"/></body></worldbody></mujoco>"""


def certify(answer: float, tolerance: float, unit: str = "m", **verify: Any) -> Certificate:
    way = ByMeasurement.model_validate({"by": "measurement", "timestep": "given", **verify})
    key = NumberKey(kind="numeric", text="How much?", verify=way, answer=answer, tolerance=tolerance, unit=unit)
    certificate = certify_key(key, dict[str, str]().__getitem__)
    assert certificate is not None
    return certificate


@pytest.mark.parametrize(("answer", "holds"), [(-0.2508, True), (-0.2017, True), (-0.226, False)])
def test_a_height_of_the_last_state_and_of_the_page_are_right(answer: float, holds: bool) -> None:
    """After 50 steps of 0.01 s the ball has fallen by g h^2 50 51 / 2 = 1.2508 m, and data.xpos has the step before."""
    certificate = certify(answer, 0.003, xml=FALL, expr="lib.bodyPos('b')[2]", seconds=0.5)
    assert certificate.ok is holds
    if holds:
        [remark] = certificate.remarks
        assert "a page shows -0.201725, and the state itself has -0.250775" in remark


def test_what_is_read_of_positions_gets_no_remark() -> None:
    certificate = certify(-1.250775, 0.003, xml=FALL, expr="data.qpos[0]", seconds=0.5)
    assert certificate.ok and not certificate.remarks


def test_a_crossing_is_right_by_either_state() -> None:
    for answer in (0.44653, 0.45653):
        verify = {"expr": "lib.bodyPos('b')[2]", "when": "crossing", "level": 0, "direction": "down", "seconds": 0.6}
        assert certify(answer, 0.003, "s", xml=FALL, **verify).ok


def test_of_the_end_alone_only_the_last_value_is_finite() -> None:
    """A ball that falls has the speed g t: over the time it is g, and 0 over 0 at the start."""
    assert certify(9.81, 0.01, "", xml=FALL, expr="-data.qvel[0]/data.time", seconds=1, timestep="both").ok
    why = certify(9.81, 0.01, "", xml=FALL, expr="1/(data.time - data.time)", seconds=1).why
    assert "has not a finite value at the end" in why
