"""Wording of each command: `golden/COMMAND.txt` contains command lines and what they print.

A line that begins with "$" is run in a folder with the files below; lines of standard error begin with "! ". Numbers
that differ from run to run are "#". `make golden` writes the files anew; add a case as a line with its "$".
"""

import re
import shlex
import sys
from pathlib import Path

import pytest
from support.boxarrays import plain_manifest, write_array
from support.program import run, write_job
from support.tiny import walk

GOLDEN = Path(__file__).with_name("golden")
FILES: dict[str, bytes] = {
    "binary.toml": b"\x00\x01\xff",
    "broken.toml": b"name = \n",
    "empty.toml": b"",
    "noise": b"glTF\x02\x00\x00\x00",
    "scene.glb": b"glTF\x02\x00\x00\x00",
    "broken.glb": b"glTF" + bytes(200),
    "a b.png": b"",
    "segments.toml": b"[[segments]]\n",
    "manifest.toml": b"fingerprint = ''\ncameras = []\n",
    "path.toml": b"[[segments]]\nframes = 2\ncamera = [0, -1]\n",
    "wrong-path.toml": b"fps = 0\n[[segments]]\nframes = 2\ncamera = 9\nlihgt = 1\n[[segments]]\ncamera = 1\n",
    "points.obj": b"v 0 0 0\nv 1 0 0\n",
    **dict.fromkeys(("scene.xcf", "noname", "a.blend", "a.FBX", "a.pbrt", "a.xml", "a.las", "a.vrm", "a.stp"), b"x"),
    "a.png": b"x",
}
# Numbers that depend on the machine, and lists that depend on the libraries.
VARYING = (
    (r"(?<=\[OPTIONS\]) .*|(?<=No such option: --)(\w+) .*| \(env var: .*?\)", r"\1"),  # by the version of typer
    (r"(?<=No such command ')(\w+)'.*|(?<=unexpected extra argument)\(s\)|(?<=value for ')\[(.*)\]", r"\1\2"),
    (r"\d[\d,.]* ?(B|kB|MB|GB|KiB|MiB|GiB)\b|\d[\d,.]*(?= ?(s|ms|min|h)\b)|(?<=traces )\d+|\d[\d.]*(?=%)", "#"),
    (r"I_A [\d.]+ to [\d.]+", "I_A # to #"),
    (r"known are [\w, ]+;", "known are #;"),
    (re.escape(sys.executable), "python"),
    (r"uv pip install --python python|python -m pip install", "pip install"),  # by the installer of the environment
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Prepare the files of all commands: a job with its scene, a frame array, a movie path, and wrong ones."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    write_job(tmp_path, output={"directory": "rendered"}, camera=walk(4))
    write_array(plain_manifest(tmp_path / "array"))
    (tmp_path / "folder").mkdir()
    for name, content in FILES.items():
        Path(name).write_bytes(content)
    return tmp_path


def printed(capsys: pytest.CaptureFixture[str], folder: Path, line: str) -> list[str]:
    """Run a command line; return its output, its errors and its exit code as lines."""
    result = run(capsys, *shlex.split(line)[1:])
    err = [f"! {text}" for text in result.err.splitlines() if not text.startswith("compil")]  # where kernels are cold
    text = "\n".join([*result.out.splitlines(), *err]).replace(f"{folder}/", "").replace(str(folder), ".")
    for pattern, word in VARYING:
        text = re.sub(pattern, word, text)
    return [line.rstrip() for line in text.splitlines()] + [f"exit code {result.code}"] * (result.code != 0)


@pytest.mark.parametrize("file", sorted(GOLDEN.glob("*.txt")), ids=lambda file: file.stem)
def test_commands_print_what_they_printed(
    file: Path, folder: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest
) -> None:
    known = file.read_text(encoding="utf-8")
    found = []
    for line in re.findall(r"^\$ (.*)$", known, re.MULTILINE):
        found += [f"$ {line}", *printed(capsys, folder, line), ""]
    if request.config.getoption("--golden"):
        file.write_text("\n".join(found), encoding="utf-8")
    else:
        assert known == "\n".join(found)


def test_every_command_has_a_file() -> None:
    from framearray_cli.cli.main import app

    commands = {command.callback.__name__ for command in app.registered_commands if command.callback}
    assert {file.stem for file in GOLDEN.glob("*.txt")} == commands
