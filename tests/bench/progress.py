"""Measure the time left that renders print, and what the first runs on a machine compile: `python -m bench.progress`.

Writes docs/quality/progress.csv. Others who use the machine change the true time left. So each estimate is also
compared with the processor time that the rest took, at the rate at which the render got processors just before.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import psutil
from support.tables import Section, write_csv

from bench.core.machine import busy
from bench.core.results import DOCS, folder, load, save

JOBS = Path(__file__).resolve().parents[2] / "jobs"
SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
SHARES = (0.05, 0.25, 0.5, 0.75)
BEFORE = 5.0  # seconds before a line in which the render's share of the processors is measured
AT_REST = {"keys": [{"frame": 0, "eye": [0.3, 1.45, -0.7], "target": [1.8, 0.85, 1.2]}], "frames": 60}

# Name, job, options: eight renders of 10 to 40 seconds on two cores.
RENDERS: dict[str, tuple[str, list[str]]] = {
    "smoke, 640 x 480": ("smoke", ["--set", "camera.resolution=[640,480]"]),
    "kitchen, PNG": ("kitchen-small", []),
    "stairs, PNG": ("stairs-small", ["--set", "camera.resolution=[400,300]"]),
    "cabin, PNG": ("cabin-small", ["--set", "camera.resolution=[400,300]"]),
    "kitchen, N_r = 0, 8 hits": ("kitchen-small", ["--set", "reuse.n_r=0", "--set", "samples.hits=8"]),
    "stairs, 144 light positions": ("stairs-small", ["--set", "light.frames=144", "--cameras", "0-7"]),
    "cabin, EXR, 48 light positions": ("cabin", ["--cameras", "0-11"]),
    "kitchen, camera at rest": ("at-rest", []),
}
# The command, with lines closer together than a log would bear. It ends as `framearray` does, at once.
RUN = """
from framearray_cli import __main__ as program
from framearray_cli.cli import screen
screen.SECONDS_BETWEEN_LINES = 0.25
program.main()
"""
# The command, with each compiled kernel and its seconds, those of kernels within it included, in a file.
COUNT = """
import json, sys, time
from numba.core import event
stack, found = [], []
class Events(event.Listener):
    def on_start(self, event):
        stack.append(time.perf_counter())
    def on_end(self, event):
        seconds, function = time.perf_counter() - stack.pop(), event.data["dispatcher"].py_func
        if function.__module__.startswith("framearray_cli"):
            found.append([function.__module__ + "." + function.__name__, seconds, len(stack)])
event.register("numba:compile", Events())
from framearray_cli.cli import main

try:
    main.main(sys.argv[2:])
finally:
    open(sys.argv[1], "w").write(json.dumps(found))
