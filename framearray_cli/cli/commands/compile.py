"""`framearray compile`."""

from framearray_cli.base.errors import OutputError

from ..options import Json, require_rendering
from ..screen import Screen, err, print_result
from .doctor import kernel_cache, kernel_lines


def compile(json: Json = False) -> None:
    """Compile all kernels for this machine, so that no later command does: for containers and farms."""
    require_rendering()
    with Screen(err) as screen:
        screen.wait("reading the program")
        from framearray_cli.render.precompile import all_kernels, compile_everything, offer_everything

        from ..results import CompileResult

        offer_everything()
        with screen.compiling(len(all_kernels()), exact=True) as clock:
            compile_everything()
    cache = kernel_cache()
    if cache.problem and not cache.ready_made:
        raise OutputError(f"compiled kernels cannot be kept: {cache.problem}")
    result = CompileResult(compiled=clock.kernels, seconds=round(clock.seconds, 3), kernels=cache)
    print_result(kernel_lines(cache), result)
