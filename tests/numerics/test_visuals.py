"""A model without what only shows moves as the whole one does, to the last bit, or is not used."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from grader.numerics.rollout import simulate
from grader.numerics.scene import Scene
from grader.numerics.visuals import compile_untextured, count_visuals, moves_alike, remove_visuals
from grader.numerics.workspace import BARE_AFTER
from grader.studies.bench.physics.models import find_gymnasium_models
from numerics.models import ALL, LESSON, MODELS

BOX = (MODELS / "tumbling_box.xml").read_text()

INFERRED = """
<mujoco><compiler {compiler}/><worldbody><light pos="0 0 3"/>
  <body pos="0 0 1" euler="10 20 30"><joint axis="0 1 0.2"/><joint type="slide" axis="0 0 1"/>
    <geom type="box" pos="0.1 0.05 0" euler="0 30 10" size="0.1 0.2 0.3" density="700" contype="0" conaffinity="0"/>
    <geom type="capsule" fromto="0 0 0 0.1 0.2 -0.5" size="0.03" contype="0" conaffinity="0"/>
    <body pos="0.1 0 -0.4"><joint type="ball"/><geom type="ellipsoid" size="0.1 0.05 0.2" pos="0 0.02 -0.2" mass="0.3"
      contype="0" conaffinity="0"/></body></body>
</worldbody></mujoco>"""


def bare(xml: str) -> mujoco.MjModel | None:
    scene = Scene.from_xml(xml)
    return remove_visuals(xml, scene.model, scene.needs)


@pytest.mark.parametrize("xml", [*LESSON.values(), BOX, ALL["sensors"], ALL["excluded_pair"]])
def test_nothing_that_only_shows_is_left(xml: str) -> None:
    model = bare(xml)
    assert model is not None
    assert count_visuals(model) == 0


@pytest.mark.parametrize("name", ["sprung_body", "tendon_limit"])
def test_a_site_that_a_tendon_hangs_from_stays(name: str) -> None:
    assert bare(ALL[name]) is None
    lit = bare(ALL[name].replace("<worldbody>", '<worldbody><light pos="0 0 3"/>'))
    assert lit is not None
    assert (lit.nlight, lit.nsite) == (0, 2)


@pytest.mark.parametrize("name", ["two_free_bodies", "cube", "explicit_pair", "mocap_alone", "fluid", "flex", "ball"])
def test_where_geoms_act_or_nothing_shows_the_model_stays_whole(name: str) -> None:
    assert bare(ALL[name]) is None


@pytest.mark.parametrize("compiler", ["", 'boundmass="0.5"', 'settotalmass="3"', 'inertiafromgeom="true"'])
@pytest.mark.parametrize("integrator", range(5))
@pytest.mark.usefixtures("bare_at_once")
def test_masses_that_come_from_geoms_outlive_them(compiler: str, integrator: int) -> None:
    scene = Scene.from_xml(INFERRED.format(compiler=compiler)).at(qvel=[1, 0.5, 2, -1, 0.3])
    less, whole = (simulate(scene, steps=200, integrator=integrator, skip=skip) for skip in (True, False))
    assert less.qpos.tobytes() == whole.qpos.tobytes()
    assert less.qvel.tobytes() == whole.qvel.tobytes()


SKY = """<mujoco><asset><texture type="skybox" builtin="gradient" rgb1="0 0 1" rgb2="0 0 0" width="64" height="64"/>
  <texture name="grid" type="2d" builtin="checker" width="8" height="8"/><material name="grid" texture="grid"/></asset>
  <worldbody><geom type="plane" size="1 1 .1" material="grid"/><body pos="0 0 1"><freejoint/>
    <geom size=".1" material="grid"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("as_file", [False, True])
def test_textures_are_left_out_and_nothing_else(tmp_path: Path, as_file: bool) -> None:
    path = tmp_path / "sky.xml"
    path.write_text(SKY)
    whole, bare = mujoco.MjModel.from_xml_string(SKY), compile_untextured(path if as_file else SKY)
    assert (whole.ntex, bare.ntex, bare.nmat) == (2, 0, 1)
    assert moves_alike(whole, bare)
    for name in ("geom_type", "geom_size", "geom_pos", "geom_matid", "body_geomadr", "geom_contype"):
        assert getattr(whole, name).tolist() == getattr(bare, name).tolist()


def test_foreign_models_move_alike_without_their_textures() -> None:
    paths = find_gymnasium_models().values()
    assert len(paths) > 10
    for path in paths:
        whole, bare = mujoco.MjModel.from_xml_path(str(path)), compile_untextured(path)
        assert moves_alike(whole, bare), path
        assert whole.geom_size.tobytes() == bare.geom_size.tobytes()


def test_what_does_not_compile_is_refused() -> None:
    with pytest.raises(ValueError, match="XML"):
        compile_untextured("<mujoco>")


def test_a_number_of_the_motion_is_noticed() -> None:
    model, heavier = (mujoco.MjModel.from_xml_string(BOX) for _ in range(2))
    assert moves_alike(model, heavier)
    heavier.body_mass[1] = np.nextafter(1.0, 2.0)
    assert not moves_alike(model, heavier)
    assert not moves_alike(model, mujoco.MjModel.from_xml_string(ALL["free_body"].replace("1 2 3", "1 2 4")))


def test_it_is_made_once_a_scene_has_run_for_long_and_only_for_runs_that_skip() -> None:
    scene = Scene.from_xml(LESSON["pendulum"].replace("pendulum", "pendulum_often_run"))
    with scene.borrow(skip=True) as lent:
        assert lent.model.ngeom
    simulate(scene, steps=BARE_AFTER, every=BARE_AFTER, skip=False)
    with scene.borrow(skip=True) as lent:
        assert lent.model.ngeom
    simulate(scene, steps=BARE_AFTER, every=BARE_AFTER)
    with scene.borrow(skip=True) as lent, scene.borrow() as whole:
        assert (lent.model.ngeom, whole.model.ngeom) == (0, 3)
        first = lent
    with scene.borrow(skip=True) as again, scene.borrow(skip=True) as second:
        assert again is first
        assert second is not first
        assert second.model.ngeom == 0


def test_a_changed_model_is_stepped_as_it_was_changed() -> None:
    scene = Scene.from_xml(LESSON["pendulum"].replace("pendulum", "pendulum_changed")).at(qpos=[1.0])
    before = simulate(scene, steps=BARE_AFTER, every=BARE_AFTER // 100)

    def damp(model: mujoco.MjModel) -> None:
        model.dof_damping[:] = 0.5

    less, whole = (simulate(scene.changed(damp), steps=BARE_AFTER, skip=skip) for skip in (True, False))
    assert less.qpos.tobytes() == whole.qpos.tobytes()
    assert abs(less.qpos[-1]) < 1e-3 < np.abs(before.qpos[1:]).max()
