// What the binding files share: arrays of NumPy as spans and back, and calls without the interpreter's lock.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include <atomic>
#include <cstdlib>
#include <memory>
#include <utility>
#include <vector>

#include "growing_array.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

namespace nb = nanobind;

template <typename T, nb::ssize_t... N>
using Array = nb::ndarray<T, nb::numpy, nb::shape<N...>, nb::c_contig, nb::device::cpu>;
template <typename T>
using Array1 = Array<T, -1>;
template <typename T, nb::ssize_t N>
using Array2 = Array<T, -1, N>;

// A named array argument: never converted, because a copy would cost what nobody sees and lose what is written.
inline auto array(const char* name) { return nb::arg(name).noconvert(); }
// The last argument of loops that may run in several threads.
inline auto stop_argument() { return nb::arg("stop").none() = nb::none(); }

template <typename T, nb::ssize_t N>
Span<T> span(const Array<T, N>& array) {
  return {array.data(), static_cast<Index>(array.shape(0))};
}
template <typename T, nb::ssize_t N>
Rows<T, static_cast<int>(N)> rows(const Array2<T, N>& array) {
  return {array.data(), static_cast<Index>(array.shape(0))};
}

// A new array that takes over one that has grown.
template <typename T>
Array1<T> take_array(GrowingArray<T>& values) {
  const auto n = static_cast<std::size_t>(values.size());
  T* data = values.release();
  nb::capsule owner(data, [](void* p) noexcept { std::free(p); });
  return Array1<T>(data, {n}, owner);
}
// A new array that takes over a vector.
template <typename T, typename A>
Array1<T> to_array(std::vector<T, A>&& values) {
  auto* owned = new std::vector<T, A>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T, A>*>(p); });
  return Array1<T>(owned->data(), {owned->size()}, owner);
}
// The same for rows of N numbers, flat in the vector.
template <nb::ssize_t N, typename T, typename A>
Array2<T, N> to_rows(std::vector<T, A>&& values) {
  auto* owned = new std::vector<T, A>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T, A>*>(p); });
  return Array2<T, N>(owned->data(), {owned->size() / N, static_cast<std::size_t>(N)}, owner);
}

// The same, read-only: what a result keeps as it is.
template <typename T, typename A>
Array1<const T> to_read_only(std::vector<T, A>&& values) {
  auto* owned = new std::vector<T, A>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T, A>*>(p); });
  return Array1<const T>(owned->data(), {owned->size()}, owner);
}
template <nb::ssize_t N, typename T, typename A>
Array2<const T, N> to_read_only_rows(std::vector<T, A>&& values) {
  auto* owned = new std::vector<T, A>(std::move(values));
  nb::capsule owner(owned, [](void* p) noexcept { delete static_cast<std::vector<T, A>*>(p); });
  return Array2<const T, N>(owned->data(), {owned->size() / N, static_cast<std::size_t>(N)}, owner);
}

// Set by the thread that waits for workers; their loops see it and stop.
struct StopFlag {
  std::atomic<bool> is_set{false};
};

// Runs `work(stop)` without the interpreter's lock. A pending signal of Python, or `flag`, ends it with
// KeyboardInterrupt. Signals are handled by Python's main thread only, which is why workers have a flag.
template <typename Work>
auto without_lock(Work&& work, StopFlag* flag = nullptr) {
  const auto asked = [](void* context) {
    const auto* chosen = static_cast<StopFlag*>(context);
    if (chosen != nullptr && chosen->is_set.load(std::memory_order_relaxed)) return true;
    nb::gil_scoped_acquire lock;
    return PyErr_CheckSignals() != 0;
  };
  try {
    nb::gil_scoped_release release;
    Stop stop(asked, flag);
    return work(stop);
  } catch (const Interrupted&) {
    if (!PyErr_Occurred()) PyErr_SetNone(PyExc_KeyboardInterrupt);
    throw nb::python_error();
  }
}

}  // namespace voxkernel
