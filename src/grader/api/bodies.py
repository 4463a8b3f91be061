"""What bodies of requests and responses have in common."""

from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator
from pydantic_core import PydanticCustomError

ENTRIES_MAX = 1000
"""Entries of a list or an object in a body."""

KEY_CHARACTERS = 64
"""Characters of an unknown key that are shown; every known one is shorter."""


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
