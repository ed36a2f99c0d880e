"""Events of a render in parts, besides those of any render."""

from typing import TYPE_CHECKING

from ..progress import AmbientFigures, RenderEvents

if TYPE_CHECKING:
    from ..errortarget import Target
    from .chunks import Chunks


class PartEvents(RenderEvents):
    """The events of a render in parts; override those of interest. Calls may come from any thread."""

    def starting_workers(self) -> None:
        """Worker processes are being started on this machine."""

    def awaiting_workers(self, address: str | None) -> None:
        """No worker has connected yet to the scheduler at an address, or on this machine."""

    def chunked(self, workers: int, chunks: "Chunks") -> None:
        """The camera path was split into chunks, and that many workers begin."""

    def ambient_known(self, figures: AmbientFigures) -> None:
        """The first worker has estimated the ambient light of the whole array."""

    def target_known(self, target: "Target") -> None:
        """The first worker has allotted native hits for the error that the job wants."""

    def compiling(self) -> None:
        """A worker is compiling kernels."""

    def compiled(self, kernels: int, seconds: float) -> None:
        """The first worker that compiled kernels has that many, after that time."""
