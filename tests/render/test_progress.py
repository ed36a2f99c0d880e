"""Events of a render, and those that a render in parts passes on from its workers."""

import ast
import inspect
import json
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import framearray_cli.render.parts.chunk as chunk
from framearray_cli.cli import rendering
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.errortarget import Target
from framearray_cli.render.messages import ambient_lines, target_lines
from framearray_cli.render.parts.chunks import Chunks
from framearray_cli.render.parts.progress import PartEvents
from framearray_cli.render.parts.queue import ChunkQueue
from framearray_cli.render.progress import AmbientFigures, RenderEvents, ambient_figures

FIGURES = AmbientFigures(lowest=0.25, highest=0.5, error=0.0123, paths=4096, notes=("a note", "another"))
TARGET = Target(
    error=0.1, expected=0.2, worst=0.25, radiance=0.5, hits=3.0, frames=(1.5, 4.5), capped=0.25, rays=12
)  # fmt: skip


class Kept(PartEvents):
    """Keeps all reported events."""

    def __init__(self) -> None:
        self.seen: list[Any] = []

    def ambient_known(self, figures: AmbientFigures) -> None:
        self.seen.append(figures)

    def target_known(self, target: Target) -> None:
        self.seen.append(target)

    def compiling(self) -> None:
        self.seen.append("compiling")

    def written(self, images: int) -> None:
        self.seen.append(images)


def sent(**message: Any) -> dict[str, Any]:
    """Return a message as it may arrive: on the way through Dask tuples become lists."""
    found: dict[str, Any] = json.loads(json.dumps({"chunk": 0, **message}))
    return found


def test_only_the_first_of_the_messages_that_all_workers_send_is_reported() -> None:
    handlers: list[Any] = []
    crew: Any = SimpleNamespace(listen=lambda topic, handler: handlers.append(handler))
    session: Any = SimpleNamespace(folder=None, prepared=SimpleNamespace(n_lights=4))
    events = Kept()
    ChunkQueue(crew, {"topic": "t"}, Chunks(each=((0, 1), (2, 3)), more=0.0), session, events)
    for _ in range(2):
        handlers[0](sent(compiling=True))
        handlers[0](sent(ambient=asdict(FIGURES)))
        handlers[0](sent(target=asdict(TARGET)))
    handlers[0](sent(left=5))
    handlers[0](sent(left=3))
    assert events.seen == ["compiling", FIGURES, TARGET, 3, 2]
    assert hash(events.seen[1]) and hash(events.seen[2])  # tuples again


def test_lines_of_the_ambient_light() -> None:
    estimate = Ambient(
        intensity=np.array([[0.1, 0.2, 0.3], [1, 2, 3]], np.float32),
        standard_error=np.array([0.01, 0.02]),
        reflectivity=np.ones(3, np.float32),
        paths=8192,
        rays=1,
        notes=("a note",),
    )
    assert ambient_lines(ambient_figures(estimate)) == [
        "ambient light: I_A 0.2 to 2 (standard error at most 2.0%, 8,192 paths)",
        "note: a note",
    ]


def test_an_ambient_light_of_one_position_is_one_number() -> None:
    (line,) = ambient_lines(AmbientFigures(lowest=0.28533, highest=0.28534, error=0.015, paths=2**18, notes=()))
    assert line == "ambient light: I_A 0.2853 (standard error at most 1.5%, 262,144 paths)"


def test_light_from_cells_has_no_ambient_light() -> None:
    assert ambient_lines(AmbientFigures(lowest=0, highest=0, error=0, paths=0, notes=("a note",))) == ["note: a note"]


def test_lines_of_a_target_that_is_not_reached() -> None:
    first, note = target_lines(TARGET)
    assert first == (
        "error: 0.1 of the mean radiance is wanted; 3.0 native hits per pixel (1.5 to 4.5 by frame) "
        "are expected to give 0.2"
    )
    assert "25.0% of all places" in note


@pytest.mark.parametrize(
    ("module", "name", "base"), [(rendering, "RenderingEvents", PartEvents), (chunk, "_Reporter", RenderEvents)]
)
def test_listeners_override_existing_events(module: Any, name: str, base: type) -> None:
    """A method with a wrong name would never be called, and nothing would report it."""
    [found] = [
        node
        for node in ast.walk(ast.parse(inspect.getsource(module)))
        if isinstance(node, ast.ClassDef) and node.name == name
    ]
    methods = {node.name for node in found.body if isinstance(node, ast.FunctionDef)}
    events = {event for event in dir(base) if not event.startswith("_")}
    own = {"send"}  # of the reporter
    assert {method for method in methods if not method.startswith("_")} - own <= events
    assert "written" in methods
    if base is PartEvents:
        silent = {"frame_written"}  # the images of a frame are counted as they are written
        assert events - silent <= methods, "an event that is not shown"
