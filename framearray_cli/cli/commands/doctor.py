"""`framearray doctor`: the program's parts, and the usable part of the machine."""

import importlib
import importlib.util
import os
import platform
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from framearray_cli import __version__
from framearray_cli.base.errors import CheckError, MissingExtraError
from framearray_cli.base.extras import install_command
from framearray_cli.base.units import counted, size

from ..options import THREADS_VARIABLE, Json
from ..screen import print_result

if TYPE_CHECKING:
    from framearray_cli.engine.embree.library import EmbreeProperties

    from ..results import DoctorResult, ExtraReport, KernelCache, LibraryReport

# Packages that the program cannot do without, and the module that proves them whole.
REQUIRED = {
    "numpy": "numpy",
    "numba": "numba",
    "llvmlite": "llvmlite.binding",
    "embreex": "embreex.rtcore_scene",
    "OpenImageIO": "OpenImageIO",
    "opencolorio": "PyOpenColorIO",
    "Pillow": "PIL.Image",
    "scipy": "scipy",
    "ephem": "ephem",
    "trimesh": "trimesh",
    "pydantic": "pydantic",
    "typer": "typer",
    "rich": "rich",
}
# Extras of the program: what they are for, and their modules.
EXTRAS = {
    "movie": ("movies", ("av",)),
    "report": ("framearray report", ("matplotlib", "jinja2")),
    "draco": ("glTF meshes compressed with Draco", ("DracoPy",)),
    "usd": ("scenes in USD", ("pxr",)),
    "dask": ("render --dask", ("distributed",)),
    "xarray": ("Python: array.to_xarray()", ("xarray",)),
    "zarr": ("Python: array.to_zarr()", ("zarr",)),
}


def doctor(json: Json = False) -> None:
    """Report versions, processor, memory, kernels and optional libraries; find what is broken."""
    found = examine_machine()
    print_result(doctor_lines(found), found)
    if any(library.problem for library in found.libraries):
        raise typer.Exit(CheckError.exit_code)


def doctor_lines(found: "DoctorResult") -> list[str]:
    """Describe a machine, one line per topic."""
    broken = [library for library in found.libraries if library.problem]
    versions = ", ".join(f"{library.name} {library.version or 'of no known version'}" for library in found.libraries)
    sets = f", {', '.join(found.instruction_sets)}" if found.instruction_sets else ""
    cores, memory, kernels = found.cores, found.memory, found.kernels
    threads = f"; FRAMEARRAY_THREADS is {cores.threads}" if cores.threads else ""
    return [
        f"framearray {found.version} in {found.package}",
        f"Python {found.python}: {found.executable}",
        f"libraries: {versions}",
        f"processor: {found.processor}{sets}",
        _embree_line(found),
        f"cores: {cores.usable} usable of {cores.machine}{threads}",
        f"memory: {size(memory.free_bytes)} free of {size(memory.machine_bytes)}",
        *kernel_lines(kernels),
        f"browser: {found.browser or 'none; `framearray view` prints the address of the page'}",
        *(_extra_line(extra.name, extra.purpose, extra.missing, extra.install) for extra in found.extras),
        *(f"warning: {library.name} cannot be loaded: {library.problem}" for library in broken),
        *([f"warning: compiled kernels cannot be kept: {kernels.problem}"] if kernels.problem else []),
    ]


def _embree_line(found: "DoctorResult") -> str:
    if found.embree is None:
        return "Embree: missing, so that nothing can be rendered here; render, check, init and report say why"
    widths = found.embree.packet_widths
    packets = " or ".join([", ".join(map(str, widths[:-1])), str(widths[-1])] if len(widths) > 1 else map(str, widths))
    rays = f"{packets} rays" if packets else "one ray"
    return f"Embree {found.embree.version}: traces {rays} at once"


def _extra_line(name: str, purpose: str, missing: tuple[str, ...], install: str | None) -> str:
    if not missing:
        return f"extra {name}: installed ({purpose})"
    return f"extra {name}: not installed ({purpose}); install it with: {install}"


def examine_machine() -> "DoctorResult":
    """Look at everything; nothing is written but the folder of kernels."""
    from framearray_cli.base.memory import available_cores, free_memory, total_memory
    from framearray_cli.engine.kernels.processor import host, instruction_sets

    from ..results import CoreCount, DoctorResult, MemoryReport

    return DoctorResult(
        version=__version__,
        package=str(Path(__file__).resolve().parents[2]),
        python=platform.python_version(),
        executable=sys.executable,
        processor=host(),
        instruction_sets=instruction_sets(),
        libraries=tuple(_library(name, module) for name, module in REQUIRED.items()),
        embree=_embree(),
        extras=tuple(_extra(name) for name in EXTRAS),
        cores=CoreCount(usable=available_cores(), machine=os.cpu_count() or 1, threads=_threads()),
        memory=MemoryReport(free_bytes=free_memory(), machine_bytes=total_memory()),
        kernels=kernel_cache(),
        browser=_browser(),
    )


def _library(name: str, module: str) -> "LibraryReport":
    """Import a library, and find its version."""
    from importlib.metadata import PackageNotFoundError, version

    from ..results import LibraryReport

    try:
        importlib.import_module(module)
        problem = None
    except Exception as error:  # a broken library may raise anything
        problem = f"{type(error).__name__}: {error}"
    found = None
    with suppress(PackageNotFoundError):
        found = version(name)
    return LibraryReport(name=name, version=found, problem=problem)


def _embree() -> "EmbreeProperties | None":
    from framearray_cli.engine.embree.library import embree_properties

    try:
        return embree_properties()
    except MissingExtraError:
        return None


def _extra(name: str) -> "ExtraReport":
    from ..results import ExtraReport

    purpose, modules = EXTRAS[name]
    missing = tuple(module for module in modules if importlib.util.find_spec(module) is None)
    install = install_command(f"[{name}]") if missing else None
    return ExtraReport(name=name, purpose=purpose, missing=missing, install=install)


def _threads() -> int | None:
    """Return the number of threads that the environment sets, if it can be read."""
    text = os.environ.get(THREADS_VARIABLE, "")
    return int(text) if text.isdecimal() else None


def kernel_cache() -> "KernelCache":
    """Look at the compiled kernels on disk."""
    from framearray_cli.engine.kernels.cache import kernel_folder, kernels_in, problem, ready_folder
    from framearray_cli.engine.kernels.processor import target

    from ..results import KernelCache

    folder = kernel_folder()
    ready, compiled = kernels_in(ready_folder()), kernels_in(folder)
    return KernelCache(
        processor=target(),
        folder=str(folder) if folder else None,
        kernels=len(compiled),
        size_bytes=sum(file.stat().st_size for file in compiled),
        ready_made=len(ready),
        ready_made_bytes=sum(file.stat().st_size for file in ready),
        problem=problem() or None,
    )


def kernel_lines(found: "KernelCache") -> list[str]:
    """Describe the compiled kernels on disk."""
    ready = f"{found.ready_made} for {found.processor}, {size(found.ready_made_bytes)}"
    kept = f"{found.folder}: {counted(found.kernels, 'kernel')}, {size(found.size_bytes)}"
    return [
        f"ready-made kernels: {ready if found.ready_made else 'none'}",
        f"compiled kernels: {f'for {found.processor}, {kept}' if found.folder else 'not kept'}",
    ]


def _browser() -> str | None:
    """Return the name of the browser that `view` opens; None: it prints only the address."""
    import webbrowser

    try:
        return getattr(webbrowser.get(), "name", None) or "the system's"
    except webbrowser.Error:
        return None
