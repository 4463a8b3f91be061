"""What bodies of requests and responses have in common."""

from math import isfinite
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, model_validator
from pydantic_core import PydanticCustomError

ENTRIES_MAX = 1000
"""Entries of a list or an object in a body."""

KEY_CHARACTERS = 64
"""Characters of an unknown key that are shown; every known one is shorter."""


def require_finite(value: Any) -> Any:
    """Returns a JSON value without numbers that no JSON has. Parsers take NaN and Infinity all the same, and make
    infinity of 1e999; what is stored of them no other program could read."""
    open_values = [value]
    while open_values:
        one = open_values.pop()
        if isinstance(one, float) and not isfinite(one):
            raise PydanticCustomError(
                "no_json", "it is not JSON: NaN, Infinity and numbers beyond 1.8e308 are no numbers"
            )
        if isinstance(one, dict | list):
            open_values += one.values() if isinstance(one, dict) else one
    return value


AnyJson = Annotated[Any, AfterValidator(require_finite)]
"""Any value that JSON has."""


class ResponseBody(BaseModel):
    """A JSON object. pydantic compiles its schema at first use: the models of all routes would take a fifth of a second
    of every start."""

    model_config = ConfigDict(defer_build=True)


class RequestBody(BaseModel):
    """A JSON object with known keys and finite numbers. The error is short however long the body
    is: pydantic lists every unknown key and every wrong entry, which takes it 0.7 s for 2 MB."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _shorten(cls, data: Any) -> Any:
        """Drops all unknown keys but the first. Refuses long lists and objects."""
        if not isinstance(data, dict):
            return data
        known = {name: data[name] for name in cls.model_fields if name in data}
        for name, value in known.items():
            if isinstance(value, list | dict) and len(value) > ENTRIES_MAX:
                raise PydanticCustomError("too_long", f"{name} has more than {ENTRIES_MAX} entries")
        if len(known) == len(data):
            return data
        first = next(name for name in data if name not in known)
        return known | {first[:KEY_CHARACTERS]: data[first]}
