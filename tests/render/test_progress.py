"""Events of a render, and those that a render in parts passes on from its workers."""

import inspect
import json
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from framearray_cli.cli import rendering
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.errortarget import Target
from framearray_cli.render.events import AmbientEstimated, Compiling, Event, HitsAllotted, ImagesWritten
from framearray_cli.render.messages import ambient_lines, target_lines
from framearray_cli.render.parts.chunks import Chunks
from framearray_cli.render.parts.queue import ChunkQueue

FIGURES = AmbientEstimated(lowest=0.25, highest=0.5, error=0.0123, paths=4096, notes=("a note", "another"))
TARGET = Target(
    error=0.1, expected=0.2, worst=0.25, radiance=0.5, hits=3.0, frames=(1.5, 4.5), capped=0.25, rays=12
)  # fmt: skip


def sent(**message: Any) -> dict[str, Any]:
    """Return a message as it may arrive: on the way through Dask tuples become lists."""
    found: dict[str, Any] = json.loads(json.dumps({"chunk": 0, **message}))
    return found


def test_only_the_first_of_the_messages_that_all_workers_send_is_reported() -> None:
    handlers: list[Any] = []
    crew: Any = SimpleNamespace(listen=lambda topic, handler: handlers.append(handler))
    session: Any = SimpleNamespace(folder=None, prepared=SimpleNamespace(n_lights=4))
    events: list[Any] = []
    ChunkQueue(crew, {"topic": "t"}, Chunks(each=((0, 1), (2, 3)), more=0.0), session, events.append)
    for _ in range(2):
        handlers[0](sent(compiling=True))
        handlers[0](sent(ambient=asdict(FIGURES)))
        handlers[0](sent(target=asdict(TARGET)))
    handlers[0](sent(left=5))
    handlers[0](sent(left=3))
    target = HitsAllotted(target=TARGET)
    assert events == [Compiling(), FIGURES, target, ImagesWritten(images=3), ImagesWritten(images=2)]
    assert hash(events[1]) and hash(events[2])  # tuples again


def test_lines_of_the_ambient_light() -> None:
    estimate = Ambient(
        intensity=np.array([[0.1, 0.2, 0.3], [1, 2, 3]], np.float32),
        standard_error=np.array([0.01, 0.02]),
        reflectivity=np.ones(3, np.float32),
        paths=8192,
        rays=1,
        notes=("a note",),
    )
    assert ambient_lines(AmbientEstimated.of(estimate)) == [
        "ambient light: I_A 0.2 to 2 (standard error at most 2.0%, 8,192 paths)",
        "note: a note",
    ]


def test_an_ambient_light_of_one_position_is_one_number() -> None:
    (line,) = ambient_lines(AmbientEstimated(lowest=0.28533, highest=0.28534, error=0.015, paths=2**18, notes=()))
    assert line == "ambient light: I_A 0.2853 (standard error at most 1.5%, 262,144 paths)"


def test_light_from_cells_has_no_ambient_light() -> None:
    assert ambient_lines(AmbientEstimated(lowest=0, highest=0, error=0, paths=0, notes=("a note",))) == ["note: a note"]


def test_lines_of_a_target_that_is_not_reached() -> None:
    first, note = target_lines(TARGET)
    assert first == (
        "error: 0.1 of the mean radiance is wanted; 3.0 native hits per pixel (1.5 to 4.5 by frame) "
        "are expected to give 0.2"
    )
    assert "25.0% of all places" in note


@pytest.mark.parametrize("kind", Event.__subclasses__(), ids=lambda kind: kind.__name__)
def test_every_event_is_printed_or_known_to_be_silent(kind: type) -> None:
    silent = {"Started", "Progress", "FrameWritten", "Finished"}  # images of a frame are counted as they are written
    printers = inspect.getsource(rendering.RenderPrinter.report) + inspect.getsource(rendering.event_lines)
    assert (f"case {kind.__name__}()" in printers) != (kind.__name__ in silent)
