"""The pictures of a report: whole images, crops of settings that take about the same time, and maps of error."""

from dataclasses import dataclass

import numpy as np

from framearray_cli.array.images import write_codes
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.colour import srgb8_from_linear

from .measure import Measured
from .run import Report
from .settings import LIGHT_REUSE, SCRATCH

CROP = 96  # pixels per side
ENLARGEMENT = 3  # times
# Brightness of a picture: this percentile of its brightest channel is shown as white.
WHITE = 98.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture of the page: its file and caption."""

    file: str
    caption: str


def draw_crops(report: Report) -> list[Picture]:
    """Write crops of the reference, of the job's own settings, and of the baselines closest to them in time.

    The crop is the part of the image where the job's own error is most visible.
    """
    top, left = _worst_crop(np.abs(report.signed) if report.flip is None else report.flip)
    own = report.measured[0]
    shown: list[tuple[str, Float32]] = [("reference", report.example), (_caption(own), own.example)]
    for family in (LIGHT_REUSE, SCRATCH):
        of_family = [m for m in report.measured if m.named.family == family]
        if of_family:
            near = min(of_family, key=lambda m: abs(np.log(m.ms / own.ms)))
            shown.append((_caption(near), near.example))
    scale = _white_scale(report.example)
    found = []
    for i, (caption, image) in enumerate(shown):
        part = image[top : top + CROP, left : left + CROP]
        codes = srgb8_from_linear(scale * part).repeat(ENLARGEMENT, axis=0).repeat(ENLARGEMENT, axis=1)
        found.append(_write_picture(report, f"crop-{i}.png", codes, caption))
    return found


def draw_maps(report: Report) -> list[Picture]:
    """Write the reference, the job's own image, and maps of its error: HDR-FLIP, if it is known, and signed."""
    own, scale = report.measured[0], _white_scale(report.example)
    found = [
        _write_picture(report, "reference.png", srgb8_from_linear(scale * report.example), "reference"),
        _write_picture(report, "own.png", srgb8_from_linear(scale * own.example), _caption(own)),
    ]
    if report.flip is not None:
        caption = f"HDR-FLIP: black 0, white 1; mean {report.flip.mean():.3f}"
        found.append(_write_picture(report, "flip.png", _heat_map(report.flip), caption))
    caption = "image less reference: red too bright, blue too dark; full colour at half the mean of the reference"
    return [*found, _write_picture(report, "signed.png", _signed_map(report.signed), caption)]


def _write_picture(report: Report, name: str, codes: Bytes, caption: str) -> Picture:
    write_codes(report.folder / name, codes)
    return Picture(file=name, caption=caption)


def _caption(one: Measured) -> str:
    return f"{one.named.name}: {one.ms:.3g} ms, RMSE {one.quality.rmse:.1%}"


def _worst_crop(error: Float32) -> tuple[int, int]:
    """Return the top left corner of the crop whose mean error is largest, on a grid of half crops."""
    h, w = error.shape
    tops, lefts = (range(0, max(side - CROP, 0) + 1, CROP // 2) for side in (h, w))
    return max(
        ((top, left) for top in tops for left in lefts),
        key=lambda corner: float(error[corner[0] : corner[0] + CROP, corner[1] : corner[1] + CROP].mean()),
    )


def _white_scale(image: Float32) -> float:
    white = float(np.percentile(image.max(axis=-1), WHITE))
    return 1.0 / white if white > 0 else 1.0


def _heat_map(values: Float32) -> Bytes:
    """Map 0 to 1 to black, violet, orange, white."""
    stops = np.array([[0, 0, 0], [0.3, 0.05, 0.5], [0.95, 0.45, 0.15], [1, 1, 1]])
    at = np.clip(values, 0, 1) * (len(stops) - 1)
    low = np.minimum(at.astype(int), len(stops) - 2)
    share = (at - low)[..., None]
    return np.asarray(255 * ((1 - share) * stops[low] + share * stops[low + 1]) + 0.5, np.uint8)


def _signed_map(values: Float32) -> Bytes:
    """Map values below 0 to blue, 0 to white, above 0 to red; full colour from one half on."""
    share = np.clip(values / 0.5, -1, 1)[..., None]
    red, blue = np.array([0.78, 0.1, 0.1]), np.array([0.1, 0.25, 0.8])
    colour = 1 - np.abs(share) * (1 - np.where(share > 0, red, blue))
    return np.asarray(255 * colour + 0.5, np.uint8)
