// The octahedron that hulls of dual points begin with: points 0 and 1, 2 and 3, 4 and 5 are opposite each other.
#pragma once

#include <cstdint>

namespace voxkernel {

constexpr std::int32_t kOctahedron[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                            {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};

// Fills, of the eight triangles of an octahedron, `across[k]`: the one across the edge opposite corner k.
template <typename Triangle>
void link_octahedron(Triangle* triangles) {
  for (int i = 0; i < 8; ++i) {
    Triangle& t = triangles[i];
    for (int k = 0; k < 3; ++k) {
      for (std::int32_t other = 0; other < 8; ++other) {
        const Triangle& o = triangles[other];
        for (int m = 0; m < 3; ++m) {
          if (o.corner[m] == t.corner[(k + 2) % 3] && o.corner[(m + 1) % 3] == t.corner[(k + 1) % 3]) {
            t.across[k] = other;
          }
        }
      }
    }
  }
}

}  // namespace voxkernel
