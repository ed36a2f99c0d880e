"""Measures how far images are from path-traced ones: `python -m bench truth`."""

from collections.abc import Sequence

from bench.core.machine import describe
from bench.core.results import folder, load, save
from bench.speed.processes import asked
from bench.speed.speed import log

from . import compare, page, rendered, traced
from .places import known_jobs, places_of


def run(names: Sequence[str], quick: bool, methods: Sequence[str]) -> None:
    """Trace what is not traced, render by each method, and compare."""
    out, jobs = folder(quick), names or known_jobs()
    for place in (place for name in jobs for place in places_of(name, quick)):
        table = load(out, f"truth-{place.name}") or {"traced": traced.trace(place, quick, out), "methods": {}}
        save(out, f"truth-{place.name}", table)
        if "skipped" in table["traced"]:
            log(f"{place.name}: {table['traced']['skipped']}")
            continue
        truth = traced.read(out / table["traced"]["file"])
        table["noise"] = compare.noise(truth)
        shown = {"truth": truth.total.mean(axis=0)}
        direct = rendered.render(place, rendered.DIRECT, quick, out)
        for method in methods or rendered.METHODS:
            image = rendered.render(place, rendered.METHODS[method], quick, out)
            if isinstance(image, str) or isinstance(direct, str):
                table["methods"][method] = {"skipped": image if isinstance(image, str) else direct}
            else:
                table["methods"][method] = compare.distance(image, direct, truth)
                shown[method] = image
            log(f"{place.name}: {method}: {table['methods'][method]}")
        save(out, f"truth-{place.name}", table)
        page.keep(shown, place, out)
    options = ["--quick"] if quick else []
    for name in jobs:
        table = load(out, f"truth-pace-{name}") or {}
        for method in methods or rendered.METHODS:
            table[method] = asked("pace", name, "--method", method, *options)["ms"]
            log(f"{name}: {method}: {table[method]:.3g} ms per image")
        table["machine"] = describe()
        save(out, f"truth-pace-{name}", table)
    page.write([place for name in known_jobs() for place in places_of(name, quick)], quick)
