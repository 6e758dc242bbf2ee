// Parts of one computation on several threads, which end together.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

constexpr std::int64_t kMuch = std::int64_t{1} << 32;  // work after which somebody is asked whether to stop

constexpr int kLooks = 2000;  // some 50 microseconds

inline void pause_briefly() {
#if defined(__x86_64__) && defined(__GNUC__)
  __builtin_ia32_pause();
#endif
}

// Runs `work(part, stop)` for every part below `n`: the first on the thread of the caller, each other one on a thread
// of its own. The first error, an interrupt of the caller among them, stops all and is thrown when they have ended.
template <typename Work>
void run_parts(int n, Stop& stop, Work&& work) {
  if (n <= 1) {
    work(0, stop);
    return;
  }
  struct {
    std::atomic<bool> is_over{false};
    std::mutex lock;
    std::condition_variable ended;
    std::atomic<int> left{0};
    std::exception_ptr error;
  } shared;
  const auto fail = [&] {
    const std::lock_guard<std::mutex> guard(shared.lock);
    if (!shared.error) shared.error = std::current_exception();
    shared.is_over = true;
  };
  const auto one = [&](int part) {
    try {
      Stop own([](void* over) { return static_cast<std::atomic<bool>*>(over)->load(std::memory_order_relaxed); },
               &shared.is_over);
      work(part, own);
    } catch (...) {
      fail();
    }
    const std::lock_guard<std::mutex> guard(shared.lock);
    --shared.left;
    shared.ended.notify_one();
  };
  std::vector<std::thread> threads;
  try {
    threads.reserve(static_cast<std::size_t>(n - 1));
    for (int part = 1; part < n; ++part) {
      {
        const std::lock_guard<std::mutex> guard(shared.lock);
        ++shared.left;
      }
      try {
        threads.emplace_back(one, part);
      } catch (...) {
        const std::lock_guard<std::mutex> guard(shared.lock);
        --shared.left;
        throw;
      }
    }
    work(0, stop);
    // The others end at about the same time: to look now and then is sooner than to be woken.
    for (int i = 0; i < kLooks && shared.left.load(std::memory_order_acquire) != 0; ++i) pause_briefly();
    std::unique_lock<std::mutex> guard(shared.lock);
    while (!shared.ended.wait_for(guard, std::chrono::milliseconds(20), [&] { return shared.left == 0; })) {
      guard.unlock();
      stop.poll(kMuch);
      guard.lock();
    }
  } catch (...) {
    fail();
  }
  for (std::thread& thread : threads) thread.join();
  if (shared.error) std::rethrow_exception(shared.error);
}

// Threads for `size` things, so that each has `least` of them or more; at most `threads`, and one at least.
inline int worth_threads(Index size, Index least, int threads) {
  return static_cast<int>(std::max<Index>(1, std::min<Index>(threads, size / least)));
}

// Where part k of n begins when 0 .. size is cut into stretches as long as each other.
inline Index part_begin(Index size, int n, int k) { return size / n * k + std::min<Index>(size % n, k); }

// Calls `work(first, last, part, stop)` for stretches of 0 .. size on `n` threads; each takes the next one when it has
// done one, so that nobody waits long for a thread that was late or slow. `part` is its thread.
template <typename Work>
void run_in_turn(Index size, int n, Stop& stop, Work&& work) {
  constexpr int kStretches = 8;  // for each thread
  const int n_stretches = n == 1 ? 1 : static_cast<int>(std::max<Index>(1, std::min<Index>(kStretches * n, size)));
  std::atomic<int> next{0};
  run_parts(n, stop, [&](int part, Stop& own) {
    for (int k = next++; k < n_stretches; k = next++) {
      work(part_begin(size, n_stretches, k), part_begin(size, n_stretches, k + 1), part, own);
    }
  });
}

// The same on at most `threads` threads, fewer where each would have less than `least`; without `part`.
template <typename Work>
void run_stretches(Index size, Index least, int threads, Stop& stop, Work&& work) {
  run_in_turn(size, worth_threads(size, least, threads), stop,
              [&](Index first, Index last, int, Stop& own) { work(first, last, own); });
}

}  // namespace voxkernel