"""


def render(name: str, where: Path, cache: Path) -> dict[str, Any]:
    """Render one of the jobs; return the estimates by share of the time passed, each over the truth."""
    job, options = RENDERS[name]
    file = _at_rest(where) if job == "at-rest" else JOBS / f"{job}.toml"
    output = where / "out"
    shutil.rmtree(output, ignore_errors=True)
    command = [sys.executable, "-c", RUN, "render", str(file), "-o", str(output), *options]
    env = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
    others, begun = busy(), time.monotonic()
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, env=env) as process:
        watched, lines = psutil.Process(process.pid), []
        assert process.stderr is not None
        for line in process.stderr:
            lines.append((time.monotonic() - begun, _cpu(watched), line))
        lines.append((time.monotonic() - begun, lines[-1][1], "end"))
    compiled = next((line for _, _, line in lines if line.startswith("compiled")), "")
    return {"others": others, "compiled": compiled.strip(), "rows": _ratios(lines)}


def _cpu(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _at_rest(where: Path) -> Path:
    """Write the kitchen with a camera that stands still."""
    import tomllib

    import tomli_w

    table = tomllib.loads((JOBS / "kitchen-small.toml").read_text(encoding="utf-8"))
    table["scene"]["file"] = str(JOBS / "scenes" / "kitchen.glb")
    table["camera"] |= AT_REST
    file = where / "at-rest.toml"
    file.write_text(tomli_w.dumps(table), encoding="utf-8")
    return file


def _ratios(lines: list[tuple[float, float, str]]) -> list[dict[str, float]]:
    """Return the first estimate, and those at some shares of the time, each with its ratios to the truth."""
    started = max(wall for wall, _, line in lines if line.startswith(("ambient light", "compiled")))
    end, all_cpu = lines[-1][:2]
    printed = [
        (wall, cpu, sum(float(n) * SECONDS[unit] for n, unit in re.findall(r"([\d.]+) (s|min|h)\b", found.group(1))))
        for wall, cpu, line in lines
        if (found := re.search(r"images, (.*) left", line))
    ]
    rows = []
    for share in (0.0, *SHARES):
        wall, cpu, left = next(row for row in printed if row[0] >= started + share * (end - started))
        before = max(i for i, row in enumerate(lines) if row[0] <= max(wall - BEFORE, started))
        rate = (cpu - lines[before][1]) / max(wall - lines[before][0], 1e-6)
        rows.append({
            "at": (wall - started) / (end - started), "left": left, "true": end - wall, "ratio": left / (end - wall),
            "corrected": left * rate / max(all_cpu - cpu, 1e-6),
        })  # fmt: skip
    return rows


def compiling(where: Path) -> dict[str, Any]:
    """Count what a first `init`, and after it a first `render`, compile; and each of them without the other."""
    commands = {
        "init": ["init", str(JOBS / "scenes" / "kitchen.glb"), "-o", str(where / "first.toml"), "--force"],
        "render": ["render", str(JOBS / "smoke.toml"), "-o", str(where / "smoke"), "--restart"],
    }
    found: dict[str, Any] = {}
    for name, order in {"init": ["init"], "render": ["render"], "render after init": ["init", "render"]}.items():
        cache = where / "cache"
        shutil.rmtree(cache, ignore_errors=True)
        for command in order:
            env = os.environ | {"NUMBA_CACHE_DIR": str(cache)}
            report = where / "kernels.json"
            started = time.perf_counter()
            arguments = [sys.executable, "-c", COUNT, str(report), *commands[command]]
            subprocess.run(arguments, env=env, check=True, capture_output=True)
            seconds = time.perf_counter() - started
        kernels = json.loads(report.read_text(encoding="utf-8"))
        found[name] = {"seconds": seconds, "kernels": kernels}
    return found


def write(results: dict[str, Any], kernels: dict[str, Any]) -> None:
    """Write the tables: time left over the true one, in brackets corrected; and what first commands compile."""
    head = ["Render", "first line", *(f"at {share:.0%}" for share in SHARES)]
    sections = []
    for state, runs in results.items():
        rows = [
            [name, *(f"{row['ratio']:.2f} ({row['corrected']:.2f})" for row in runs[name]["rows"])]
            for name in RENDERS
            if name in runs
        ]
        sections.append(Section(f"Time left: {state}", head, rows))
    rows = []
    for name, run in kernels.items():
        outermost = sum(seconds for _, seconds, depth in run["kernels"] if depth == 0)
        rows.append(
            [name, str(len({kernel for kernel, _, _ in run["kernels"]})), f"{outermost:.0f}", f"{run['seconds']:.0f}"]
        )
    sections.append(Section("Compiling", ["First", "kernels", "compiling, s", "whole command, s"], rows))
    longest = Counter[str]()
    for name, seconds, _ in kernels.get("render", {}).get("kernels", []):
        longest[name] += seconds
    init = {name for name, _, _ in kernels.get("init", {}).get("kernels", [])}
    rows = [
        [name.removeprefix("framearray_cli."), f"{s:.1f}", "yes" if name in init else ""]
        for name, s in longest.most_common()
    ]
    sections.append(Section("Compiling", ["Kernel of a first render", "s", "init too"], rows))
    write_csv(DOCS.tables / "progress.csv", sections)


def main() -> None:
    """Measure what is asked for, and write the tables."""
    parser = argparse.ArgumentParser(prog="bench.progress")
    parser.add_argument("what", nargs="*", default=["warm", "cold", "compiling"])
    parser.add_argument("--only", nargs="*", default=list(RENDERS), help="some of the renders")
    args = parser.parse_args()
    out = folder(False)
    results, kernels = load(out, "progress") or {}, load(out, "compiling") or {}
    with tempfile.TemporaryDirectory() as name:
        where = Path(name)
        for state in [what for what in args.what if what != "compiling"]:
            for render_name in args.only:
                cache = where / "warm" if state == "warm" else where / "cold"
                if state == "cold":
                    shutil.rmtree(cache, ignore_errors=True)
                elif not any(cache.rglob("*.nbi")):
                    render(render_name, where, cache)
                results.setdefault(state, {})[render_name] = render(render_name, where, cache)
                print(state, render_name, json.dumps(results[state][render_name]), flush=True)
                save(out, "progress", results)
        if "compiling" in args.what:
            kernels = compiling(where)
            save(out, "compiling", kernels)
    write(results, kernels)


if __name__ == "__main__":
    main()
