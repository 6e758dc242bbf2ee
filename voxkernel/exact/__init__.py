"""Half-spaces in, the kernel as a polytope out, with a certificate in rational arithmetic."""

from voxkernel.exact.certificate import Certificate
from voxkernel.exact.exact_kernel import exact_kernel, kernel_of_halfspaces
from voxkernel.exact.kernel import Kernel
from voxkernel.exact.kernel_polytope import KernelPolytope

__all__ = [
    "Certificate",
    "Kernel",
    "KernelPolytope",
    "exact_kernel",
    "kernel_of_halfspaces",
]
