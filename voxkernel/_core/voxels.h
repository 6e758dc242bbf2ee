// Voxel masks of 8^3 bricks, and the tiles and leaves an octree hands out.
#pragma once

#include <cstdint>
#include <vector>

#include "spans.h"

namespace voxkernel {

using Word = std::uint64_t;
constexpr Word kAllBits = ~Word{0};

// How many bits of a word are set.
inline Index ones(Word word) {
  word = word - ((word >> 1) & 0x5555555555555555u);
  word = (word & 0x3333333333333333u) + ((word >> 2) & 0x3333333333333333u);
  word = (word + (word >> 4)) & 0x0F0F0F0F0F0F0F0Fu;
  return static_cast<Index>((word * 0x0101010101010101u) >> 56);
}

enum class Content { nothing, everything, some };

// Appends the lower corner of a cell whose edge has 2**exponent voxels.
inline void add_corner(std::vector<std::int32_t>& corners, const Index* cell, int exponent) {
  for (int k = 0; k < 3; ++k) corners.push_back(static_cast<std::int32_t>(cell[k] << exponent));
}

// Lower corners of cubes and the exponents of their edges, in voxels.
struct Tiles {
  std::vector<std::int32_t> ijk;
  std::vector<std::int8_t> log2;

  void add(const Index* cell, int exponent) {
    add_corner(ijk, cell, exponent);
    log2.push_back(static_cast<std::int8_t>(exponent));
  }
};

// Lower corners of 8^3 bricks and their two masks: word = x, bit = 8 y + z.
struct Leaves {
  std::vector<std::int32_t> ijk;
  std::vector<Word> inside;
  std::vector<Word> boundary;

  void add(const Index* cell, const Word* in, const Word* undecided) {
    add_corner(ijk, cell, 3);
    inside.insert(inside.end(), in, in + 8);
    boundary.insert(boundary.end(), undecided, undecided + 8);
  }
};

// The cell of child c.
inline void child_cell(const Index* cell, int c, Index* child) {
  child[0] = 2 * cell[0] + (c >> 2 & 1);
  child[1] = 2 * cell[1] + (c >> 1 & 1);
  child[2] = 2 * cell[2] + (c & 1);
}

}  // namespace voxkernel
