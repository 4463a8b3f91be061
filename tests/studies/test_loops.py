"""The loops that speed is measured with do the same work: the same bits, and a bracket that is right."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.numerics.integrators import EULER
from grader.numerics.scene import Scene
from grader.numerics.stability.trials import check_bracket
from grader.studies.bench import floors
from grader.studies.bench.physics import loops
from grader.studies.bench.timing import TimeRatio


@pytest.mark.parametrize("integrator", ["Euler", "RK4"])
@pytest.mark.parametrize("name", loops.SCENES)
def test_all_loops_give_the_same_bits(name: str, integrator: str) -> None:
    scene = loops.load_course_scene(name)
    plain, lesson = loops.make_rollout(scene, integrator, skip=False)(), loops.make_lessons_run(scene, integrator)
    lesson()
    assert plain == loops.make_rollout(scene, integrator, skip=True)() == lesson.state().tobytes()
    try:
        in_c = loops.LoopInC(scene, integrator)
        in_c()
    except loops.NoLoop as why:
        assert "no C compiler" in str(why)
    else:
        assert in_c.state().tobytes() == plain


def test_the_lessons_bisection_finds_what_is_certified() -> None:
    low, high = loops.bisect_as_lesson()
    assert 19.5e-3 < low < 20.117e-3 < high < 20.7e-3
    assert check_bracket(
        Scene.from_xml(loops.write_stiff_servo()).at(qpos=[1.0]), low, high, integrator=EULER.code
    ).holds


@pytest.fixture
def loop_not_compiled_yet() -> Iterator[None]:
    loops.compile_loop.cache_clear()
    yield
    loops.compile_loop.cache_clear()


@pytest.mark.usefixtures("loop_not_compiled_yet")
def test_without_a_compiler_the_reason_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    with pytest.raises(loops.NoLoop, match="no C compiler"):
        loops.compile_loop()


@pytest.mark.usefixtures("loop_not_compiled_yet")
def test_without_headers_the_reason_is_said(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(loops, "PACKAGE", tmp_path)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    with pytest.raises(loops.NoLoop, match="headers or library"):
        loops.compile_loop()


def no_loop() -> TimeRatio:
    raise loops.NoLoop("no compiler")


def found(least: float, *median: float) -> TimeRatio:
    low, high = median
    return TimeRatio((low + high) / 2, (low, high), least, 1.0, (low, high))


FAST, SLOW = found(2.0, 1.95, 2.05), found(1.4, 1.3, 1.5)
ONE_FAST_SAMPLE, DISTURBED = found(1.4, 1.95, 2.05), found(2.0, 1.3, 1.5)


@pytest.mark.parametrize(
    ("measurements", "said", "times"),
    [
        ([FAST], "ok", 1),
        ([ONE_FAST_SAMPLE], "ok", 1),
        ([DISTURBED], "ok", 1),
        ([SLOW, FAST], "ok", 2),
        ([SLOW, SLOW, FAST], "ok", 3),
        ([SLOW, SLOW, SLOW, FAST], "BELOW", 3),
    ],
)
def test_a_ratio_below_its_floor_each_time_fails_and_one_not_measured_says_why(
    measurements: list[TimeRatio],
    said: str,
    times: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    turns = iter(measurements)
    faster = floors.Floor("faster", lambda: next(turns), 1.8, "a test")
    monkeypatch.setattr(floors, "FLOORS", [faster, floors.Floor("in C", no_loop, 1.0, "a test")])
    assert floors.main([]) == (said == "BELOW")
    assert len(measurements) - len(list(turns)) == times
    assert floors.main(["in C"]) == 0
    shown = capsys.readouterr().out
    assert f"{said:6}faster" in shown
    assert "not measured: no compiler" in shown
