"""The settings that speed and error depend on, and those that a report tests.

A setting is one line of a job file; `KEYS` maps its keys to fields of `Settings`.
"""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeAlias

from pydantic import ValidationError

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.base.forms.toml import parse_value
from framearray_cli.base.units import counted
from framearray_cli.job.job import Job

# Settings by the job file's key.
KEYS = {
    "reuse.n_r": "n_r",
    "reuse.weights": "weights",
    "samples.hits": "hits",
    "samples.obscurance": "obscurance",
    "indirect.method": "indirect",
}
# Keys instead of `samples.hits`; measured settings always give a number of hits.
TARGET = (("samples", "error"), ("samples", "most_hits"))
# Keys of light from cells, see `IndirectTable`.
CELL_KEYS = tuple(("indirect", name) for name in ("cell", "samples", "filter", "exact"))
METHOD_KEY = "indirect.method"
# The fewest hits per pixel and frame that a job may have.
FEWEST_HITS = 1 / 8


Method: TypeAlias = Literal["obscurance", "cells"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings that cost and error of an image depend on; see the reference of job files.

    Attributes:
        one_light: render every image for only one light position, as other renderers do; no key of a job.
    """

    n_r: int
    weights: Literal["average", "balance", "area"]
    hits: float
    obscurance: int
    indirect: Method = "obscurance"
    one_light: bool = False

    @staticmethod
    def of(job: Job) -> "Settings":
        """Return the settings of a job."""
        tables = {key: key.split(".") for key in KEYS}
        return Settings(**{KEYS[key]: getattr(getattr(job, table), name) for key, (table, name) in tables.items()})

    @property
    def window_hits(self) -> float:
        """Hits of a pixel whose surface every frame of its window sees."""
        return (2 * self.n_r + 1) * self.hits

    def apply_to(self, job: Job) -> Job:
        """Return the job with these settings, validated like a file."""
        tables: dict[str, dict[str, Any]] = {}
        for key, field in KEYS.items():
            table, name = key.split(".")
            tables.setdefault(table, {})[name] = getattr(self, field)
        # the keys of the job file, and these; validation sets defaults that depend on other keys again
        dropped = {*TARGET, *(CELL_KEYS if self.indirect == "obscurance" else ())}
        updates = {}
        for table, values in tables.items():
            old = getattr(job, table)
            said = {name: getattr(old, name) for name in old.model_fields_set if (table, name) not in dropped}
            updates[table] = type(old).model_validate({**said, **values})
        return changed(job, **updates)


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedSettings:
    """Settings to test.

    Attributes:
        name: in tables and plots.
        family: a line joins the points of one family in plots.
    """

    name: str
    family: str
    settings: Settings


METHODS: tuple[Method, ...] = ("obscurance", "cells")
LIGHT_REUSE, SCRATCH = "light reuse only", "from scratch"


def settings_to_try(
    base: Settings, n_cameras: int, vary: Mapping[str, Sequence[Any]] | None = None
) -> list[NamedSettings]:
    """List the settings that a report tests: the job's own, one setting changed at a time, and the baselines.

    Args:
        base: the job's.
        n_cameras: N_c; a window is no longer than the path.
        vary: values by the job file's key, and no others; without any, values of all keys.
    """
    found = [NamedSettings(name="as the job says", family="job", settings=base)]
    longest = (n_cameras - 1) // 2
    default_values: dict[str, Iterable[Any]] = {
        "reuse.n_r": sorted({0, 1, max(base.n_r, 1), 2 * base.n_r + 1, 2 * (2 * base.n_r + 1)}),
        "reuse.weights": ("average", "balance", "area"),
        "samples.hits": (0.5, 1, 2, 4, 8),
        "samples.obscurance": (1, 2, 5, 10, 20),
    }
    for key, values in (vary or default_values).items():
        for value in values if key != METHOD_KEY else ():
            changed = replace(base, **{KEYS[key]: value})
            if changed.n_r <= longest and changed != base:
                text = f"{value:g}" if isinstance(value, float) else str(value)
                found.append(NamedSettings(name=f"{KEYS[key]} {text}", family=key, settings=changed))
    for hits, n_r in ((base.hits / 2, 2 * base.n_r + 1), (base.hits / 4, 4 * base.n_r + 2)):
        if base.n_r and n_r <= longest and hits >= FEWEST_HITS and not vary:
            wide = replace(base, hits=hits, n_r=n_r)
            found.append(NamedSettings(name=f"hits {hits:g}, n_r {n_r}", family="hits for n_r", settings=wide))
    return [*found, *baselines(base)]


def methods_to_try(
    base: Settings, vary: Mapping[str, Sequence[Any]] | None = None
) -> dict[Method, list[NamedSettings]]:
    """List settings with other ways to find indirect light, by method: with half, as many and twice the hits.

    They approach the true light, and not the reference of the job's own method.
    """
    counts = [hits for hits in (base.hits / 2, base.hits, 2 * base.hits) if hits >= FEWEST_HITS]
    return {
        method: [
            NamedSettings(
                name=method if hits == base.hits else f"{method}, hits {hits:g}",
                family=method,
                settings=replace(base, indirect=method, hits=hits),
            )
            for hits in counts
        ]
        for method in METHODS
        if method != base.indirect and (not vary or method in vary.get(METHOD_KEY, ()))
    }


def baselines(base: Settings) -> list[NamedSettings]:
    """List settings without reuse among frames, with and without reuse among lights, by hits per pixel.

    They weigh hits by area where the job does: native hits gain by it, too.
    """
    weights: Literal["area", "average"] = "area" if base.weights == "area" else "average"
    unshared = replace(base, n_r=0, weights=weights)
    shares = (1 / 14, 1 / 7, 2 / 7, 4 / 7, 1.0, 2.0)
    counts = sorted({max(round(share * base.window_hits), 1) for share in shares})
    return [
        NamedSettings(
            name=f"{family}, {counted(hits, 'hit')}",
            family=family,
            settings=replace(unshared, hits=hits, one_light=one_light),
        )
        for family, one_light in ((LIGHT_REUSE, False), (SCRATCH, True))
        for hits in counts
    ]


def read_vary(option: str, job: Job) -> tuple[str, list[Any]]:
    """Parse an option `samples.hits=1,2,4`.

    Raises:
        JobError: a report cannot vary the key, or no job may have the value.
    """
    key, _, text = option.partition("=")
    key, where = key.strip(), "--vary"
    if key not in KEYS or not text.strip():
        names = ", ".join(KEYS)
        raise JobError(where, [f"expected one of {names}, an equals sign and values, got {option!r}"])
    values: list[Any] = []
    base, problems = Settings.of(job), []
    for word in text.split(","):
        values.append(word.strip())
        with suppress(ValueError):  # a text without quotes
            values[-1] = parse_value(values[-1])
        if (value := values[-1]) == "auto":
            problems.append(f"{key} = {value!r}: expected a value to measure")
            continue
        try:
            replace(base, **{KEYS[key]: value}).apply_to(job)
        except ValidationError as error:
            messages = "; ".join(detail["msg"] for detail in error.errors())
            problems.append(f"{key} = {value!r}: {messages}")
    if problems:
        raise JobError(where, problems)
    return key, values


assert set(KEYS.values()) | {"one_light"} == {field.name for field in fields(Settings)}
