"""What costs much to make and seldom changes: kept as it is, or part by part, such as the questions of a quiz."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Mapping, Set
from threading import Lock
from typing import Generic, TypeVar

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")
Whole = TypeVar("Whole", bound=Hashable)
Part = TypeVar("Part")


class Kept(Generic[Key, Value]):
    """The `count` values that were used last, by key. Thread-safe."""

    def __init__(self, count: int) -> None:
        self._count, self._lock = count, Lock()
        self._kept: OrderedDict[Key, Value] = OrderedDict()

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """The value of this key; calls `make` if it is not kept. Several threads may make the same one at once."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        made = make()
        with self._lock:
            value = self._kept.setdefault(key, made)
            self._kept.move_to_end(key)
            if len(self._kept) > self._count:
                self._kept.popitem(last=False)
        return value


class Parts(Generic[Whole, Key, Part]):
    """The parts of the `count` documents that were used last, each with the state that it was made in. Thread-safe."""

    def __init__(self, count: int) -> None:
        self._kept: Kept[Whole, list[Mapping[Key, tuple[object, Part]]]] = Kept(count)

    def get(
        self, whole: Whole, states: Mapping[Key, object], make: Callable[[Set[Key]], Mapping[Key, Part]]
    ) -> dict[Key, Part]:
        """The parts of a document, in the order of `states`, which change whenever their parts do.

        Calls `make` for the parts that are not kept in their present state; what it does not return is left out.
        Several threads may make the same ones at once.
        """
        place = self._kept.get(whole, lambda: [{}])
        parts = {key: one for key, one in place[0].items() if key in states and one[0] == states[key]}
        if changed := states.keys() - parts.keys():
            parts |= {key: (states[key], part) for key, part in make(changed).items()}
        place[0] = parts
        return {key: parts[key][1] for key in states if key in parts}
