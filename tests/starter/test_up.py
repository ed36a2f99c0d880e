"""Which axis points up in a first job: what the format says, how the scene lies, or what --up says."""

from pathlib import Path

import numpy as np
import pytest
from support.tiny import box

from framearray_cli.base.arrays import Float64
from framearray_cli.cli.main import main
from framearray_cli.starter import StartOptions, init

TOWER = (([-1, 0, -0.5], [1, 1, 0.5]), ([-0.3, 1, -0.3], [0.3, 2, 0.3]))
LEGS = tuple(([x, 0, z], [x + 0.1, 0.7, z + 0.1]) for x in (-0.6, 0.5) for z in (-0.4, 0.3))
TABLE = (([-1, 0.7, -0.8], [1, 0.75, 0.8]), *LEGS)


def with_z_up(points: Float64) -> Float64:
    """Turn points (..., 3) so that what pointed along y points along z."""
    return points[..., [0, 2, 1]] * (1.0, -1.0, 1.0)


def saved(boxes: tuple[tuple[list[float], list[float]], ...], file: Path, up: str) -> Path:
    """Save boxes, whose y points up, as an OBJ that does not say so; with z up they are turned."""
    corners = np.concatenate([box(low, high) for low, high in boxes]).reshape(-1, 3)
    if up == "z":
        corners = with_z_up(corners)
    points = [f"v {x} {y} {z}" for x, y, z in corners]
    file.write_text("\n".join(points + [f"f {k} {k + 1} {k + 2}" for k in range(1, len(corners), 3)]))
    return file


def test_a_model_with_z_up_is_walked_around_as_one_with_y_up(tmp_path: Path) -> None:
    options = {"y": StartOptions(frames=4, lights=1), "z": StartOptions(frames=4, lights=1, up="z")}
    files = {up: saved(TOWER, tmp_path / f"{up}.obj", up) for up in options}
    shots = {up: init(files[up], tmp_path / f"{up}.toml", options[up]) for up in options}
    assert {up: start.up for up, start in shots.items()} == {"y": "y", "z": "z"}
    assert "z is taken for up, as --up asks for." in shots["z"].about
    level, turned = (np.array([(key["eye"], key["target"]) for key in shots[up].camera.keys]) for up in options)
    assert turned == pytest.approx(with_z_up(level), abs=1e-3)


@pytest.mark.parametrize("asked", [None, "y"])
def test_a_guess_can_be_overruled(asked: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A table whose z points up is flat along z, and its feet are there."""
    scene, job = saved(TABLE, tmp_path / "table.obj", "z"), tmp_path / "table.toml"
    main(["init", str(scene), "-o", str(job), "--frames", "2", *(["--up", asked] if asked else [])])
    said = capsys.readouterr().err
    assert ("z is taken for up; --up y says otherwise." in said) == (asked is None)
    assert ('up = "z"' in job.read_text()) == (asked is None)


def test_another_axis_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = saved(TABLE, tmp_path / "table.obj", "y")
    with pytest.raises(SystemExit) as ended:
        main(["init", str(scene), "--up", "x"])
    assert ended.value.code == 2
    assert "expected y or z" in capsys.readouterr().err
