"""The result of `framearray report` as typed data, for `--json`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredSettings:
    """Some settings, their cost and their error.

    Attributes:
        lines: what they change in the job file; empty for the job's own.
        ms: per image, before writing.
        rmse, bias, noise: over the mean of the reference.
        flip: mean HDR-FLIP; null where it was not measured.
        best: whether no other settings beat these in both time and error.
    """

    name: str
    lines: tuple[str, ...]
    ms: float
    rmse: float
    bias: float
    noise: float
    flip: float | None
    hits_per_pixel: float
    best: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class AdvisedSettings:
    """The cheapest settings for an error, an RMSE; null where none that were tried reach it."""

    error: float
    settings: MeasuredSettings | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueSettings:
    """Some settings, their cost, and how far they are from true light.

    Attributes:
        lines: what they change in the job file; empty for the job's own.
        ms: per image, before writing.
        rmse: with respect to true light, over its mean; `rmse_error`: its standard error.
        rmse_of_squares: that of means over 4 x 4 pixels, over their root mean square.
        mean_off: mean of the images over that of true light, less 1.
    """

    name: str
    lines: tuple[str, ...]
    ms: float
    rmse: float
    rmse_error: float
    rmse_of_squares: float
    mean_off: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueAdvice:
    """The cheapest settings for an error with respect to true light; null where none that were tried reach it."""

    error: float
    settings: TrueSettings | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueLightResult:
    """What `report` measured with respect to true light, which it makes by paths.

    Attributes:
        cameras, lights: of the images that were compared.
        hits: native hits per pixel of images in true light; `noise`: RMSE of these, which is no part of errors.
        settings: the first are the job's own; the last have another `indirect.method`.
    """

    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    hits: int
    noise: float
    settings: tuple[TrueSettings, ...]
    advice: tuple[TrueAdvice, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportResult:
    """What `report` measured.

    Attributes:
        page: file to open in a browser; table.csv and table.toml beside it have all figures.
        cameras, lights: of the images that were compared.
        reference_hits: native hits per pixel of the references; `reference_error`: their own RMSE.
        settings: the first are the job's own.
        true_light: null where nothing was compared with it.
    """

    directory: str
    page: str
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    reference_hits: float
    reference_error: float
    settings: tuple[MeasuredSettings, ...]
    advice: tuple[AdvisedSettings, ...]
    true_light: TrueLightResult | None = None
