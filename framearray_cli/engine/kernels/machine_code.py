"""Machine code of kernels on disk: one process compiles a kernel, all others load it.

numba prepares to compile before it looks for machine code, and reads the code that other functions would inline. Both
take longer than the loading itself. Here both wait until something is compiled.
"""

from .start import is_tried, load_numba  # isort: skip  # before any of numba

from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, TypeVar

from llvmlite import binding
from numba.core import caching, codegen

from . import second_process
from .cache import forgive, kernel_folder
from .clock import counted_as_compiled
from .processor import target

F = TypeVar("F", bound=Callable[..., Any])

# Seconds that a process waits for another one's kernel before it compiles its own: the slowest takes a tenth.
PATIENCE = 60.0
# Parts of numba without type annotations.
_Files: Any = caching.CompileResultCacheImpl
_FunctionCache: Any = caching.FunctionCache
_Library: Any = codegen.JITCodeLibrary
_Locator: Any = caching._CacheLocator
_OfSourceFile: Any = caching._SourceFileBackedLocatorMixin


class _LazyLibrary(_Library):  # type: ignore[misc]  # numba has no annotations
    """Machine code from disk; the code that other functions inline is read when one of them is compiled.

    Until then numba knows none of its symbols.
    """

    _unread: tuple[bytes, bytes] | None = None  # machine code, code to inline
    _module: Any = None

    @classmethod
    def _unserialize(cls, codegen: Any, state: tuple[str, str, Any]) -> Any:
        name, kind, stored = state
        if kind != "object":
            return super()._unserialize(codegen, state)
        made = codegen.create_library(name)
        made.enable_object_caching()
        made._set_compiled_object(stored[0])
        made._unread = stored
        made._finalize_final_module()
        return made

    def get_pointer_to_function(self, name: str) -> Any:
        """Return the address of a function, 0 if there is none of that name."""
        if self._unread is None:
            return super().get_pointer_to_function(name)
        there = name.encode() + b"\0" in self._unread[0]  # in its table of symbols
        return self._codegen._engine.get_function_address(name) if there else 0

    @property
    def _shared_module(self) -> Any:
        if self._unread is not None:
            self._module, self._unread = binding.parse_bitcode(self._unread[1]), None
            self._codegen._engine._load_defined_symbols(self._module)
        return self._module

    @_shared_module.setter
    def _shared_module(self, module: Any) -> None:
        self._module = module


class _KernelLocator(_OfSourceFile, _Locator):  # type: ignore[misc]
    """The folder for the kernels of a source file, inside the one for this state of the package."""

    def __init__(self, function: Any, file: str, folder: Path) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno
        self._folder = str(folder / self.get_suitable_cache_subpath(file))

    def get_cache_path(self) -> str:
        return self._folder

    @classmethod
    def from_function(cls, function: Any, file: str) -> "_KernelLocator | None":
        folder = kernel_folder()
        return cls(function, file, folder) if folder and Path(file).exists() else None


class _KernelFiles(_Files):  # type: ignore[misc]  # numba has no annotations
    """numba's files of a function, in our folder, read with `_LazyLibrary`."""

    _locator_classes = (_KernelLocator,)

    def rebuild(self, context: Any, stored: Any) -> Any:
        """Return the machine code of stored data; the caller holds numba's lock."""
        if not is_tried():
            return super().rebuild(context, stored)
        generator = context.codegen()
        generator._library_class = _LazyLibrary
        try:
            return super().rebuild(context, stored)
        finally:
            with suppress(AttributeError):
                del generator._library_class  # numba's own class again


class _KernelCache(_FunctionCache):  # type: ignore[misc]  # numba has no annotations
    """numba's cache of a function; where that fails, numba compiles."""

    _impl_class = _KernelFiles

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the machine code for a signature, or None; as numba does, but without preparing to compile."""
        if not is_tried():
            return super().load_overload(signature, context)
        with forgive(self):
            return self._load_overload(signature, context)

    def _index_key(self, signature: Any, generator: Any) -> Any:
        """Return numba's key; a change of an environment variable of numba's resets its name of the processor."""
        signature, (triple, _, features), code = super()._index_key(signature, generator)
        return signature, (triple, target(), features), code

    def _guard_against_spurious_io_errors(self) -> AbstractContextManager[None]:
        return forgive(self)


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
        """
        from filelock import FileLock

        if self._lock is None:
            self._lock = FileLock(folder / f"{self._function.__name__}-{self._function.__code__.co_firstlineno}.lock")
        with suppress(OSError, NotImplementedError):  # a folder, or a file system, without locks
            folder.mkdir(parents=True, exist_ok=True)
            try:
                self._lock.acquire(timeout=0)
            except TimeoutError:
                with counted_as_compiled(self._function), suppress(TimeoutError):
                    self._lock.acquire(timeout=PATIENCE, poll_interval=0.02)
                return True
        return False

    def give_back(self) -> None:
        """Let other processes go on."""
        if self._lock is not None:
            self._lock.release()


class _LazyCache:
    """numba's cache of a function, opened when numba first asks for machine code."""

    def __init__(self, function: Any, *, counts: bool) -> None:
        self._function, self._counts = function, counts
        self._claim = Claim(function)
        self._opened: Any = None

    @property
    def cache(self) -> Any:
        if self._opened is None:
            try:
                self._opened = _KernelCache(self._function)
            except RuntimeError:  # no folder, or a function without a source file
                self._opened = caching.NullCache()
        return self._opened

    @property
    def cache_path(self) -> Any:
        return self.cache.cache_path

    def load_overload(self, signature: Any, context: Any) -> Any:
        if self._counts or not is_tried():
            load_numba()
            context.refresh()  # loads what counts references
        found = self.cache.load_overload(signature, context)
        if found is not None:
            if second_process.has_made(Path(self.cache._cache_file._index_path)):
                with counted_as_compiled(self._function):
                    return found
            return found
        second_process.start()
        load_numba()  # numba compiles it now, unless another process does
        return self._compiled_elsewhere(signature, context)

    def _compiled_elsewhere(self, signature: Any, context: Any) -> Any:
        """Return the machine code if another process has just compiled it; else None, and this one has the claim."""
        if self.cache_path is None or not self._claim.take(Path(self.cache_path)):
            return None
        found = self.cache.load_overload(signature, context)
        if found is not None:
            self._claim.give_back()
        return found

    def save_overload(self, signature: Any, compiled: Any) -> None:
        self.cache.save_overload(signature, compiled)
        self._claim.give_back()

    def flush(self) -> None:
        self.cache.flush()


def keep_on_disk(function: F) -> F:
    """Keep the machine code of a declared function (`nb.njit`, `CFunc`) for later runs."""
    compiled: Any = function
    if hasattr(compiled, "enable_caching"):  # NUMBA_DISABLE_JIT leaves plain Python functions
        options = getattr(compiled, "targetoptions", {})
        plain = getattr(compiled, "py_func", None) or compiled.__wrapped__
        compiled._cache = _LazyCache(plain, counts=options.get("_nrt", True))
    return function
