"""`framearray render --preview`: one small picture, and nothing else."""

from pathlib import Path

import numpy as np
import PIL.Image
import pytest
from support import tiny
from support.iesfiles import ies
from support.irradiance import flat_arrays
from support.program import names, run, write_job
from support.tiny import SUN, TABLE, WALK

from framearray_cli.array.images import read_image
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.terms.cells.solution import build_cells
from framearray_cli.job.read import read_job
from framearray_cli.render.preview import CELL_SAMPLES, lights_of_preview, render_preview, share_of, small_job
from framearray_cli.scene.paths.paths import lights

LAMP = TABLE["light"]["sources"][0]
LARGE = WALK | {"resolution": [640, 160]}


def read_codes(file: Path) -> np.ndarray:
    return np.asarray(PIL.Image.open(file), np.float64)


def test_it_shows_what_the_array_will_show(tmp_path, capsys):
    job = write_job(tmp_path, camera=WALK, samples={"hits": 16}, output={"format": "exr"})
    assert run(capsys, "render", "-q", job, "--cameras", "3").code == 0
    before = names(tmp_path / "out")
    result = run(capsys, "render", job, "--preview", "--cameras", "3", "--light", "last", "-o", tmp_path / "p.exr")
    assert (result.code, result.err) == (0, f"{tmp_path / 'tiny.glb'}: 176 triangles, 6 materials, 1 texture\n")
    width, height = TABLE["camera"]["resolution"]
    assert result.out == f"{tmp_path / 'p.exr'}: camera 3, light 2, {width} x {height} of {width} x {height} pixels\n"
    picture, image = read_image(tmp_path / "p.exr"), read_image(tmp_path / "out" / "tiny.c0003.l002.exr")
    assert abs(picture.mean() / image.mean() - 1) < 0.1
    assert np.corrcoef(picture.ravel(), image.ravel())[0, 1] > 0.9
    other = read_image(tmp_path / "out" / "tiny.c0003.l000.exr")
    assert np.corrcoef(picture.ravel(), other.ravel())[0, 1] < np.corrcoef(picture.ravel(), image.ravel())[0, 1]
    assert names(tmp_path / "out") == before


def test_light_from_cells_is_shown_with_fewer_samples(tmp_path, capsys, monkeypatch):
    """As bright as the array, in which cells have as many samples as the job says."""
    cells = {"method": "cells", "samples": 2**17, "filter": 0}
    job = write_job(tmp_path, samples={"hits": 64}, indirect=cells, output={"format": "exr"})
    assert run(capsys, "render", "-q", job).code == 0
    built = []

    def count(work):
        built.append(work.count)
        return build_cells(work)

    monkeypatch.setattr("framearray_cli.render.plan.build_cells", count)
    picture = render_preview(read_job(job), 0, {"light": 1})[0]
    assert built == [CELL_SAMPLES] and cells["samples"] > CELL_SAMPLES
    image = read_image(tmp_path / "out" / "tiny.c0000.l001.exr")
    assert abs(picture.mean() / image.mean() - 1) < 0.05
    few = job.read_text().replace(str(2**17), "2048")
    job.write_text(few)
    render_preview(read_job(job), 0, {"light": 1})
    assert built == [CELL_SAMPLES, 2048]


