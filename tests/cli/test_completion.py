"""Completion of the command line, through the protocol of the shells' scripts; rotations as options name them."""

import shlex
from pathlib import Path

import pytest
from support.program import run, start

from framearray_cli.base.errors import JobError
from framearray_cli.cli.options import sum_options

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


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_gets_commands_and_options(shell, tmp_path):
    assert offered(shell, "framearray re", tmp_path) == ["render", "report"]
    assert offered(shell, "framearray render --res", tmp_path) == ["--restart"]


def test_descriptions_are_whole(tmp_path):
    """As the list of commands has them: typer would cut the first line of the help."""
    assert "render\tRender a job into a frame array." in answer("fish", "framearray re", tmp_path)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "framearray export out/small --format ",
            ["nerfstudio", "colmap", "rti", "blender", "olat", "huggingface"],
        ),
        ("framearray export out/small --image-format t", ["tif"]),
        ("framearray schema ", ["job", "path", "manifest", "results"]),
    ],
)
def test_words_fit_the_place(line, words, tmp_path):
    assert offered("bash", line, tmp_path) == words


@pytest.mark.parametrize("shell", SHELLS)
def test_the_script_of_a_shell_asks_the_program(shell, capsys, monkeypatch):
    monkeypatch.setenv("_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION", "")
    monkeypatch.setenv("_FRAMEARRAY_COMPLETE", f"source_{shell}")
    result = run(capsys)
    assert result.code == 0
    assert f"_FRAMEARRAY_COMPLETE=complete_{shell}" in result.out


@pytest.mark.parametrize(
    ("text", "moves", "turn"),
    [("30", False, (30.0, 30.0)), ("0-360", True, (0.0, 360.0)), (" -5.5 ", True, (-5.5, -5.5))],
)
def test_a_rotation(text: str, moves: bool, turn: tuple[float, float]) -> None:
    assert sum_options(Path("sky.exr"), text, None, moves=moves).rotate == turn


@pytest.mark.parametrize(
    ("text", "moves", "message"),
    [
        ("0-360", False, "expected degrees such as 30, got"),
        ("east", True, "or 0-360, got"),
        ("999999", False, "at most"),
    ],
)
def test_a_rotation_that_is_none(text: str, moves: bool, message: str) -> None:
    with pytest.raises(JobError, match=message):
        sum_options(Path("sky.exr"), text, None, moves=moves)


def test_a_rotation_needs_a_map() -> None:
    with pytest.raises(JobError, match="expected --environment next to it"):
        sum_options(None, "30", None)
