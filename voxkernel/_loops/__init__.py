"""The compiled loops: plain arrays in and out, one file per algorithm.

Modules of this package import Numba; import them inside the function that needs them.
"""

import os

# One switch for all loops: VOXKERNEL_NUMBA_CACHE=0 compiles afresh in every process.
NUMBA_CACHE = os.environ.get("VOXKERNEL_NUMBA_CACHE", "1") != "0"
