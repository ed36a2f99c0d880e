"""Completion of the command line, through the protocol that the shells' scripts speak, without a shell."""

import json
import shlex
import struct
from pathlib import Path

import pytest
from support import handmade
from support.program import run, start, write_job

SHELLS = ("bash", "zsh", "fish")


def answer(shell: str, line: str, folder: Path) -> str:
    """Return what the program tells the script of a shell at the end of a line."""
    words = [*shlex.split(line), *([""] if line.endswith(" ") else [])]
    variables = {"_FRAMEARRAY_COMPLETE": f"complete_{shell}", "_TYPER_COMPLETE_ARGS": line}
    variables |= {"COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)}
    variables |= {"_TYPER_COMPLETE_FISH_ACTION": "get-args"}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        out, err = start(cwd=folder).communicate(timeout=60)
    assert err == ""
    return out


def offered(shell: str, line: str, folder: Path) -> list[str]:
    """Return what a shell would offer at the end of a line."""
    out = answer(shell, line, folder)
    if shell == "zsh":  # _arguments '*: :(("--threads":"Threads" ...))'
        return [one.strip('"').split('":"')[0] for one in out[out.find("((") + 2 : out.rfind("))")].split("\n")]
    return [one.split("\t")[0] for one in out.splitlines() if one]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a job, two arrays and a scene with cameras."""
    place = tmp_path_factory.mktemp("completion")
    write_job(place, camera={"frames": 24})
    handmade.plain(place / "out" / "small", n_c=3, n_l=2)
    handmade.grouped(place / "out" / "lamps")
    (place / "notes.txt").write_text("")
    tree = {"nodes": [{"camera": 0, "name": "Shot"}, {"camera": 0}, {}], "cameras": [{"name": "Lens"}]}
    text = json.dumps(tree).encode()
    (place / "house.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0) + text)
    return place


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_commands_and_options(shell, folder):
    assert offered(shell, "framearray re", folder) == ["render", "report"]
    assert offered(shell, "framearray render --res", folder) == ["--restart"]


def test_descriptions_are_whole(folder):
    """As the list of commands has them: typer would cut the first line of the help."""
    assert "render\tRender a job into a frame array." in answer("fish", "framearray re", folder)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "framearray export out/small --format ",
            ["nerfstudio", "colmap", "cinema", "rti", "blender", "olat", "webdataset", "huggingface"],
        ),
        ("framearray export out/small --image-format t", ["tif"]),
        ("framearray schema ", ["job", "path", "manifest", "results"]),
        ("framearray check ", ["job.toml"]),
        ("framearray check j", ["job.toml"]),
        ("framearray init ", ["house.glb", "tiny.glb"]),
        ("framearray init house.glb --camera ", ["Shot", "Lens"]),
        ("framearray verify o", ["out/lamps", "out/small"]),
        ("framearray verify out/s", ["out/small"]),
        ("framearray render job.toml --cameras ", ["all", "first", "last", "50%", "0-23"]),
        ("framearray export out/small -f colmap --cameras 0", ["0-2"]),
        ("framearray sheet out/lamps --side ", ["light", "lamps"]),
        ("framearray sheet out/lamps --at la", ["lamps="]),
        ("framearray sheet out/lamps --at lamps=l", ["lamps=last"]),
        ("framearray check job.toml --set camera.fo", ["camera.fov="]),
        ("framearray sheet nothing --side ", []),
        ("framearray init notes.txt --camera ", []),
    ],
)
def test_words_fit_the_place(line, words, folder):
    assert offered("bash", line, folder) == words


def test_broken_files_offer_nothing(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"camera = [\xff")
    (tmp_path / "a.glb").write_bytes(b"glTF\x00")
    (tmp_path / "b.gltf").write_text('{"nodes": 3}')
    assert offered("bash", "framearray sheet job.toml --side ", tmp_path) == []
    for scene in ("a.glb", "b.gltf"):
        assert offered("bash", f"framearray init {scene} --camera ", tmp_path) == []


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_of_a_shell_asks_the_program(shell, capsys, monkeypatch):
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "")
    monkeypatch.setenv("_FRAMEARRAY_COMPLETE", f"source_{shell}")
    result = run(capsys)
    assert result.code == 0
    assert f"_FRAMEARRAY_COMPLETE=complete_{shell}" in result.out
