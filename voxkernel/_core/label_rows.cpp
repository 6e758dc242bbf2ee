#include "label_rows.h"

#include <algorithm>
#include <cstdlib>

#include "bits.h"

namespace voxkernel {
namespace {

using Word = std::uint64_t;
constexpr Index kBits = 64;
constexpr std::int32_t kFar = 1 << 22;  // background goes on for ever outside the grid
constexpr Index kRowSteps = 4;          // a row costs about as much as so many voxels of a segment

Word from_bit(Index bit) { return ~Word{0} << bit; }
Word to_bit(Index bit) { return ~Word{0} >> (kBits - 1 - bit); }

template <bool is_up>
Word shifted(Word word, Index by) {
  return is_up ? word << by : word >> by;
}

// `seeds` and the bits of `of` that follow one of them without a gap.
template <bool is_up>
Word filled(Word of, Word seeds) {
  for (Index by = 1; by < kBits; by *= 2) {
    const Word more = of & shifted<is_up>(seeds, by) & ~seeds;
    if (more == 0) break;
    seeds |= more;
    of &= shifted<is_up>(of, by);
  }
  return seeds;
}

// The same for one of `of`.
template <bool is_up>
Word run_of(Word of, Word seed) {
  if (is_up) return of & ~(of + seed);
  const Word gaps = ~of & (seed - 1), below = seed | (seed - 1);
  return gaps == 0 ? below : below & ~to_bit(highest_bit(gaps));
}

// Ones spread by `reach` along a line of `n` groups of words, `stride` words from one to the next. What has spread by c
// already may be moved by up to 2 c + 1 without leaving gaps. On its way it may leave the line by up to `reach`.
void widen_across(Word* words, Index n, Index stride, Index group, Index reach, std::vector<Word>& line) {
  const Index size = (n + 2 * reach) * group;
  line.assign(static_cast<std::size_t>(2 * size), 0);
  Word *from = line.data(), *to = from + size;
  for (Index i = 0; i < n; ++i) std::copy_n(words + i * stride, group, from + (i + reach) * group);
  for (Index c = 0; c < reach;) {
    const Index by = std::min(2 * c + 1, reach - c), move = by * group;
    for (Index w = 0; w < size; ++w) to[w] = from[w];
    for (Index w = move; w < size; ++w) to[w] |= from[w - move];
    for (Index w = 0; w < size - move; ++w) to[w] |= from[w + move];
    std::swap(from, to);
    c += by;
  }
  for (Index i = 0; i < n; ++i) std::copy_n(from + (i + reach) * group, group, words + i * stride);
}

// The same along the bits of a row.
void widen_along(Word* row, Index n_words, Index n_bits, Index reach, std::vector<Word>& line) {
  line.resize(static_cast<std::size_t>(n_words + 2));
  for (Index c = 0; c < reach;) {
    const Index by = std::min(std::min(2 * c + 1, reach - c), kBits - 1);
    line.front() = line.back() = 0;
    std::copy_n(row, n_words, line.data() + 1);
    for (Index w = 0; w < n_words; ++w) {
      const Word* own = line.data() + 1 + w;
      row[w] |= own[0] << by | own[-1] >> (kBits - by) | own[0] >> by | own[1] << (kBits - by);
    }
    if (n_bits % kBits != 0) row[n_words - 1] &= to_bit(n_bits % kBits - 1);
    c += by;
  }
}

}  // namespace

LabelRows::Walls::Walls(Index n, const Index* shape) {
  if (std::max({shape[0], shape[1], shape[2]}) < UINT16_MAX) {
    short_.assign(static_cast<std::size_t>(n), ShortWall{0, 0, 1, 0});
  } else {
    long_.assign(static_cast<std::size_t>(n), Wall{0, 0, 0, -1});
  }
}

LabelRows::Wall LabelRows::Walls::operator[](Index at) const {
  if (short_.empty()) return long_[at];
  const ShortWall& wall = short_[at];
  return {wall.i, wall.j, wall.first == 0 ? -kFar : wall.first - 1, wall.last == UINT16_MAX ? kFar : wall.last - 1};
}

void LabelRows::Walls::set(Index at, const Wall& wall) {
  if (short_.empty()) {
    long_[at] = wall;
    return;
  }
  const auto narrow = [](std::int32_t n) { return static_cast<std::uint16_t>(n); };
  short_[at] = {narrow(wall.i), narrow(wall.j), narrow(wall.first < 0 ? 0 : wall.first + 1),
                narrow(wall.last == kFar ? UINT16_MAX : wall.last + 1)};
}

LabelRows::LabelRows(const Crop& crop, Index reach, const LabelRows* like) {
  // Rows along the axis that needs the fewest words.
  Index fewest = -1;
  for (int a = crop.is_flat ? 1 : 0; a < 3; ++a) {
    Index words = 1;
    for (int b = 0; b < 3; ++b) {
      const Index n = crop.shape[b] + (crop.is_flat && b == 0 ? 0 : 2 * reach);
      words *= a == b ? (n + kBits - 1) / kBits : n;
    }
    if (fewest >= 0 && words > fewest) continue;
    fewest = words;
    axes_[2] = a;
  }
  axes_[0] = axes_[2] == 0 ? 1 : 0;
  axes_[1] = 3 - axes_[0] - axes_[2];
  const Index edge = 2 * reach + 1;
  for (int a = 0; a < 3; ++a) {
    const bool is_widened = reach > 0 && !(crop.is_flat && axes_[a] == 0);
    extent_[a] = crop.shape[axes_[a]];
    // Nothing is looked at farther out than targets and the outermost middles of cubes.
    const Index last_middle = (extent_[a] - 1) / edge * edge + reach;
    margin_[a] = !is_widened ? 0 : a < 2 ? 1 : reach;
    shape_[a] = extent_[a] + 2 * margin_[a];
    if (is_widened && a < 2) shape_[a] = std::max(shape_[a], last_middle + margin_[a] + 2);
    if (a < 2) full_[a] = extent_[a] + (is_widened ? 2 * reach : 0);
  }
  n_words_ = (shape_[2] + kBits - 1) / kBits;
  n_own_ = (extent_[2] + kBits - 1) / kBits;
  whole_ = (margin_[2] + kBits - 1) / kBits;
  bit_ = whole_ * kBits - margin_[2];
  strides_[0] = shape_[1] * n_words_ * kBits;
  strides_[1] = n_words_ * kBits;
  strides_[2] = 1;
  if (like != nullptr && std::equal(axes_, axes_ + 3, like->axes_)) {
    shared_ = like->shared_;
  } else {
    shared_ = std::make_shared<Shared>();
    take_targets(crop);
  }
  targets_ = open_ = shared_->targets.data();
  const Index n_rows = shape_[0] * shape_[1];
  if (reach > 0) {
    widen(reach);
    open_ = widened_.data();
  }
  const std::size_t n_all = static_cast<std::size_t>(n_rows * n_words_);
  if (shared_->seen.size() < n_all) {
    Brief<Word>().swap(shared_->seen);
    shared_->seen.assign(n_all, 0);
  }
  walls_ = Walls(2 * n_rows, shape_);
  is_open_.assign(static_cast<std::size_t>(n_rows), 0);
  for (Index w = 0; w < n_rows * n_words_; ++w) {
    if (open_[w] != 0) is_open_[w / n_words_] = 1;
  }
  steps_ = SegmentSteps(shape_, strides_);
}

void LabelRows::take_targets(const Crop& crop) {
  Brief<Word>& targets = shared_->targets;
  targets.assign(static_cast<std::size_t>(extent_[0] * extent_[1] * n_own_), 0);
  Index steps[3];
  steps[axes_[0]] = extent_[1] * n_own_ * kBits;
  steps[axes_[1]] = n_own_ * kBits;
  steps[axes_[2]] = 1;
  for (Index i = 0; i < crop.shape[0]; ++i) {
    for (Index j = 0; j < crop.shape[1]; ++j) {
      const std::uint8_t* from = crop.bytes.data() + crop.flat(i, j, 0);
      Index to = i * steps[0] + j * steps[1];
      for (Index k = 0; k < crop.shape[2]; ++k, to += steps[2]) {
        targets[to / kBits] |= Word{from[k] != 0 ? 1u : 0u} << (to % kBits);
      }
    }
  }
}

void LabelRows::widen(Index reach) {
  widened_.assign(static_cast<std::size_t>(shape_[0] * shape_[1] * n_words_), 0);
  std::vector<Word> line;
  for (Index i = margin_[0]; i < margin_[0] + extent_[0]; ++i) {
    for (Index j = margin_[1]; j < margin_[1] + extent_[1]; ++j) {
      const Word* own = targets_of(i, j);
      Word* row = widened_.data() + (i * shape_[1] + j) * n_words_;
      for (Index w = 0; w < n_words_; ++w) row[w] = targets_in(own, w);
      if (margin_[2] > 0) widen_along(row, n_words_, shape_[2], reach, line);
    }
  }
  for (Index i = 0; margin_[1] > 0 && i < shape_[0]; ++i) {
    widen_across(widened_.data() + i * shape_[1] * n_words_, shape_[1], n_words_, n_words_, reach, line);
  }
  for (Index j = 0; margin_[0] > 0 && j < shape_[1]; ++j) {
    widen_across(widened_.data() + j * n_words_, shape_[0], shape_[1] * n_words_, n_words_, reach, line);
  }
}

// Nothing outside the crop.
const Word* LabelRows::targets_of(Index i, Index j) const {
  const Index own_i = i - margin_[0], own_j = j - margin_[1];
  if (own_i < 0 || own_i >= extent_[0] || own_j < 0 || own_j >= extent_[1]) return nullptr;
  return targets_ + (own_i * extent_[1] + own_j) * n_own_;
}

// The targets in a word of a row with its margin.
inline Word LabelRows::targets_in(const Word* row, Index word) const {
  if (margin_[2] == 0) return row[word];
  const Index whole = word - whole_;
  const Word low = whole >= 0 && whole < n_own_ ? row[whole] >> bit_ : 0;
  const Word high = bit_ > 0 && whole >= -1 && whole + 1 < n_own_ ? row[whole + 1] << (kBits - bit_) : 0;
  return low | high;
}

void LabelRows::stand_at(const Index* voxel) {
  at_ = 0;
  for (int a = 0; a < 3; ++a) {
    center_[a] = voxel[axes_[a]] + margin_[a];
    at_ += center_[a] * strides_[a];
  }
  seen_ = shared_->seen.data();
  n_hidden_ = n_steps_ = 0;
}

// Planes and rows from the centre outwards, so that those nearer to it are known. All that are open count as looked at.
Index LabelRows::hidden(const Index* voxel, Index enough, Index& n_steps, Stop& stop) {
  stand_at(voxel);
  Index low[2], high[2];
  for (int a = 0; a < 2; ++a) {
    low[a] = std::min(center_[a], margin_[a] + 1);
    high[a] = std::max(center_[a], margin_[a] + extent_[a] - 2);
  }
  const Index first_plane = center_[0] - margin_[0] + (full_[0] - extent_[0]) / 2;  // in all that is open
  for (const Index step_i : {Index{1}, Index{-1}}) {
    Index n_planes = step_i > 0 ? full_[0] - 1 - first_plane : first_plane - 1;
    for (Index i = step_i > 0 ? center_[0] : center_[0] - 1; i >= low[0] && i <= high[0]; i += step_i) {
      back_i_ = i == center_[0] ? 0 : -step_i * shape_[1];
      back_j_ = -1;
      for (Index j = center_[1]; j <= high[1]; ++j) look_at(i, j);
      back_j_ = 1;
      for (Index j = center_[1] - 1; j >= low[1]; --j) look_at(i, j);
      n_steps_ += kRowSteps * full_[1];
      stop.poll(n_steps_);
      n_steps += n_steps_;
      n_steps_ = 0;
      --n_planes;
      if (n_hidden_ > enough) return n_hidden_;
    }
    n_steps += n_planes * kRowSteps * full_[1];
  }
  return n_hidden_;
}

void LabelRows::list_hidden(const Crop& crop, std::vector<Index>& targets) const {
  targets.clear();
  Index steps[3];
  for (int a = 0; a < 3; ++a) steps[a] = crop.stride(axes_[a]);
  for (Index row = 0; row < shape_[0] * shape_[1]; ++row) {
    if (is_open_[row] == 0) continue;
    const Index start = row / shape_[1] * steps[0] + row % shape_[1] * steps[1];
    for (Index w = 0; w < n_words_; ++w) {
      Word left = targets_[row * n_words_ + w] & ~seen_[row * n_words_ + w];
      for (; left != 0; left &= left - 1) targets.push_back(start + (w * kBits + lowest_bit(left)) * steps[2]);
    }
  }
}

void LabelRows::look_at(Index i, Index j) {
  const Index row = i * shape_[1] + j;
  if (is_open_[row] == 0) {
    std::fill_n(seen_ + row * n_words_, n_words_, 0);
    return;
  }
  offset_[0] = i - center_[0];
  offset_[1] = j - center_[1];
  row_targets_ = targets_of(i, j);
  half_row<true>(row);
  half_row<false>(row);
  if (row_targets_ == nullptr) return;
  const Word* seen = seen_ + row * n_words_;
  for (Index w = 0; w < n_words_; ++w) n_hidden_ += count_bits(targets_in(row_targets_, w) & ~seen[w]);
}

template <bool is_up>
void LabelRows::half_row(Index row) {
  const Index middle = center_[2] / kBits, bit = center_[2] % kBits;
  Word* seen_row = seen_ + row * n_words_;
  bool goes_on = is_up || (seen_row[middle] >> bit & 1u) != 0;  // whether the voxel before the next one is seen
  for (Index w = middle; is_up ? w < n_words_ : w >= 0; w += is_up ? 1 : -1) {
    Word mask = ~Word{0};
    if (w == middle) mask = is_up ? from_bit(bit) : bit == 0 ? 0 : to_bit(bit - 1);
    if (mask == 0) continue;
    const Index at = row * n_words_ + w;
    if ((open_[at] & mask) == 0) {
      goes_on = false;
      if (w != middle || is_up) seen_row[w] = 0;
      continue;
    }
    Word chain;
    Word found = sure<is_up>(at, w, mask, goes_on, chain);
    Word left = row_targets_ == nullptr ? 0 : targets_in(row_targets_, w) & mask & ~found;
    while (left != 0) {
      const Index k = is_up ? lowest_bit(left) : highest_bit(left);
      const Word hides = dark<is_up>(row, w, w * kBits + k);
      left &= ~hides;
      if (hides != 0) continue;
      const Word one = Word{1} << k, next = shifted<is_up>(one, 1);
      found |= one;
      if ((chain & next) != 0) found |= run_of<is_up>(chain, next);
      left &= ~found;
    }
    goes_on = (found >> (is_up ? kBits - 1 : 0) & 1u) != 0;
    seen_row[w] = w == middle && !is_up ? seen_row[w] | found : found;
  }
}

// Voxels of a word that are seen because others are; `chain`: those that are if the one before them in the row is.
//
// A segment to a voxel d touches, apart from d, only voxels that are touched by the segments to the neighbours of d
// that are nearer by one along an axis. For: the ends whose segments touch p are those in open cubes of edge l >= 1
// around l p. Let d be in such a cube, and let l shrink until d is on its border, on upper faces then, with l > 1, as d
// is not p. For a slightly larger l the neighbour along the axis of one of these faces is in the cube, too.
//
// And let the segment be longest along one axis, and r its point nearer by one along this. What it touches between r
// and d, apart from d, and what it touches before r is touched by segments to the lattice points around r, at most
// four, or is one of them: an open cube of edge l > 1 that holds r holds one of them, and one of edge 1 its middle.
template <bool is_up>
Word LabelRows::sure(Index at, Index word, Word mask, bool goes_on, Word& chain) const {
  const Index a = std::abs(offset_[0]), b = std::abs(offset_[1]);
  const bool has_i = a > 0, has_j = b > 0;
  const Word open = open_[at] & mask;
  const Word near_i = has_i ? seen_[at + back_i_ * n_words_] : ~Word{0};
  const Word near_j = has_j ? seen_[at + back_j_ * n_words_] : ~Word{0};
  const Word near_ij = has_i && has_j ? seen_[at + (back_i_ + back_j_) * n_words_] : ~Word{0};
  const Word flank = near_i & near_j;
  // What the word before this one holds is taken for unseen.
  chain = open & (flank | (shifted<is_up>(flank & near_ij, 1) & ~within<is_up>(word, std::max(a, b) - 1)));
  Word seeds = 0;
  const Word zero = within<is_up>(word, 0);
  if (has_i && a >= b) {
    const Word ahead = near_i & near_ij;
    seeds |= ahead & (shifted<is_up>(ahead, 1) | zero) & within<is_up>(word, a);
  }
  if (has_j && b >= a) {
    const Word ahead = near_j & near_ij;
    seeds |= ahead & (shifted<is_up>(ahead, 1) | zero) & within<is_up>(word, b);
  }
  if (goes_on) seeds |= chain & (is_up ? mask & (~mask + 1) : Word{1} << highest_bit(mask));
  return filled<is_up>(chain, seeds & open);
}

// The voxels of a word that are at most `c` from the middle of their row.
template <bool is_up>
Word LabelRows::within(Index word, Index c) const {
  const Index end = (is_up ? center_[2] + c : center_[2] - c) - word * kBits;
  if (c < 0) return 0;
  if (is_up) return end < 0 ? 0 : to_bit(std::min(end, kBits - 1));
  return end >= kBits ? 0 : from_bit(std::max<Index>(end, 0));
}

// 0 where voxel k of a row is seen; else what the same wall hides of a word.
template <bool is_up>
Word LabelRows::dark(Index row, Index word, Index k) {
  const Index half = is_up ? 0 : 1;
  const Index own = 2 * row + half;
  Word hides = shadow<is_up>(walls_[own], word, k);
  if (hides != 0) return hides;
  for (const Index back : {back_i_, offset_[1] == 0 ? Index{0} : back_j_}) {
    if (back == 0) continue;
    const Wall wall = walls_[2 * (row + back) + half];
    hides = shadow<is_up>(wall, word, k);
    if (hides == 0) continue;
    walls_.set(own, wall);
    return hides;
  }
  const Index at = find_wall(row, k);
  if (at < 0) return 0;
  const Wall wall = wall_at(at);
  walls_.set(own, wall);
  return shadow<is_up>(wall, word, k);
}

// Of half of the row at work, all that a wall hides in a word; 0 if `k` is given, and it does not hide that. The
// segment to c voxels up the row is in the column of the wall at the shares s of it with s1 < s < s2, and touches the
// wall if c s2 > first - 1/2 and c s1 < last + 1/2: an interval of c.
template <bool is_up>
Word LabelRows::shadow(const Wall& wall, Index word, Index k) const {
  if (wall.first > wall.last) return 0;
  // s1 = n1 / (2 d1), s2 = n2 / (2 d2)
  Index n1 = 0, d1 = 1, n2 = 2, d2 = 1;
  const Index columns[2] = {wall.i - center_[0], wall.j - center_[1]};
  for (int axis = 0; axis < 2; ++axis) {
    const Index d = offset_[axis] < 0 ? -offset_[axis] : offset_[axis];
    const Index n = offset_[axis] < 0 ? -columns[axis] : columns[axis];
    if (n < 0 || n > d) return 0;
    if (d == 0) continue;
    if ((2 * n - 1) * d1 > n1 * d) {
      n1 = 2 * n - 1;
      d1 = d;
    }
    if ((2 * n + 1) * d2 < n2 * d) {
      n2 = 2 * n + 1;
      d2 = d;
    }
  }
  if (n1 * d2 >= n2 * d1) return 0;
  const Index first = 2 * (is_up ? wall.first - center_[2] : center_[2] - wall.last) - 1;  // halves of voxels
  const Index last = 2 * (is_up ? wall.last - center_[2] : center_[2] - wall.first) + 1;
  if (last < 0) return 0;
  if (k >= 0) {
    const Index c = is_up ? k - center_[2] : center_[2] - k;
    if (c * n2 <= first * d2 || c * n1 >= last * d1) return 0;
  }
  const Index low = first > 0 ? first * d2 / n2 + 1 : is_up ? 0 : 1;
  const Index high = n1 > 0 ? std::min<Index>((last * d1 - 1) / n1, kFar) : kFar;
  if (low > high) return 0;
  const Index from = (is_up ? center_[2] + low : center_[2] - high) - word * kBits;
  const Index to = (is_up ? center_[2] + high : center_[2] - low) - word * kBits;
  if (from >= kBits || to < 0) return 0;
  return from_bit(std::max<Index>(from, 0)) & to_bit(std::min(to, kBits - 1));
}

// A voxel of a segment that is not open, the first from its far end; -1 where all are.
Index LabelRows::find_wall(Index row, Index k) {
  const Index d[3] = {-offset_[0], -offset_[1], center_[2] - k};
  Index at = row * strides_[1] + k;
  const auto is_open = [&] { return (open_[at / kBits] >> (at % kBits) & 1u) != 0; };
  if (steps_.is_kept()) {
    const SegmentSteps::Found found = steps_.find(d);
    const std::uint8_t* step = found.steps;
    const Index* moves = found.moves;
    for (; *step != 0; ++step) {
      at += moves[*step];
      ++n_steps_;
      if (!is_open()) return at;
    }
    return -1;
  }
  SegmentWalk walk(at, d, strides_);
  while (walk.advance()) {
    at = walk.at();
    ++n_steps_;
    if (!is_open()) return at;
  }
  return -1;
}

// The run of background that a position is in, as far as its word tells.
LabelRows::Wall LabelRows::wall_at(Index position) const {
  const Index row = position / strides_[1], k = position % strides_[1];
  const Index word = k / kBits, bit = k % kBits;
  const Word open = open_[row * n_words_ + word];
  const Word above = open & ~to_bit(bit), below = open & ~from_bit(bit);
  Index first = word == 0 ? -kFar : word * kBits, last = word == n_words_ - 1 ? kFar : (word + 1) * kBits - 1;
  if (below != 0) first = word * kBits + highest_bit(below) + 1;
  if (above != 0) last = word * kBits + lowest_bit(above) - 1;
  return {static_cast<std::int32_t>(row / shape_[1]), static_cast<std::int32_t>(row % shape_[1]),
          static_cast<std::int32_t>(first), static_cast<std::int32_t>(last)};
}

}  // namespace voxkernel
