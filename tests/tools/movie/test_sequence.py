"""Image sequences: links, copies and conversions; the folder after a failure."""

import errno
import os
import signal
from pathlib import Path

import numpy as np
import pytest
from support.making import assemble_movie
from support.movies import barred, grouped, path_file, plain
from support.program import finish, names, start, wait_for

from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.movie import movie as movies
from framearray_cli.tools.movie.look import Look

WALK = "[[segments]]\nframes = 9\ncamera = [0, 4]\nlight = 1\n"
EYES = [0, 1, 1, 2, 2, 3, 3, 4, 4]  # halves go up


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return plain(tmp_path / "out")


@pytest.mark.parametrize(("name", "n"), [("f.###.exr", 12), ("a_v2.#.png", 120), ("x_####.tif", 3)])
def test_fileseq_finds_the_names(tmp_path: Path, name: str, n: int) -> None:
    """A second opinion on padding, and on what a player makes of the folder."""
    fileseq = pytest.importorskip("fileseq", reason="fileseq is not installed (extra dev)")
    names = movies._names(tmp_path / name, n)
    head, digits, tail = name.partition("#" * name.count("#"))
    theirs = fileseq.FileSequence(f"{head}0-{n - 1}{digits}{tail}", pad_style=fileseq.PAD_STYLE_HASH1)
    assert names == [theirs.frame(k) for k in range(n)]
    for file in names:
        (tmp_path / file).touch()
    (found,) = fileseq.findSequencesOnDisk(str(tmp_path), pad_style=fileseq.PAD_STYLE_HASH1)
    assert (found.start(), found.end(), len(found)) == (0, n - 1, n)


@pytest.mark.parametrize("extension", ["exr", "png"])
def test_unchanged_images_are_linked(tmp_path: Path, extension: str) -> None:
    array = plain(tmp_path / "out", extension=extension)
    path, target = path_file(tmp_path, WALK), tmp_path / "cut" / f"f.###.{extension}"
    assert assemble_movie(array.directory, path, target).path == str(tmp_path / "cut")
    for k, c in enumerate(EYES):
        made, own = tmp_path / "cut" / f"f.{k:03d}.{extension}", image_path(array, c, 1)
        assert made.stat().st_ino == own.stat().st_ino
    assert image_path(array, 2, 1).stat().st_nlink == 3


def test_where_links_are_not_possible_images_are_copied(
    array: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EXDEV, "Invalid cross-device link")

    monkeypatch.setattr(os, "link", refuse)
    assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / "f.###.exr")
    for k, c in enumerate(EYES):
        made, own = tmp_path / f"f.{k:03d}.exr", image_path(array, c, 1)
        assert made.stat().st_ino != own.stat().st_ino
        assert made.read_bytes() == own.read_bytes()


def test_writing_a_sequence_twice_keeps_the_array(array: Manifest, tmp_path: Path) -> None:
    """The second time a link replaces a link to the same file, or to another."""
    path = path_file(tmp_path, WALK)
    before = {file.name: file.read_bytes() for file in array.directory.iterdir()}
    assemble_movie(array.directory, path, tmp_path / "f.###.exr")
    assemble_movie(array.directory, path, tmp_path / "f.###.exr")
    assemble_movie(array.directory, path_file(tmp_path, WALK.replace("light = 1", "light = 2")), tmp_path / "f.###.exr")
    assert {file.name: file.read_bytes() for file in array.directory.iterdir()} == before
    assert (tmp_path / "f.000.exr").stat().st_ino == image_path(array, 0, 2).stat().st_ino
    assert not [file for file in tmp_path.iterdir() if file.name.endswith(".part")]


def test_a_held_picture_is_converted_once(array: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    write = movies.write_codes
    monkeypatch.setattr(movies, "write_codes", lambda path, *rest: (made.append(path.name), write(path, *rest)))
    assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / "f.#.png")
    assert made == [f"f.{k}.png" for k in (0, 1, 3, 5, 7)]
    np.testing.assert_array_equal(read_codes(tmp_path / "f.1.png"), read_codes(tmp_path / "f.2.png"))


def test_blended_exr_frames_are_linear_and_name_their_place(array: Manifest, tmp_path: Path) -> None:
    import OpenImageIO

    text = 'positions = "blend"\n[[segments]]\nframes = 5\ncamera = 1\nlight = [0, 1]\n'
    assemble_movie(array.directory, path_file(tmp_path, text), tmp_path / "f.#.exr")
    a, b = read_image(image_path(array, 1, 0)), read_image(image_path(array, 1, 1))
    for k in range(5):
        np.testing.assert_allclose(read_image(tmp_path / f"f.{k}.exr"), a + (b - a) * (k / 4), rtol=2**-10, atol=1e-6)
    spec = OpenImageIO.ImageInput.open(str(tmp_path / "f.1.exr")).spec()
    assert (spec["framearray:camera"], spec["framearray:place"]) == (1, "c 1  l 0.25")
    assert spec.get("framearray:light") is None
    assert (tmp_path / "f.4.exr").stat().st_ino == image_path(array, 1, 1).stat().st_ino


