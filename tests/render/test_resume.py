"""A render that is resumed, split or stopped writes the bytes of one that is not."""

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fuzz import jobseeds
from support import tiny
from support.divided import in_blocks
from support.handed import contents
from support.iesfiles import ies
from support.tiny import WALK

import framearray_cli.render.division as dividing
import framearray_cli.render.session as sessions
from framearray_cli.array.integrity import find_damage, scan_output
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import read_records, record_files, seal, unseal
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest
from framearray_cli.engine.terms.ambient import intensity as ambient
from framearray_cli.job.job import Job
from framearray_cli.render.events import AmbientEstimated, Event, HitsAllotted, ImagesWritten, Scanned, Working
from framearray_cli.render.render import render

N = 7


def job(scene: Path, out: Path, **changes: Any) -> Job:
    return tiny.job_of_file(scene, out, **{"camera": tiny.walk(N), "reuse": {"n_r": 2}} | changes)


@pytest.fixture(scope="module")
def whole(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole")
    render(job(scene, out))
    return out


class Counting:
    """Counts written images, and stops after some."""

    def __init__(self, most: float = np.inf) -> None:
        self.images, self._most = 0, most

    def __call__(self, event: Event) -> None:
        self.images += event.images if isinstance(event, ImagesWritten) else 0
        if self.images > self._most:
            raise OutputError("stopped by the test")


def test_parts_in_any_order_equal_the_whole(scene: Path, tmp_path: Path, whole: Path) -> None:
    parts = [(0, 1), (2, 5), (3,), (4, 6)]
    random.Random(3).shuffle(parts)
    for k, part in enumerate(parts):
        assert not (k and read_manifest(tmp_path).summary["finished"])
        summary = render(job(scene, tmp_path), cameras=part)
        assert summary.written == 3 * len(part)
    assert contents(tmp_path) == contents(whole)
    summary = read_manifest(tmp_path).summary
    assert summary["finished"] is True and summary["images"] == 3 * N
    assert summary["hits_per_pixel"] == pytest.approx(read_manifest(whole).summary["hits_per_pixel"], abs=2e-3)
    assert sorted(file.stem for file in record_files(tmp_path)) == ["0-1", "2,5", "3", "4,6"]


def test_a_stopped_render_goes_on(scene: Path, tmp_path: Path, whole: Path) -> None:
    runs, written = 0, 0
    while True:
        runs += 1
        counting = Counting(most=5)
        try:
            render(job(scene, tmp_path), counting)
            break
        except OutputError:
            written += counting.images
            assert read_manifest(tmp_path).summary["finished"] is False
    assert runs > 2, "it was stopped"
    assert contents(tmp_path) == contents(whole)
    assert read_manifest(tmp_path).summary["images"] == 3 * N
    counting = Counting()
    summary = render(job(scene, tmp_path), counting)
    assert (counting.images, summary.written, summary.there) == (0, 0, 3 * N)


def test_blocks_of_lights_go_on(scene: Path, tmp_path: Path, whole: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run stopped in its second block, and resumed with other blocks."""
    monkeypatch.setattr(dividing, "divide", in_blocks(range(0, 1), range(1, 3)))
    with pytest.raises(OutputError, match="stopped"):
        render(job(scene, tmp_path), Counting(most=N + 5))
    monkeypatch.setattr(dividing, "divide", in_blocks(range(0, 2), range(2, 3)))
    render(job(scene, tmp_path))
    assert contents(tmp_path) == contents(whole)
    assert read_manifest(tmp_path).summary["finished"] is True


def test_torn_and_foreign_lines_do_not_count(scene: Path, tmp_path: Path, whole: Path) -> None:
    render(job(scene, tmp_path), cameras=(0, 1, 2))
    [file] = record_files(tmp_path)
    lines = file.read_bytes().splitlines(keepends=True)
    entries = [k for k, line in enumerate(lines) if b'"c":' in line]
    for foreign in (
        b"",
        b"{",
        b'{"c":0}',
        seal({"c": 0}),
        seal({"c": 0, "lights": [0, 3], "files": [1], "hits": 0}),
        b"\xff\xfe",
        b"[" * 100000,
        b"7",
    ):
        torn = [*lines[: entries[1]], foreign + b"\n", *lines[entries[1] : entries[2]], lines[entries[2]][:-20]]
        file.write_bytes(b"".join(torn))
        assert scan_output(tmp_path, read_manifest(tmp_path).fingerprint).images == 3 * 2
        assert read_records(tmp_path, "sha256:other").entries == ()
    render(job(scene, tmp_path), cameras=(0, 1, 2))
    render(job(scene, tmp_path))
    assert contents(tmp_path) == contents(whole)


def test_no_flipped_bit_of_a_record_is_believed(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path), cameras=(0, 1))
    [file] = record_files(tmp_path)
    fingerprint, data = read_manifest(tmp_path).fingerprint, file.read_bytes()
    known = read_records(tmp_path, fingerprint).entries
    assert len(known) == 2
    rng = random.Random(5)
    for place in rng.sample(range(len(data)), 200):
        flipped = bytearray(data)
        flipped[place] ^= 1 << rng.randrange(8)
        file.write_bytes(flipped)
        found = read_records(tmp_path, fingerprint).entries
        assert set(map(repr, found)) <= set(map(repr, known))


def test_a_part_reads_only_its_own_files(scene: Path, tmp_path: Path, whole: Path) -> None:
    """Otherwise each part of a long path would read all of it."""
    render(job(scene, tmp_path), cameras=(0, 1))
    name = sorted(contents(tmp_path))[0]
    (tmp_path / name).write_bytes(b"")
    assert render(job(scene, tmp_path), cameras=(3, 4)).there == 3 * 4
    assert (tmp_path / name).read_bytes() == b""
    render(job(scene, tmp_path))
    assert contents(tmp_path) == contents(whole)


def test_damage_is_found_and_repaired(scene: Path, tmp_path: Path, whole: Path) -> None:
    render(job(scene, tmp_path))
    rng = random.Random(7)
    names = rng.sample(sorted(contents(tmp_path)), 6)
    for k, name in enumerate(names):
        data = bytearray((tmp_path / name).read_bytes())
        if k == 0:
            (tmp_path / name).unlink()
            continue
        if k == 1:
            del data[-1]
        else:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        (tmp_path / name).write_bytes(data)
    records = read_records(tmp_path, read_manifest(tmp_path).fingerprint)
    checksums = records.checksums()
    assert sorted(name for name, _ in find_damage(tmp_path, checksums, checksums)) == sorted(names)
    events: list[Event] = []
    render(job(scene, tmp_path), events.append)
    [scanned] = [event for event in events if isinstance(event, Scanned)]
    assert Working(text=f"comparing {len(contents(whole))} files with their checksums") in events
    assert len(scanned.damaged) == 6
    assert contents(tmp_path) == contents(whole)
    assert scan_output(tmp_path, read_manifest(tmp_path).fingerprint).damaged == ()


def test_another_processor_is_reported(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    [file] = record_files(tmp_path)
    lines = file.read_bytes().splitlines()
    head = next(k for k, line in enumerate(lines) if b"processor" in line)
    lines[head] = seal({**(unseal(lines[head]) or {}), "processor": "another"})
    file.write_bytes(b"\n".join(lines) + b"\n")
    summary = render(job(scene, tmp_path))
    assert any("several kinds of processor" in note and "another" in note for note in summary.notes)


def test_notes_stay_where_only_the_manifest_was_missing(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A render killed after its last image and before it wrote the manifest."""
    written: list[Manifest] = []
    keep = sessions.write_manifest
    monkeypatch.setattr(sessions, "write_manifest", lambda folder, m: (written.append(m), keep(folder, m)))
    few = {"ambient": {"paths": None}, "light": {"sources": [{**tiny.SUN}]}}
    monkeypatch.setattr(ambient, "TARGET_ERROR", 1e-9)
    render(job(scene, tmp_path, **few))
    whole = read_manifest(tmp_path).summary
    assert any("set ambient.paths for more" in note for note in whole["notes"])
    keep(tmp_path, written[0])
    assert render(job(scene, tmp_path, **few)).written == 0
    assert read_manifest(tmp_path).summary["notes"] == whole["notes"]
    assert read_manifest(tmp_path).summary["finished"] is True


def test_a_camera_at_rest_is_rendered_in_parts(scene: Path, tmp_path: Path) -> None:
    still = {"camera": {"frames": N, "keys": WALK["keys"][:1]}}
    render(job(scene, tmp_path / "whole", **still))
    render(job(scene, tmp_path / "parts", **still), cameras=(5, 6))
    render(job(scene, tmp_path / "parts", **still))
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")


def test_a_digest_detects_any_flipped_bit(tmp_path: Path) -> None:
    data = bytearray(np.random.default_rng(1).bytes(5000))
    (tmp_path / "a").write_bytes(data)
    known = digest(tmp_path / "a")
    for place in range(0, 5000, 37):
        data[place] ^= 1 << place % 8
        (tmp_path / "a").write_bytes(data)
        assert digest(tmp_path / "a") != known
        data[place] ^= 1 << place % 8


class Blocked:
    """Starts other runs during a render."""

    def __init__(self, *others: Any) -> None:
        self.found_others: list[str] = []
        self._others = list(others)

    def __call__(self, event: Event) -> None:
        assert not isinstance(event, HitsAllotted)
        for other in self._others if isinstance(event, AmbientEstimated) else ():
            try:
                other()
                self.found_others.append("")
            except OutputError as error:
                self.found_others.append(str(error))


def test_two_runs_in_one_folder(scene: Path, tmp_path: Path, whole: Path) -> None:
    """Runs on different cameras work side by side; runs on the same cameras, and --restart, are refused."""
    whole_job = job(scene, tmp_path)
    blocked = Blocked(
        lambda: render(whole_job, cameras=(0, 1)),
        lambda: render(whole_job, cameras=(3, 4)),
        lambda: render(whole_job),
        lambda: render(whole_job, cameras=(0,), restart=True),
    )
    render(whole_job, blocked, cameras=(2, 3))
    assert blocked.found_others[0] == ""
    for message in blocked.found_others[1:]:
        assert "another run is rendering cameras 2-3 into this folder" in message
    render(whole_job)
    assert contents(tmp_path) == contents(whole)
    assert not list((tmp_path / "records").glob("*.lock"))


def test_a_lock_of_a_killed_run_stops_no_other(scene: Path, tmp_path: Path) -> None:
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "0-6.lock").write_text("")
    assert render(job(scene, tmp_path), cameras=(1,)).written == 3
    assert not list((tmp_path / "records").glob("*.lock"))


SOFT = {
    "sources": [
        {"type": "point", "keys": [{**key, "radius": 0.2} for key in tiny.TABLE["light"]["sources"][0]["keys"]]},
        {"type": "directional", "keys": [{**key, "angle": 5.0} for key in tiny.SUN["keys"]]},
        jobseeds.SPOTS[0],
        jobseeds.PANELS[0],
        {
            "type": "spot",
            "ies": "lamp.ies",
            "keys": [{"frame": 0, "position": [0.2, 1.8, -0.5], "target": [0, 0, 0], "intensity": 4.0}],
        },
    ]
}


STUDY = {"sources": [tiny.STUDY | {"date": "2026-06-21", "start": "08:00", "stop": "16:00", "step": 240.0}]}


def job_in_threads(scene: Path, out: Path, threads: int, more: dict[str, Any]) -> Job:
    tables = {"scene": {"background": [0.3, 0.4, 0.5]}, "camera": WALK, "reuse": {"n_r": 1, "weights": "area"}}
    output = {"sun_hours": more.get("light") is STUDY}
    return tiny.job_of_file(scene, out, output=output, render={"threads": threads}, **tables, **more)


@pytest.mark.parametrize(
    "more",
    [{}, {"indirect": tiny.CELLS}, {"light": SOFT}, {"light": STUDY}],
    ids=["area", "cells", "soft", "hours of sun"],
)
def test_any_way_to_render_writes_the_same_bytes(
    more: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    (tmp_path / "lamp.ies").write_text(ies())
    monkeypatch.chdir(tmp_path)
    render(job_in_threads(scene, tmp_path / "whole", 1, more))
    whole = contents(tmp_path / "whole")
    assert len(set(whole.values())) == 6 * (3 + 1), "images and layers, all different"

    for part in ((2, 5), (0, 3), (1, 4)):
        render(job_in_threads(scene, tmp_path / "parts", 5, more), cameras=part)
    assert contents(tmp_path / "parts") == whole

    for most in (2, 7):
        with pytest.raises(OutputError, match="stopped"):
            render(job_in_threads(scene, tmp_path / "stopped", 2, more), Counting(most))
    assert 0 < len(contents(tmp_path / "stopped")) < len(whole)
    render(job_in_threads(scene, tmp_path / "stopped", 2, more))
    assert contents(tmp_path / "stopped") == whole

    monkeypatch.setattr(dividing, "divide", in_blocks(range(0, 2), range(2, 3)))
    render(job_in_threads(scene, tmp_path / "blocks", 2, more))
    assert contents(tmp_path / "blocks") == whole
