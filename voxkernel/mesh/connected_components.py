"""Connected components of a graph given by its edges."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["components"]


def components(n: int, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> tuple[int, NDArray[np.int32]]:
    """Count the parts of a graph of `n` nodes joined by the edges (rows, columns), and label every node."""
    from scipy.sparse import coo_matrix  # a tenth of a second: not at import
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n))
    count, labels = connected_components(graph, directed=False)
    return int(count), labels
