"""`framearray check`."""

from typing import TYPE_CHECKING

from framearray_cli.render.messages import (
    ambient_lines,
    cost_lines,
    scene_lines,
    settings_lines,
    size_lines,
    target_lines,
    warning_lines,
)
from framearray_cli.render.progress import RenderEvents, ambient_figures

from ..options import JobFile, Json, Output, Sets, Strict, Threads, load_job, refuse_warnings, require_rendering
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.engine.terms.ambient.intensity import Ambient
    from framearray_cli.render.automatic import AutoSettings
    from framearray_cli.render.errortarget import Target
    from framearray_cli.render.prepare import Prepared


def check(
    job_file: JobFile,
    sets: Sets = None,
    threads: Threads = None,
    output: Output = None,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Validate a job and its scene, and print its size, memory, disk and time, without rendering it."""
    require_rendering()
    job = load_job(job_file, threads, output, sets)
    with Screen(err) as screen:
        screen.show(size_lines(job))  # before the scene is read: a wrong number is seen at once
        screen.wait("reading the scene")
        from framearray_cli.render.beside import offer_for
        from framearray_cli.render.estimate import check as run

        offer_for(job)
        with screen.compiling():
            estimate = run(job, CheckingEvents(screen))
    warnings = [] if strict else warning_lines(estimate.warnings)
    from ..results import check_result

    print_result([*cost_lines(estimate), *warnings], check_result(estimate))
    if strict:
        refuse_warnings(job_file, estimate.warnings)


class CheckingEvents(RenderEvents):
    """Print what is found as soon as it is."""

    def __init__(self, screen: Screen) -> None:
        self._screen = screen

    def prepared(self, prepared: "Prepared") -> None:
        self._screen.show(scene_lines(prepared))
        self._screen.wait("estimating the ambient light")

    def resolved(self, settings: "AutoSettings") -> None:
        self._screen.show(settings_lines(settings))

    def planned(self, ambient: "Ambient") -> None:
        self._screen.show(ambient_lines(ambient_figures(ambient)))
        self._screen.wait("rendering a few small frames")

    def allotted(self, target: "Target") -> None:
        self._screen.show(target_lines(target))
