"""Write finished frames while the next ones are traced."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, Self

import numpy as np

from framearray_cli.array import cryptomatte
from framearray_cli.array.exr import Attribute, Attributes, encode_chunked_exr, frame_attributes, is_plain
from framearray_cli.array.images import (
    COLOUR_ID,
    DATA,
    SCENE_LIGHT,
    ImageFormat,
    counted_part,
    pixel_shares,
    write_image,
    write_layers,
)
from framearray_cli.base.arrays import Float32, Image, Images
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest, reason, write_bytes
from framearray_cli.base.threads import TaskPool, take
from framearray_cli.engine.features.aov import AOVS, Matte
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.dwa import LINES, dwa_chunks
from framearray_cli.engine.images.standard_error import square_mean, standard_error
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Eyes, Lights, Plane

from .names import ArrayNames, array_names
from .prepare import Prepared


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroupSum:
    """A picture: the sum of some image planes, and of one that I_A multiplies.

    Attributes:
        planes: the direct light of each group, and the background if there is one.
        indirect: the plane that holds R W.
        ambient: (3,) I_A of all groups together.
    """

    planes: tuple[int, ...]
    indirect: int
    ambient: Float32


def group_sums(lights: Lights, intensity: Float32) -> tuple[GroupSum, ...]:
    """Return the pictures along all light axes at once, one for each position of the longest; empty without groups.

    Args:
        intensity: (n_planes, 3) I_A of each plane.
    """
    if not lights.groups:
        return ()
    indirect = lights.planes.index(Plane.INDIRECT)
    always = tuple(p for p, plane in enumerate(lights.planes) if plane is Plane.BACKGROUND)
    sums = []
    for share in np.linspace(0, 1, max(len(group.positions) for group in lights.groups)):
        shining = [group.positions[round((len(group.positions) - 1) * float(share))] for group in lights.groups]
        dark = intensity[indirect]  # no source shines at that plane
        ambient = dark + sum((intensity[p] - dark for p in shining), np.zeros(3, np.float32))
        sums.append(GroupSum(planes=(*shining, *always), indirect=indirect, ambient=np.asarray(ambient, np.float32)))
    return tuple(sums)


def sum_shares(
    images: Images, sums: Sequence[GroupSum], image_format: ImageFormat, alpha: Float32 | None = None
) -> list[tuple[float, float]]:
    """Return the shares of clipped and of black pixels of some pictures; see `pixel_shares`.

    Args:
        images: (n_planes, h, w, 3).
        alpha: (h, w), see `pixel_shares`.
    """
    if not sums:
        return []
    parts, covered = counted_part(images), None if alpha is None else counted_part(alpha[..., None])[..., 0]
    found = []
    for one in sums:
        total = parts[one.indirect].astype(np.float32) * one.ambient
        for p in one.planes:
            total += parts[p]
        found.append(pixel_shares(total, image_format, covered))
    return found


# The names of a layer's components, by layer; of others by their number.
LETTERS = {"depth": "Z", "normal": "XYZ", "position": "XYZ", "uv": "UV"}
BY_NUMBER = {2: "XY", 3: "RGB"}


def layer_channels(layers: Mapping[str, Any]) -> dict[str, Float32]:
    """Return the channels of all layers, name -> (h, w), mattes last."""
    channels: dict[str, Float32] = {}
    for name, values in layers.items():
        if isinstance(values, Matte):
            continue
        if values.ndim == 2:
            channels[f"{name}.{LETTERS[name]}" if name in LETTERS else name] = values
        else:
            letters = LETTERS.get(name, BY_NUMBER[values.shape[-1]])
            channels |= {f"{name}.{letter}": values[..., i] for i, letter in enumerate(letters)}
    for kind, matte in _mattes(layers).items():
        channels |= cryptomatte.channels_of(cryptomatte.LAYERS[kind], matte.names, matte.number, matte.coverage)
    return channels


def layer_attributes(layers: Mapping[str, Any]) -> Mapping[str, Attribute]:
    """Return what the header says of the channels; nothing of those that every array has."""
    if not layers.keys() & AOVS:
        return {}
    found: dict[str, Attribute] = {COLOUR_ID: DATA}
    for kind, matte in _mattes(layers).items():
        found |= cryptomatte.attributes_of(cryptomatte.LAYERS[kind], matte.names)
    return found


def _mattes(layers: Mapping[str, Any]) -> dict[str, Matte]:
    return {kind: matte for kind, matte in layers.items() if isinstance(matte, Matte)}


# Blocks of images in memory: one is filled while the other is written.
BLOCKS = 2


def image_format(job: Job) -> ImageFormat:
    """Return the image format of a job."""
    out = job.output
    return ImageFormat(
        format=out.format, compression=out.compression, half=out.half, quality=out.quality, exposure=out.exposure
    )


def write_stored(
    path: Path,
    image: Images,
    image_format: ImageFormat,
    attributes: Attributes,
    more: Mapping[str, Image],
    alpha: Float32 | None,
) -> None:
    """Write an image of an array as `write_image` does, but with the faster encoder of DWA where it can."""
    if has_own_dwa(image, image_format, attributes, alpha) and not more:
        write_bytes(path, encode_dwa_exr(image, image_format.compression, attributes))
    else:
        write_image(path, image, image_format, attributes, more, alpha)


def has_own_dwa(image: Images, image_format: ImageFormat, attributes: Attributes, alpha: Float32 | None) -> bool:
    """Return True if our own encoder of DWA writes an image."""
    dwa = image_format.format == "exr" and image_format.compression in LINES and is_plain(attributes)
    return dwa and alpha is None and image.dtype == np.float16


def encode_dwa_exr(image: Images, compression: str, attributes: Attributes) -> bytes:
    """Encode an image (h, w, 3) of finite halves as a file of EXR, with our own encoder.

    Args:
        compression: "dwaa" or "dwab".
        attributes: for which `is_plain`.
    """
    lines, size = LINES[compression], (image.shape[1], image.shape[0])
    return encode_chunked_exr(dwa_chunks(image, lines), lines, size, list("RGB"), attributes, compression)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayTarget:
    """Destination of an array's images, and the metadata of their files.

    Attributes:
        directory: output folder.
        names: file names of images and layers.
        resolution: width, height, pixels.
        sums: pictures that the images written together add up to; empty without groups of sources.
    """

    directory: Path
    names: ArrayNames
    format: ImageFormat
    eyes: Eyes
    resolution: tuple[int, int]
    fps: float
    sums: tuple[GroupSum, ...] = ()

    def attributes(self, c: int, l: int | None = None, group: str = "") -> Attributes:
        """Return the metadata of a file of camera c, at light position l of a group if it belongs to one."""
        return frame_attributes(
            world_from_camera=self.eyes.world_from_camera[c],
            lens=self.eyes.lenses[c],
            resolution=self.resolution,
            fps=self.fps,
            c=c,
            l=l,
            group=group,
        )


def array_target(prepared: Prepared) -> ArrayTarget:
    """Return the target of a job's images."""
    job = prepared.job
    return ArrayTarget(
        directory=job.output.directory,
        names=array_names(job, prepared.n_cameras, prepared.lights),
        format=image_format(job),
        eyes=prepared.eyes,
        resolution=job.camera.resolution,
        fps=job.output.fps,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FinishedFiles:
    """The files of a camera at some image planes, all on disk.

    Attributes:
        eye: whose frame it is, which differs from c if the camera never moves.
        hits: mean hits per pixel.
        bad, first_bad: see `Composed`.
        files: name -> size and checksum of every file, layers included.
        errors: plane -> (mean square of the standard error, mean radiance), of images that estimate theirs.
        shares: of clipped and of black pixels, of each picture; empty where these images are parts of pictures.
    """

    c: int
    eye: int
    planes: range
    hits: float
    bad: int
    first_bad: tuple[int, int] | None
    files: Mapping[str, tuple[int, str]]
    errors: Mapping[int, tuple[float, float]]
    shares: Sequence[tuple[float, float]]


class Countdown:
    """Calls a function when the last of n tasks is done, in the thread of that task."""

    def __init__(self, n: int, call: Callable[[], None]) -> None:
        self._left, self._call, self._lock = n, call, threading.Lock()

    def count_down(self) -> None:
        with self._lock:
            self._left -= 1
            done = self._left == 0
        if done:
            self._call()


class ArrayWriter:
    """Threads that write images; lends blocks of memory for frames and reclaims them when written.

    An error in a thread stops the render at the next frame.
    """

    def __init__(
        self,
        target: ArrayTarget,
        planes: range,
        threads: int,
        written: Callable[[float, float], None] = lambda images, seconds: None,
        finished: Callable[[FinishedFiles], None] = lambda done: None,
        rows: int | None = None,
    ) -> None:
        """Start the threads.

        Args:
            planes: the image planes that frames are composed for.
            written: called after each file, with the number of images in it, 1 or 0, or the share of one, and the
                processor seconds that it took, from any thread.
            finished: called when all files of a camera are on disk, from any thread.
            rows: of the blocks; None: of whole images.
        """
        self._target, self._planes = target, planes
        self._written, self._finished = written, finished
        self._pool = TaskPool(threads, thread_name_prefix="write")
        self._free: SimpleQueue[Images | BaseException] = SimpleQueue()
        width, height = target.resolution
        shape = (len(planes), rows or height, width, 3)
        for _ in range(BLOCKS):
            halves = target.format.composes_halves
            self._free.put(np.empty(shape, np.float16) if halves else np.empty(shape, np.float32))

    def block(self) -> Images:
        """Return a block to compose a frame into, (n_planes, height, width, 3); waits until one is free.

        Raises:
            OutputError: an earlier frame could not be written.
        """
        block = take(self._free)
        if isinstance(block, BaseException):
            raise block
        return block

    def write(self, composed: Composed, cameras: Sequence[int], block: Images | None = None) -> None:
        """Write a composed frame as the frame of each of the given cameras.

        Args:
            block: to reclaim afterwards; the frame's own images if None.
        """
        block = composed.images if block is None else block
        unfinished = Countdown(len(cameras), lambda: self._free.put(block))
        for c in cameras:
            self._write_camera(composed, c, unfinished)

    def _write_camera(self, composed: Composed, c: int, unfinished: "Countdown") -> None:
        """Write all files of a camera, then report them as finished."""
        errors: dict[int, tuple[float, float]] = {}
        shares: dict[int, tuple[float, float]] = {}
        write = partial(self._write_image, composed, c, errors=errors, shares=shares)
        files: dict[str, tuple[int, str]] = {}

        def finish() -> None:
            target = self._target
            found = sum_shares(composed.images, target.sums, target.format, composed.alpha) or list(shares.values())
            self._finished(
                FinishedFiles(
                    c=c,
                    eye=composed.c,
                    planes=self._planes,
                    hits=float(composed.hits.mean()),
                    bad=composed.bad,
                    first_bad=composed.first_bad,
                    files=files,
                    errors=errors,
                    shares=found,
                )
            )
            unfinished.count_down()

        tasks: list[tuple[Callable[[], None], float]] = [
            (partial(self._note, files, partial(write, p)), 1) for p in self._planes
        ]
        if composed.layers:
            tasks.append((partial(self._note, files, partial(self._write_layers, composed.layers, c)), 0))
        self._submit(tasks, finish)

    def _submit(self, tasks: Sequence[tuple[Callable[[], None], float]], finish: Callable[[], None]) -> None:
        """Have some tasks done, each of a number of images, and call `finish` after the last of them."""
        left = Countdown(len(tasks), finish)

        def run(task: Callable[[], None], images: float) -> None:
            started = time.thread_time()
            task()
            self._written(images, time.thread_time() - started)
            left.count_down()

        for future in [self._pool.submit(run, *task) for task in tasks]:
            future.add_done_callback(self._pass_error)

    def _note(self, files: dict[str, tuple[int, str]], write: Callable[[], Path]) -> None:
        """Write a file, and note its size and checksum."""
        path = write()
        try:
            files[path.name] = digest(path)
        except OSError as error:
            raise OutputError(f"{path}: cannot be read back: {reason(error)}") from error

    def _pass_error(self, future: Future[None]) -> None:
        error = None if future.cancelled() else future.exception()
        if error is not None:
            self._free.put(error)

    def _write_image(
        self,
        composed: Composed,
        c: int,
        p: int,
        errors: dict[int, tuple[float, float]],
        shares: dict[int, tuple[float, float]],
    ) -> Path:
        target = self._target
        stored = target.names.images[p]
        path = target.directory / stored.file(c)
        at = p - self._planes.start
        image, more = composed.images[at], {}
        if composed.differences is not None:
            hits = composed.hits.reshape(image.shape[:2])
            more = {
                "error": standard_error(composed.differences[at], hits),
                "difference": composed.differences[at],
            }
            errors[p] = square_mean(more["error"]), float(image.mean(dtype=np.float64))
        if not stored.group:
            shares[p] = pixel_shares(image, target.format, composed.alpha)
        write_stored(path, image, target.format, self._attributes(composed, c, p), more, composed.alpha)
        return path

    def _attributes(self, composed: Composed, c: int, p: int) -> Attributes:
        """Return the metadata of the file of a plane."""
        stored, target = self._target.names.images[p], self._target
        found = target.attributes(c, stored.light, stored.group)
        own = composed.alpha is not None and target.format.format == "exr"
        return {**found, COLOUR_ID: SCENE_LIGHT} if own else found

    def _write_layers(self, layers: Mapping[str, Any], c: int) -> Path:
        path = self._target.directory / self._target.names.layers_file(c)
        write_layers(path, layer_channels(layers), {**self._target.attributes(c), **layer_attributes(layers)})
        return path

    def finish(self) -> None:
        """Wait until all is written and all blocks are free.

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
        self._pool.close(drop=error is not None)
