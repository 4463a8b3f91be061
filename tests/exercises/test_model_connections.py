"""Mistakes in what relates the parts of a model: constraints, tendons, contacts, and geoms between two ends. Each is
measured here as the jail does, and the first variant of the reference that is alike must tell it."""

from inspect import getsource
from typing import Any

import pytest

from grader.exercises.kinds.model import matching, measuring
from grader.exercises.kinds.model.variants import list_variants

NAMES: dict[str, Any] = {}
exec(getsource(measuring), NAMES)
exec(getsource(matching), NAMES)

GEARED = """<mujoco>
<worldbody><geom name="floor" type="plane" size="2 2 .1"/>
<body name="box" pos="0 0 0.1"><freejoint/><geom name="b" type="box" size=".1 .1 .1" mass="1"/></body>
<body name="arm" pos="0 1 .5"><joint name="h" axis="1 0 0" damping=".1"/>
<geom name="rod" type="capsule" fromto="0 0 0 0 0 -.3" size=".02" mass=".5" contype="0" conaffinity="0"/></body>
<body name="arm2" pos="0 1 .5"><joint name="h2" axis="1 0 0" damping=".1"/>
<geom name="rod2" type="capsule" pos="0 0 -.15" size=".02 .15" mass="3" contype="0" conaffinity="0"/></body>
</worldbody><equality><joint name="geared" joint1="h2" joint2="h" polycoef="0 2 0 0 0"/></equality></mujoco>"""

TENDON = """<mujoco><worldbody>
<body name="a" pos="-0.2 0 1"><joint name="ja" type="slide" axis="0 0 1"/><geom size=".05" mass="1"/></body>
<body name="b" pos="0.2 0 1"><joint name="jb" type="slide" axis="0 0 1"/><geom size=".05" mass="2"/></body></worldbody>
<tendon><fixed name="sum" stiffness="200" damping="1"><joint joint="ja" coef="1"/><joint joint="jb" coef="1"/></fixed>
</tendon><actuator><motor name="pull" tendon="sum" gear="3"/></actuator></mujoco>"""

FALLS = {
    "goals": [
        {"same": ["data.joint('h').qpos", "data.joint('h2').qpos", "fullinertia('arm')"],
         "within": ["data.body('box').xpos[2]"]}
    ],
    "seconds": 0.5, "timestep": 0.002, "start": {"h": 0.4, "h2": 0.5}, "start_velocity": {}, "ctrl": {},
}  # fmt: skip
SLIDES = {
    "goals": [{"same": ["data.joint('ja').qpos", "data.joint('jb').qpos"], "within": []}],
    "seconds": 0.5, "timestep": 0.002, "start": {"ja": 0.1, "jb": 0.05}, "start_velocity": {}, "ctrl": {"pull": 2},
}  # fmt: skip


def name_mistake(reference: str, wrong: str, inputs: dict[str, Any]) -> str | None:
    """Returns the sentence of the first variant that does what a wrong model does."""
    found = NAMES["describe"](wrong, inputs, halved=False)["goals"]
    assert found != NAMES["describe"](reference, inputs, halved=False)["goals"]
    trial = {**inputs, "text": 0, "found": found}
    return next((each.sentence for each in list_variants(reference) if NAMES["is_like"]([each.xml], [trial])), None)


ONE_OVER = (
    'The equality constraint "geared" has one over the ratio that was asked for: its polycoef gives joint1 as a '
    "function of joint2, so turn the ratio round, or exchange the two joints."
)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('<joint name="geared" joint1="h2" joint2="h" polycoef="0 2 0 0 0"/>', "",
         'The equality constraint "geared" is missing.'),
        ("0 2 0 0 0", "0 .5 0 0 0", ONE_OVER),
        ('joint1="h2" joint2="h"', 'joint1="h" joint2="h2"', ONE_OVER),
        ("0 2 0 0 0", "0 -2 0 0 0",
         'The ratio of the equality constraint "geared", the second number of its polycoef, is of the wrong sign.'),
        (' polycoef="0 2 0 0 0"', "",
         'The polycoef of the equality constraint "geared" is missing: MuJoCo\'s default is 0 1 0 0 0.'),
        ('0 2 0 0 0"', '0 2 0 0 0" solref=".1 1"',
         'The equality constraint "geared" is softer than was asked for'),
        ('name="b"', 'name="b" contype="0" conaffinity="0"',
         'The geom "b" collides with nothing: look at contype and conaffinity, its own and those of what it hits.'),
        ('name="floor"', 'name="floor" contype="0" conaffinity="0"',
         'The geom "b" collides with nothing: look at contype and conaffinity, its own and those of what it hits.'),
        ('fromto="0 0 0 0 0 -.3" size=".02"', 'pos="0 0 -.15" size=".02 .3"',
         'The geom "rod" is twice as long as was asked for: a size has half of the length, fromto all of it.'),
        ('fromto="0 0 0 0 0 -.3" size=".02"', 'pos="0 0 -.15" size=".04 .3"',
         'The size of the geom "rod" is the full one: MuJoCo\'s sizes are radii and half lengths.'),
        ('axis="1 0 0"', 'axis="0 1 0"', "The axis of every joint is wrong: it is the y axis of its body."),
    ],
)  # fmt: skip
def test_a_mistake_in_a_constraint_a_contact_or_a_length_is_named(old: str, new: str, told: str) -> None:
    assert (name_mistake(GEARED, GEARED.replace(old, new), FALLS) or "").startswith(told)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (' damping="1"', "", 'The damping of the tendon "sum" is missing.'),
        ('"jb" coef="1"', '"jb" coef="-1"', 'The coef of the joint "jb" in the tendon "sum" is of the wrong sign.'),
        ('"ja" coef="1"', '"ja" coef="2"',
         'The coef of the joint "ja" in the tendon "sum" is twice what was asked for.'),
        ('tendon="sum" gear', 'joint="ja" gear',
         'The motor "pull" acts on the joint "ja", where the tendon "sum" was asked for.'),
    ],
)  # fmt: skip
def test_a_mistake_in_a_tendon_is_named(old: str, new: str, told: str) -> None:
    assert name_mistake(TENDON, TENDON.replace(old, new), SLIDES) == told
