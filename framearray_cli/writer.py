"""Writes finished frames while the next ones are traced."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Self

import numpy as np

from .arrays import Float32, Images
from .imageattributes import Attributes, frame_attributes
from .images import ImageFormat, write_image, write_layers
from .job import Job
from .paths import Eyes
from .standarderror import square_mean, standard_error
from .stored import Files
from .window import Composed, Layers

# Blocks of images in memory: one is filled while the other is written.
BLOCKS = 2


def image_format(job: Job) -> ImageFormat:
    """How the job wants its images stored."""
    out = job.output
    return ImageFormat(
        format=out.format, compression=out.compression, half=out.half, quality=out.quality, exposure=out.exposure
    )


class ArrayWriter:
    """A few threads that write images; hands out blocks of memory for frames and takes them back when written.

    An error in a thread stops the render at the next frame.

    Attributes:
        errors: (camera, light) -> mean square of the standard error, and mean radiance, of images that tell theirs.
    """

    def __init__(
        self,
        directory: Path,
        files: Files,
        eyes: Eyes,
        resolution: tuple[int, int],
        fps: float,
        image_format: ImageFormat,
        lights: range,
        threads: int,
        written: Callable[[int], None],
    ) -> None:
        """Start the threads.

        Args:
            files: names of images and layers.
            lights: the light positions that frames are composed for.
            written: called with 1 after each image, from any thread.
        """
        self._directory, self._files, self._eyes = directory, files, eyes
        self._resolution, self._fps, self._format = resolution, fps, image_format
        self._written, self._lights = written, lights
        self.errors: dict[tuple[int, int], tuple[float, float]] = {}
        self._pool = ThreadPoolExecutor(threads, thread_name_prefix="write")
        self._free: SimpleQueue[Images | BaseException] = SimpleQueue()
        width, height = resolution
        shape = (len(lights), height, width, 3)
        for _ in range(BLOCKS):
            halves = image_format.composes_halves
            self._free.put(np.empty(shape, np.float16) if halves else np.empty(shape, np.float32))

    def block(self) -> Images:
        """A block to compose a frame into, (n_lights, height, width, 3); waits until one is free.

        Raises:
            OutputError: an earlier frame could not be written.
        """
        block = self._free.get()
        if isinstance(block, BaseException):
            raise block
        return block

    def give_back(self, block: Images) -> None:
        """Take a block back that is not to be written."""
        self._free.put(block)

    def write(self, composed: Composed, cameras: range, block: Images | None = None) -> None:
        """Write a composed frame as that of each of the given cameras.

        Args:
            block: what is free when that is done; the frame's own images if None.
        """
        block = composed.images if block is None else block
        tasks = [self._pool.submit(self._write_image, composed, c, l) for c in cameras for l in self._lights]
        if composed.layers is not None:
            tasks += [self._pool.submit(self._write_layers, composed.layers, c) for c in cameras]
        unfinished = SimpleQueue[None]()  # one entry fewer than tasks: who finds none left is the last
        for _ in tasks[1:]:
            unfinished.put(None)

        def done(task: Future[None]) -> None:
            error = None if task.cancelled() else task.exception()
            if error is not None:
                self._free.put(error)
                return
            try:
                unfinished.get_nowait()
            except Empty:
                self._free.put(block)

        for task in tasks:
            task.add_done_callback(done)

    def _attributes(self, c: int, l: int | None, group: str = "") -> Attributes:
        return frame_attributes(
            world_from_camera=self._eyes.world_from_camera[c],
            fov_deg=self._eyes.fov_deg,
            resolution=self._resolution,
            fps=self._fps,
            c=c,
            l=l,
            group=group,
        )

    def _write_image(self, composed: Composed, c: int, l: int) -> None:
        stored = self._files.images[l]
        path = self._directory / stored.file(c)
        at = l - self._lights.start
        image, more = composed.images[at], {}
        if composed.differences is not None:
            hits = composed.hits.reshape(image.shape[:2])
            more = {
                "error": standard_error(composed.differences[at], hits),
                "difference": composed.differences[at],
            }
            self.errors[c, l] = square_mean(more["error"]), float(image.mean(dtype=np.float64))
        write_image(path, image, self._format, self._attributes(c, stored.light, stored.group), more)
        self._written(1)

    def _write_layers(self, layers: Layers, c: int) -> None:
        path = self._directory / self._files.layers.format(camera=c)
        channels: dict[str, Float32] = {"depth.Z": layers.depth, "samples": layers.samples}
        for name, letters, values in (
            ("obscurance", "RGB", layers.obscurance),
            ("indirect", "RGB", layers.indirect),
            ("reflectivity", "RGB", layers.reflectivity),
            ("normal", "XYZ", layers.normal),
        ):
            channels |= {f"{name}.{letter}": values[..., i] for i, letter in enumerate(letters)}
        write_layers(path, channels, self._attributes(c, None))

    def finish(self) -> None:
        """Wait until everything is written; all blocks are free again.

        Raises:
            OutputError: something could not be written.
        """
        for block in [self.block() for _ in range(BLOCKS)]:
            self._free.put(block)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._pool.shutdown(wait=True, cancel_futures=error is not None)
