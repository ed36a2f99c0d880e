"""Quality of the images of some settings: every measure of error, averaged over the probe images."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .flip import flip_map
from .metrics import EPSILON, errors, shadow_edges, squared_bias
from .reference import Reference


@dataclass(frozen=True, slots=True, kw_only=True)
class Quality:
    """Distances of images from their references.

    Attributes:
        rmse: root mean square error over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON).
        flip: mean HDR-FLIP, 0 to 1; only for the first of neighbours, because it is slow; None without its library.
        mean_off: mean of I - R over the mean of the reference.
        edge_rmse, edge_max: error at shadow edges, see `Errors`.
        squared_bias, squared_bias_error: squared bias and its standard error, over the squared mean of the reference;
            noise may make it negative.
        flicker_camera, flicker_light: relMSE of the change from one image to the next along either path; None without
            two consecutive images.
    """

    rmse: float
    relmse: float
    flip: float | None
    mean_off: float
    edge_rmse: float
    edge_max: float
    squared_bias: float
    squared_bias_error: float
    flicker_camera: float | None
    flicker_light: float | None

    @property
    def bias(self) -> float:
        """Root of the squared bias; 0 where noise hides it."""
        return float(np.sqrt(max(self.squared_bias, 0.0)))

    @property
    def noise(self) -> float:
        """Standard deviation over the mean of the reference: the rest of `rmse` beside the bias."""
        return float(np.sqrt(max(self.rmse**2 - max(self.squared_bias, 0.0), 0.0)))


def compare_frames(
    runs: tuple[Float32, Float32], references: Sequence[Reference], ambient: Ambient, lights: Sequence[int],
    pairs: Sequence[tuple[int, int]],
) -> list[Quality]:  # fmt: skip
    """Compare consecutive frames with their references, image by image.

    Args:
        runs: two runs with different seeds, (n_frames, n_lights, h, w, 3) each.
        references: one per frame.
        lights: light positions of the images.
        pairs: indices in `lights` of neighbours on the light path.
    """
    neighbours = {second for _, second in pairs}
    right = np.stack([[r.image(k, ambient.intensity[l]) for k, l in enumerate(lights)] for r in references])
    found = []
    for c, reference in enumerate(references):
        for k, l in enumerate(lights):
            image, wanted = runs[0][c, k], right[c, k]
            edges = shadow_edges(reference.irradiance(k), reference.normal, reference.depth)
            apart = errors(image, wanted, edges)
            halves = (reference.half(0, k, ambient.intensity[l]), reference.half(1, k, ambient.intensity[l]))
            square, spread = squared_bias((image, runs[1][c, k]), halves)
            scale = float(wanted.mean(dtype=np.float64)) ** 2
            after = next((second for first, second in pairs if first == k), None)
            found.append(
                Quality(
                    rmse=apart.rmse,
                    relmse=apart.relmse,
                    flip=_mean_flip(image, wanted) if c == 0 and k not in neighbours else None,
                    mean_off=apart.bias,
                    edge_rmse=apart.edge_rmse,
                    edge_max=apart.edge_max,
                    squared_bias=square / scale,
                    squared_bias_error=spread / scale,
                    flicker_camera=_flicker(image, wanted, runs[0][c + 1, k], right[c + 1, k])
                    if c + 1 < len(references)
                    else None,
                    flicker_light=_flicker(image, wanted, runs[0][c, after], right[c, after])
                    if after is not None
                    else None,
                )
            )
    return found


def _mean_flip(image: Image, wanted: Image) -> float | None:
    found = flip_map(image, wanted)
    return None if found is None else float(found.mean(dtype=np.float64))


def _flicker(image: Image, wanted: Image, next_image: Image, next_wanted: Image) -> float:
    """Return the relMSE of the change from one image to the next."""
    change: Float64 = (next_image - image).astype(np.float64) - (next_wanted - wanted)
    return float((change**2 / (wanted.astype(np.float64) ** 2 + EPSILON)).mean())


def mean_quality(found: Sequence[Quality]) -> Quality:
    """Average every measure over the images that have it: take the root mean square of RMSE, the largest `edge_max`."""
    means: dict[str, float | None] = {}
    for f in fields(Quality):
        values = [value for value in (getattr(one, f.name) for one in found) if value is not None]
        means[f.name] = float(np.mean(values)) if values else None
    spreads = [one.squared_bias_error for one in found]
    means["squared_bias_error"] = float(np.sqrt(np.sum(np.square(spreads))) / len(spreads))
    means["rmse"] = float(np.sqrt(np.mean([one.rmse**2 for one in found])))
    means["edge_max"] = max(one.edge_max for one in found)
    return Quality(**means)  # type: ignore[arg-type]
