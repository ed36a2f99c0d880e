"""Measures how far images are from path-traced ones: `python -m bench truth`."""

from collections.abc import Sequence

from bench.core.cases import JOBS, job_named
from bench.core.results import folder, load, save
from bench.speed.speed import log

from . import compare, page, rendered, traced
from .traced import Place

# Camera and light positions of the images, as shares of their paths.
PLACES = ((0.4, 0.5), (0.75, 0.2))


def places_of(name: str, quick: bool) -> list[Place]:
    """The images of a job that are compared."""
    job = job_named(name, quick)
    return [Place(job=name, c=int(c * job.camera.frames), l=int(l * job.light.frames)) for c, l in PLACES]


def run(names: Sequence[str], quick: bool, methods: Sequence[str]) -> None:
    """Trace what is not traced, render by each method, and compare."""
    out = folder(quick)
    for place in (place for name in names or JOBS for place in places_of(name, quick)):
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
    page.write([place for name in JOBS for place in places_of(name, quick)], quick)
