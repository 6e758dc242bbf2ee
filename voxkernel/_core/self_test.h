// Whether the compiler kept to the arithmetic that the exact predicates rest on.
#pragma once

namespace voxkernel {

// Null where it did, else what went wrong.
const char* arithmetic_fault();

}  // namespace voxkernel
