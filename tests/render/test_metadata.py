"""Values of a job that change no pixel never force a new render: headers and manifest take them over."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.handed import contents
from support.tiny import WALK

import framearray_cli.array.metadata as metadata
from framearray_cli.array.folder import ArrayFolder
from framearray_cli.array.images import read_image
from framearray_cli.array.integrity import verify
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.metadata import frame_rate_of, read_rate, with_frame_rate
from framearray_cli.array.record import record_files
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import write_bytes
from framearray_cli.base.units import frame_rate
from framearray_cli.cli.commands.verify import verified_lines
from framearray_cli.job.job import Job
from framearray_cli.render.events import Event, Noted
from framearray_cli.render.render import render

N = 4
CAMERA = {**WALK, "frames": N, "keys": [WALK["keys"][0], {**WALK["keys"][1], "frame": N - 1}]}
OTHER, THIRD = 23.976, 12.5


def job(scene: Path, out: Path, kind: str = "exr", changes: Any = None, **output: Any) -> Job:
    table = {"scene": {"file": str(scene)}, "camera": CAMERA, "reuse": {"n_r": 1}, **(changes or {})}
    return tiny.job(**table, output={"directory": str(out), "format": kind, **output})


def rates(folder: Path) -> set[Any]:
    found = {frame_rate_of(data) for name, data in contents(folder).items() if not name.endswith((".tif", ".jpg"))}
    return found | {frame_rate(read_manifest(folder).fps)}


def is_whole(folder: Path) -> bool:
    found = verify(folder, 1, lambda done, total: None)
    return not found.wrong and not found.unknown


def noted(events: list[Event], word: str) -> list[str]:
    """Return the notes with a word."""
    return [event.text for event in events if isinstance(event, Noted) and word in event.text]


@pytest.mark.parametrize("kind", ["exr", "png", "jpg"])
def test_another_rate_gives_the_bytes_of_a_new_render(scene: Path, tmp_path: Path, kind: str) -> None:
    out = tmp_path / "out"
    render(job(scene, out, kind))
    before = {name: read_image(out / name) for name in contents(out) if "layers" not in name}
    events: list[Event] = []
    assert render(job(scene, out, kind, fps=OTHER), events.append).images == 0
    [note] = noted(events, "rewriting")
    assert f"the headers of {N if kind == 'jpg' else 4 * N} files" in note
    assert rates(out) == {frame_rate(OTHER)} and is_whole(out)
    assert not (out / "records" / metadata.JOURNAL).exists() and read_manifest(out).job["output"]["fps"] == OTHER
    for name, image in before.items():
        np.testing.assert_array_equal(read_image(out / name), image)
    render(job(scene, tmp_path / "new", kind, fps=OTHER))
    assert contents(out) == contents(tmp_path / "new")


def test_an_unfinished_array_goes_on_at_one_rate(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    render(job(scene, out), cameras=(1,))
    assert render(job(scene, out, fps=OTHER), cameras=(2,)).images == 3
    assert render(job(scene, out, fps=THIRD)).images == 3 * (N - 2)
    assert rates(out) == {frame_rate(THIRD)} and is_whole(out)


def test_damaged_files_stay_damaged_and_are_rendered_again(scene: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    render(job(scene, out, "png"))
    for name in ("tiny.c0001.l001.png", "tiny.layers.c0002.exr"):
        data = bytearray((out / name).read_bytes())
        data[-30] ^= 1
        (out / name).write_bytes(data)
    (out / "tiny.c0003.l000.png").unlink()
    assert render(job(scene, out, "png", fps=OTHER)).images == 3 * 3
    assert rates(out) == {frame_rate(OTHER)} and is_whole(out)


@pytest.mark.parametrize("writes", [0, 1, 2, 7, 16, 17, 18])
def test_an_interruption_at_any_write_harms_nothing(
    scene: Path, tmp_path: Path, writes: int, monkeypatch: pytest.MonkeyPatch, finished: dict[str, bytes]
) -> None:
    """Journal, 16 files, one record, manifest: then back to the first rate, or on to another."""
    for k, then in enumerate((24.0, OTHER, THIRD)):
        out = tmp_path / str(k)
        for name, data in finished.items():
            write_bytes(out / name, data)
        stop_after(writes, monkeypatch)
        with pytest.raises(KeyboardInterrupt):
            render(job(scene, out, fps=OTHER))
        monkeypatch.undo()
        assert metadata.was_interrupted(out) == (writes > 0)
        said = verified_lines(verify(out, 1, lambda done, total: None))
        assert any("a change of output.fps was interrupted" in line for line in said) == (writes > 0)
        assert render(job(scene, out, fps=then)).images == 0
        assert rates(out) == {frame_rate(then)} and is_whole(out) and not metadata.was_interrupted(out)


@pytest.fixture(scope="module")
def finished(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("finished")
    render(job(scene, out))
    files = [file for file in out.rglob("*.*") if file.is_file() and not file.name.startswith(".")]
    return {file.relative_to(out).as_posix(): file.read_bytes() for file in files}


def stop_after(writes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Interrupt the change of metadata after some files were written."""
    left = [writes]

    def stop() -> None:
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt

    for module, name in ((metadata, "write_bytes"), (metadata, "write_manifest")):
        real = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *given, real=real: (stop(), real(*given)))
    real = metadata.rewrite_checksums
    monkeypatch.setattr(metadata, "rewrite_checksums", lambda *given: (stop(), real(*given)))


