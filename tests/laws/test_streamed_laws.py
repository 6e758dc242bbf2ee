"""Of any surface, the kernel in chunks is that of memory to the last bit."""

import numpy as np
import shapes
from hypothesis import given, settings
from hypothesis import strategies as st
from streams import assert_same, proof

import voxkernel

turns = st.one_of(st.none(), st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed)))


@settings(max_examples=30)
@given(shapes.integer_meshes(), turns, st.sampled_from([0.0, 1e3, 1e8]), st.sampled_from([2, 5, 1000]))
def test_the_kernel_is_that_of_memory(surface, rng, shift, chunk):
    """Turned, what met in a point or a plane does so no more, and little is decided by floating point."""
    vertices, faces = surface
    if rng is not None:
        vertices = vertices @ shapes.random_rotation(rng).T * 0.37 + shift
    whole = voxkernel.exact_kernel((vertices, faces))
    kernel = voxkernel.exact_kernel(voxkernel.stream_mesh((vertices, faces), chunk_facets=chunk))
    if kernel.domain is None and whole.domain is not None:  # no ball is made of an open surface with an empty kernel
        assert whole.unclipped_dimension == -1
        assert proof(kernel.certificate) == proof(whole.unclipped_certificate)
    else:
        assert_same(kernel, whole)
