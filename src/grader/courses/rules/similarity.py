"""Scripts that look alike: fingerprints of their tokens, by winnowing. Names, numbers and texts count as equal, so that
renaming hides nothing; comments and layout do not count. Source: Schleimer, Wilkerson and Aiken 2003. Pure.

The time grows with the length of all scripts: a fingerprint of more learners than `COMMON_MAX` is what people write
anyway, and pairs no one."""

import keyword
import re
import zlib
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

TOKEN = re.compile(
    r"(?P<skip>[ \t\r\f\\]+|\#[^\n]*)|(?P<newline>\n)"
    r"|(?P<text>[rbfuRBFU]{0,2}(?:\"\"\"[\s\S]*?\"\"\"|'''[\s\S]*?'''|\"[^\"\n]*\"|'[^'\n]*'))"
    r"|(?P<number>\.?\d(?:[eE][+-]\d|[\w.])*)|(?P<name>[^\W\d]\w*)|(?P<sign>[\s\S])"
)

GRAM = 12
"""Tokens of a fingerprint: shorter matches are chance."""
WINDOW = 8
"""Of so many grams in a row one fingerprint is kept: equal parts of GRAM + WINDOW - 1 tokens are found."""

TOKENS_MAX = 20_000
"""Tokens of a script that are read."""
COMMON_MAX = 40
SHARED_MIN = 6
"""Shared fingerprints of a pair that is listed, at least."""
SHARE_MIN = 0.4
"""The part of the shorter script's fingerprints that a listed pair shares, at least."""
GROUPS_MAX = 40


@dataclass(frozen=True)
class Fingerprints:
    """A script's fingerprints, with the lines of each, from 1."""

    lines: Mapping[int, tuple[int, int]]


@dataclass(frozen=True)
class Alike:
    """Two scripts that share `shared` fingerprints, which are the part `share` of those of the shorter one."""

    one: str
    other: str
    shared: int
    share: float


@dataclass(frozen=True)
class Group:
    """Scripts that look alike: each is in a pair with another of them. The pairs that share most come first."""

    pairs: tuple[Alike, ...]

    @property
    def closest(self) -> dict[str, str]:
        """The members in the order of the pairs, each with the one that it shares most with."""
        others: dict[str, str] = {}
        for pair in self.pairs:
            others.setdefault(pair.one, pair.other)
            others.setdefault(pair.other, pair.one)
        return others


def read_tokens(source: str) -> list[tuple[str, int]]:
    """Returns the tokens of a script with their lines: names after a dot and keywords as they are, others as their
    kind. Any text is read, also one that is no Python."""
    tokens: list[tuple[str, int]] = []
    line, after_dot = 1, False
    for match in TOKEN.finditer(source):
        kind, text = match.lastgroup, match[0]
        if kind not in ("skip", "newline"):
            is_kept = kind == "sign" or (kind == "name" and (after_dot or keyword.iskeyword(text)))
            tokens.append((text if is_kept else str(kind), line))
            after_dot = text == "."
            if len(tokens) >= TOKENS_MAX:
                break
        line += text.count("\n")
    return tokens


def list_grams(source: str) -> list[tuple[int, int, int]]:
    """Returns the hash of every gram of a script, with its first and last line."""
    tokens = read_tokens(source)
    texts = [text for text, _ in tokens]
    return [
        (zlib.crc32("\x1f".join(texts[at : at + GRAM]).encode()), tokens[at][1], tokens[at + GRAM - 1][1])
        for at in range(len(tokens) - GRAM + 1)
    ]


def take_fingerprints(source: str, without: frozenset[int] = frozenset()) -> Fingerprints:
    """Returns the fingerprints of a script: the least hash of every window, the last one of equal ones. Hashes that are
    given `without` are left out: those of the starter and of the right programs."""
    grams = list_grams(source)
    lines: dict[int, tuple[int, int]] = {}
    for start in range(max(1, len(grams) - WINDOW + 1) if grams else 0):
        window = grams[start : start + WINDOW]
        least = min(reversed(window), key=lambda gram: gram[0])
        if least[0] not in without:
            lines.setdefault(least[0], (least[1], least[2]))
    return Fingerprints(lines)


def hash_given(sources: Iterable[str]) -> frozenset[int]:
    """Returns the hashes of every gram of programs that all learners may have seen."""
    return frozenset(gram[0] for source in sources for gram in list_grams(source))


def find_alike(scripts: Mapping[str, Fingerprints]) -> list[Group]:
    """Returns the groups of scripts that look alike, those with the closest pair first; at most `GROUPS_MAX`."""
    owners: dict[int, list[str]] = defaultdict(list)
    for name, fingerprints in scripts.items():
        for fingerprint in fingerprints.lines:
            owners[fingerprint].append(name)
    common = min(COMMON_MAX, max(4, len(scripts) // 3))
    shared: Counter[tuple[str, str]] = Counter()
    for names in owners.values():
        if 1 < len(names) <= common:
            shared.update(combinations(sorted(names), 2))
    pairs = []
    for (one, other), count in shared.items():
        share = count / min(len(scripts[one].lines), len(scripts[other].lines))
        if count >= SHARED_MIN and share >= SHARE_MIN:
            pairs.append(Alike(one, other, count, share))
    return group_pairs(sorted(pairs, key=lambda pair: (-pair.share, -pair.shared, pair.one, pair.other)))[:GROUPS_MAX]


def group_pairs(pairs: Sequence[Alike]) -> list[Group]:
    """Joins pairs that have a script in common, in the order of the first pair of each group."""
    neighbours: dict[str, list[str]] = defaultdict(list)
    for pair in pairs:
        neighbours[pair.one].append(pair.other)
        neighbours[pair.other].append(pair.one)
    place: dict[str, int] = {}
    groups: list[list[Alike]] = []
    for pair in pairs:
        if pair.one not in place:
            reached = [pair.one]
            while reached:
                script = reached.pop()
                if script not in place:
                    place[script] = len(groups)
                    reached += neighbours[script]
            groups.append([])
        groups[place[pair.one]].append(pair)
    return [Group(tuple(group)) for group in groups]


def mark_lines(script: Fingerprints, other: Fingerprints) -> set[int]:
    """Returns the lines of a script whose fingerprints the other has too."""
    return {
        line
        for one, (first, last) in script.lines.items()
        if one in other.lines
        for line in range(first, last + 1)
    }  # fmt: skip
