"""The command: `python -m distribution`, from the folder `tests`: build the wheel, install it elsewhere, and use it.

The wheel has machine code for this processor, and the commands compile nothing. What is tested has only what a user
installs, and no pytest.
"""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import venv
import zipfile
from pathlib import Path

from framearray_cli.engine.kernels.cache import SUFFIX
from framearray_cli.engine.kernels.processor import slow_gathers

from .ready import DIST, ROOT, build, compile_for, levels_here

# One of every kind of command, on the smallest job.
COMMANDS = (
    "framearray --version",
    "framearray doctor",
    "framearray check jobs/smoke.toml",
    "framearray render jobs/smoke.toml --output array",
    "framearray verify array",
    "framearray assemble array diagonal -o movie.gif",
    "framearray sheet array -o sheet.png",
    "framearray view array --export page",
    "framearray export array -f nerfstudio -o nerf",
)
RELATIVE = re.compile(r"\]\((?!https?://|#)([^)]*)\)")


def main() -> None:
    """Build both distributions, and run the commands in an empty environment that has the wheel."""
    shutil.rmtree(DIST, ignore_errors=True)
    build([], compile_for(levels_here()[:1], ("slow" if slow_gathers() else "fast",)))
    [wheel], [source] = DIST.glob("*.whl"), DIST.glob("*.tar.gz")
    _look_into(wheel, source)
    with tempfile.TemporaryDirectory(prefix="framearray-") as name:
        folder = Path(name)
        _use(wheel, folder)
    print(f"{wheel.name} installs and renders")


def _look_into(wheel: Path, source: Path) -> None:
    """The wheel, made from the source distribution, has every file of the packages, and no link that leads nowhere."""
    known = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout.splitlines()
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        [metadata] = [name for name in names if name.endswith(".dist-info/METADATA")]
        text = archive.read(metadata).decode()
    packages = {name.partition("/")[0] for name in names if name.endswith("/__init__.py")}
    missing = {name for name in known if name.partition("/")[0] in packages} - names
    assert not missing, f"not in the wheel: {sorted(missing)}"
    assert not (found := RELATIVE.findall(text)), f"links that lead nowhere on a package index: {found}"
    with tarfile.open(source) as archive:
        packed = {name.partition("/")[2] for name in archive.getnames()}
    assert not (missing := set(known) - packed), f"not in the source distribution: {sorted(missing)}"


def _use(wheel: Path, folder: Path) -> None:
    """Install a wheel in an empty environment with an empty home, and run the commands."""
    venv.create(folder / "env", with_pip=True)
    python = next(p for p in (folder / "env/bin/python", folder / "env/Scripts/python.exe") if p.exists())
    shutil.copytree(ROOT / "jobs", folder / "jobs")
    (folder / "home").mkdir()
    env = {**os.environ, "HOME": str(folder / "home"), "PATH": f"{python.parent}{os.pathsep}{os.environ['PATH']}"}
    for name in ("PYTHONPATH", "XDG_CACHE_HOME", "VIRTUAL_ENV"):
        env.pop(name, None)
    _run([str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(wheel)], folder, env)
    place = "import framearray_cli, pathlib; print(pathlib.Path(framearray_cli.__file__).parents[1])"
    found = subprocess.run([str(python), "-c", place], cwd=folder, env=env, check=True, capture_output=True, text=True)
    assert Path(found.stdout.strip()).is_relative_to(folder.resolve()), found.stdout
    for command in COMMANDS:
        _run(command.split(), folder, env)
    compiled = [file.name for file in (folder / "home").rglob(f"*{SUFFIX}")]
    assert not compiled, f"compiled in spite of ready-made machine code: {compiled}"


def _run(command: list[str], folder: Path, env: dict[str, str] | None = None) -> None:
    """Run a command; show what it prints only if it fails."""
    begin = time.monotonic()
    found = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)
    print(f"{time.monotonic() - begin:6.1f} s  {' '.join(command[:6])}", flush=True)
    if found.returncode:
        print(found.stdout, found.stderr, sep="\n")
        sys.exit(f"exit code {found.returncode}")


if __name__ == "__main__":
    main()
