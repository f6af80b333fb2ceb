"""LLVM assembly to machine code of this processor, kept on disk (see `disk`) so that a program is compiled once.

A file is named by a hash of everything its content depends on: the program, how it is called, processor, and versions of
compiler and emitter.
"""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path
from typing import Any, NamedTuple

from ...errors import MissingDataError

# Lines above which LLVM takes no pains: its choice of registers would take many minutes, as of a machine of 1,000 muscles.
# The code then takes 1.6 times as long, and gives the same bits.
LARGE = 250_000


class Host(NamedTuple):
    """The processor: its name, its features for LLVM, the bits of its vectors, and whether it divides quickly."""

    cpu: str
    features: str
    bits: int
    divides: bool


class Loaded(NamedTuple):
    """Machine code in memory; the engine owns it."""

    address: int
    engine: Any


@functools.cache
def llvm() -> Any:
    """The binding of llvmlite, ready to compile.

    Raises:
        MissingDataError: if it is not installed.
    """
    try:
        import llvmlite.binding as binding
    except ImportError:
        raise MissingDataError("Native kernels need llvmlite: pip install 'mckibben[native]'.") from None
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding


@functools.cache
def host() -> Host:
    """What processor this is."""
    binding = llvm()
    features = binding.get_host_cpu_features()
    bits = 512 if features.get("avx512f") else 256 if features.get("avx") else 128
    name = binding.get_host_cpu_name()
    # measured on Zen 5: its division of whole vectors is faster than what stands for it elsewhere
    return Host(name, features.flatten(), bits, name.startswith(("znver4", "znver5", "znver6")))


@functools.cache
def emitter_version() -> str:
    """A hash of this package's own sources, without which a cache would outlive a change of them."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def attributes() -> str:
    """Attributes of a function for this processor."""
    at = host()
    # Without a frame pointer LLVM cannot align the stack once it finds that it must keep vectors there: every one of them
    # would then lie across two lines of the cache, which costs a quarter of the speed.
    stack = '"stackrealign" "frame-pointer"="all"'
    return (
        f'"target-cpu"="{at.cpu}" "target-features"="{at.features}" "prefer-vector-width"="{at.bits}" {stack} nounwind '
    )


def compiled(text: str) -> bytes:
    """Assembly to an object file."""
    binding = llvm()
    module = binding.parse_assembly(text)
    module.verify()
    return bytes(machine(2 if text.count("\n") < LARGE else 0).emit_object(module))


def machine(effort: int = 2) -> Any:
    """LLVM's description of this processor."""
    binding, at = llvm(), host()
    target = binding.Target.from_default_triple()
    return target.create_target_machine(
        cpu=at.cpu, features=at.features, opt=effort, reloc="pic", codemodel="jitdefault"
    )


def loaded(data: bytes) -> Loaded:
    """An object file's kernel, ready to be called."""
    binding = llvm()
    module = binding.parse_assembly("")
    engine = binding.create_mcjit_compiler(module, machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(data))
    engine.finalize_object()
    return Loaded(engine.get_function_address("kernel"), engine)


def key(*parts: Any) -> str:
    """The name of machine code that depends on these parts, on this processor and on the versions here."""
    import llvmlite

    digest = hashlib.sha256()
    for part in (*parts, *host(), llvmlite.__version__, emitter_version()):
        data = part if isinstance(part, bytes) else repr(part).encode()
        digest.update(len(data).to_bytes(8, "little") + data)
    return digest.hexdigest()[:40]
