"""Headers of PLY, STL, OFF and packed files that claim the impossible."""

import io
import time
import zipfile
from pathlib import Path

import pytest

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_meshes
from framearray_cli.scene.files.assets import Limit
from framearray_cli.scene.files.other import check_headers

PLY = """ply
format {} 1.0
element vertex {}
property float x
property {} y
property float z
element face 1
property list uchar int vertex_indices
end_header
"""
ROWS = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"


@pytest.mark.parametrize(
    ("head", "message"),
    [
        (PLY.format("ascii", 10**9, "float"), "its header promises 3000000001 bytes or more, "),
        (PLY.format("binary_little_endian", 10**9, "float"), "its header promises 12000000001 bytes or more"),
        (PLY.format("ascii", -3, "float"), "expected 'element NAME COUNT', got 'element vertex -3'"),
        (PLY.format("ascii", "9" * 30, "float"), "expected 'element NAME COUNT', got 'element vertex 9999"),
        (PLY.format("ascii", 3, "quad"), "expected 'property KIND NAME', got 'property quad y'"),
        (PLY.format("ascii", 3, "list float"), "expected 'property KIND NAME', got 'property list float y'"),
        (
            PLY.format("ascii", 3, "float").replace("float y", "float v"),
            "expected the properties x, y and z, got no y",
        ),
        (PLY.format("ascii", 3, "float").replace("face", "fac\xe9"), "expected a header of plain letters"),
        (PLY.format("ascii", 3, "float")[:100], "expected a header from 'ply' to 'end_header'"),
        ("", "expected a header from 'ply' to 'end_header'"),
    ],
)
def test_headers_of_ply(tmp_path: Path, head: str, message: str) -> None:
    file = tmp_path / "a.ply"
    file.write_text(head + ROWS)
    with pytest.raises(SceneError) as caught:
        read_meshes(file)
    assert f"{file}: broken PLY: {message}" in str(caught.value)
    file.write_text(PLY.format("ascii", 3, "float") + ROWS)
    assert len(read_meshes(file).parts[0].corners) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("OFF\n3000000 1 0\n0 0 0\n", "its header promises 3,000,000 vertices and 1 face, the file has 22 bytes"),
        ("OFF\n-3 1 0\n", "expected the numbers of vertices and faces"),
        ("OFF\n", "expected the numbers of vertices and faces"),
    ],
)
def test_headers_of_off(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "a.off"
    file.write_text(text)
    with pytest.raises(SceneError) as caught:
        read_meshes(file)
    assert f"{file}: broken OFF: {message}" in str(caught.value)


def test_many_solids_of_an_stl_are_one_mesh(tmp_path: Path) -> None:
    """trimesh took 2.3 s for 4,000 of them, and twice as many took three times as long."""
    facet = "facet normal 0 0 1\nouter loop\nvertex {0} 0 0\nvertex {0} 1 0\nvertex {0} 0 1\nendloop\nendfacet\n"
    file = tmp_path / "a.stl"
    file.write_text("".join(f"solid part {k}\n{facet.format(k)}endsolid part {k}\n\n" for k in range(20_000)))
    started = time.perf_counter()
    (part,) = read_meshes(file).parts
    assert time.perf_counter() - started < 5
    assert len(part.corners) == 20_000
    assert part.corners[:, 0, 0].tolist() == list(range(20_000))


def packed(**files: bytes) -> bytes:
    """A ZIP."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


def test_what_an_archive_unpacks_to_counts() -> None:
    data = packed(model=bytes(50 * 2**20), more=bytes(50 * 2**20))
    assert len(data) < 2**20
    check_headers(data, "3mf", Limit(most=2**27))
    with pytest.raises(SceneError, match=r"unpacked files 100\.0 MiB\), 64\.0 MiB may be used"):
        check_headers(data, "3mf", Limit(most=2**26))


ENTITY = '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-32"])
def test_entities_of_xml_are_refused(encoding: str) -> None:
    data = ENTITY.encode(encoding)
    for extension, content in (("dae", data), ("xaml", data), ("3mf", packed(model=data)), ("zae", packed(a=data))):
        with pytest.raises(SceneError, match="defines XML entities, which are refused"):
            check_headers(content, extension, Limit())
    check_headers(ENTITY.replace('[<!ENTITY b SYSTEM "file:///etc/passwd">]', "").encode(encoding), "dae", Limit())
