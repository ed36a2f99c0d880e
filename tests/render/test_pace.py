"""The time left of a render, whole and in parts, and its events."""

import inspect
import pickle
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from framearray_cli.cli import rendering
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.errortarget import Target
from framearray_cli.render.events import (
    AmbientEstimated,
    Chunks,
    Compiling,
    Event,
    HitsAllotted,
    ImagesWritten,
    Progress,
)
from framearray_cli.render.messages import ambient_lines, target_lines
from framearray_cli.render.pace import Clocks, Expected, Pace, Work, block_work, eye_work, pixel_cost
from framearray_cli.render.parts.queue import ChunkPace, ChunkQueue, Message

# Of a render on two cores that are always busy: processor seconds of the hits of an eye, of a frame and of its images.
EYE, FRAME, IMAGES = 4.0, 1.0, 3.0
HITS, PLANES = 1000.0, 10


@dataclass
class Time:
    """Clocks of a machine with two cores."""

    wall: float = 50.0
    cpu: float = 10.0

    def spend(self, seconds: float, cores: float = 2.0) -> None:
        self.cpu += seconds
        self.wall += seconds / cores

    def now(self) -> Clocks:
        return Clocks(self.wall, self.cpu)


def simulate(pace: Pace, time: Time, n: int, n_r: int, blocks: int = 1, cores: float = 2.0) -> list[tuple[float, Any]]:
    """Render n frames in some blocks; return when the time left was asked for, and the answers."""
    answers = []

    def ask() -> None:
        answers.append((time.wall, pace.left()))

    for _ in range(blocks):
        for c in range(n):
            time.spend(EYE, cores)
            pace.lap(hits=HITS)
            ask()
            ready = [c - n_r] if c >= n_r else []
            for _ in ready if c < n - 1 else range(min(n_r, c) + 1):  # the last eye completes all frames behind it
                time.spend(FRAME, cores)
                pace.lap(planes=PLANES)
                ask()
                for _ in range(PLANES):
                    time.spend(IMAGES / PLANES, cores)
                    pace.written(1, IMAGES / PLANES)
                ask()
    return answers


def worst(answers: list[tuple[float, Any]], end: float) -> float:
    """Return the largest ratio of an answer to the truth, or its inverse, up to 90 % of the time."""
    start = answers[0][0]
    ratios = [left / (end - wall) for wall, left in answers if wall < start + 0.9 * (end - start)]
    return max(max(ratio, 1 / ratio) for ratio in ratios)


def whole(n: int, blocks: int = 1) -> Work:
    return Work(n * HITS * blocks, n * PLANES * blocks, n * PLANES * blocks)


def expected(factor: float = 1.0, busy: float = 2.0) -> Expected:
    return Expected(plane=factor * FRAME / PLANES / (EYE / HITS), image=factor * IMAGES / PLANES, busy=busy)


@pytest.mark.parametrize(("n", "n_r", "blocks"), [(40, 3, 1), (12, 3, 3), (20, 0, 1), (6, 16, 1)])
def test_it_is_right_from_the_first_eye_on(n: int, n_r: int, blocks: int) -> None:
    """First the window fills, without an image; then there is work of all kinds; at the end, images without eyes."""
    time = Time()
    pace = Pace(whole(n, blocks), expected(), time.now)
    assert pace.left() is None
    answers = simulate(pace, time, n, n_r, blocks)
    assert worst(answers, time.wall) < 1.001
    assert pace.left() == pytest.approx(0.0, abs=1e-6)


def test_a_wrong_expectation_is_forgotten_with_the_first_frame() -> None:
    time = Time()
    pace = Pace(whole(40), expected(factor=3.0, busy=8.0), time.now)
    answers = simulate(pace, time, 40, 3)
    assert worst(answers, time.wall) > 1.5
    assert worst([answer for answer in answers if answer[0] > answers[6][0]], time.wall) < 1.1


def test_a_machine_that_others_use_takes_longer() -> None:
    time = Time()
    pace = Pace(whole(40), expected(), time.now)
    assert worst(simulate(pace, time, 40, 3, cores=0.5), time.wall) < 1.1


def test_a_camera_at_rest_is_all_writing() -> None:
    """One eye, one frame, and a thousand images of it."""
    time = Time()
    pace = Pace(Work(HITS, PLANES, 1000), expected(4 / 3), time.now)
    time.spend(EYE)
    pace.lap(hits=HITS)
    time.spend(FRAME)
    pace.lap(planes=PLANES)
    answers = [(time.wall, pace.left())]
    for _ in range(1000):
        time.spend(0.4)
        pace.written(1, 0.3)  # the rest is spent around the threads that write
        answers.append((time.wall, pace.left()))
    assert worst(answers, time.wall) < 1.001


def test_layers_of_few_light_positions_count() -> None:
    """An image per frame, and layers that take eight times as long."""
    time = Time()
    pace = Pace(Work(4 * HITS, 4, 4, 4), Expected(plane=FRAME / (EYE / HITS), image=0.5, busy=2.0), time.now)
    answers = []
    for _ in range(4):
        time.spend(EYE)
        pace.lap(hits=HITS)
    for _ in range(4):
        time.spend(FRAME)
        pace.lap(planes=1)
        for images, seconds in ((1, 0.5), (0, 4.0)):
            time.spend(seconds)
            pace.written(images, seconds)
            answers.append((time.wall, pace.left()))
    assert worst(answers[1:], time.wall) < 1.001
    assert pace.left() == pytest.approx(0.0, abs=1e-6)


