"""Scripts that look alike: renamed copies are found, the starter and common code are not, and the time stays linear."""

import time

import pytest

from grader.courses.rules.similarity import Alike, find_alike, group_pairs, hash_given, mark_lines, take_fingerprints

BISECTION = """
def is_stable(model, h):
    model.opt.timestep = h
    data = mujoco.MjData(model)
    while data.time < 3.0:
        mujoco.mj_step(model, data)
        if data.warning[0].number:
            return False
    return True

def largest(model):
    low, high = 0.001, 0.05
    while high - low > 0.0005:
        middle = (low + high) / 2
        if is_stable(model, middle):
            low = middle
        else:
            high = middle
    return low, high
"""
RENAMED = BISECTION.replace("middle", "h_mid").replace("is_stable", "ok").replace("0.05", "50e-3").replace(
    "    low,", "    # search between the ends\n    low,"
)  # fmt: skip
OTHER = """
import numpy as np
def largest(model):
    inertia = model.dof_M0[0]
    gains = np.array([model.actuator_gainprm[0, 0], -model.actuator_biasprm[0, 2]])
    matrix = np.array([[1, 2], [-gains[0] / inertia, 1 - gains[1] / inertia]])
    radius = max(abs(np.linalg.eigvals(matrix)))
    return [h for h in np.linspace(0.001, 0.05, 400) if radius * h < 1][-1]
"""


def test_a_renamed_copy_is_found_and_its_lines_are_marked() -> None:
    scripts = {name: take_fingerprints(text) for name, text in
               {"ann": BISECTION, "bob": RENAMED, "cem": OTHER}.items()}  # fmt: skip
    [group] = find_alike(scripts)
    [pair] = group.pairs
    assert (pair.one, pair.other) == ("ann", "bob")
    assert pair.share > 0.95
    marked = mark_lines(scripts["bob"], scripts["ann"])
    assert len(marked) >= 15
    assert mark_lines(scripts["cem"], scripts["ann"]) == set()


def test_ten_equal_scripts_are_one_group_with_each_member_once() -> None:
    """They make 45 pairs. Two others, alike too, are a group of their own."""
    names = [f"learner {place}" for place in range(10)]
    copies = {name: take_fingerprints(BISECTION) for name in names}
    upside_down = "\n".join(reversed(BISECTION.splitlines()))
    others = {name: take_fingerprints(upside_down) for name in ("ann", "bob")}
    alone = {f"alone {place}": take_fingerprints("") for place in range(30)}
    many, two = sorted(find_alike({**copies, **others, **alone}), key=lambda group: -len(group.pairs))
    assert sorted(many.closest) == names
    assert len(many.pairs) == 45
    assert two.closest == {"ann": "bob", "bob": "ann"}


def test_a_chain_of_pairs_is_one_group() -> None:
    """The first and the last share nothing: each stands beside the one it shares most with."""
    pairs = [Alike("a", "b", 9, 0.9), Alike("d", "e", 8, 0.8), Alike("b", "c", 7, 0.7)]
    chain, other = group_pairs(pairs)
    assert chain.closest == {"a": "b", "b": "a", "c": "b"}
    assert other.pairs == (pairs[1],)


def test_the_starter_is_left_out() -> None:
    given = hash_given([BISECTION])
    assert find_alike({name: take_fingerprints(BISECTION, given) for name in ("ann", "bob")}) == []


def test_what_a_third_of_the_class_writes_pairs_no_one() -> None:
    assert find_alike({f"learner {place}": take_fingerprints(BISECTION) for place in range(12)}) == []


@pytest.mark.parametrize("text", ["", "x", "'''", '"""never ends', "\x00\ud800 def (", "é" * 100, "))))" * 500])
def test_any_text_is_read(text: str) -> None:
    take_fingerprints(text)


def test_hostile_texts_take_no_longer_than_their_length() -> None:
    for text in ("'" * 50_000, '"""' * 20_000, "a." * 50_000, "0" * 100_000, "(" * 100_000):
        start = time.process_time()
        take_fingerprints(text)
        assert time.process_time() - start < 2, text[:10]
