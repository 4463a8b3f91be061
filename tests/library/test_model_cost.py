"""A model that is too large to compile is refused in moments, and no model reads another file."""

import time
from pathlib import Path

import pytest

from grader.errors import ContentError
from grader.library import load
from grader.library.checking.model_cost import explain_cost

COPIED = '<replicate count="100">'
SPHERE = '<geom size="1"/>'
JOINT = f'<body name="arm"><joint name="hinge"/>{SPHERE}</body>'

TOO_LARGE = {
    "a replicate": f'<worldbody><replicate count="200000" offset="1 0 0">{SPHERE}</replicate></worldbody>',
    "replicates of replicates": f"<worldbody>{COPIED * 4}{SPHERE}{'</replicate>' * 4}</worldbody>",
    "many elements": f"<worldbody>{SPHERE * 6000}</worldbody>",
    "a texture": '<asset><texture name="a" type="2d" builtin="flat" width="100000" height="100000"/></asset>',
    "a height field": '<asset><hfield name="a" nrow="50000" ncol="50000" size="1 1 1 1"/></asset>',
    "a flexible grid": '<worldbody><flexcomp name="f" count="300 300 300" spacing="1 1 1" dim="3"/></worldbody>',
    "memory": '<size memory="1T"/>',
    "user data": '<size nuserdata="2000000000"/>',

    "a sensor": f'<worldbody>{JOINT}</worldbody><sensor><user dim="2000000000"/></sensor>',
    "a length range": (
        f'<compiler><lengthrange timestep="1e-6" inttotal="1e9"/></compiler><worldbody>{JOINT}</worldbody>'
        '<actuator><muscle name="m" joint="hinge"/></actuator>'
    ),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("what", TOO_LARGE)
def test_a_model_that_is_too_large_is_refused_in_moments(what: str) -> None:
    began = time.process_time()
    why = explain_cost(f"<mujoco>{TOO_LARGE[what]}</mujoco>")
    assert why is not None and "make it smaller" in why
    assert time.process_time() - began < 5, "this process must not compile it"


@pytest.mark.slow
def test_models_of_ordinary_size_pass() -> None:
    chain = f'<replicate count="20" offset="1 0 0">{SPHERE}</replicate>'
    texture = '<asset><texture name="a" type="2d" builtin="checker" width="300" height="300"/></asset>'
    for inside in (f"<worldbody>{chain}</worldbody>", texture, f"<worldbody>{SPHERE * 500}</worldbody>", "<broken"):
        assert explain_cost(f"<mujoco>{inside}</mujoco>") is None


def test_a_content_folder_with_such_a_model_is_refused(tmp_path: Path) -> None:
    xml = f"<mujoco>{TOO_LARGE['a replicate']}</mujoco>"
    for folder in ("models", "quizzes"):
        (tmp_path / folder).mkdir()
    (tmp_path / "models/chain.xml").write_text(xml)
    text = '{"id": "quiz", "title": "A quiz", "labs": [{"id": "lab", "xml": "%s"}]}'
    (tmp_path / "quizzes/quiz.json").write_text(text % xml.replace('"', "'"))
    with pytest.raises(ContentError) as refused:
        load(tmp_path)
    faults = {(fault.file, fault.key): fault.why for fault in refused.value.faults}
    assert set(faults) == {("models/chain.xml", "model"), ("quizzes/quiz.json", "lab.xml")}
    assert all("has 200003 elements" in why for why in faults.values())


HIDDEN = [
    '<!DOCTYPE x [<!-- > <mujoco><include file="{secret}"/></mujoco> -->]><mujoco/>',
    '<!DOCTYPE x [<!ENTITY a "b">]><mujoco><include file="{secret}"/></mujoco>',
    '<mujoco><include file="{secret}"/></mujoco>',
    '<mujoco><asset><mesh name="m" file="file://{secret}"/></asset></mujoco>',
    '<mujoco><asset><hfield name="h" file="http://127.0.0.1/a.png" size="1 1 1 1"/></asset></mujoco>',
    '<mujoco><compiler meshdir="{folder}"/><asset><mesh file="secret.xml"/></asset></mujoco>',
    '<mujoco><asset><model name="m" file="../secret.xml"/></asset></mujoco>',
    '<mujoco><asset><model name="m" file="{secret}"/></asset></mujoco>',
    '<mujoco><asset><model name="m" file="http://127.0.0.1/a.xml"/></asset></mujoco>',
]


@pytest.mark.parametrize("xml", HIDDEN)
def test_no_model_reads_a_file_outside_its_folder(tmp_path: Path, xml: str) -> None:
    (tmp_path / "secret.xml").write_text("<mujoco><worldbody><geom size='1'/></worldbody></mujoco>")
    root = tmp_path / "content"
    for folder in ("models", "quizzes"):
        (root / folder).mkdir(parents=True)
    (root / "models/bad.xml").write_text(xml.format(secret=tmp_path / "secret.xml", folder=tmp_path))
    (root / "quizzes/quiz.json").write_text('{"id": "quiz", "title": "A quiz"}')
    with pytest.raises(ContentError) as refused:
        load(root)
    assert [(fault.file, fault.key) for fault in refused.value.faults] == [("models/bad.xml", "model")]
