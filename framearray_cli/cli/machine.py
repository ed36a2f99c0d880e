"""Findings of `framearray doctor`: the program's parts, and the usable part of the machine."""

import importlib
import importlib.util
import os
import platform
import sys
from contextlib import suppress
from pathlib import Path

from framearray_cli import __version__
from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import install_command
from framearray_cli.base.memory import available_cores, free_memory
from framearray_cli.engine.embree.library import EmbreeProperties, embree_properties

from .options import THREADS_VARIABLE
from .results import CoreCount, DoctorResult, ExtraReport, KernelCache, LibraryReport, MemoryReport

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
FLIP = ("flip_evaluator",) if sys.version_info < (3, 14) else ()  # it has no wheel for later ones
# Extras of the program: what they are for, and their modules.
EXTRAS = {
    "movie": ("movies", ("av",)),
    "report": ("framearray report", ("matplotlib", "jinja2", *FLIP)),
    "otio": ("assemble --otio", ("opentimelineio",)),
    "draco": ("glTF meshes compressed with Draco", ("DracoPy",)),
    "usd": ("scenes in USD", ("pxr",)),
    "dask": ("render --dask", ("distributed",)),
    "xarray": ("Python: array.to_xarray()", ("xarray",)),
    "zarr": ("Python: array.to_zarr()", ("zarr",)),
}


def examine_machine() -> DoctorResult:
    """Look at everything; nothing is written but the folder of kernels."""
    from framearray_cli.engine.kernels.processor import instruction_sets, processor

    return DoctorResult(
        version=__version__,
        package=str(Path(__file__).resolve().parents[1]),
        python=platform.python_version(),
        executable=sys.executable,
        processor=processor(),
        instruction_sets=instruction_sets(),
        libraries=tuple(_library(name, module) for name, module in REQUIRED.items()),
        embree=_embree(),
        extras=tuple(_extra(name) for name in EXTRAS),
        cores=CoreCount(usable=available_cores(), machine=os.cpu_count() or 1, threads=_threads()),
        memory=_memory(),
        kernels=_kernels(),
        browser=_browser(),
    )


def _library(name: str, module: str) -> LibraryReport:
    """Import a library, and find its version."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        importlib.import_module(module)
        problem = None
    except Exception as error:  # a broken library may raise anything
        problem = f"{type(error).__name__}: {error}"
    found = None
    with suppress(PackageNotFoundError):
        found = version(name)
    return LibraryReport(name=name, version=found, problem=problem)


def _embree() -> EmbreeProperties | None:
    try:
        return embree_properties()
    except MissingExtraError:
        return None


def _extra(name: str) -> ExtraReport:
    purpose, modules = EXTRAS[name]
    missing = tuple(module for module in modules if importlib.util.find_spec(module) is None)
    install = install_command(f"[{name}]") if missing else None
    return ExtraReport(name=name, purpose=purpose, missing=missing, install=install)


def _threads() -> int | None:
    """Return the number of threads that the environment sets, if it can be read."""
    text = os.environ.get(THREADS_VARIABLE, "")
    return int(text) if text.isdecimal() else None


def _memory() -> MemoryReport:
    from framearray_cli.base.memory import total_memory

    return MemoryReport(free_bytes=free_memory(), machine_bytes=total_memory())


def _kernels() -> KernelCache:
    from framearray_cli.engine.kernels.cache import kept_kernels, kernel_folder, problem

    folder = kernel_folder()
    files = [file for file in folder.rglob("*") if file.is_file()] if folder else []
    return KernelCache(
        folder=str(folder) if folder else None,
        kernels=kept_kernels(),
        size_bytes=sum(file.stat().st_size for file in files),
        problem=problem() or None,
    )


def _browser() -> str | None:
    """Return the name of the browser that `view` opens; None: it prints only the address."""
    import webbrowser

    try:
        return getattr(webbrowser.get(), "name", None) or "the system's"
    except webbrowser.Error:
        return None
