"""A sun study: what hours of direct sun need of a job, and the days that they are counted for."""

from framearray_cli.base.forms.table import Place
from framearray_cli.base.sundays import SunDay, short_days, sun_days

from .light import LightTable
from .sources import SunSource


def study_days(light: LightTable) -> tuple[SunDay, ...]:
    """Return the days of the only sun of a job, in the order of its positions."""
    (moments,) = light.moments.values()
    return sun_days(moments)


def study_problems(light: LightTable, *, layers: bool) -> list[tuple[Place, str]]:
    """Return why hours of sun cannot be counted, as problems of `output.sun_hours`.

    Args:
        layers: whether layers are written.
    """
    place, suns = ("output", "sun_hours"), sum(isinstance(source, SunSource) for source in light.sources)
    if not layers:
        return [(place, "expected layers = true beside it, as hours are a layer")]
    if suns != 1:
        return [(place, f'expected one source of type "sun", whose hours are counted, got {suns or "none"}')]
    short = short_days(study_days(light))
    return [(place, f"expected {short}; a position counts for the time to the next")] if short else []
