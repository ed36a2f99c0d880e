"""Memory that goes from eye to eye: fresh pages cost the system more than arrays that were used before."""

from typing import Any

from framearray_cli.base.arrays import reshaped, with_room


class ArrayPool:
    """Arrays of hits that the window dropped, by name, for the next eye to use.

    Neighbour eyes have about the same number of hits. At the ends of the path they have up to twice as many.
    """

    def __init__(self) -> None:
        self._free: dict[str, list[Any]] = {}

    def take(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """Take an array of a shape, contents arbitrary; free arrays of that name that do not fit are released."""
        free = self._free.get(name, [])
        while free:
            array = reshaped(free.pop(), shape)
            if array is not None:
                return array
        return with_room(shape, dtype)

    def give(self, name: str, array: Any) -> None:
        """Return an array that nobody reads any more."""
        self._free.setdefault(name, []).append(array)
