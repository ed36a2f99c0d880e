"""Files of an array, and threads that code and write its frames while the next ones are traced."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path
from queue import SimpleQueue
from secrets import token_hex
from typing import Any, NamedTuple, Self

import numpy as np

from framearray_cli.array import cryptomatte
from framearray_cli.array.exr import Attribute, Attributes, frame_attributes
from framearray_cli.array.images import (
    COLOUR_ID,
    DATA,
    POSITION_ORIGIN,
    SCENE_LIGHT,
    ImageFormat,
    mean_shares,
    pixel_shares,
    write_layers,
)
from framearray_cli.array.manifest import BACKGROUND, camera_pattern, file_name, file_patterns
from framearray_cli.array.record import Entry
from framearray_cli.array.stripfiles import StripFile, remove_strips, strip_file, write_strip
from framearray_cli.base.arrays import Float32, Images
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import digest, reason
from framearray_cli.base.threads import TaskPool, take
from framearray_cli.base.units import agree, counted
from framearray_cli.engine.features.aov import AOVS, Matte
from framearray_cli.engine.images.compose import Composed
from framearray_cli.engine.images.standard_error import square_mean, standard_error
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.paths import Eyes, Lights, Plane

from .prepare import Prepared
from .rows import (
    ALPHA,
    NUMBERS,
    Part,
    Rows,
    Strips,
    image_format,
    join_layer,
    join_rows,
    layers_of,
    stored_rows,
    write_rows,
)

# The names of a layer's components, by layer; of others by their number.
LETTERS = {"depth": "Z", "normal": "XYZ", "position": "XYZ", "uv": "UV"}
BY_NUMBER = {2: "XY", 3: "RGB"}


def layer_channels(layers: Mapping[str, Any]) -> dict[str, Float32]:
    """Return the channels of all layers, name -> (h, w), mattes last."""
    channels, mattes = dict[str, Float32](), dict[str, Float32]()
    for name, values in layers.items():
        if isinstance(values, Matte):
            mattes |= cryptomatte.channels_of(cryptomatte.LAYERS[name], values.names, values.number, values.coverage)
        elif values.ndim == 2:
            channels[f"{name}.{LETTERS[name]}" if name in LETTERS else name] = values
        else:
            letters = LETTERS.get(name, BY_NUMBER[values.shape[-1]])
            channels |= {f"{name}.{letter}": values[..., i] for i, letter in enumerate(letters)}
    return channels | mattes


def _layer_attributes(layers: Mapping[str, Any], origin: str) -> Mapping[str, Attribute]:
    """Return what the header says of the channels; nothing of those that every array has.

    Args:
        origin: of positions; "" if it is 0, or no layer has positions.
    """
    if not layers.keys() & AOVS:
        return {}
    found: dict[str, Attribute] = {COLOUR_ID: DATA}
    if origin:
        found[POSITION_ORIGIN] = origin
    for name, values in layers.items():
        if isinstance(values, Matte):
            found |= cryptomatte.attributes_of(cryptomatte.LAYERS[name], values.names)
    return found


def noise_of(composed: Composed, p: int) -> dict[str, Float32]:
    """Return what halves of the hits tell of the noise of image p, by the name in its file; nothing without halves."""
    if composed.differences is None:
        return {}
    difference = composed.differences[p]
    return {"error": standard_error(difference, composed.hits.reshape(difference.shape[:2])), "difference": difference}


AMBIENT = "ambient"  # next to the groups: R W
_UNLIT = {Plane.INDIRECT: AMBIENT, Plane.BACKGROUND: BACKGROUND}


class PlaneFiles(NamedTuple):
    """Files of one image plane, one per camera.

    Attributes:
        pattern: for `str.format` with {camera} and {light}.
        light: position along the axis that {light} counts; None for planes that no source lights.
        group: "" in an array without groups.
    """

    pattern: str
    light: int | None
    group: str

    def file(self, c: int) -> str:
        """Return the file name of camera c."""
        return file_name(self.pattern, c, self.light or 0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ArrayNames:
    """File names of an array.

    Attributes:
        images: files of each image plane.
        layers: pattern of the layers.
    """

    images: tuple[PlaneFiles, ...]
    layers: str

    def pattern(self, group: str) -> str:
        """Return the pattern of a group, AMBIENT, BACKGROUND, or "" (all images); empty if there is none."""
        return next((image.pattern for image in self.images if image.group == group), "")


def array_names(job: Job, n_cameras: int, lights: Lights) -> ArrayNames:
    """Return the file names of a job."""
    name, extension, images = job.name, job.output.format, list[PlaneFiles]()
    groups = {group.name: len(group.positions) for group in lights.groups} or {"": lights.n}
    for group, n in groups.items():
        pattern, _ = file_patterns(f"{name}.{group}" if group else name, n_cameras, n, extension)
        images += [PlaneFiles(pattern, l, group) for l in range(n)]
    for group in map(_UNLIT.__getitem__, lights.unlit):
        images.append(PlaneFiles(camera_pattern(name, group, n_cameras, extension), None, group))
    return ArrayNames(images=tuple(images), layers=camera_pattern(name, "layers", n_cameras, "exr"))


# Blocks of images in memory: one is filled while the other is written.
BLOCKS = 2
CODING = 0.9  # of the work of writing an image, about; the rest joins what was coded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArrayTarget:
    """Destination of an array's images, and the metadata of their files.

    Attributes:
        directory: output folder.
        names: file names of images and layers.
        resolution: width, height, pixels.
        origin: of positions in layers, as text: "500000 4600000 0"; "" if it is 0, or no layer has positions.
    """

    directory: Path
    names: ArrayNames
    format: ImageFormat
    eyes: Eyes
    resolution: tuple[int, int]
    fps: float
    origin: str

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

    def attributes_of_layers(self, c: int, layers: Mapping[str, Any]) -> Attributes:
        """Return the metadata of the layers of camera c."""
        return {**self.attributes(c), **_layer_attributes(layers, self.origin)}


def array_target(prepared: Prepared) -> ArrayTarget:
    """Return the target of a job's images."""
    job = prepared.job
    origin = prepared.scene.position_origin if job.output.position else np.zeros(3)
    return ArrayTarget(
        directory=job.output.directory,
        names=array_names(job, prepared.n_cameras, prepared.lights),
        format=image_format(job),
        eyes=prepared.eyes,
        resolution=job.camera.resolution,
        fps=job.output.fps,
        origin=" ".join(f"{value:.9g}" for value in origin) if origin.any() else "",
    )


