"""From `render --view` to pictures on the screen: `python -m bench live`, from the folder `tests`; of jobs by name.

The clock starts with the process of the command. A browser opens the page as soon as the address is printed, goes to
the four corners of the grid, and notes when each has a picture, drawn: a coarse one of that very place, or the fine
one. Then it waits until the coarse array is complete.
"""

import json
import signal
import statistics
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from support.browsers import browser, shown
from support.program import start

from bench.core.results import ROOT

RUNS = 3
CORNERS = ("Home PageUp", "Home PageDown", "End PageUp", "End PageDown")
# The place of the picture on the screen, in numbers of the array: that of the view, unless a coarse one stands in.
SHOWN = """(() => {
  const { array, view, store, level } = framearray;
  const part = array.parts(view)[0];
  if (level < 1) return null;
  if (array.contents.has(part.stream, view.c, part.l)) return [view.c, part.l];
  const near = array.coarse?.part(part, view.c);
  return near && [near.c, near.stream.axis ? array.coarse.places[near.stream.axis][near.l] : 0];
})()"""


def run(jobs: Sequence[str]) -> None:
    """Measure some jobs, the kitchen if none is named; one run before each has its kernels compiled."""
    with browser() as chromium:
        for name in jobs or ("kitchen",):
            _measure(chromium, name)
            found = [_measure(chromium, name) for _ in range(RUNS)]
            medians = {key: round(statistics.median(one[key] for one in found), 2) for key in found[0]}
            print(
                json.dumps({"job": name, "others": psutil.cpu_percent(1.0), "runs": found, "median": medians}, indent=1)
            )


def _measure(chromium: Any, name: str) -> dict[str, float]:
    """Seconds from the start of the command."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "log")
        with log.open("w") as errors:
            started = time.perf_counter()
            command = ["render", ROOT / "jobs" / f"{name}.toml", "-o", Path(folder, "out"), "--view", "--no-browser"]
            process = start(*command, stderr=errors)
            try:
                url = process.stdout.readline().split()[0] if process.stdout else ""
                found = {"address": time.perf_counter() - started}
                with shown(chromium, url) as page:
                    found["first picture"] = time.perf_counter() - started
                    for keys in CORNERS:
                        for key in keys.split():
                            page.page.keyboard.press(key)
                        _wait_for_corner(page, log)
                    found["every corner"] = time.perf_counter() - started
                    while "coarse array: " not in log.read_text():
                        time.sleep(0.01)
                    found["coarse array"] = time.perf_counter() - started
                    page.get("framearray.refresh()")
                    page.all_loaded()
                    found["coarse array, loaded"] = time.perf_counter() - started
                    near = page.get("[...new Set(framearray.array.coarse.near.values().next().value.at)]")
                    found["positions"] = len(near)
                    found["largest step"] = int(np.diff(near).max())
                    if page.errors:
                        raise RuntimeError(page.errors[0])
            finally:
                process.send_signal(signal.SIGINT)
                process.wait()
        return {key: round(value, 2) for key, value in found.items()}


def _wait_for_corner(page: Any, log: Path) -> None:
    end = time.monotonic() + 120
    while page.get(SHOWN) != page.get("[framearray.view.c, framearray.l]"):
        if time.monotonic() > end:
            raise RuntimeError(f"no picture of {page.place}: {log.read_text()}")
        page.get("framearray.refresh()")
        time.sleep(0.02)
