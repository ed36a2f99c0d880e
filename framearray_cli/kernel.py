"""How hot loops are compiled.

`kernel` leaves out two things that numba does by default and that cost more than the loops themselves here: counting
references to every array that is passed on (an atomic instruction each, for arrays that the caller holds anyway), and
a check for division by zero at every division. So a kernel must not allocate: it is given its scratch arrays. It
releases the GIL and is compiled once for all runs.

`inlined` is for the small functions that kernels are written with.
"""

from functools import partial
from typing import Any

import numba as nb

kernel: Any = partial(nb.njit, nogil=True, cache=True, error_model="numpy", _nrt=False)()
inlined: Any = partial(nb.njit, nogil=True, cache=True, error_model="numpy", _nrt=False, inline="always")()