def test_an_array_with_groups_is_composed_in_its_own_format(tmp_path: Path) -> None:
    array = grouped(tmp_path / "out")
    path = path_file(tmp_path, "[[segments]]\nframes = 4\nlight = [0, 3]\n")
    assert assemble_movie(array.directory, path, tmp_path / "cut").images == 4
    for l in range(4):
        made = read_image(tmp_path / "cut" / f"frame.{l:04d}.exr")
        np.testing.assert_allclose(made, Pictures(array).picture(0, (l, 0)), rtol=2**-10, atol=1e-6)


@pytest.mark.parametrize("look", [Look(exposure=1), Look(label=True)])
@pytest.mark.parametrize("extension", ["exr", "tif"])
def test_radiance_is_not_changed(array: Manifest, tmp_path: Path, look: Look, extension: str) -> None:
    with pytest.raises(OutputError, match=rf"{look.changes[0]} changes only movies, PNG and JPEG; \.{extension} keeps"):
        assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / f"f.#.{extension}", look=look)


# broken images


@pytest.mark.parametrize("extension", ["exr", "tif", "png", "jpg"])
@pytest.mark.parametrize("target", ["m.mp4", "m.gif", "f.##.png", "f.##.exr"])
def test_a_truncated_image_is_named(tmp_path: Path, extension: str, target: str) -> None:
    array = plain(tmp_path / "out", extension=extension)
    path = path_file(tmp_path, WALK)
    for c in (2, 4):
        file = image_path(array, c, 1)
        file.write_bytes(file.read_bytes()[: 2 * file.stat().st_size // 3])
    (tmp_path / "m.mp4").write_bytes(b"an earlier movie")
    with pytest.raises(OutputError, match=rf"c0002\.l001\.{extension}: "):
        assemble_movie(array.directory, path, tmp_path / target)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["m.mp4", "out", "path.toml"]
    assert (tmp_path / "m.mp4").read_bytes() == b"an earlier movie"


def test_damage_inside_an_image_is_found_when_it_is_read(tmp_path: Path) -> None:
    array = plain(tmp_path / "out")
    file = image_path(array, 3, 1)
    write_image(file, barred(3, 1), ImageFormat(compression="zip"))
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 200] = bytes(200)
    file.write_bytes(data)
    for target in ("m.mp4", "m.webp", "f.##.png", "deep/er/f.##.jpg", "deep/m.gif"):
        with pytest.raises(OutputError, match=r"c0003\.l001\.exr: "):
            assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / target)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "path.toml"]


# interrupts


@pytest.mark.parametrize("target", ["m.mp4", "m.mov", "m.gif", "m.webp", "f.##.png", "new/f.##.png", "new/m.mp4"])
@pytest.mark.parametrize("when", [1, 5, 9])
def test_an_interrupt_leaves_nothing(array: Manifest, tmp_path: Path, target: str, when: int) -> None:
    def interrupt(done: int, total: int) -> None:
        if done == when:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / target, progress=interrupt)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["out", "path.toml"]


def test_an_interrupt_while_frames_are_moved_waits_for_all(
    array: Manifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved: list[str] = []
    replace = Path.replace

    def interrupted(self: Path, target: Path) -> Path:
        moved.append(target.name)
        if len(moved) == 4:
            raise KeyboardInterrupt
        return replace(self, target)

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        assemble_movie(array.directory, path_file(tmp_path, WALK), tmp_path / "f.###.png")
    names = [f"f.{k:03d}.png" for k in range(9)]
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [*names, "out", "path.toml"]


def test_ctrl_c_in_a_process_of_its_own(tmp_path: Path) -> None:
    """A real signal, while a long movie is encoded."""
    array = plain(tmp_path / "out", 2, 2)
    (tmp_path / "m.mp4").write_bytes(b"an earlier movie")
    path = path_file(tmp_path, "[[segments]]\nframes = 200\ncamera = [0, 1]\nloops = 500\n")
    process = start("assemble", array.directory, path, "-o", "m.mp4", "-q", "--force", cwd=tmp_path)
    wait_for(lambda: any(name.endswith(".part") for name in names(tmp_path)), process, seconds=60)
    process.send_signal(signal.SIGINT)
    result = finish(process, seconds=60)
    assert (result.code, result.err) == (130, "interrupted\n")
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["m.mp4", "out", "path.toml"]
    assert (tmp_path / "m.mp4").read_bytes() == b"an earlier movie"