def test_lights_of_every_shape_are_taken_at_one_position(tmp_path):
    """A sphere, a spot, a rectangle and a measured lamp, which all change from one position to the next."""
    (tmp_path / "lamp.ies").write_text(ies())
    keys = [{"frame": 0, "position": [0.1, 1.5, 0]}, {"frame": 4, "position": [0.5, 1.2, 0.2]}]
    strong = [key | {"intensity": 3.0 + key["frame"]} for key in keys]
    aimed = [key | {"target": [0.3, 0.1 * key["frame"], 0]} for key in strong]
    flat = [key | {"direction": [0, -1, 0.2 * key["frame"]], "width": 0.3, "height": 0.2, "power": 2.0} for key in keys]
    sources = [
        {"type": "point", "keys": [key | {"radius": 0.1 + 0.01 * key["frame"]} for key in strong]},
        {"type": "spot", "keys": [key | {"inner": 5, "outer": 20 + key["frame"]} for key in aimed]},
        {"type": "rect", "keys": flat},
        {"type": "spot", "keys": aimed, "ies": "lamp.ies"},
    ]
    whole = lights(read_job(write_job(tmp_path, light={"frames": 5, "sources": sources})))
    wanted, centre = light_arrays(whole, np.zeros(3)).at([3]), np.zeros(3)
    found = light_arrays(lights_of_preview(whole, {"light": 3}), centre)
    assert all(np.array_equal(a, b) for a, b in zip(flat_arrays(wanted), flat_arrays(found), strict=True))


def test_it_lies_beside_the_folder_and_is_replaced(tmp_path, capsys):
    job = write_job(tmp_path, camera=LARGE)
    for _ in range(2):
        result = run(capsys, "render", job, "--preview")
        assert result.out.endswith("out-preview.png: camera 3, light 1, 320 x 80 of 640 x 160 pixels\n")
    assert names(tmp_path) == {"job.toml", "tiny.glb", "out-preview.png"}
    assert read_codes(tmp_path / "out-preview.png").shape == (80, 320, 3)


def test_groups_of_sources_shine_at_their_own_positions(tmp_path):
    both = {"frames": 3, "sources": [SUN, LAMP]}
    grouped = both | {"sources": [SUN, LAMP | {"group": "lamps", "axis": "lamps"}]}
    plain = read_job(write_job(tmp_path, light=both, output={"format": "exr"}))
    job = read_job(write_job(tmp_path, light=grouped, output={"format": "exr"}))
    n = job.light.axes["lamps"]
    for l in (0, n - 1):
        same = render_preview(plain, 0, {"light": l})[0]
        np.testing.assert_array_equal(render_preview(job, 0, {"light": l, "lamps": l})[0], same)
    mixed = render_preview(job, 0, {"light": 0, "lamps": n - 1})[0]
    assert not np.array_equal(mixed, render_preview(job, 0, {"light": 0, "lamps": 0})[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--preview", "--cameras", "0-2"], "--cameras: expected one place for the picture of --preview, got 3"),
        (["--preview", "--light", "7"], "--light: expected one of 3 light positions (0 to 2, or -3 to -1), got 7"),
        (["--preview", "--at", "lamps=1"], "--at: expected AXIS=PLACES with one of the axes light (0 to 2)"),
        (["--preview", "--workers", "2"], "does not go with --preview"),
        (["--preview", "--restart"], "does not go with --preview"),
        (["--preview", "--dask", ""], "--dask: does not go with --preview"),
        (["--light", ""], "--light: needs --preview"),
        (["--cameras", ""], "--cameras: expected places such as"),
        (["--force"], "needs --preview"),
    ],
)
def test_wrong_options(tmp_path, capsys, options, message):
    result = run(capsys, "render", write_job(tmp_path, camera=WALK), *options)
    assert (result.code, result.out) == (2, "")
    assert message in " ".join(result.err.split())
    assert names(tmp_path) == {"job.toml", "tiny.glb"}


def test_a_format_without_pictures_is_refused(tmp_path, capsys):
    result = run(capsys, "render", write_job(tmp_path), "--preview", "-o", tmp_path / "p.gif")
    assert result.code == 4
    assert "p.gif: expected a .png, .jpg, .exr or .tif for the picture of --preview" in result.err


def test_many_sources_share_hits_and_samples() -> None:
    """Each of them casts a shadow ray per hit."""
    assert [share_of(8, n, 1) for n in (1, 32, 64, 500)] == [8, 8, 4, 1]
    sources = [LAMP] * 128
    small = small_job(tiny.job(light={"sources": sources}, indirect={"method": "cells"}), 320, 8)
    assert (small.samples.hits, small.indirect.samples) == (2, CELL_SAMPLES // 4)
