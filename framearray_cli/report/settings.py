"""The settings that speed and error depend on, and which of them a report tries.

A setting is one line of a job file; the names of `Settings` are those of its keys, see `KEYS`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from importlib.util import find_spec
from typing import Any, Literal

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.base.forms.text import brief
from framearray_cli.job.job import Job

# Settings by the job file's key.
KEYS = {
    "reuse.n_r": "n_r",
    "reuse.weights": "weights",
    "samples.hits": "hits",
    "samples.obscurance": "obscurance",
    "samples.shadow_step": "shadow_step",
    "samples.shadow_unbiased": "shadow_unbiased",
    "denoise.obscurance": "denoise",
}
# What hits are given for in their place: settings that are measured say how many hits there are.
TARGET = (("samples", "error"), ("samples", "most_hits"))
# Fewer hits a pixel than that a frame cannot have: see `plan.py`.
FEWEST_HITS = 1 / 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the cost and the error of a picture depend on; see the job file's reference.

    Attributes:
        one_light: every image is made for one light position alone, as other renderers do; no key of a job.
    """

    n_r: int
    weights: Literal["average", "balance"]
    hits: float
    obscurance: int
    shadow_step: int
    shadow_unbiased: bool
    denoise: bool
    one_light: bool = False

    @staticmethod
    def of(job: Job) -> "Settings":
        """Those of a job."""
        tables = {key: key.split(".") for key in KEYS}
        return Settings(**{KEYS[key]: getattr(getattr(job, table), name) for key, (table, name) in tables.items()})

    @property
    def rests_on(self) -> float:
        """Native hits that a pixel would rest on if every frame of its window saw what it sees."""
        return (2 * self.n_r + 1) * self.hits

    def applied(self, job: Job) -> Job:
        """The job with these settings; they are checked as those of a file are.

        Raises:
            JobError: a value that no job may have.
        """
        tables: dict[str, dict[str, Any]] = {}
        for key, field in KEYS.items():
            table, name = key.split(".")
            tables.setdefault(table, {})[name] = getattr(self, field)
        updates = {}
        for table, values in tables.items():
            old = getattr(job, table)
            # what the job file says of it, and these; defaults that depend on others are worked out again
            said = {name: getattr(old, name) for name in old.model_fields_set if (table, name) not in TARGET}
            updates[table] = type(old).model_validate({**said, **values})
        return changed(job, **updates)

    def lines(self, base: "Settings") -> list[str]:
        """What to write into a job file with settings `base` to get these."""
        tables: dict[str, list[str]] = {}
        for key, field in KEYS.items():
            if getattr(self, field) != getattr(base, field):
                table, name = key.split(".")
                tables.setdefault(table, []).append(f"{name} = {brief(getattr(self, field))}")
        return [line for table, lines in tables.items() for line in (f"[{table}]", *lines)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Named:
    """Settings to try.

    Attributes:
        name: how tables and plots call them.
        family: points of one family are joined by a line in plots.
    """

    name: str
    family: str
    settings: Settings


LIGHT_REUSE, SCRATCH = "light reuse alone", "from scratch"


def to_try(base: Settings, n_cameras: int, vary: Mapping[str, Sequence[Any]]) -> list[Named]:
    """What a report tries: the job's own settings, each setting changed for itself, and the baselines.

    Args:
        base: the job's.
        n_cameras: N_c; a window is no longer than the path.
        vary: values by the job file's key; they take the place of those that are tried by themselves.
    """
    found = [Named(name="as the job says", family="job", settings=base)]
    longest = (n_cameras - 1) // 2
    by_itself: dict[str, Iterable[Any]] = {
        "reuse.n_r": sorted({0, 1, max(base.n_r, 1), 2 * base.n_r + 1, 2 * (2 * base.n_r + 1)}),
        "reuse.weights": ("average", "balance"),
        "samples.hits": (0.5, 1, 2, 4, 8),
        "samples.obscurance": (1, 2, 5, 10, 20),
        "samples.shadow_step": (1, 2, 4, 8),
        "denoise.obscurance": (False, True) if find_spec("pyoidn") else (False,),
    }
    for key, values in {**by_itself, **vary}.items():
        for value in values:
            changed = replace(base, **{KEYS[key]: value})
            if changed.n_r <= longest and changed != base:
                found.append(Named(name=f"{KEYS[key]} {_plain(value)}", family=key, settings=changed))
    for hits, n_r in ((base.hits / 2, 2 * base.n_r + 1), (base.hits / 4, 4 * base.n_r + 2)):
        if base.n_r and n_r <= longest and hits >= FEWEST_HITS:
            wide = replace(base, hits=hits, n_r=n_r)
            found.append(Named(name=f"hits {hits:g}, n_r {n_r}", family="hits for n_r", settings=wide))
    return [*found, *baselines(base)]


def baselines(base: Settings) -> list[Named]:
    """Every frame for itself, and every image for itself, with more and more hits a pixel."""
    alone = replace(base, n_r=0, shadow_step=1, shadow_unbiased=False, weights="average", denoise=False)
    shares = (1 / 14, 1 / 7, 2 / 7, 4 / 7, 1.0, 2.0)
    counts = sorted({max(round(share * base.rests_on), 1) for share in shares})
    return [
        Named(name=f"{family}, {hits} hits", family=family, settings=replace(alone, hits=hits, one_light=one_light))
        for family, one_light in ((LIGHT_REUSE, False), (SCRATCH, True))
        for hits in counts
    ]


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    return f"{value:g}" if isinstance(value, float) else str(value)


def read_vary(option: str, job: Job) -> tuple[str, list[Any]]:
    """Read an option `samples.hits=1,2,4`.

    Raises:
        JobError: not a setting that can be varied, or a value that no job may have.
    """
    key, _, text = option.partition("=")
    key = key.strip()
    where = "--vary"
    if key not in KEYS or not text.strip():
        names = ", ".join(KEYS)
        raise JobError(where, [f"expected one of {names}, an equals sign and values, got {option!r}"])
    values = [_value(word.strip()) for word in text.split(",")]
    base, problems = Settings.of(job), []
    for value in values:
        if value == "auto":
            problems.append(f"{key} = {value!r}: expected a value to measure")
            continue
        try:
            replace(base, **{KEYS[key]: value}).applied(job)
        except ValueError as error:
            problems.append(f"{key} = {value!r}: {_reason(error)}")
    if problems:
        raise JobError(where, problems)
    return key, values


def _value(word: str) -> Any:
    if word in ("true", "false"):
        return word == "true"
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            pass
    return word.strip("\"'")


def _reason(error: ValueError) -> str:
    """What a check of values says, in one line."""
    details = getattr(error, "errors", None)
    return "; ".join(str(detail["msg"]) for detail in details()) if details else str(error)


assert set(KEYS.values()) | {"one_light"} == {field.name for field in fields(Settings)}