@pytest.mark.parametrize(
    ("kind", "old", "new"),
    [
        ("exr", {"exposure": 0.0}, {"exposure": 1.5, "quality": 80}),
        ("png", {"compression": "none"}, {"compression": "zip", "half": "never", "quality": 50}),
        ("tif", {"half": "auto"}, {"half": "always", "exposure": -1.0}),
        ("jpg", {"half": "auto"}, {"half": "always", "compression": "piz"}),
    ],
)
def test_what_a_format_ignores_only_changes_the_manifest(
    scene: Path, tmp_path: Path, kind: str, old: Any, new: Any
) -> None:
    one = {"layers": False, **old}
    render(job(scene, tmp_path, kind, **one), cameras=(0,))
    before = contents(tmp_path)
    assert render(job(scene, tmp_path, kind, **{**one, **new}), cameras=(0,)).images == 0
    assert contents(tmp_path) == before
    assert read_manifest(tmp_path).job["output"].items() >= new.items()


def test_other_ignored_values_are_taken_over_too(scene: Path, tmp_path: Path) -> None:
    changes = {"obscurance": {"range": 1.2, "tau": 2.0}}
    render(job(scene, tmp_path, changes={"obscurance": {"range": 1.2}}), cameras=(0,))
    assert render(job(scene, tmp_path, changes=changes), cameras=(0,)).images == 0
    assert read_manifest(tmp_path).job["obscurance"]["tau"] == 2.0


@pytest.mark.parametrize(
    ("kind", "output"),
    [("png", {"exposure": 1.0}), ("jpg", {"quality": 90}), ("exr", {"half": "never"}), ("exr", {"compression": "b44"})],
)
def test_what_a_format_depends_on_is_another_array(scene: Path, tmp_path: Path, kind: str, output: Any) -> None:
    render(job(scene, tmp_path, kind), cameras=(0,))
    with pytest.raises(OutputError, match=f"another frame array.*output.{next(iter(output))}"):
        render(job(scene, tmp_path, kind, **output), cameras=(0,))


@pytest.mark.parametrize(("old", "new"), [("none", "zip"), ("zip", "rle"), ("piz", "none")])
def test_images_to_come_have_another_lossless_compression(scene: Path, tmp_path: Path, old: str, new: str) -> None:
    """Pixels are those of either, and files that are there stay."""
    out, events = tmp_path / "out", list[Event]()
    render(job(scene, out, compression=old), cameras=(0,))
    before = contents(out)
    assert render(job(scene, out, compression=new), events.append).images == 3 * (N - 1)
    assert f"output.compression is {new} now" in noted(events, "keep")[0] and is_whole(out)
    render(job(scene, tmp_path / "new", compression=new))
    assert contents(out) == contents(tmp_path / "new") | before
    for name in before:
        if "layers" not in name:
            np.testing.assert_array_equal(read_image(out / name), read_image(tmp_path / "new" / name))
    again: list[Event] = []
    assert render(job(scene, out, compression=new), again.append).images == 0 and not noted(again, "output.compression")


def test_lossy_compression_is_another_array_either_way(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path, compression="dwaa"), cameras=(0,))
    for other in ("zip", "dwab"):
        with pytest.raises(OutputError, match=f'output.compression: "dwaa" there, "{other}" now'):
            render(job(scene, tmp_path, compression=other), cameras=(0,))


