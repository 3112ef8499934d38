"""The decorator of every compiled function of the renderer.

`fastmath` may reorder sums and use reciprocals: a picture has 8 bits per channel. The order of operations is fixed
when a kernel is compiled, so the same machine gives the same bits for any number of threads. NaN and infinity keep
their meaning (no nnan, no ninf).
"""

from __future__ import annotations

import numba

kernel = numba.njit(
    nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc", "arcp", "afn"}
)
