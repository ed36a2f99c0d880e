"""`framearray doctor`."""

from typing import TYPE_CHECKING

import typer

from framearray_cli.base.errors import CheckError
from framearray_cli.base.units import size

from ..options import Json
from ..screen import print_result

if TYPE_CHECKING:
    from ..results import DoctorResult


def doctor(json: Json = False) -> None:
    """Report versions, processor, memory, kernels and optional libraries; find what is broken."""
    from ..machine import examine_machine

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
    kept = f"{kernels.folder}: {kernels.kernels} kernels, {size(kernels.size_bytes)}" if kernels.folder else "not kept"
    return [
        f"framearray {found.version} in {found.package}",
        f"Python {found.python}: {found.executable}",
        f"libraries: {versions}",
        f"processor: {found.processor}{sets}",
        _embree_line(found),
        f"cores: {cores.usable} usable of {cores.machine}{threads}",
        f"memory: {size(memory.free_bytes)} free of {size(memory.machine_bytes)}",
        f"compiled kernels: {kept}",
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