DOME = {"type": "dome", "positions": 3, "irradiance": 2.0}
UPRIGHT = {**CAMERA, "keys": [{**key, "up": [0.0, 1.0, 0.0]} for key in CAMERA["keys"]]}


@pytest.fixture(scope="module")
def matt(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene without mirrors."""
    return tiny.save_glb(tiny.room_meshes(mirrors=False), tmp_path_factory.mktemp("scene") / "matt.glb")


@pytest.mark.parametrize(
    "changes", [{"specular": {"depth": 2}}, {"specular": {"hits": 40}}, {"scene": {"up": "z"}, "camera": UPRIGHT}]
)
def test_keys_that_play_no_part_keep_their_first_value(matt: Path, tmp_path: Path, changes: Any) -> None:
    first = {"camera": UPRIGHT} if "camera" in changes else {}
    later = changes | ({"scene": {"file": str(matt), **changes["scene"]}} if "scene" in changes else {})
    render(job(matt, tmp_path, changes=first), cameras=(0,))
    table, fingerprint = read_manifest(tmp_path).job, read_manifest(tmp_path).fingerprint
    for cameras in ((0,), (1,), (0, 1)):
        made = render(job(matt, tmp_path, changes=later), cameras=cameras).images
        assert made == (3 if cameras == (1,) else 0)
    assert (read_manifest(tmp_path).job, read_manifest(tmp_path).fingerprint) == (table, fingerprint)
    assert render(job(matt, tmp_path, changes=first), cameras=(0, 1)).images == 0


@pytest.mark.parametrize(
    ("first", "changes", "key"),
    [
        ({}, {"specular": {"depth": 2}}, "specular.depth"),
        ({}, {"specular": {"hits": 40}}, "specular.hits"),
        ({}, {"scene": {"up": "z"}}, "scene.up"),
        ({"camera": UPRIGHT, "light": {"frames": 3, "sources": [DOME]}}, {"scene": {"up": "z"}}, "scene.up"),
    ],
)
def test_where_they_play_a_part_they_make_another_array(
    scene: Path, tmp_path: Path, first: Any, changes: Any, key: str
) -> None:
    """The scene has mirrors, and the camera no `up` of its own, or the light is a dome over the scene."""
    render(job(scene, tmp_path, changes=first), cameras=(0,))
    later = first | changes | {"scene": {"file": str(scene), **changes.get("scene", {})}}
    with pytest.raises(OutputError, match=f"another frame array.*{key}"):
        render(job(scene, tmp_path, changes=later), cameras=(0,))


def test_another_run_in_the_folder_comes_first(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    before, folder = contents(tmp_path), ArrayFolder(tmp_path)
    with (
        folder.reserve((2,), "2"),
        pytest.raises(OutputError, match="another run is rendering cameras 2 into this folder"),
    ):
        render(job(scene, tmp_path, fps=OTHER), cameras=(1,))
    assert contents(tmp_path) == before and len(record_files(tmp_path)) == 1


@pytest.mark.parametrize(
    "data", [b"", b"\x76\x2f\x31\x01\2\0\0\0", b"\x89PNG\r\n\x1a\n", b"\xff\xd8", b"\x76\x2f\x31\x01" * 9]
)
def test_files_without_a_rate_stay(data: bytes) -> None:
    assert frame_rate_of(data) is None
    assert with_frame_rate(data, frame_rate(OTHER)) == data


@pytest.mark.parametrize("text", ["", "1e999999999", "-1", "0.5", "1/0", "9" * 10, "1/2/3", "\u0661"])
def test_texts_that_are_no_rate_are_refused(text: str) -> None:
    with pytest.raises((ValueError, ZeroDivisionError)):
        read_rate(text)


@pytest.mark.parametrize("journal", [b"", b"[1]", b'["1e999999999"]', b'{"a": 1}', b"[" * 10**5])
def test_a_broken_journal_is_replaced(scene: Path, tmp_path: Path, journal: bytes) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    (tmp_path / "records" / metadata.JOURNAL).write_bytes(journal)
    assert render(job(scene, tmp_path, fps=OTHER), cameras=(0,)).images == 0
    assert rates(tmp_path) == {frame_rate(OTHER)} and not metadata.was_interrupted(tmp_path)
