// How long loops are interrupted: they say how much work they have done, and now and then somebody is asked.
#pragma once

#include <chrono>
#include <cstdint>

namespace voxkernel {

// Thrown out of a loop that was asked to stop; its results are lost.
struct Interrupted {};

class Stop {
 public:
  // `asked(context)` says whether to stop; without it nothing ever does.
  using Asked = bool (*)(void* context);
  Stop() = default;
  Stop(Asked asked, void* context) : asked_(asked), context_(context) {}
  Stop(const Stop&) = delete;
  Stop& operator=(const Stop&) = delete;

  // To be called at least once in every few thousand steps; `work` is about the number of planes looked at.
  void poll(std::int64_t work = 1) {
    left_ -= work;
    if (left_ < 0) ask();
  }

 private:
  static constexpr std::int64_t kStride = 1 << 16;  // about 0.1 ms of work
  static constexpr std::chrono::milliseconds kPause{50};

  void ask() {
    left_ = kStride;
    if (asked_ == nullptr) return;
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < kPause) return;
    last_ = now;
    if (asked_(context_)) throw Interrupted{};
  }

  Asked asked_ = nullptr;
  void* context_ = nullptr;
  std::int64_t left_ = kStride;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace voxkernel
