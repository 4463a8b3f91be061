"""Removes MuJoCo's integrators from the memory of one child, from outside.

In each child the pages of machine code that hold the integrators are replaced by a shared mapping of a memory file
with the same bytes. The child can only read and execute it; its keeper holds the one descriptor that writes. While
the student's module is imported everything works. Then the keeper rewrites the file: every integrator becomes a few
instructions that count the call and return, and the rest of its body becomes traps, for a thread that was halfway
through it. Every route ends there: the Python bindings, ctypes, mujoco.rollout, a callback, a pointer saved earlier.

The original bytes do not come back: the policy refuses executable memory that is anonymous, shared or writable, and
the library's file is out of reach (lockdown.landlock, namespaces.hide). Calls from within MuJoCo itself are not
counted, as compiling a model steps it once. A script can write to the counter, which decides only the sentence that the
student gets.
"""

import ctypes
import mmap
import os
import platform
import re
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .kernel import build_error, libc

PAGE = mmap.PAGESIZE
MAP_SHARED, MAP_PRIVATE, MAP_FIXED, MAP_ANONYMOUS = 0x01, 0x02, 0x10, 0x20
READ_WRITE, READ_EXECUTE = mmap.PROT_READ | mmap.PROT_WRITE, mmap.PROT_READ | mmap.PROT_EXEC
# Every function of MuJoCo that moves a state by a timestep, or that writes such a state into its workspace. The batches
# of 4.0.0 (mjb_step, mjb_rollout) call mj_step.
NAMES = frozenset(
    {"mj_step", "mj_step1", "mj_step2", "mj_stepSkip", "mj_Euler", "mj_EulerSkip", "mj_RungeKutta", "mj_implicit"}
    | {"mj_implicitSkip", "mjd_transitionFD", "mj_ipc"}
)
# The internal functions in which they end, by their names in 3.14.0 and in 4.0.0.
ADVANCE = (frozenset({"mj_advance", "advance"}), frozenset({"advanceFinish"}))
INTEGRATORS = NAMES.union(*ADVANCE)
SECTION, SYMBOL = struct.Struct("<IIQQQQIIQQ"), struct.Struct("<IBBHQQ")  # Elf64_Shdr, Elf64_Sym
SYMTAB, FUNCTION = 2, 2

libc.mmap.restype = ctypes.c_void_p
libc.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_long]


class IntegratorsUnavailable(Exception):
    """The integrators cannot be removed on this machine; the text says why."""


@dataclass(frozen=True)
class Pages:
    """The pages with the integrators, before and after removal; `counter` is the address of the count of calls."""

    address: int
    original: bytes
    removed: bytes
    counter: int
    library: str

    def open(self) -> tuple[int, int]:
        """Make a memory file of the original bytes and a zeroed counter; return descriptors to write and to read it."""
        map_at(self.counter, PAGE, READ_WRITE, MAP_SHARED | MAP_ANONYMOUS)
        writable = os.memfd_create("code")
        os.write(writable, self.original)
        # Opened again for reading, the file can never be mapped writable.
        return writable, os.open(f"/proc/self/fd/{writable}", os.O_RDONLY | os.O_CLOEXEC)

    def lay_over(self, readable: int) -> None:
        """Replace the pages of this process by the memory file."""
        map_at(self.address, len(self.original), READ_EXECUTE, MAP_SHARED, readable)

    def remove(self, writable: int) -> None:
        """Remove the integrators from every process that maps the file. Truncation drops the pages that are mapped, so
        that the kernel brings the instruction caches up to date."""
        os.ftruncate(writable, 0)
        os.pwrite(writable, self.removed, 0)

    def count(self) -> int:
        """Return the number of calls of removed integrators in the child of this keeper."""
        return ctypes.c_uint64.from_address(self.counter).value


def map_at(address: int, size: int, protection: int, flags: int, descriptor: int = -1) -> None:
    """Map memory at exactly this address."""
    if libc.mmap(address, size, protection, flags | MAP_FIXED, descriptor, 0) != address:
        raise build_error("mmap")


