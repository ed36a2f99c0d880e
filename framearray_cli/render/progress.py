"""What a render reports while it runs."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from framearray_cli.array.integrity import OnDisk
    from framearray_cli.engine.terms.ambient.estimate import Ambient

    from .automatic.choose import AutoSettings
    from .prepare import Prepared
    from .target.pilot import Target


class RenderEvents:
    """The events of a render, in their order; override those that you want. Calls may come from any thread."""

    def prepared(self, prepared: "Prepared") -> None:
        """Inputs were read."""

    def removed(self, files: int) -> None:
        """That many files of the array that lay in the folder were removed."""

    def resolved(self, settings: "AutoSettings") -> None:
        """What the job leaves open was chosen."""

    def scanning(self, files: int) -> None:
        """That many files of the array are there; they will be compared with their checksums."""

    def scanned(self, on_disk: "OnDisk", wanted: int) -> None:
        """What of the array is there already, and the number of images that will be rendered."""

    def planned(self, ambient: "Ambient") -> None:
        """The ambient light is known."""

    def allotted(self, target: "Target") -> None:
        """Native hits were allotted for the error that the job wants."""

    def written(self, images: int) -> None:
        """That many more images are on disk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbientFigures:
    """The ambient light in few numbers.

    Attributes:
        lowest, highest: mean of I_A over the channels, at the light positions where it is least and most; radiance.
        error: largest standard error of a light position, relative.
        paths: walks or particles per light position.
        notes: what the user should know.
    """

    lowest: float
    highest: float
    error: float
    paths: int
    notes: tuple[str, ...]


def ambient_figures(ambient: "Ambient") -> AmbientFigures:
    """Sum an estimate up for a report."""
    mean = ambient.intensity.mean(axis=1)
    return AmbientFigures(
        lowest=float(mean.min()),
        highest=float(mean.max()),
        error=float(ambient.standard_error.max()),
        paths=ambient.paths,
        notes=ambient.notes,
    )