class Countdown:
    """Calls a function when the last of n tasks is done, in the thread of that task."""

    def __init__(self, n: int, call: Callable[[], None]) -> None:
        self._left, self._lock = n, threading.Lock()
        self._calls = [call]  # forgotten once it is called, with the memory that it refers to

    def count_down(self) -> None:
        with self._lock:
            self._left -= 1
            done = self._left == 0
        if done:
            self._calls.pop()()


@dataclass(slots=True, kw_only=True, eq=False)
class _Frame:
    """The rows of a frame that are composed so far, slice by slice from top to bottom.

    Attributes:
        slices: what is stored of each; `facts`: what the record says of it; `rows`: its rows.
        files: of slices that wait outside of memory.
        left: counts down what is still to be coded.
        last: the last slice, in a block that is free when the frame is written; `cameras`: that show the frame.
    """

    left: Countdown
    slices: list[Part] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)
    facts: list[dict[str, Any]] = field(default_factory=list)
    rows: list[range] = field(default_factory=list)
    last: tuple[Composed, Images] = field(init=False)
    cameras: Sequence[int] = ()


def _digest(path: Path) -> tuple[int, str]:
    try:
        return digest(path)
    except OSError as error:
        raise OutputError(f"{path}: cannot be read back: {reason(error)}") from error