def find_integrators() -> Pages:
    """Locate the integrators in the MuJoCo that this process has loaded. Raises Unavailable if the machine is neither
    x86-64 nor aarch64, or MuJoCo is another build."""
    stub_for = STUBS.get(platform.machine())
    if stub_for is None:
        raise IntegratorsUnavailable(f"the machine code of {platform.machine()} is not known")
    low, high, path = _find_library()
    symbols = _read_functions(Path(path))
    if missing := NAMES - symbols.keys():
        raise IntegratorsUnavailable(f"MuJoCo's library has no symbols {', '.join(sorted(missing))}")
    for alternatives in ADVANCE:
        if not alternatives & symbols.keys():
            raise IntegratorsUnavailable(f"MuJoCo's library has no symbol {' or '.join(sorted(alternatives))}")
    base = _find_address("mj_step") - symbols["mj_step"][0]
    if _find_address("mj_RungeKutta") != base + symbols["mj_RungeKutta"][0]:
        raise IntegratorsUnavailable("MuJoCo's library does not lie where its symbols say")
    counter = libc.mmap(None, PAGE, READ_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)
    stub, trap = stub_for(low, high - low, counter)
    spans = [(base + offset, size) for offset, size in symbols.values()]
    first = min(start for start, _ in spans) & -PAGE
    end = (max(start + size for start, size in spans) + PAGE - 1) & -PAGE
    if not low <= first < end <= high:
        raise IntegratorsUnavailable("MuJoCo's integrators do not lie in its code")
    original = ctypes.string_at(first, end - first)
    removed = bytearray(original)
    for start, size in spans:
        if size < len(stub):  # too short for a stub: it only jumps to another one of these functions
            continue
        body = stub + trap * ((size - len(stub)) // len(trap))
        removed[start - first : start - first + len(body)] = body
    return Pages(first, original, bytes(removed), counter, path)


def _build_x86_64(low: int, size: int, counter: int) -> tuple[bytes, bytes]:
    """Return the stub and a trap. The stub returns at once; it counts calls from outside the `size` bytes at `low`."""
    instructions = (
        b"\x48\x8b\x04\x24",  # mov rax, [rsp]
        b"\x48\xb9" + struct.pack("<Q", low),  # mov rcx, low
        b"\x48\x29\xc8",  # sub rax, rcx
        b"\x48\x3d" + struct.pack("<I", size),  # cmp rax, size
        b"\x72\x0e",  # jb to the ret
        b"\x48\xb8" + struct.pack("<Q", counter),  # mov rax, counter
        b"\xf0\x48\xff\x00",  # lock inc qword [rax]
        b"\xc3",  # ret
    )
    return b"".join(instructions), b"\xcc"  # int3


def _build_aarch64(low: int, size: int, counter: int) -> tuple[bytes, bytes]:
    """Return the same for aarch64. Two threads may lose an increment, which does no harm."""
    instructions = (
        0x58000149,  # ldr x9, low
        0x5800016A,  # ldr x10, size
        0xCB0903C9,  # sub x9, x30, x9
        0xEB0A013F,  # cmp x9, x10
        0x540000A3,  # b.lo to the ret
        0x58000129,  # ldr x9, counter
        0xF940012A,  # ldr x10, [x9]
        0x9100054A,  # add x10, x10, #1
        0xF900012A,  # str x10, [x9]
        0xD65F03C0,  # ret
    )
    code = struct.pack("<10I", *instructions) + struct.pack("<3Q", low, size, counter)
    return code, struct.pack("<I", 0xD4200000)  # brk #0


STUBS: dict[str, Callable[[int, int, int], tuple[bytes, bytes]]] = {"x86_64": _build_x86_64, "aarch64": _build_aarch64}


def _find_library() -> tuple[int, int, str]:
    """Find where MuJoCo's code is mapped: first address, end, the library's file."""
    mapped = re.findall(
        r"^(\w+)-(\w+) r-xp \S+ \S+ \S+ +(/\S*/libmujoco\.so\S*)$", Path("/proc/self/maps").read_text(), re.M
    )
    if len(mapped) != 1:
        raise IntegratorsUnavailable("MuJoCo's library is not mapped as one piece")
    low, high, path = mapped[0]
    return int(low, 16), int(high, 16), path


def _find_address(name: str) -> int:
    """Return the address of an exported function of MuJoCo."""
    return ctypes.cast(getattr(ctypes.CDLL(_find_library()[2]), name), ctypes.c_void_p).value or 0


def _read_functions(path: Path) -> dict[str, tuple[int, int]]:
    """Read offset and size of the integrators from a library's symbol table."""
    return {name: span for name, span in read_symbols(path) if name in INTEGRATORS}


def read_symbols(path: Path) -> Iterator[tuple[str, tuple[int, int]]]:
    """Yield name, offset and size of every function in a library's symbol table (ELF, 64 bits, little-endian). A linker
    that optimises adds ".llvm." and a number to the names of internal functions."""
    data = path.read_bytes()
    (table,) = struct.unpack_from("<Q", data, 0x28)
    (count,) = struct.unpack_from("<H", data, 0x3C)
    sections = [SECTION.unpack_from(data, table + n * SECTION.size) for n in range(count)]
    for section in sections:
        if section[1] != SYMTAB:
            continue
        _, _, _, _, offset, size, strings, *_ = section
        names = sections[strings][4]
        for name, info, _, _, value, length in SYMBOL.iter_unpack(data[offset : offset + size]):
            if info & 0xF == FUNCTION and value:
                start = names + name
                text = data[start : data.index(b"\0", start)].decode("ascii", "replace")
                yield text.partition(".llvm.")[0], (value, length)
