#include "label_tiles.h"

#include <algorithm>
#include <cstdlib>

#include "avx2.h"
#include "bits.h"
#include "tile_probes.h"

namespace voxkernel {
namespace {

constexpr Index kBits = 64;
constexpr Index kLayers = 4;
constexpr Index kPlanes = 2;  // after so many it is asked which voxels of a tile are out of the race

}  // namespace

LabelTiles::LabelTiles(const Crop& crop, int order) : order_(order) {
  const bool flat = crop.is_flat;
  is_flat_ = flat;
  const Index own_edges[3] = {kLayers, flat ? 1 : 8, flat ? kBits : 8};
  axes_[0] = flat ? 1 : 0;
  axes_[1] = flat ? 0 : 1;
  axes_[2] = 2;
  for (int a = 0; a < 3; ++a) {
    edges_[axes_[a]] = own_edges[a];
    margin_[a] = own_edges[a] - 1;
    shape_[a] = crop.shape[axes_[a]] + margin_[a] + (a == 0 ? margin_[0] : 0);
  }
  strides_[0] = 1;
  strides_[2] = shape_[0];
  strides_[1] = shape_[2] * shape_[0];
  const Index size = shape_[0] * shape_[1] * shape_[2];
  words_.assign(static_cast<std::size_t>(size), 0);
  const Index ni = crop.shape[axes_[0]], nj = crop.shape[axes_[1]], nk = crop.shape[axes_[2]];
  const Index step_i = crop.stride(axes_[0]), step_j = crop.stride(axes_[1]);
  const Word row_mask = flat ? ~Word{0} : (Word{1} << own_edges[2]) - 1;
  std::vector<Word> rows(static_cast<std::size_t>(ni));
  for (Index j = nj - 1; j >= -margin_[1]; --j) {
    std::fill(rows.begin(), rows.end(), Word{0});
    for (Index k = nk - 1; k >= -margin_[2]; --k) {
      const bool is_in = j >= 0 && k >= 0;
      const std::uint8_t* const bytes = crop.bytes.data() + (is_in ? j * step_j + k : 0);
      Word* const to = words_.data() + margin_[0] + (j + margin_[1]) * strides_[1] + (k + margin_[2]) * strides_[2];
      const bool goes_on = !flat && j < nj - 1;
      for (Index i = 0; i < ni; ++i) {
        rows[i] = (rows[i] << 1 | (is_in && bytes[i * step_i] != 0 ? 1u : 0u)) & row_mask;
        to[i] = rows[i] | (goes_on ? to[i + strides_[1]] << own_edges[2] : 0);
      }
    }
  }
  seen_.assign(static_cast<std::size_t>(4 * size), 0);
  ones_.assign(static_cast<std::size_t>(4 * shape_[0]), ~Word{0});
  first_.assign(static_cast<std::size_t>(shape_[1] * shape_[2]), 0);
  last_.assign(first_.size(), -1);
  for (Index j = 0; j < shape_[1]; ++j) planes_.insert(planes_.end(), {shape_[2], -1});
  for (Index row = 0; row < shape_[1] * shape_[2]; ++row) {
    for (Index i = shape_[0] - kLayers; i >= 0; --i) {
      if (is_none(four(words_.data() + row * shape_[0] + i))) continue;
      first_[row] = static_cast<std::int32_t>(i);
      if (last_[row] < 0) last_[row] = static_cast<std::int32_t>(i);
    }
    n_places_ += last_[row] + 1 - first_[row];
    if (last_[row] < 0) continue;
    Index* const range = planes_.data() + 2 * (row / shape_[2]);
    range[0] = std::min(range[0], row % shape_[2]);
    range[1] = row % shape_[2];
  }
  for (int a = 0; a < 3; ++a) {
    probes_[a].resize(static_cast<std::size_t>((2 * shape_[a] - 1) * kAllProbes + 1));  // `add_offsets` reads on
    for (Index d = 1 - shape_[a]; d < shape_[a]; ++d) {
      for (Index p = 0; p < kAllProbes; ++p) {
        const Index n = probe_at(order, p, d < 0 ? -d : d);
        probes_[a][(d + shape_[a] - 1) * kAllProbes + p] = static_cast<std::int32_t>((d < 0 ? -n : n) * strides_[a]);
      }
    }
  }
  steps_ = SegmentSteps(shape_, strides_);
  Index n_voxels = 0;
  for (const std::uint8_t byte : crop.bytes) n_voxels += byte != 0 ? 1 : 0;
  counts_.n_levels = static_cast<int>(highest_bit(static_cast<Word>(n_voxels))) + 1;
}

void LabelTiles::stand_at(const Index* low) {
  at_ = 0;
  for (int a = 0; a < 3; ++a) {
    low_[a] = low[axes_[a]] + margin_[a];
    at_ += low_[a] * strides_[a];
  }
  std::copy_n(words_.data() + at_, 4, own_);
  counts_.clear();
}

// Where more than enough is hidden nothing is to be found; counts go on from what is known.
void LabelTiles::start_at(const Index* low, Index enough, Span<const Index> hidden) {
  stand_at(low);
  counts_.start(hidden, enough, own_);
}

// Voxels from which more than enough is hidden are no longer looked from. Whether none is left.
bool LabelTiles::drop(Index enough) {
  counts_.settle();
  counts_.keep_up_to(enough, own_);
  return is_none(four(own_));
}

// Planes and rows from the tile outwards, so that places nearer to it are known.
void LabelTiles::look(const Index* low, Index enough, Span<Index> hidden, Index& n_steps, Stop& stop) {
  start_at(low, enough, hidden);
  Word of[4];
  std::copy_n(own_, 4, of);
  const auto look_at_plane = [&](Index j) {
    for (Index k = low_[2]; k < shape_[2]; ++k) look_at_rows(j, k);
    for (Index k = low_[2] - 1; k >= 0; --k) look_at_rows(j, k);
    n_steps_ += shape_[2];
    stop.poll(n_steps_);
    n_steps += n_steps_;
    n_steps_ = 0;
  };
  look_at_plane(low_[1]);
  const bool is_up_first = 2 * low_[1] < shape_[1];  // where more is far
  bool is_over = false;
  for (const bool is_up : {is_up_first, !is_up_first}) {
    const Index n = is_up ? shape_[1] - 1 - low_[1] : low_[1];
    for (Index p = 1; p <= n && !is_over; ++p) {
      look_at_plane(is_up ? low_[1] + p : low_[1] - p);
      is_over = p % kPlanes == 0 && drop(enough);
    }
  }
  counts_.settle();
  counts_.write(hidden, of);
}

// Both ways along the first axis.
void LabelTiles::look_at_rows(Index j, Index k) {
  const Index first = first_[j * shape_[2] + k], last = last_[j * shape_[2] + k];
  if (first > last) return;
  const Index dj = j - low_[1], dk = k - low_[2], start = (j * shape_[2] + k) * shape_[0];
  Row row{0,
          0,
          1,
          {0, dj, dk},
          dj == 0  ? 0
          : dj > 0 ? -strides_[1]
                   : strides_[1],
          dk == 0  ? 0
          : dk > 0 ? -strides_[2]
                   : strides_[2]};
  for (const bool is_up : {true, false}) {
    const Index from = is_up ? std::max(first, low_[0]) : std::min(last, low_[0] - 1);
    row.n = is_up ? last + 1 - from : from + 1 - first;
    if (row.n <= 0) continue;
    row.at = start + from;
    row.step = is_up ? 1 : -1;
    row.d[0] = from - low_[0];
    n_steps_ += row.n;
#ifdef VOXKERNEL_HAS_AVX2
    if (has_avx2) {
      look_at_avx2(row);
      continue;
    }
#endif
    look_at(row);
  }
}

// The rows nearer to the tile. Where there is none, all would be seen there.
LabelTiles::Near LabelTiles::near_of(const Row& row) const {
  const Word* const seen = seen_.data() + 4 * row.at;
  const Word* const ones = ones_.data();
  const Index step = 4 * row.step, b = std::abs(row.d[1]), c = std::abs(row.d[2]);
  const bool has_j = row.back_j != 0, has_k = row.back_k != 0;
  return {has_j ? seen + 4 * row.back_j : ones,
          has_k ? seen + 4 * row.back_k : ones,
          has_j || has_k ? seen + 4 * (row.back_j + row.back_k) : ones,
          has_j ? step : 0,
          has_k ? step : 0,
          has_j || has_k ? step : 0,
          std::max(b, c),
          b >= c};
}

// The places a segment takes the tile to, until a visit after some of them says no.
template <typename See, typename GoesOn>
void LabelTiles::walk(Index at, const Index* d, See&& see, GoesOn&& goes_on) {
  const Index back[3] = {-d[0], -d[1], -d[2]};
  if (!steps_.is_kept()) {
    SegmentWalk walk(at, back, strides_);
    while (goes_on() && walk.advance()) {
      ++n_steps_;
      see(walk.at());
    }
    return;
  }
  const SegmentSteps::Found found = steps_.find(back);
  for (const std::uint8_t* s = found.steps; *s != 0 && goes_on(); s += SegmentSteps::kEnds) {
    n_steps_ += SegmentSteps::kEnds;
    for (Index n = 0; n < SegmentSteps::kEnds; ++n) see(at += found.moves[s[n]]);
  }
}

// A voxel sees what is at d from it if it sees what is nearer by one along each axis (LabelRows::sure), here for all
// voxels of the tile. What is left is probed before it is walked along; what is
// hidden is counted where the passes before did not find it.
void LabelTiles::look_at(const Row& row) {
  const Word* const words = words_.data();
  const Four own = four(own_);
  const Near near = near_of(row);
  Four last{}, last_j{}, last_k{}, last_jk{};
  if (row.d[0] == 0) {
    last = last_j = last_k = last_jk = four(ones_.data());
  } else {
    last_j = four(near.j - near.step_j);
    last_k = four(near.k - near.step_k);
    last_jk = four(near.jk - near.step_jk);
  }
  Index d[3] = {row.d[0], row.d[1], row.d[2]};
  const std::int32_t* const probes_j = probes_[1].data() + (d[1] + shape_[1] - 1) * kAllProbes;
  const std::int32_t* const probes_k = probes_[2].data() + (d[2] + shape_[2] - 1) * kAllProbes;
  Index at = row.at;
  for (Index i = 0; i < row.n; ++i, at += row.step, d[0] += row.step) {
    const Four wanted = both(own, four(words + at));
    const Four in_j = four(near.j + i * near.step_j), in_k = four(near.k + i * near.step_k);
    const Four in_jk = four(near.jk + i * near.step_jk);
    Four sure = both(last, both(in_j, in_k));
    if (std::abs(d[0]) >= near.longest) {
      sure = either(sure, both(both(last, last_j), both(last_k, last_jk)));
    } else if (near.is_j) {
      sure = either(sure, both(both(in_j, last_j), both(in_jk, last_jk)));
    } else {
      sure = either(sure, both(both(in_k, last_k), both(in_jk, last_jk)));
    }
    sure = both(sure, wanted);
    last_j = in_j;
    last_k = in_k;
    last_jk = in_jk;
    const Four open = without(wanted, sure);
    last = sure;
    if (!is_none(open)) {
      Four seen = open;
      const std::int32_t* const probes_i = probes_[0].data() + (d[0] + shape_[0] - 1) * kAllProbes;
      const auto probe = [&](Four& found, int from, int to) {
        for (int p = from; p < to; ++p)
          found = both(found, four(words + at_ + probes_i[p] + probes_j[p] + probes_k[p]));
      };
      probe(seen, 0, kProbes[1]);
      if (!is_none(seen)) {
        Four hidden = seen;
        walk(at, d, [&](Index to) { seen = both(seen, four(words + to)); }, [&] { return !is_none(seen); });
        for (int w = 0; w < 4; ++w) last.w[w] |= seen.w[w];
        hidden = without(hidden, seen);
        if (!is_none(hidden)) {
          probe(hidden, kProbes[1], n_probes(std::max(std::abs(d[0]), near.longest)));
          store(counts_.waiting[counts_.n_waiting], hidden);
          if (!is_none(hidden)) counts_.count_waiting();
        }
      }
    }
    store(seen_.data() + 4 * at, last);
  }
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2 void LabelTiles::look_at_avx2(const Row& row) {
  const Word* const words = words_.data();
  const __m256i own = load_words(own_);
  const Near near = near_of(row);
  __m256i last = _mm256_setzero_si256(), last_j, last_k, last_jk;
  if (row.d[0] == 0) {
    last = last_j = last_k = last_jk = load_words(ones_.data());
  } else {
    last_j = load_words(near.j - near.step_j);
    last_k = load_words(near.k - near.step_k);
    last_jk = load_words(near.jk - near.step_jk);
  }
  Index d[3] = {row.d[0], row.d[1], row.d[2]};
  Word* seen_at = seen_.data() + 4 * row.at;
  const std::int32_t* probes_i = probes_[0].data() + (d[0] + shape_[0] - 1) * kAllProbes;
  Index probed[kAllProbes + 1];
  add_offsets<kAllProbes>(probes_[1].data() + (d[1] + shape_[1] - 1) * kAllProbes,
                          probes_[2].data() + (d[2] + shape_[2] - 1) * kAllProbes, at_, probed);
  Index at = row.at, n_steps = 0;
  for (Index i = 0; i < row.n; ++i) {
    const __m256i wanted = _mm256_and_si256(own, load_words(words + at));
    const __m256i in_j = load_words(near.j + i * near.step_j), in_k = load_words(near.k + i * near.step_k);
    const __m256i in_jk = load_words(near.jk + i * near.step_jk);
    __m256i sure = and_all(last, in_j, in_k, wanted);
    if (std::abs(d[0]) >= near.longest) {
      sure = _mm256_or_si256(sure, and_all(last, last_j, last_k, last_jk));
    } else if (near.is_j) {
      sure = _mm256_or_si256(sure, and_all(in_j, last_j, in_jk, last_jk));
    } else {
      sure = _mm256_or_si256(sure, and_all(in_k, last_k, in_jk, last_jk));
    }
    sure = _mm256_and_si256(sure, wanted);
    last_j = in_j;
    last_k = in_k;
    last_jk = in_jk;
    const __m256i open = _mm256_andnot_si256(sure, wanted);
    last = sure;
    if (!is_none(open)) {
      __m256i seen = open;
      for (int p = 0; p < kProbes[1]; ++p) seen = _mm256_and_si256(seen, load_words(words + probed[p] + probes_i[p]));
      if (!is_none(seen)) {
        __m256i hidden = seen;
        const Index back[3] = {-d[0], -d[1], -d[2]};
        if (steps_.is_kept()) {
          const SegmentSteps::Found found = steps_.find(back);
          const Word* to = words + at;
          for (const std::uint8_t* s = found.steps; *s != 0 && !is_none(seen); s += SegmentSteps::kEnds) {
            n_steps += SegmentSteps::kEnds;
            for (Index n = 0; n < SegmentSteps::kEnds; ++n) {
              to += found.moves[s[n]];
              seen = _mm256_and_si256(seen, load_words(to));
            }
          }
        } else {
          SegmentWalk walk(at, back, strides_);
          while (!is_none(seen) && walk.advance()) {
            ++n_steps;
            seen = _mm256_and_si256(seen, load_words(words + walk.at()));
          }
        }
        last = _mm256_or_si256(sure, seen);
        hidden = _mm256_andnot_si256(seen, hidden);
        if (!is_none(hidden)) {
          const int n = n_probes(std::max(std::abs(d[0]), near.longest));
          for (int p = kProbes[1]; p < n; ++p)
            hidden = _mm256_and_si256(hidden, load_words(words + probed[p] + probes_i[p]));
          store_words(counts_.waiting[counts_.n_waiting], hidden);
          if (!is_none(hidden)) counts_.count_waiting();
        }
      }
    }
    store_words(seen_at, last);
    at += row.step;
    d[0] += row.step;
    seen_at += 4 * row.step;
    probes_i += kAllProbes * row.step;
  }
  n_steps_ += n_steps;
}
#endif

}  // namespace voxkernel
