"""Sums over light positions, without a ray: soft light, environments, and weights from a CSV file.

A file of weights has a column `weight`, or `r`, `g` and `b`, and one row per light position. With a column `light` rows
may be in any order, and positions without a row have the weight 0.
"""

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.mixtures import Mixture, Position, check_linear, check_mixture
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.arrays import Float64, Image
from framearray_cli.base.errors import JobError
from framearray_cli.base.files import read_at_most
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

from .lightfield import LightField, environment_weights, light_field, read_map

LARGEST_FILE = 2**24  # bytes
MOST_WEIGHT = 1e6
MOST_PROBLEMS = 10  # a column that is wrong is wrong in every row
_COLUMNS = (["weight"], ["r", "g", "b"])
# Below this share of a map's light pictures miss some of it that people would see.
MOST_LIGHT = 0.95
# Weights below this share of the largest are rounding: of texels that lie between two cells.
LEAST_WEIGHT = 1e-9
# Replaces a position along the first axis by a sum; the second argument is the share of a movie that has passed.
Mixer: TypeAlias = Callable[[Position, float], Position]


def read_weights(file: Path, n: int) -> Float64:
    """Read the weights of n light positions, (n, 3).

    Raises:
        JobError: the file cannot be read, or has wrong rows; the error names the rows.
    """
    header, rows = _read_rows(file)
    columns = [name for name in header if name != "light"]
    if sorted(columns) not in [sorted(names) for names in _COLUMNS] or len(set(header)) != len(header):
        names = ", ".join(header)[:200] or "none"
        raise JobError(file, [f"row 1: expected the column names weight, or r, g, b; and light if wanted, got {names}"])
    if "light" not in header and len(rows) != n:
        raise JobError(file, [f"expected {counted(n, 'row')}, one per light position, got {len(rows)}"])
    weights, seen, problems = np.zeros((n, 3)), set[int](), list[str]()
    for k, (number, cells) in enumerate(rows):
        if len(cells) != len(header):
            problems.append(f"row {number}: expected {counted(len(header), 'cell')}, got {len(cells)}")
            continue
        row = dict(zip(header, cells, strict=True))
        values = [_weight_in(row[name]) for name in (_COLUMNS[1] if "r" in row else _COLUMNS[0])]
        l = _index_in(row["light"], n) if "light" in row else k
        if None in values:
            bad = next(cell for cell in cells if _weight_in(cell) is None)
            problems.append(f"row {number}: expected numbers from {-MOST_WEIGHT:.0f} to {MOST_WEIGHT:.0f}, got {bad!r}")
        elif l is None or l in seen:
            wanted = "each light position once" if l in seen else f"a light position from 0 to {n - 1}"
            problems.append(f"row {number}: light: expected {wanted}, got {shown(row['light'])}")
        else:
            seen.add(l)
            weights[l] = values  # one number fills three
    if problems:
        from framearray_cli.base.forms.problems import append_count  # loads pydantic

        raise JobError(file, append_count(problems[:MOST_PROBLEMS], len(problems)))
    return weights