class ArrayWriter:
    """Threads that code frames slice by slice, and write them once all of their slices and strips are there.

    Lends blocks of memory for slices and reclaims them when coded, the last one when the frame is written. An
    error in a thread stops the render at the next slice.
    """

    def __init__(
        self,
        target: ArrayTarget,
        planes: range,
        threads: int,
        written: Callable[[float, float], None] = lambda images, seconds: None,
        stored: Callable[[], object] = lambda: None,
        finished: Callable[[Entry], None] = lambda entry: None,
        strips: Strips | None = None,
        slices: Sequence[range] = (),
        *,
        filed: bool = False,
    ) -> None:
        """Start the threads.

        Args:
            planes: the image planes that frames are composed for.
            written: called after each file and whatever was coded, with the number of images, 1 or 0, or the share of
                one, and the processor seconds that it took, from any thread.
            stored: called after each image that is on disk, from any thread.
            finished: called with the record of a camera whose files are all on disk, from any thread.
            strips: of which one is written; None: whole frames.
            slices: the rows of this strip that are composed together; empty: all.
            filed: slices wait in files, as their rows are not coded yet.
        """
        width, height = target.resolution
        self._target, self._planes = target, planes
        self._strips = strips or Strips(all=(range(height),), directory=target.directory)
        self._slices, self._filed = slices or [self._strips.rows], filed
        self._frames = dict[int, _Frame]()
        self._written, self._stored, self._finished = written, stored, finished
        self._pool = TaskPool(threads, thread_name_prefix="write")
        self._free: SimpleQueue[Images | BaseException] = SimpleQueue()
        shape = (len(planes), max(len(rows) for rows in self._slices), width, 3)
        for _ in range(BLOCKS):
            halves = target.format.composes_halves
            self._free.put(np.empty(shape, np.float16) if halves else np.empty(shape, np.float32))

    def block(self) -> Images:
        """Return a block to compose a slice into, (n_planes, most rows of one, width, 3); waits until one is free.

        Raises:
            OutputError: an earlier frame could not be written.
        """
        block = take(self._free)
        if isinstance(block, BaseException):
            raise block
        return block

    def write(self, composed: Composed, cameras: Sequence[int], block: Images) -> None:
        """Code the next slice of a frame, and after the last one write it as the frame of each of the given cameras.

        Args:
            block: to reclaim afterwards.
        """
        c = composed.c
        if c not in self._frames:
            self._frames[c] = _Frame(left=Countdown(len(self._slices), lambda: self._write_frame(frame)))
        frame, arrays, lock = self._frames[c], layers_of(composed), threading.Lock()
        number, facts = len(frame.slices), dict[str, Any]()
        frame.slices.append(arrays)
        frame.rows.append(composed.rows)
        frame.facts.append(facts)
        is_last = composed.rows.stop == self._strips.rows.stop
        if is_last:
            frame.last, frame.cameras = (composed, block), cameras if self._strips.is_last else [c]
            del self._frames[c]
        height = self._target.resolution[1]
        shown = {"whole": len(composed.rows) == height, "keep": is_last or self._filed}

        def store(p: int) -> None:
            image, attributes = composed.images[p - self._planes.start], self._attributes(composed, c, p)
            if composed.differences is None:
                found = stored_rows(image, self._target.format, attributes, composed.alpha, **shown)
            else:
                found = {NUMBERS: image}
            with lock:
                arrays.update({f"{name}-{p}": array for name, array in found.items()})

        def finish() -> None:
            facts.update(self._facts(composed))
            if not is_last:
                if self._filed:
                    path = strip_file(self._target.directory, token_hex(8), c, composed.rows)
                    write_strip(path, [], arrays.items())
                    frame.slices[number] = StripFile(path)
                    frame.files.append(path)
                self._free.put(block)
            frame.left.count_down()

        share = CODING * len(composed.rows) / height
        self._submit([(partial(store, p), share) for p in self._planes], finish)

    def _write_frame(self, frame: _Frame) -> None:
        """Write the rows of a strip, or a whole frame for each camera that shows it."""
        strips, composed = self._strips, frame.last[0]
        if not strips.is_last:
            kept = ((name, np.concatenate([part[name] for part in frame.slices])) for name in layers_of(composed))
            images = ((f"{kind}-{p}", array) for p in self._planes for kind, array in self._rows(frame, p).items())
            write_strip(strips.file(composed.c, strips.now), frame.facts, chain(kept, images))
            self._release(frame)
            return
        before = [StripFile(strips.file(composed.c, k)) for k in range(strips.now)]
        frame.slices[:0], frame.rows[:0] = before, strips.all[: strips.now]
        frame.facts[:0] = [facts for file in before for facts in file.facts]
        unfinished = Countdown(len(frame.cameras), partial(self._release, frame))
        alpha = None if composed.alpha is None else join_layer(ALPHA, composed.alpha, frame.slices)
        layers = {name: join_layer(name, values, frame.slices) for name, values in composed.layers.items()}
        for c in frame.cameras:
            self._write_camera(frame, c, layers, alpha, unfinished)

    def _release(self, frame: _Frame) -> None:
        """Free what a frame holds that is written."""
        for path in frame.files:
            path.unlink(missing_ok=True)
        self._free.put(frame.last[1])

    def _rows(self, frame: _Frame, p: int) -> Rows:
        return join_rows(frame.slices, frame.rows, self._target.resolution[0], self._target.format.compression, p)

    def _write_camera(
        self, frame: _Frame, c: int, layers: Mapping[str, Any], alpha: Float32 | None, unfinished: Countdown
    ) -> None:
        """Write all files of a camera, then report them as finished."""
        strips, files, errors = self._strips, dict[str, tuple[int, str]](), dict[int, tuple[float, float]]()

        def write(p: int) -> None:
            path = self._write_image(frame, c, alpha, errors, p)
            files[path.name] = _digest(path)
            self._stored()

        def write_together() -> None:
            path = self._target.directory / file_name(self._target.names.layers, c)
            write_layers(
                path,
                layer_channels(layers),
                self._target.attributes_of_layers(c, layers),
            )
            files[path.name] = _digest(path)

        def finish() -> None:
            self._finished(self._entry(frame, c, files, errors))
            if strips.now and not strips.still:  # other runs may need them
                remove_strips(strips.directory, [c])
            unfinished.count_down()

        tasks = [(partial(write, p), 1 - CODING) for p in self._planes]
        self._submit([*tasks, *([(write_together, 0.0)] if layers else [])], finish)

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

    def _pass_error(self, future: Future[None]) -> None:
        error = None if future.cancelled() else future.exception()
        if error is not None:
            self._free.put(error)

    def _write_image(
        self, frame: _Frame, c: int, alpha: Float32 | None, errors: dict[int, tuple[float, float]], p: int
    ) -> Path:
        target, composed = self._target, frame.last[0]
        path, rows = target.directory / target.names.images[p].file(c), self._rows(frame, p)
        if more := noise_of(composed, p - self._planes.start):  # of a whole frame
            errors[p] = square_mean(more["error"]), float(rows[NUMBERS].mean(dtype=np.float64))
        attributes = self._attributes(composed, c, p)
        write_rows(path, rows, target.resolution, target.format, attributes, more, alpha)
        return path

    def _facts(self, composed: Composed) -> dict[str, Any]:
        """Return what the record of a frame says of some of its rows."""
        shares = [
            pixel_shares(composed.images[p - self._planes.start], self._target.format, composed.alpha)
            for p in self._planes
            if not self._target.names.images[p].group
        ]
        return {
            "share": len(composed.rows) / self._target.resolution[1],
            "hits": float(composed.hits.mean()),
            "bad": composed.bad,
            "first_bad": composed.first_bad,
            "shares": shares,
        }

    def _entry(
        self,
        frame: _Frame,
        c: int,
        files: Mapping[str, tuple[int, str]],
        errors: Mapping[int, tuple[float, float]],
    ) -> Entry:
        """Return the record of a finished frame."""
        facts = frame.facts
        weights = np.array([part["share"] for part in facts])
        shares = np.einsum(
            "k,kpi->pi", weights, np.array([part["shares"] for part in facts]).reshape(len(facts), -1, 2)
        )
        return Entry(
            c=c,
            lights=(self._planes.start, self._planes.stop),
            files=files,
            hits=float(weights @ [part["hits"] for part in facts]),
            notes=self._bad_values(frame),
            errors=errors,
            shares=mean_shares((clipped, black) for clipped, black in shares.tolist()),
        )

    def _bad_values(self, frame: _Frame) -> tuple[str, ...]:
        """Note values that were not finite, and where the first of them was."""
        count, c, width = sum(part["bad"] for part in frame.facts), frame.last[0].c, self._target.resolution[0]
        if not count:
            return ()
        l, pixel = next(part["first_bad"] for part in frame.facts if part["bad"])
        where = f"camera {c}, light {l}, pixel ({pixel % width}, {pixel // width})"
        some = f"{counted(count, 'value')} of camera {c} {agree(count, 'was', 'were')} not finite"
        return (f"{some} and {agree(count, 'was', 'were')} set to 0; the first: {where}",)

    def _attributes(self, composed: Composed, c: int, p: int) -> Attributes:
        """Return the metadata of the file of a plane."""
        stored, target = self._target.names.images[p], self._target
        found = target.attributes(c, stored.light, stored.group)
        own = composed.alpha is not None and target.format.format == "exr"
        return {**found, COLOUR_ID: SCENE_LIGHT} if own else found

    def finish(self) -> None:
        """Wait until all is written and all blocks are free.

        Raises:
            OutputError: something could not be written.
        """
        for block in [self.block() for _ in range(BLOCKS)]:
            self._free.put(block)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self._pool.close(drop=error is not None)
