"""Random projections that are the same on every machine and with every version of NumPy."""

from __future__ import annotations

import functools
import hashlib
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@functools.cache
def random_projection(name: str, rows: int, cols: int) -> NDArray[np.float32]:
    """Return a (rows, cols) matrix of -1 and 1, drawn from a hash of its name and size.

    Indexes on disk hold projected descriptors for years: the draw may not depend on a library.

    Example:
        >>> random_projection("docs", 2, 4)
        array([[ 1.,  1., -1., -1.],
               [ 1.,  1., -1.,  1.]], dtype=float32)
    """
    count = rows * cols
    stream = hashlib.shake_256(f"zeroscd {name} {rows}x{cols}".encode()).digest(-(-count // 8))
    bits = np.unpackbits(np.frombuffer(stream, np.uint8), count=count)
    signs = (2.0 * bits - 1.0).astype(np.float32).reshape(rows, cols)
    signs.flags.writeable = False
    return signs
