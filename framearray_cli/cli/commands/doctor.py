"""`framearray doctor` and `framearray compile`: what is installed, and compiled."""

import importlib
import importlib.util
import os
import platform
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from framearray_cli import __version__
from framearray_cli.base.errors import CheckError, MissingExtraError, OutputError
from framearray_cli.base.extras import install_command
from framearray_cli.base.units import counted, size

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from ..results import KernelCache

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
    "usd": ("scenes in USD", ("pxr", "MaterialX")),
    "ifc": ("scenes in IFC", ("ifcopenshell",)),
    "formats": ("scenes in COLLADA and 3MF", ("collada", "lxml", "networkx")),
    "dask": ("render --dask", ("distributed",)),
    "xarray": ("Python: array.to_xarray()", ("xarray",)),
    "zarr": ("Python: array.to_zarr()", ("zarr",)),
}


def doctor() -> None:
    """Report versions, processor, memory, kernels and optional libraries; find what is broken."""
    from framearray_cli.base.memory import available_cores, free_memory, total_memory
    from framearray_cli.engine.kernels.processor import host, instruction_sets

    broken = {name: problem for name, module in REQUIRED.items() if (problem := _problem(module))}
    kernels, threads = kernel_cache(), os.environ.get(opt.THREADS_VARIABLE, "")
    lines = [
        f"framearray {__version__} in {Path(__file__).resolve().parents[2]}",
        f"Python {platform.python_version()}: {sys.executable}",
        f"libraries: {', '.join(f'{name} {_version(name)}' for name in REQUIRED)}",
        f"processor: {', '.join([host(), *instruction_sets()])}",
        _embree_line(),
        f"cores: {available_cores()} usable of {os.cpu_count() or 1}"
        + (f"; {opt.THREADS_VARIABLE} is {threads}" if threads else ""),
        f"memory: {size(free_memory())} free of {size(total_memory())}",
        *kernel_lines(kernels),
        f"browser: {_browser() or 'none; `framearray view` prints the address of the page'}",
        *(_extra_line(name, purpose, modules) for name, (purpose, modules) in EXTRAS.items()),
        *(f"warning: {name} cannot be loaded: {problem}" for name, problem in broken.items()),
    ]
    print_result(lines + ([f"warning: compiled kernels cannot be kept: {kernels.problem}"] if kernels.problem else []))
    if broken:
        raise typer.Exit(CheckError.exit_code)


def compile(json: opt.Json = False) -> None:
    """Compile all kernels for this machine, so that no later command does: for containers and farms."""
    opt.require_rendering()
    with Screen(err) as screen:
        screen.wait("reading the program")
        from framearray_cli.render.precompile import all_kernels, compile_everything, offer_beside

        from ..results import CompileResult

        offer_beside(None)
        with screen.compiling(len(all_kernels()), exact=True) as clock:
            compile_everything()
    cache = kernel_cache()
    if cache.problem and not cache.ready_made:
        raise OutputError(f"compiled kernels cannot be kept: {cache.problem}")
    result = CompileResult(compiled=clock.kernels, seconds=round(clock.seconds, 3), kernels=cache)
    print_result(kernel_lines(cache), result)


def _problem(module: str) -> str:
    """Return why a library cannot be imported; "" if it can."""
    try:
        importlib.import_module(module)
    except Exception as error:  # a broken library may raise anything
        return f"{type(error).__name__}: {error}"
    return ""


def _version(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version  # takes long to import

    try:
        return version(name)
    except PackageNotFoundError:
        return "of no known version"


def _embree_line() -> str:
    from framearray_cli.engine.embree.library import embree_properties

    try:
        found = embree_properties()
    except MissingExtraError:
        return "Embree: missing, so that nothing can be rendered here; render, check, init and report say why"
    return f"Embree {found.version}: rays in packets of {', '.join(map(str, found.packet_widths)) or '1'}"


def _extra_line(name: str, purpose: str, modules: tuple[str, ...]) -> str:
    if all(importlib.util.find_spec(module) for module in modules):
        return f"extra {name}: installed ({purpose})"
    return f"extra {name}: not installed ({purpose}); install it with: {install_command(f'[{name}]')}"


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
