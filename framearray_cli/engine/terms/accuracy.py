"""The error of light from cells, in a few figures."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Error of light from cells, over the mean indirect light of images.

    Attributes:
        bias: signed mean over points and light positions; `bias_error`: its standard error.
        error: root mean square over points and light positions, 0 where noise makes the square negative;
            `error_error`: its standard error, upwards where the square is within its own.
        points: number of points that were compared; `paths`: number of paths at each.
    """

    bias: float
    bias_error: float
    error: float
    error_error: float
    points: int
    paths: int

    @property
    def note(self) -> str:
        """What renders and reports print of it."""
        level = f"{self.error:.1%} +- {self.error_error:.1%}"
        return f"indirect light differs from paths by {level}, its mean by {self.bias:+.1%} +- {self.bias_error:.1%}"

    def table(self) -> dict[str, float | int]:
        """Return the table for the manifest."""
        figures = {"mean": self.bias, "mean_error": self.bias_error, "rms": self.error, "rms_error": self.error_error}
        return {key: round(value, 5) for key, value in figures.items()} | {"points": self.points, "paths": self.paths}
