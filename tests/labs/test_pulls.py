"""Pulls in a lab: a damped spring on a body, for a while, and nothing else of the run changes."""

import math
from typing import Any

import numpy as np
import pytest

from grader.domain.lab import LabConfig
from grader.errors import LabRefused
from grader.labs import PULLS_MAX, LabRun, Pull, run_lab
from grader.numerics import drawing

FLOATING = """<mujoco><option timestep="0.0005" gravity="0 0 0"/><worldbody><geom type="plane" size="1 1 .1"/>
  <body name="puck" pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1" mass="2"/></body></worldbody></mujoco>"""
LAB = LabConfig.model_validate({"xml": FLOATING, "seconds": 1, "readouts": [{"label": "x", "expr": "data.qpos[0]"}]})
GOAL = (0.3, 0.0, 1.0)
STIFFNESS = 100.0
"""MuJoCo's default of `visual/map/stiffness` [1/s^2]: the damping of its spring is the root of it, half of critical."""


def run(*pulls: Pull, lab: LabConfig = LAB) -> LabRun:
    return run_lab(lab, FLOATING, pulls=pulls)


def positions(run: LabRun) -> dict[float, float]:
    return dict(zip(run.times, (float(place[1][0]) for place, _ in run.poses), strict=True))


def pull(**changes: Any) -> Pull:
    return Pull(**{"geom": 1, "point": (0.0, 0.0, 0.0), "goal": GOAL, "begin": 0.25, "end": 1.0, **changes})


def test_a_pull_is_a_damped_spring() -> None:
    decay = math.sqrt(STIFFNESS) / 2
    rate = math.sqrt(STIFFNESS - decay**2)
    for time, x in positions(run(pull())).items():
        late = max(0.0, time - 0.25)
        swing = math.cos(rate * late) + decay / rate * math.sin(rate * late)
        assert x == pytest.approx(GOAL[0] * (1 - math.exp(-decay * late) * swing), abs=1e-3)


def test_after_the_end_of_a_pull_the_body_moves_freely() -> None:
    x = positions(run(pull(end=0.5)))
    free = [(time, value) for time, value in x.items() if time > 0.51]
    rates = np.diff([value for _, value in free]) / np.diff([time for time, _ in free])
    assert np.ptp(rates) < 1e-9
    assert rates[0] > 0.1


def test_a_run_is_the_same_until_it_is_pulled_and_a_pull_repeats() -> None:
    before, pulled = positions(run()), positions(run(pull()))
    assert [x for time, x in pulled.items() if time <= 0.25] == [0.0] * sum(time <= 0.25 for time in pulled)
    assert before.keys() >= {time for time in pulled if time <= 0.25}
    assert positions(run(pull())) == pulled


def test_forces_of_the_author_and_of_other_pulls_go_on() -> None:
    windy = LabConfig.model_validate(
        {"xml": FLOATING, "setup": "data.xfrc_applied[7] = 0.5", "seconds": 1,
         "readouts": [{"label": f"force along {axis}", "expr": f"data.xfrc_applied[{6 + axis}]"} for axis in range(3)]}
    )  # fmt: skip
    along, across = pull(begin=0, end=0.5), pull(begin=0, end=0.5, goal=(0.0, 0.3, 1.0))
    both, one, other = run(along, across, lab=windy), run(along, lab=windy), run(across, lab=windy)
    assert both.readouts == [(0.0,) * len(both.times), (0.5,) * len(both.times), (0.0,) * len(both.times)]
    late = min(both.times, key=lambda time: abs(time - 0.49))
    middles = [positions(each)[late] for each in (both, one, other)]
    assert middles[1] == pytest.approx(GOAL[0], abs=0.05)
    assert middles[2] == 0
    assert middles[0] == pytest.approx(GOAL[0] / 2, abs=0.05)  # between the two goals


@pytest.mark.parametrize(
    ("pulls", "why"),
    [
        ([pull(geom=0)], "fixed to the world"),
        ([pull(geom=2)], "draws 2"),
        ([pull(goal=(math.inf, 0, 0))], "within 1000 m"),
        ([pull(begin=0.5, end=0.5)], "lasts more than 0"),
        ([pull(end=9.0)], "at most 5 s"),
        ([pull(begin=math.nan)], "begins at 0 s"),
        ([pull()] * (PULLS_MAX + 1), "At most 8"),
    ],
)
def test_what_cannot_be_pulled_is_refused(pulls: list[Pull], why: str) -> None:
    with pytest.raises(LabRefused, match=why):
        run(*pulls)


def test_meshes_and_height_fields_are_drawn_by_their_triangles_as_far_as_they_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1))
    xml = f"""<mujoco><asset><mesh name="cube" vertex="{corners}"/>
      <hfield name="hill" nrow="2" ncol="3" size="3 2 .5 .1" elevation="0 1 0 0 0 0"/></asset><worldbody>
      <geom type="hfield" hfield="hill"/><body name="a"><joint/><geom type="mesh" mesh="cube"/></body>
      </worldbody></mujoco>"""
    lab = LabConfig.model_validate({"xml": xml, "seconds": 0.1})
    hill, cube = run_lab(lab, xml).geoms
    assert (hill["type"], hill["body"], len(hill["mesh"]["faces"])) == ("hfield", None, 12)
    assert np.reshape(hill["mesh"]["vertices"], (6, 3))[4] == pytest.approx([0, 2, 0.5])
    assert (cube["type"], cube["body"], len(cube["mesh"]["faces"])) == ("mesh", "a", 36)
    assert np.ptp(np.reshape(cube["mesh"]["vertices"], (8, 3)), axis=0) == pytest.approx([1, 1, 1])
    monkeypatch.setattr(drawing, "MESH_MAX", 3)
    boxes = [np.reshape(geom["mesh"]["vertices"], (8, 3)) for geom in run_lab(lab, xml).geoms]
    assert [(box.min(axis=0).tolist(), box.max(axis=0).tolist()) for box in boxes] == [
        ([-3, -2, pytest.approx(-0.1)], [3, 2, pytest.approx(0.5)]),
        ([pytest.approx(-0.5)] * 3, [pytest.approx(0.5)] * 3),
    ]
