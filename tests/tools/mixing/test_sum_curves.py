"""Sums of light positions that change over a movie: widths and files of weights as curves."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.movies import plain

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.tools.movie.assemble import assemble_movie


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    """Six directions of light; image l is l + 1 everywhere."""
    made = plain(tmp_path / "out", 1, 6, picture=lambda c, l: np.full((8, 12, 3), l + 1.0, np.float32))
    tables = [{"type": "directional", "direction": [0.1 * l, -1.0, 0.0], "irradiance": [1.0] * 3} for l in range(6)]
    lights = tuple(replace(light, sources=(table,)) for light, table in zip(made.lights, tables, strict=True))
    changed = replace(made, lights=lights, job={"scene": {"up": "y"}, "ambient": {"method": "eye"}})
    write_manifest(made.directory, changed)
    return changed


def frames(array: Manifest, folder: Path, text: str, n: int = 5, segment: str = "") -> list[float]:
    """Cut a movie of n frames, and return the value of each."""
    (folder / "path.toml").write_text(f"{text}\n[[segments]]\nframes = {n}\n{segment}\n", encoding="utf-8")
    assemble_movie(array.directory, folder / "path.toml", folder / "f.##.exr")
    return [float(read_image(folder / f"f.{k:02d}.exr")[0, 0, 0]) for k in range(n)]


def weights(folder: Path, name: str, *values: float) -> None:
    (folder / name).write_text("weight\n" + "\n".join(map(str, values)) + "\n", encoding="utf-8")


def test_light_that_grows_softer(array: Manifest, tmp_path: Path) -> None:
    """At the first position a mean of N reaches to the left end of the axis and (N - 1) / 2 steps to the right."""
    found = frames(array, tmp_path, 'soft = [{time = 0, value = 1}, {time = "100%", value = 5}]', segment="light = 0")

    def mean(width: float) -> float:
        parts = np.clip(width / 2 + 0.5 - np.arange(6), 0, 1)
        return float((parts * np.arange(1, 7)).sum() / parts.sum())

    np.testing.assert_allclose(found, [mean(width) for width in (1, 2, 3, 4, 5)], rtol=2**-10)


def test_weights_from_one_file_to_the_next(array: Manifest, tmp_path: Path) -> None:
    weights(tmp_path, "dawn.csv", 1, 0, 0, 0, 0, 0)
    weights(tmp_path, "noon.csv", 0, 0, 1, 2, 0, 0)
    weights(tmp_path, "dusk.csv", 0, 0, 0, 0, 0, 3)
    dawn, noon, dusk = 1.0, 1 * 3 + 2 * 4.0, 3 * 6.0
    keys = ", ".join(
        f'{{time = "{t}%", value = "{name}.csv"}}' for t, name in ((0, "dawn"), (50, "noon"), (100, "dusk"))
    )
    found = frames(array, tmp_path, f"weights = [{keys}]")
    wanted = [dawn, (dawn + noon) / 2, noon, (noon + dusk) / 2, dusk]
    np.testing.assert_allclose(found, wanted, rtol=2**-10)
    np.testing.assert_allclose(frames(array, tmp_path, 'weights = "noon.csv"'), noon, rtol=2**-10)


BROKEN = {
    "weights = 3": "weights: expected the name of a file, got 3",
    'weights = "none.csv"': "none.csv: no such file",
    'soft = 2\nweights = "w.csv"': "weights: expected either soft or weights, got both",
    'weights = [{time = 0, value = 1}, {time = "x", value = "w.csv"}]': "weights[0].value: expected the name of a file",
    'weights = [{time = 0}]': "weights[0].value: missing; expected the name of a file",
    'weights = [{time = 1, value = "w.csv"}, {time = 0, value = "w.csv"}]':
        "weights[1].time: expected at least that of the one before (1 s), got 0 s",
    "soft = [{time = 0, value = 0.5}]": "soft[0].value: expected a number from 1 to 100000, got 0.5",
    "soft = [{time = 1, value = 2}, {time = 0, value = 3}]": "soft[1].time: expected at least that of the one before",
}  # fmt: skip


@pytest.mark.parametrize("text", BROKEN)
def test_broken_curves_of_sums(array: Manifest, tmp_path: Path, text: str) -> None:
    weights(tmp_path, "w.csv", 1, 0, 0, 0, 0, 0)
    with pytest.raises(JobError) as caught:
        frames(array, tmp_path, text)
    assert BROKEN[text] in str(caught.value)


def test_weights_of_images_that_hold_the_background(array: Manifest, tmp_path: Path) -> None:
    """A blend of weights of sum 1 has the sum 1; any other holds the background more than once."""
    write_manifest(array.directory, replace(array, job=array.job | {"scene": {"background": [1.0, 1.0, 1.0]}}))
    weights(tmp_path, "a.csv", 1, 0, 0, 0, 0, 0)
    weights(tmp_path, "b.csv", 0, 0, 0.5, 0.5, 0, 0)
    curve = 'weights = [{{time = 0, value = "a.csv"}}, {{time = "100%", value = "{}.csv"}}]'
    np.testing.assert_allclose(frames(array, tmp_path, curve.format("b"))[-1], 3.5, rtol=2**-10)
    weights(tmp_path, "c.csv", 0, 0, 1, 1, 0, 0)
    with pytest.raises(OutputError, match="holds the background, which a sum may contain only once"):
        frames(array, tmp_path, curve.format("c"))