def _read_rows(file: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the names of the columns, and number and cells of each row."""
    try:
        data = read_at_most(file, LARGEST_FILE)
        text = (data or b"").decode("utf-8-sig")
    except FileNotFoundError:
        raise JobError(file, ["no such file"]) from None
    except OSError as error:
        raise JobError(file, [f"cannot be read: {error.strerror}"]) from error
    except UnicodeDecodeError as error:
        raise JobError(file, ["expected UTF-8 text, got another encoding; save the file as UTF-8"]) from error
    if data is None:
        raise JobError(file, [f"expected at most {LARGEST_FILE >> 20} MB, got a bigger file"])
    try:
        reader = csv.reader(text.splitlines(), strict=True)
        lines = [(reader.line_num, [cell.strip() for cell in line]) for line in reader if line]
    except csv.Error as error:
        raise JobError(file, [f"not valid CSV: {error}"]) from error
    header = [name.lower() for name in lines[0][1]] if lines else []
    return header, lines[1:]


def _weight_in(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) and abs(value) <= MOST_WEIGHT else None


def _index_in(cell: str, n: int) -> int | None:
    return int(cell) if cell.isascii() and cell.isdigit() and len(cell) < 10 and int(cell) < n else None


@dataclass(frozen=True, slots=True, kw_only=True)
class SumOptions:
    """Sums that pictures show; at most one of `environment`, `soft` and `weights`.

    Attributes:
        environment: a map whose light the positions along the first axis stand for.
        rotate: degrees that the map is turned clockwise, in the first and in the last picture of a movie.
        soft: the number of positions whose mean takes the place of one.
        weights: a CSV file with the weight of each position.
    """

    environment: Path | None = None
    rotate: tuple[float, float] = (0.0, 0.0)
    soft: float | None = None
    weights: Path | None = None

    @property
    def collapses(self) -> bool:
        """True if all positions along the first axis become one picture."""
        return self.environment is not None or self.weights is not None

    @property
    def turns(self) -> bool:
        """True if an environment turns during a movie."""
        return self.rotate[0] != self.rotate[1]

    @property
    def any(self) -> bool:
        """True if pictures are sums."""
        return self.environment is not None or self.soft is not None or self.weights is not None


def make_mixer(manifest: Manifest, options: SumOptions, warn: Callable[[str], None]) -> Mixer | None:
    """Make the sums of an array; None if pictures stay as they are.

    Args:
        warn: called with what is left out.

    Raises:
        JobError: options exclude each other, or a file of weights is broken.
        OutputError: the array cannot be summed, or the map cannot be read.
    """
    if not options.any:
        return None
    if sum(value is not None for value in (options.environment, options.soft, options.weights)) > 1:
        raise JobError("--environment", ["expected only one of --environment, --soft and --weights"])
    check_linear(manifest)
    n, (first, last) = manifest.n_lights, options.rotate
    if options.soft is not None:
        width = options.soft
        return lambda position, share: mean_around(position, width, n)
    if options.weights is not None:
        mixture = mixture_of(read_weights(options.weights, n))
        check_mixture(manifest, mixture)
        return lambda position, share: mixture
    assert options.environment is not None
    turned = turn_environment(manifest, options.environment, first, warn)
    return lambda position, share: turned(first + (last - first) * share)


def turn_environment(
    manifest: Manifest, file: Path, first_deg: float, warn: Callable[[str], None]
) -> Callable[[float], Mixture]:
    """Return the sum of light positions that an environment is, as a function of its rotation, degrees.

    Args:
        first_deg: rotation at which the array should stand for most of the map's light.
        warn: called with what is left out.

    Raises:
        OutputError: the array cannot be summed, or the map cannot be read.
    """
    field, (panorama, note) = light_field(manifest), read_map(file)
    if note:
        warn(note)
    _, covered = environment_mixture(manifest, field, panorama, first_deg)
    if covered < MOST_LIGHT:
        warn(f"{file}: {1 - covered:.0%} of its light comes from where the array has no light position")
    return lambda degrees: environment_mixture(manifest, field, panorama, degrees)[0]


def environment_mixture(
    manifest: Manifest, field: LightField, panorama: Image, rotate_deg: float
) -> tuple[Mixture, float]:
    """Return the sum of light positions that an environment is, and the share of its light that they stand for.

    Args:
        field, panorama, rotate_deg: as in `environment_weights`.

    Raises:
        OutputError: the sum would be wrong, as in `check_mixture`.
    """
    weights, covered = environment_weights(field, panorama, rotate_deg)
    mixture = mixture_of(weights)
    check_mixture(manifest, mixture)
    return mixture, covered


def scaled(mixture: Mixture, factor: float) -> Mixture:
    """Multiply the weights of a mixture."""
    rows = mixture.weights if factor else ()
    return Mixture(tuple((l, (r * factor, g * factor, b * factor)) for l, (r, g, b) in rows))


def open_pictures(manifest: Manifest, options: SumOptions) -> tuple[Pictures, tuple[str, ...]]:
    """Return the pictures of an array, as sums if the options say so, and warnings about what is left out.

    Raises:
        JobError, OutputError: as `make_mixer`.
    """
    left_out: list[str] = []
    mixer = make_mixer(manifest, options, left_out.append)
    mix = None if mixer is None else lambda positions: (mixer(positions[0], 0.0), *positions[1:])
    return Pictures(manifest, mix=mix), tuple(left_out)


def mixture_of(weights: Float64) -> Mixture:
    """Make the mixture of weights (n, 3) of all light positions."""
    least = LEAST_WEIGHT * np.abs(weights).max(initial=0.0)
    rows = [(l, (float(r), float(g), float(b))) for l, (r, g, b) in enumerate(weights.tolist())]
    return Mixture(tuple((l, weight) for l, weight in rows if max(map(abs, weight)) > least))


def mean_around(position: Position, width: float, n: int) -> Mixture:
    """Return the mean of `width` light positions around one, where the axis has them; the weights sum to 1.

    A position stands for the stretch from half a step before to half a step after it.

    Args:
        position: from 0 to n - 1; no mixture.
        width: at least 1.
    """
    assert not isinstance(position, Mixture)
    at = np.arange(n)
    low, high = max(position - width / 2, -0.5), min(position + width / 2, n - 0.5)
    overlap = np.clip(np.minimum(high, at + 0.5) - np.maximum(low, at - 0.5), 0, None)
    share = overlap / overlap.sum()
    return mixture_of(np.repeat(share[:, None], 3, axis=1))
