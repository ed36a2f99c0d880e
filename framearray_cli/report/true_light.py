"""The part of a report with respect to true light: settings and methods, their cost, and how far they are from it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from .case import Case, with_method
from .front import Advice, advise, best_front
from .measure import Measured, MeasuredMethod, measure_method
from .probes import Probes
from .settings import Method, NamedSettings
from .truth import HITS, PASSES, Truth, TruthError, make_truth, true_case, true_places

# Settings whose error with respect to true light is known.
TrueMeasured: TypeAlias = Measured | MeasuredMethod
# Errors to find settings for, over that of the job's own settings.
SHARES = (1.0, 0.5, 0.25)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueLight:
    """Settings and methods with respect to true light.

    Attributes:
        cameras, lights: of the images that were compared.
        hits: native hits per pixel of the images in true light, with PATHS paths each.
        noise: RMSE of these images over their mean; errors are without it.
        measured: the job's own settings first; then others, and other methods.
    """

    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    hits: int
    noise: float
    measured: tuple[TrueMeasured, ...]
    front: tuple[TrueMeasured, ...]
    advice: tuple[Advice[TrueMeasured], ...]

    @property
    def methods(self) -> tuple[TrueMeasured, ...]:
        """The job's own settings, and those with another method."""
        return (self.measured[0], *(one for one in self.measured if isinstance(one, MeasuredMethod)))


def truth_of(one: TrueMeasured) -> TruthError:
    """The error of settings of `TrueLight`."""
    assert one.truth is not None
    return one.truth


def true_rmse(one: TrueMeasured) -> float:
    """RMSE with respect to true light."""
    return truth_of(one).rmse


def render_truths(case: Case, probes: Probes, folder: Path, done: Callable[[], None]) -> dict[int, Truth]:
    """Render some of a report's images in true light, or read them."""
    cameras, rows = true_places(probes)
    paths = true_case(case)
    truths = {}
    for c in cameras:
        truths[c] = make_truth(paths, c, probes.lights, rows, folder)
        done()
    return truths


def compare_methods(
    case: Case, measured: Sequence[Measured], methods: dict[Method, list[NamedSettings]], probes: Probes,
    truths: dict[int, Truth], errors: Sequence[float], done: Callable[[], None],
) -> TrueLight | None:  # fmt: skip
    """Measure settings with other methods, and put them beside those that were measured; None where all is black.

    Args:
        errors: each RMSE to find the cheapest settings for; if empty, shares of that of the job's own settings.
    """
    found: list[TrueMeasured] = [one for one in measured if one.truth is not None]
    if not found:
        return None
    for method, tried in methods.items():
        changed = with_method(case, method)
        for named in tried:
            one = measure_method(changed, named, probes.lights, truths)
            found += [one] if one else []
            done()
    any_truth = next(iter(truths.values()))
    return TrueLight(
        cameras=tuple(truths),
        lights=tuple(probes.lights[i] for i in any_truth.rows),
        hits=2 * HITS * PASSES,
        noise=sum(truth.noise for truth in truths.values()) / len(truths),
        measured=tuple(found),
        front=tuple(best_front(found, true_rmse)),
        advice=tuple(advise(found, errors or [share * true_rmse(found[0]) for share in SHARES], true_rmse)),
    )