def test_without_an_expectation_nothing_is_known_before_all_was_measured() -> None:
    time = Time()
    pace = Pace(whole(10), None, time.now)
    answers = simulate(pace, time, 10, 3)
    known = [left is not None for _, left in answers]
    assert known == [False] * 5 + [True] * (len(known) - 5)
    assert worst(answers[5:], time.wall) < 1.001


def setup_of(n: int, **values: Any) -> Any:
    """A setup of n eyes, as far as the work needs it."""
    usual = {
        "per_pixel": np.full(n, 2.0), "n_pixels": 100, "n_zone": 100, "share": 1.0, "has_layers": True,
        "balance": False, "n_r": 1,
        "indirect": SimpleNamespace(settings=SimpleNamespace(n_rays=1)), "lights": SimpleNamespace(n_lights=3),
        "area": False, "features": (),
        "eyes_for": lambda wanted: sorted({c for j in wanted for c in range(max(j - 1, 0), min(j + 1, n - 1) + 1)}),
        "frames_around": lambda c, reach: range(max(c - reach, 0), min(c + reach, n - 1) + 1),
        "frame_of": lambda eye: eye,
    }  # fmt: skip
    return SimpleNamespace(**usual | values)


def test_the_work_of_a_resumed_render_is_that_of_the_missing_frames() -> None:
    setup = setup_of(6, per_pixel=np.array([2.0, 2, 2, 2, 2, 4]), frames_around=lambda c, reach: range(1))
    assert block_work(setup, range(6)) == Work(1400, 18, 18, 6)
    assert block_work(setup, [4]) == Work(800, 3, 3, 1)
    assert block_work(setup, range(6), still=True) == Work(400, 3, 18, 6)


def test_hits_that_more_frames_share_are_more_work() -> None:
    balance, average = setup_of(9, balance=True), setup_of(9)
    cost = [eye_work(balance, c) / 200 - 1 for c in range(9)]
    assert cost == pytest.approx(np.multiply(cost[0], [1, 1.5, 2, 2, 2, 2, 2, 1.5, 1]))
    assert eye_work(average, 4) == pytest.approx(eye_work(balance, 0)) == pytest.approx(eye_work(setup_of(3), 1))
    assert block_work(balance, range(9)).hits == pytest.approx(sum(eye_work(balance, c) for c in range(9)))


def test_weighing_by_area_is_part_of_composing_and_shared_by_the_planes() -> None:
    plain, area = setup_of(9), setup_of(9, area=True)
    more = [n * (pixel_cost(area, n) - pixel_cost(plain, n)) for n in (1, 10)]
    assert more == pytest.approx([more[0]] * 2) and more[0] > 0


def test_waiting_chunks_take_as_long_as_those_at_work() -> None:
    time = Time()
    pace = ChunkPace(lambda: time.wall)
    left = {0: 40, 10: 40, 20: 40, 30: 20}
    assert pace.left(left) is None
    pace.begin(0, 40)
    pace.begin(10, 40)
    time.wall += 10
    assert pace.left(left) is None
    pace.expect(0, 30.0)  # 40 s for 40 images
    assert pace.left(left) == pytest.approx((30 + 40 + 40 + 20) / 2)
    pace.expect(10, 30.0)
    assert pace.left(left) == pytest.approx((30 + 30 + 40 + 20) / 2)
    time.wall += 10
    assert pace.left(left) == pytest.approx((20 + 20 + 40 + 20) / 2)


def test_the_last_chunk_is_as_long_as_its_worker_says() -> None:
    time = Time()
    pace = ChunkPace(lambda: time.wall)
    pace.begin(0, 40)
    pace.begin(10, 40)
    pace.expect(0, 5.0)
    pace.expect(10, 60.0)
    time.wall += 5
    assert pace.left({10: 30}) == pytest.approx(55.0)


def test_a_chunk_that_is_submitted_again_begins_again() -> None:
    time = Time()
    pace = ChunkPace(lambda: time.wall)
    pace.begin(0, 40)
    pace.expect(0, 5.0)
    pace.begin(0, 20)
    assert pace.left({0: 20}) is None


FIGURES = AmbientEstimated(lowest=0.25, highest=0.5, error=0.0123, paths=4096, notes=("a note", "another"))
TARGET = Target(
    error=0.1, expected=0.2, worst=0.25, radiance=0.5, hits=3.0, frames=(1.5, 4.5), capped=0.25, rays=12
)  # fmt: skip


def sent(event: Event) -> Message:
    """Return a message as it arrives."""
    found: Message = pickle.loads(pickle.dumps((0, event)))
    return found


def test_only_the_first_of_the_messages_that_all_workers_send_is_reported() -> None:
    handlers: list[Any] = []
    crew: Any = SimpleNamespace(listen=lambda topic, handler: handlers.append(handler))
    session: Any = SimpleNamespace(folder=None, prepared=SimpleNamespace(n_lights=4))
    events, target = list[Any](), HitsAllotted(target=TARGET)
    ChunkQueue(crew, {"topic": "t"}, Chunks(each=((0, 1), (2, 3)), more=0.0), session, events.append)
    for _ in range(2):
        for event in (Compiling(), FIGURES, target):
            handlers[0](sent(event))
    for written in (1, 3):
        handlers[0](sent(Progress(written=written, wanted=6, seconds_left=None)))
    assert events == [Compiling(), FIGURES, target, ImagesWritten(images=3), ImagesWritten(images=2)]


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
    assert (f"case events.{kind.__name__}()" in printers) != (kind.__name__ in silent)
