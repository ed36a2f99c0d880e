"""An environment that turns, as a light axis of the page: position r is the array lit by the map, turned by r steps."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.arrays import Image
from framearray_cli.base.hashing import line_digest

from ..mixing.mixer import SumOptions, make_mixer
from .stamps import Source
from .streams import Stream

STEP_DEG = 10  # a smoother turn needs as many more pictures
AXIS = "rotation"
KEY = "environment"  # folder of its pictures


@dataclass(frozen=True, slots=True, kw_only=True)
class Turning:
    """The pictures of an array under an environment.

    Attributes:
        file: the map.
        mixtures: the sum of light positions at each turn.
        digest: changes with them.
        warnings: what of the map's light is left out.
    """

    manifest: Manifest
    file: Path
    mixtures: tuple[Mixture, ...]
    digest: str
    warnings: tuple[str, ...]

    @property
    def stream(self) -> Stream:
        """The stream of its pictures."""
        return Stream(key=KEY, role="environment", label="Picture", axis=AXIS, n=len(self.mixtures))

    @property
    def axis(self) -> dict[str, Any]:
        """The axis as the index describes it."""
        n = len(self.mixtures)
        return {"name": AXIS, "n": n, "times": [f"{STEP_DEG * r} degrees" for r in range(n)]}

    def reader(self) -> Callable[[int, int], Image]:
        """Return a function that reads the picture of camera c at turn r; it keeps the files of one camera."""
        pictures, rest = Pictures(self.manifest), (0.0,) * (len(self.manifest.axes) - 1)
        return lambda c, r: pictures.picture(c, (self.mixtures[r], *rest))

    def names(self, c: int) -> list[str]:
        """Return the files that the pictures of a camera are made of, relative to the array's folder."""
        used = {l: weight for mixture in self.mixtures for l, weight in mixture.weights}
        rest = (0.0,) * (len(self.manifest.axes) - 1)
        files = Pictures(self.manifest).files(c, (Mixture(tuple(used.items())), *rest))
        return [file.relative_to(self.manifest.directory).as_posix() for file in files]

    def source(self, c: int, source_at: Callable[[str], Source | None]) -> Source | None:
        """Return all files of a camera as one; None if one of them is not there."""
        found = [source_at(name) for name in self.names(c)]
        sizes = [source.size for source in found if source is not None]
        if len(sizes) < len(found):
            return None
        return Source(int(line_digest(repr([source and tuple(source) for source in found]).encode()), 16), sum(sizes))


def make_turning(manifest: Manifest, file: Path) -> Turning:
    """Find the sums of light positions that stand for a map at every turn.

    Raises:
        OutputError: the array cannot be summed, or the map cannot be read; see `make_mixer`.
    """
    warnings: list[str] = []
    options = SumOptions(environment=file, rotate=(0.0, 360.0))
    mixer = make_mixer(manifest, options, warnings.append)
    assert mixer is not None
    n = 360 // STEP_DEG
    mixtures = tuple(found for r in range(n) if isinstance(found := mixer((0.0,), r / n)[0], Mixture))
    digest = line_digest(repr(mixtures).encode()).decode()
    return Turning(manifest=manifest, file=file, mixtures=mixtures, digest=digest, warnings=tuple(warnings))
