"""Clips of an export: their codes, their files, their size."""

import os
from pathlib import Path

import numpy as np
import pytest
from support import handmade
from support.program import complete, start, wait_for

from framearray_cli.array.images import write_image
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view.clips import CHOICES, LENGTH, Clips
from framearray_cli.tools.view.coding import encode
from framearray_cli.tools.view.pagefiles import bytes_for_tiles, write_page
from framearray_cli.tools.view.show import open_tiles, prepare_all
from framearray_cli.tools.view.tiles import Tiles

av = pytest.importorskip("av")


def packets_of(data: bytes) -> list[bytes]:
    sizes = np.frombuffer(data, "<u4", 1 + int.from_bytes(data[:4], "little"))[1:]
    ends = 4 * (len(sizes) + 1) + np.cumsum(sizes)
    assert ends[-1] == len(data)
    return [data[end - size : end] for end, size in zip(ends, sizes, strict=True)]


def frames_of(data: bytes) -> list[tuple[np.ndarray, bool]]:
    """Decode a clip, from its middle to both ends: codes, (h, w, 3) float, and whether it is a key frame."""
    packets = packets_of(data)
    middle = len(packets) // 2
    before, after = packets[middle::-1], packets[middle:]
    return [*decoded(before)[:0:-1], *decoded(after)]


def decoded(packets: list[bytes]) -> list[tuple[np.ndarray, bool]]:
    decoder = av.CodecContext.create("vp9", "r")
    found = []
    for packet in (*map(av.Packet, packets), None):
        for frame in decoder.decode(packet):
            assert frame.format.name == "yuv420p" and frame.color_range == 1
            planes = [np.frombuffer(plane, np.uint8).reshape(plane.height, plane.line_size) for plane in frame.planes]
            y = (planes[0][:, : frame.width].astype(float) - 16) * 255 / 219
            wide = [one.repeat(2, 0).repeat(2, 1)[: y.shape[0], : y.shape[1]].astype(float) for one in planes[1:]]
            u, v = ((one - 128) * 255 / 224 for one in wide)
            rgb = np.stack([y + 1.5748 * v, y - 0.18733 * u - 0.46813 * v, y + 1.8556 * u], -1)
            found.append((rgb, frame.key_frame))
    return found


def test_a_clip_has_one_key_frame_and_the_codes_of_its_pictures():
    pictures = [np.rint(255 * np.clip(handmade.soft(1, l), 0, 1)).astype(np.uint8)[:-1, :-1] for l in range(5)]
    frames = frames_of(Clips(crf=20).encode(pictures))
    assert [key for _, key in frames] == [False, False, True, False, False]
    for (codes, _), right in zip(frames, pictures, strict=True):
        assert codes.shape == (48, 64, 3), "odd sizes grow"
        assert np.abs(codes[:-1, :-1] - right).mean() < 2.0
    assert Clips(crf=20).encode(pictures) == Clips(crf=20).encode(pictures)
    one = Clips(crf=20).encode(pictures[:1])
    assert [key for _, key in frames_of(one)] == [True]
    sizes = [len(Clips(crf=crf).encode(pictures)) for crf in (20, 40, 60)]
    assert sizes == sorted(sizes, reverse=True)


def open_export(folder: Path, **sizes) -> Tiles:
    tiles = open_tiles(handmade.plain(folder / "array", layers=False, **sizes).directory, None, 2)
    tiles.clips = Clips()
    return tiles


def clip_files(tiles: Tiles) -> dict[str, int]:
    """Times of the clips."""
    return {path.name: path.stat().st_mtime_ns for path in tiles.folder.rglob("*.clip")}


def test_an_export_goes_on_and_codes_only_what_changed(tmp_path):
    tiles = open_export(tmp_path, n_c=2, n_l=LENGTH + 2)
    stream = tiles.streams[0]
    tiles.prepare(stream, 1)  # a first run that was stopped
    first = clip_files(tiles)
    assert sorted(first) == ["c0001.l000.clip", f"c0001.l{LENGTH:03d}.clip"]
    prepare_all(tiles, 1, lambda n: None)
    second = clip_files(tiles)
    assert len(second) == 4 and first.items() <= second.items()
    os.utime(tmp_path / "array" / f"room.c0000.l{LENGTH:03d}.exr", (1, 1))
    prepare_all(tiles, 1, lambda n: None)
    third = clip_files(tiles)
    assert {name for name in second if second[name] != third[name]} == {f"c0000.l{LENGTH:03d}.clip"}


@pytest.mark.slow
def test_an_export_goes_on_after_a_kill(tmp_path):
    tiles = open_export(tmp_path, n_c=40, n_l=LENGTH)
    command = "view", tmp_path / "array", "-q", "--export"
    process = start(*command, tmp_path / "killed")
    try:
        wait_for(lambda: len(clip_files(tiles)) >= 3, process)
    finally:
        process.kill()
        process.communicate()
    before = clip_files(tiles)
    assert len(before) < 40 and not (tmp_path / "killed").exists()
    complete(*command, tmp_path / "killed")
    after = clip_files(tiles)
    assert len(after) == 40 and before.items() <= after.items()
    complete(*command, tmp_path / "whole", "--cache", tmp_path / "other")
    files = {path.relative_to(tmp_path / "whole") for path in (tmp_path / "whole").rglob("*") if path.is_file()}
    assert len(files) > 40
    for file in files:
        assert (tmp_path / "killed" / file).read_bytes() == (tmp_path / "whole" / file).read_bytes(), file


