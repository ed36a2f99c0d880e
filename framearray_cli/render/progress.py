"""Events of a render, for progress displays."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from framearray_cli.array.integrity import OnDisk
    from framearray_cli.array.manifest import Manifest
    from framearray_cli.engine.terms.ambient.intensity import Ambient

    from .automatic import AutoSettings
    from .errortarget import Target
    from .prepare import Prepared


class RenderEvents:
    """The events of a render, in order; override those of interest. Calls may come from any thread."""

    def prepared(self, prepared: "Prepared") -> None:
        """Inputs were read."""

    def removed(self, files: int) -> None:
        """The array in the folder was removed, with that many files."""

    def rewriting(self, files: int) -> None:
        """The headers of that many files are about to be rewritten: the job has another frame rate."""

    def keeping_compression(self, compression: str) -> None:
        """The job wants this lossless compression; files that are there keep theirs, which is lossless too."""

    def resolved(self, settings: "AutoSettings") -> None:
        """Settings were chosen where the job says "auto"."""

    def scanning(self, files: int) -> None:
        """That many files on disk are about to be compared with their checksums."""

    def scanned(self, on_disk: "OnDisk", wanted: int) -> None:
        """The files on disk were compared; `wanted` images are to be rendered."""

    def coarse_begins(self, array: "Manifest") -> None:
        """Coarse pictures begin to appear; `array` describes the array to come, with a rough ambient light."""

    def coarse_ends(self, coarse: "CoarseFigures") -> None:
        """All coarse pictures are on disk."""

    def planned(self, ambient: "Ambient") -> None:
        """The ambient light was estimated."""

    def loaded(self) -> None:
        """All kernels of frames were compiled, or loaded from disk."""

    def warned(self, warnings: tuple[str, ...]) -> None:
        """Pilots were rendered; `warnings` are of what would make the array useless. May raise an error."""

    def allotted(self, target: "Target") -> None:
        """Native hits were allotted for the error that the job wants."""

    def tracing(self) -> None:
        """The first frame begins."""

    def expected(self, seconds: float | None) -> None:
        """The rest is expected to take that long; None: not known yet."""

    def written(self, images: int) -> None:
        """That many more images are on disk."""

    def frame_written(self, c: int, images: int) -> None:
        """All files of a camera position are on disk and recorded; of that many images if it is rendered in blocks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseFigures:
    """The size of a coarse array, and of the array beside it.

    Attributes:
        cameras, lights: the number of positions that it has and that of all; lights along all axes together.
        resolution: width, height, pixels.
        step: the largest number of camera positions from one to the next.
        seconds: that it took.
    """

    cameras: tuple[int, int]
    lights: tuple[int, int]
    resolution: tuple[int, int]
    step: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbientFigures:
    """The ambient light in a few figures.

    Attributes:
        lowest, highest: mean of I_A over the channels, radiance, at the darkest and brightest light position.
        error: largest relative standard error of a light position.
        paths: number of walks.
        notes: messages for the user.
    """

    lowest: float
    highest: float
    error: float
    paths: int
    notes: tuple[str, ...]


def ambient_figures(ambient: "Ambient") -> AmbientFigures:
    """Summarize an estimate for display."""
    mean = ambient.intensity.mean(axis=1)
    return AmbientFigures(
        lowest=float(mean.min()),
        highest=float(mean.max()),
        error=float(ambient.standard_error.max()),
        paths=ambient.paths,
        notes=ambient.notes,
    )
