"""Machine code of kernels on disk: one process compiles a kernel, all others load it.

A file contains the machine code of one kernel for arguments of some types, and all that numba needs to call it.

numba prepares to compile before it looks for machine code, and reads the code that other functions would inline. Both
take longer than the loading itself. Here both wait until something is compiled.
"""

from .start import is_tried, load_numba  # isort: skip  # before any of numba

import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from llvmlite import binding
from numba.core import codegen, compiler, serialize

from framearray_cli.base.files import write_bytes

from . import second_process
from .cache import SUFFIX, forgive, kernel_folder, ready_folder
from .calls import Callee, callees_in, file_name, fill_slots, open_slots
from .clock import counted_as_compiled
from .pipeline import shortcuts

F = TypeVar("F", bound=Callable[..., Any])

# Seconds that a process waits for another one's kernel before it compiles its own: the slowest takes a tenth.
PATIENCE = 60.0


class _StoredLibrary(codegen.JITCodeLibrary):
    """Machine code from disk; the code that other functions inline is read when one of them is compiled."""

    _code = _to_inline = b""
    _shared_module: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, tuple[bytes, bytes]]) -> Any:
        made = codegen.create_library(state[0])
        made.enable_object_caching()
        made._code, made._to_inline = state[2]
        made._set_compiled_object(made._code)
        made._finalize_final_module()
        return made

    def get_pointer_to_function(self, name: str) -> Any:
        """Return the address of a function, 0 if there is none of that name."""
        there = name.encode() + b"\0" in self._code  # in its table of symbols
        return self._codegen._engine.get_function_address(name) if there else 0

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self._to_inline)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return self._shared_module


class _Made(NamedTuple):
    """A compiled function, and the kernels that it calls."""

    compiled: Any
    callees: list[tuple[str, Callee]]


def _stored(made: _Made, *, inlined: bool) -> bytes:
    """Return the contents of a kernel's file.

    Args:
        inlined: other functions inline this one.
    """
    library = made.compiled.library
    if not inlined and is_tried():
        state = (library.name, "object", (library._get_compiled_object(), b""))
        library.serialize_using_object_code = lambda: state
    return serialize.dumps((made.callees, made.compiled._reduce()))


def _rebuilt(context: Any, stored: bytes) -> _Made:
    """Return a compiled kernel from a file; the caller holds numba's lock."""
    callees, parts = pickle.loads(stored)
    if not is_tried():
        return _Made(compiler.CompileResult._rebuild(context, *parts), callees)
    open_slots(callees)
    generator = context.codegen()
    generator._library_class = _StoredLibrary
    try:
        return _Made(compiler.CompileResult._rebuild(context, *parts), callees)
    finally:
        del generator._library_class  # numba's own class again


class Claim:
    """The right to compile a kernel, which one process has at a time; the system ends it with the process.

    Processes wait only for kernels that theirs call, which do not call each other in a circle; so none waits for ever.
    """

    def __init__(self, function: Any) -> None:
        self._function = function
        self._lock: Any = None

    def take(self, folder: Path) -> bool:
        """Take the claim, or wait for whoever has it; a folder that cannot be locked gives it at once.

        Args:
            folder: of the kernel.

        Returns:
            True if another process had it; it has probably put the kernel on disk.

        Raises:
            KernelTakenError: another process has it, and this one must not wait.
        """
        from filelock import FileLock

        if self._lock is None:
            self._lock = FileLock(folder / f"{self._function.__name__}-{self._function.__code__.co_firstlineno}.lock")
        with suppress(OSError, NotImplementedError):  # a folder, or a file system, without locks
            folder.mkdir(parents=True, exist_ok=True)
            try:
                self._lock.acquire(timeout=0)
            except TimeoutError:
                second_process.expect_to_wait()
                with counted_as_compiled(self._function), suppress(TimeoutError):
                    self._lock.acquire(timeout=PATIENCE, poll_interval=0.02)
                return True
        return False

    def give_back(self) -> None:
        """Let other processes go on."""
        if self._lock is not None:
            self._lock.release()


class _Kept:
    """The machine code of a function on disk: what numba calls its cache."""

    def __init__(self, function: Any, compiler: Any, *, counts: bool) -> None:
        self._function, self._counts = function, counts
        self._claim = Claim(function)
        self._made: dict[Any, _Made] = {}  # by the types of arguments
        self._compile_by_numba, compiler.compile = compiler.compile, self._compile

    @property
    def cache_path(self) -> str | None:
        folder = kernel_folder()
        return str(folder) if folder else None

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the machine code for a signature, or None: this process then compiles it, and has the claim."""
        if self._counts or not is_tried():
            load_numba()
            context.refresh()  # loads what counts references
        args = getattr(signature, "args", signature)
        found = self._made.get(args) or self._find(args, context)
        if found is None:
            return None
        self._made[args] = found
        fill_slots(found.callees)
        return found.compiled

    def _find(self, args: Any, context: Any) -> _Made | None:
        name = file_name(self._function, args)
        if name is None:
            return None
        found = self._load(name, context)
        if found is None:
            second_process.start()
            load_numba()  # numba compiles it now, unless another process does
            folder = kernel_folder()
            if folder:
                self._claim.take(folder)
                if (found := self._load(name, context)) is not None:  # also if another has just finished
                    self._claim.give_back()
        return found

    def _load(self, name: str, context: Any) -> _Made | None:
        for file in self._files(name):
            with forgive(file):
                found = _rebuilt(context, file.read_bytes())
                if second_process.has_made(file):
                    with counted_as_compiled(self._function):
                        pass
                return found
        return None

    def _files(self, name: str) -> Iterator[Path]:
        """Yield the files of that name that are there, the ready-made one first."""
        for folder in (ready_folder, kernel_folder):
            if (found := folder()) and (file := found / f"{name}{SUFFIX}").is_file():
                yield file

    def _compile(self, args: Any, return_type: Any) -> Any:
        """Compile the function, keep its machine code, and have all that it calls; other threads cannot see it yet."""
        try:
            with shortcuts():
                compiled = self._compile_by_numba(args, return_type)
            self._made[args] = made = _Made(compiled, callees_in(compiled.library))
            self._write(args, made)
        finally:
            self._claim.give_back()
        fill_slots(made.callees)
        return compiled

    def _write(self, args: Any, made: _Made) -> None:
        folder, name = kernel_folder(), file_name(self._function, args)
        if folder and name and not made.compiled.library.has_dynamic_globals:
            with forgive(folder / f"{name}{SUFFIX}"):
                write_bytes(folder / f"{name}{SUFFIX}", _stored(made, inlined=self._counts))

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Do nothing: it is kept as soon as it is compiled."""

    def flush(self) -> None:
        """Do nothing: numba calls this to compile anew, and a kernel's file is then replaced."""


def keep_on_disk(function: F) -> F:
    """Keep the machine code of a declared function (`nb.njit`, `CFunc`) for later runs."""
    compiled: Any = function
    if hasattr(compiled, "enable_caching"):  # NUMBA_DISABLE_JIT leaves plain Python functions
        options = getattr(compiled, "targetoptions", {})
        plain = getattr(compiled, "py_func", None) or compiled.__wrapped__
        compiled._cache = _Kept(plain, compiled._compiler, counts=options.get("_nrt", True))
    return function