def test_a_clip_is_black_where_an_image_is_missing_or_damaged(tmp_path):
    tiles = open_export(tmp_path, n_c=1, n_l=4)
    (tmp_path / "array" / "room.c0000.l001.exr").unlink()
    (tmp_path / "array" / "room.c0000.l002.exr").write_bytes(b"damaged")
    (problem,) = prepare_all(tiles, 1, lambda n: None)
    assert "room.c0000.l002.exr" in str(problem)
    ((path, _),) = tiles.tile_files(tiles.streams[0], 0)
    stamp, _, clip = path.read_bytes().partition(b"\n")
    means = [codes.mean() for codes, _ in frames_of(clip)]
    assert len(stamp) == 16 and means[1] < 2 and means[2] < 2 and min(means[0], means[3]) > 20


def test_layers_are_coded_along_the_cameras(tmp_path, monkeypatch):
    n_c = LENGTH + 3
    tiles = open_tiles(handmade.plain(tmp_path / "array", n_c=n_c, n_l=1).directory, None, 2)
    tiles.clips = Clips(crf=20)
    monkeypatch.setattr("framearray_cli.tools.view.tiles.LAYER_CODES", 2 * 3 * 64 * 48 * LENGTH)  # of two layers
    (tmp_path / "array" / "room.layers.c0003.exr").unlink()
    (tmp_path / "array" / "room.layers.c0004.exr").write_bytes(b"damaged")
    problems = prepare_all(tiles, 2, lambda n: None)
    assert {str(problem).partition(":")[0].rpartition("/")[2] for problem in problems} == {"room.layers.c0004.exr"}
    layers = [stream for stream in tiles.streams if stream.role == "layer"]
    assert {stream.key for stream in layers} > {"depth", "normal", "obscurance"}
    files = {path.relative_to(tiles.folder / "tiles").as_posix() for path in tiles.folder.rglob("*.clip")}
    assert files == {f"{stream.key}/c{c:04d}.clip" for stream in layers for c in (0, LENGTH)}
    for stream in layers:
        clips = [tiles.layer_clip_path(stream, first).read_bytes().partition(b"\n")[2] for first in (0, LENGTH)]
        frames = [codes for clip in clips for codes, _ in frames_of(clip)]
        assert len(frames) == n_c
        for c, codes in enumerate(frames):
            channels = handmade.layer_channels(c)
            right = encode(np.stack([channels[name] for name in stream.channels], axis=-1), stream.coding).astype(float)
            wrong = np.abs(codes - (0 if c in (3, 4) else right)).mean()
            assert wrong < 3.0, (stream.key, c)
    before = clip_files(tiles)
    os.utime(tmp_path / "array" / f"room.layers.c{LENGTH:04d}.exr", (1, 1))
    prepare_all(tiles, 1, lambda n: None)
    after = clip_files(tiles)
    assert {name for name in before if before[name] != after[name]} == {f"c{LENGTH:04d}.clip"}
    coarse = sum(path.stat().st_size for path in tiles.folder.rglob("*.clip"))
    monkeypatch.setattr("framearray_cli.tools.view.clips.LAYER_CRF", 0)
    prepare_all(tiles, 1, lambda n: None)
    assert sum(path.stat().st_size for path in tiles.folder.rglob("*.clip")) > coarse


@pytest.mark.parametrize("name", ["page", "page.zip"])
def test_most_bytes(tmp_path, name):
    tiles = open_export(tmp_path, n_c=5, n_l=9)
    rng = np.random.default_rng(5)
    for file in (tmp_path / "array").glob("*.exr"):  # noise costs bytes
        write_image(file, handmade.soft(1, 1) * rng.uniform(0.7, 1.3, (48, 64, 1)).astype(np.float32), handmade.FLOAT)
    target = tmp_path / name
    found: list[Clips] = []
    most = 3e5
    with pytest.raises(OutputError, match=r"pictures of this array need about [\d.]+ KiB"):
        while True:
            tiles.fit_clips(bytes_for_tiles(target, most))
            if found[-1:] != [tiles.clips]:
                found.append(tiles.clips)
                written, _ = write_page(tiles, target, threads=2, progress=lambda n: None)
                assert written <= most
            most *= 0.95
    order = [CHOICES.index(clips) for clips in found]
    assert order == sorted(order) and len(order) > 2, "smaller limits, lower quality"


def test_a_smaller_export_has_smaller_pictures(tmp_path):
    tiles = open_export(tmp_path, n_c=1, n_l=2)
    tiles.clips = Clips(factor=2)
    assert tiles.export_index()["resolution"] == [32, 24]
    prepare_all(tiles, 1, lambda n: None)
    ((path, _),) = tiles.tile_files(tiles.streams[0], 0)
    codes = frames_of(path.read_bytes().partition(b"\n")[2])[1][0]
    values = handmade.soft(0, 1, 6.0).reshape(24, 2, 32, 2, 3).mean((1, 3)).astype(np.float32)
    assert np.abs(codes - encode(values, tiles.streams[0].coding)).mean() < 3
