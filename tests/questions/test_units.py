"""Conversions between units: with the bits of pint, whose factors are kept."""

import itertools
from functools import cache

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grader.errors import InvalidAnswer
from grader.questions.kinds.number.units import FAMILIES, UNCLEAR, Rotation, convert, get_registry, read_unit

PRODUCTS = ("N m/rad", "N m/deg", "m/s", "km/h", "kg m^2", "g cm^2", "rad/s", "deg/s", "rpm", "Hz", "1/s")


@cache
def list_pairs() -> list[tuple[str, str]]:
    """Pairs of units between which pint converts; pint takes long to start."""
    return [
        (one, other)
        for family in (*FAMILIES, PRODUCTS)
        for one, other in itertools.permutations(family, 2)
        if read_unit(one).quantity.is_compatible_with(read_unit(other).quantity)
    ]


SAME = (Rotation.TURNS, Rotation.CYCLES)
"""Between these pint's own number is divided or multiplied by turns."""


@given(pair=st.deferred(lambda: st.sampled_from(list_pairs())), value=st.floats(-1e12, 1e12))
def test_a_conversion_has_the_bits_of_pint(pair: tuple[str, str], value: float) -> None:
    one, other = map(read_unit, pair)
    if {one.rotation, other.rotation} in UNCLEAR:
        with pytest.raises(InvalidAnswer, match="counts rotation"):
            convert(value, one, other)
    elif not (one.rotation in SAME and other.rotation in SAME and one.rotation is not other.rotation):
        assert convert(value, one, other) == get_registry().Quantity(value, one.quantity).to(other.quantity).magnitude


@pytest.mark.parametrize(
    ("name", "meant"),
    [("Prozent", "percent"), ("pour cent", "percent"), ("por ciento", "percent"), ("per cento", "percent"),
     ("Per cent", "percent"), ("процентов", "percent"), ("Promille", "permille")],
)  # fmt: skip
def test_a_share_is_read_in_other_languages(name: str, meant: str) -> None:
    assert convert(1.0, read_unit(name), read_unit(meant)) == 1.0


@pytest.mark.parametrize(("one", "other", "value", "expected"), [("ms", "s", 5.0, 0.005), ("degC", "K", 20.0, 293.15)])
def test_scales_with_and_without_an_offset(one: str, other: str, value: float, expected: float) -> None:
    assert convert(value, read_unit(one), read_unit(other)) == pytest.approx(expected, rel=1e-15)
