"""The result of `framearray doctor` as typed data, for `--json`."""

from dataclasses import dataclass

from framearray_cli.engine.embree.library import EmbreeProperties


@dataclass(frozen=True, slots=True, kw_only=True)
class LibraryReport:
    """A library that the program needs; `problem`: why it cannot be loaded."""

    name: str
    version: str | None
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExtraReport:
    """Optional libraries; `missing`: modules; `install`: the command that installs them."""

    name: str
    purpose: str
    missing: tuple[str, ...]
    install: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CoreCount:
    """Cores that affinity and container leave to the program; `threads`: as FRAMEARRAY_THREADS says."""

    usable: int
    machine: int
    threads: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MemoryReport:
    """Memory that the program can still get, and that of the machine."""

    free_bytes: int
    machine_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelCache:
    """Compiled kernels of this version; `folder` is null, and `problem` says why, where they cannot be kept."""

    folder: str | None
    kernels: int
    size_bytes: int
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DoctorResult:
    """What `doctor` found.

    Attributes:
        package: folder of the program.
        instruction_sets: of the processor, the widest first.
        embree: null where it cannot be used.
        browser: that `view` opens.
    """

    version: str
    package: str
    python: str
    executable: str
    processor: str
    instruction_sets: tuple[str, ...]
    libraries: tuple[LibraryReport, ...]
    embree: EmbreeProperties | None
    extras: tuple[ExtraReport, ...]
    cores: CoreCount
    memory: MemoryReport
    kernels: KernelCache
    browser: str | None
