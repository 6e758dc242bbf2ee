#include "cover_search.h"

#include <algorithm>
#include <numeric>

namespace voxkernel {
namespace {

Index ones(std::uint64_t x) {
  x -= (x >> 1) & 0x5555555555555555u;
  x = (x & 0x3333333333333333u) + ((x >> 2) & 0x3333333333333333u);
  x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0Fu;
  return static_cast<Index>((x * 0x0101010101010101u) >> 56);
}

Index ones_in(const std::uint64_t* set, const std::uint64_t* left, Index n_words) {
  Index sum = 0;
  for (Index w = 0; w < n_words; ++w) sum += ones(set[w] & left[w]);
  return sum;
}

// Depth first. A choice of `count` sets is ordered by what each adds, the most first, so the next one adds at least
// its share of what is missing, and no set that adds less needs to be looked at.
class Search {
 public:
  Search(Span<const std::uint64_t> sets, Index n_words, Index max_steps, Stop& stop)
      : sets_(sets), n_words_(n_words), n_(n_words > 0 ? sets.size() / n_words : 0), steps_(max_steps), stop_(stop) {}

  // 1 found, 0 there is none, -1 open.
  int run(const std::vector<std::uint64_t>& left, const std::vector<Index>& from, Index count, Index need) {
    if (need <= 0) return 1;
    if (count == 0) return 0;
    std::vector<std::pair<Index, Index>> gains;
    for (const Index i : from) {
      stop_.poll(n_words_);
      if (--steps_ < 0) return -1;
      const Index gain = ones_in(sets_.data() + i * n_words_, left.data(), n_words_);
      if (gain > 0) gains.emplace_back(gain, i);
    }
    std::sort(gains.begin(), gains.end(), [](const auto& a, const auto& b) {
      return a.first != b.first ? a.first > b.first : a.second < b.second;
    });
    std::vector<Index> rest;
    std::vector<std::uint64_t> after(left.size());
    for (std::size_t k = 0; k < gains.size(); ++k) {
      const auto [gain, i] = gains[k];
      if (gain * count < need) break;
      for (Index w = 0; w < n_words_; ++w) after[w] = left[w] & ~sets_[i * n_words_ + w];
      rest.clear();
      // Sets before this one have been tried as a part of the choice already.
      for (std::size_t j = k + 1; j < gains.size(); ++j) rest.push_back(gains[j].second);
      chosen.push_back(i);
      const int found = run(after, rest, count - 1, need - gain);
      if (found != 0) return found;
      chosen.pop_back();
    }
    return 0;
  }
  Index size() const { return n_; }
  std::vector<Index> chosen;

 private:
  Span<const std::uint64_t> sets_;
  Index n_words_, n_, steps_;
  Stop& stop_;
};

}  // namespace

void cover_gains(Span<const std::uint64_t> sets, Index n_words, Span<const std::uint64_t> left, Span<Index> gains,
                 Stop& stop) {
  for (Index i = 0; i < gains.size(); ++i) {
    stop.poll(n_words);
    gains[i] = ones_in(sets.data() + i * n_words, left.data(), n_words);
  }
}

std::vector<Index> maximal_sets(Span<const std::uint64_t> sets, Index n_words, Stop& stop) {
  const Index n = n_words > 0 ? sets.size() / n_words : 0;
  const auto row = [&](Index i) { return sets.data() + i * n_words; };
  std::vector<Index> sizes(n), order(n);
  for (Index i = 0; i < n; ++i) sizes[i] = ones_in(row(i), row(i), n_words);
  std::iota(order.begin(), order.end(), Index{0});
  std::stable_sort(order.begin(), order.end(), [&](Index a, Index b) { return sizes[a] > sizes[b]; });
  std::vector<Index> kept;
  for (const Index i : order) {
    const bool is_within = std::any_of(kept.begin(), kept.end(), [&](Index other) {
      stop.poll();
      Index w = 0;
      while (w < n_words && (row(i)[w] & ~row(other)[w]) == 0) ++w;
      return w == n_words;
    });
    if (!is_within) kept.push_back(i);
  }
  return kept;
}

std::vector<Index> find_cover(Span<const std::uint64_t> sets, Index n_words, Index count, Index need, Index max_steps,
                              Stop& stop) {
  Search search(sets, n_words, max_steps, stop);
  std::vector<Index> all(search.size());
  std::iota(all.begin(), all.end(), Index{0});
  const std::vector<std::uint64_t> everything(n_words, ~std::uint64_t{0});
  const int found = search.run(everything, all, count, need);
  if (found < 0) return {-1};
  return found == 0 ? std::vector<Index>{} : search.chosen;
}

}  // namespace voxkernel
