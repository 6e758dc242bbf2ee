"""Half-spaces in, the kernel as a polytope out, with a certificate in rational arithmetic."""

from voxkernel.exact.certificate import Certificate
from voxkernel.exact.exact_kernel import exact_kernel, kernel_of_halfspaces
from voxkernel.exact.kernel_polytope import KernelPolytope

__all__ = [
    "Certificate",
    "KernelPolytope",
    "exact_kernel",
    "kernel_of_halfspaces",
]
