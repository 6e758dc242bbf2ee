// Signed integers of any width, for signs that floating point cannot decide.
//
// A `Wide` is a sign and a magnitude in limbs of 64 bits, the lowest first, the highest not zero. It does not own its
// limbs: a `LimbPool` does, and gives them back all at once. Every operation is exact and never overflows.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

namespace voxkernel {

struct Wide {
  const std::uint64_t* limbs = nullptr;
  int size = 0;  // 0 is zero
  int sign = 0;
};

// The memory of many short-lived numbers: blocks that grow, forgotten together.
class LimbPool {
 public:
  std::uint64_t* take(int n) {
    while (true) {
      if (block_ < blocks_.size()) {
        if (used_ + n <= blocks_[block_].size) {
          used_ += n;
          return blocks_[block_].data.get() + used_ - n;
        }
        ++block_;
        used_ = 0;
        continue;
      }
      const int size = std::max(n, kFirst);
      blocks_.push_back({std::unique_ptr<std::uint64_t[]>(new std::uint64_t[size]), size});
    }
  }
  void forget() {
    block_ = 0;
    used_ = 0;
  }

 private:
  static constexpr int kFirst = 4096;
  struct Block {
    std::unique_ptr<std::uint64_t[]> data;
    int size;
  };
  std::vector<Block> blocks_;
  std::size_t block_ = 0;
  int used_ = 0;
};

struct HighLowLimb {
  std::uint64_t high, low;
};

// a b + c + d, which always fits into two limbs.
inline HighLowLimb multiply_add(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d) {
#ifdef __SIZEOF_INT128__
  __extension__ using Double = unsigned __int128;
  const Double product = static_cast<Double>(a) * b + c + d;
  return {static_cast<std::uint64_t>(product >> 64), static_cast<std::uint64_t>(product)};
#else
  const std::uint64_t mask = 0xffffffffu, a0 = a & mask, a1 = a >> 32, b0 = b & mask, b1 = b >> 32;
  const std::uint64_t low = a0 * b0, middle = a1 * b0 + (low >> 32), other = a0 * b1 + (middle & mask);
  std::uint64_t high = a1 * b1 + (middle >> 32) + (other >> 32), rest = (other << 32) | (low & mask);
  rest += c;
  high += rest < c;
  rest += d;
  high += rest < d;
  return {high, rest};
#endif
}

inline Wide trimmed(const std::uint64_t* limbs, int size, int sign) {
  while (size > 0 && limbs[size - 1] == 0) --size;
  return {limbs, size, size == 0 ? 0 : sign};
}

inline Wide operator-(const Wide& a) { return {a.limbs, a.size, -a.sign}; }

inline int compare_magnitudes(const Wide& a, const Wide& b) {
  if (a.size != b.size) return a.size < b.size ? -1 : 1;
  for (int i = a.size - 1; i >= 0; --i) {
    if (a.limbs[i] != b.limbs[i]) return a.limbs[i] < b.limbs[i] ? -1 : 1;
  }
  return 0;
}

inline Wide product(LimbPool& pool, const Wide& a, const Wide& b) {
  if (a.sign == 0 || b.sign == 0) return {};
  std::uint64_t* out = pool.take(a.size + b.size);
  for (int i = 0; i < a.size; ++i) out[i] = 0;
  for (int j = 0; j < b.size; ++j) {
    const std::uint64_t factor = b.limbs[j];
    std::uint64_t carry = 0;
    for (int i = 0; i < a.size; ++i) {
      const HighLowLimb next = multiply_add(a.limbs[i], factor, out[i + j], carry);
      out[i + j] = next.low;
      carry = next.high;
    }
    out[j + a.size] = carry;
  }
  return trimmed(out, a.size + b.size, a.sign * b.sign);
}

inline Wide sum(LimbPool& pool, const Wide& a, const Wide& b) {
  if (a.sign == 0) return b;
  if (b.sign == 0) return a;
  if (a.sign == b.sign) {
    const Wide& longer = a.size >= b.size ? a : b;
    const Wide& other = a.size >= b.size ? b : a;
    std::uint64_t* out = pool.take(longer.size + 1);
    std::uint64_t carry = 0;
    for (int i = 0; i < longer.size; ++i) {
      const std::uint64_t part = i < other.size ? other.limbs[i] : 0;
      const std::uint64_t once = longer.limbs[i] + part, twice = once + carry;
      carry = static_cast<std::uint64_t>(once < part) + static_cast<std::uint64_t>(twice < carry);
      out[i] = twice;
    }
    out[longer.size] = carry;
    return trimmed(out, longer.size + 1, a.sign);
  }
  const int order = compare_magnitudes(a, b);
  if (order == 0) return {};
  const Wide& larger = order > 0 ? a : b;
  const Wide& other = order > 0 ? b : a;
  std::uint64_t* out = pool.take(larger.size);
  std::uint64_t borrow = 0;
  for (int i = 0; i < larger.size; ++i) {
    const std::uint64_t part = i < other.size ? other.limbs[i] : 0;
    const std::uint64_t once = larger.limbs[i] - part, twice = once - borrow;
    borrow = static_cast<std::uint64_t>(larger.limbs[i] < part) + static_cast<std::uint64_t>(once < borrow);
    out[i] = twice;
  }
  return trimmed(out, larger.size, larger.sign);
}

inline Wide difference(LimbPool& pool, const Wide& a, const Wide& b) { return sum(pool, a, -b); }

// a b - c d.
inline Wide difference_of_products(LimbPool& pool, const Wide& a, const Wide& b, const Wide& c, const Wide& d) {
  return difference(pool, product(pool, a, b), product(pool, c, d));
}

// A finite double that is not zero is +-mantissa 2**exponent.
struct Bits {
  std::uint64_t mantissa;
  int exponent;
};

inline Bits bits_of(double value) {
  std::uint64_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  const std::uint64_t fraction = bits & 0xfffffffffffffu;
  const int exponent = static_cast<int>(bits >> 52 & 0x7ff);
  if (exponent == 0) return {fraction, -1074};
  return {fraction | 0x10000000000000u, exponent - 1075};
}

// The exponent of the lowest bit that is set: the double is an odd integer times 2 to that.
inline int lowest_bit(double value) {
  Bits bits = bits_of(value);
  for (int step = 32; step > 0; step /= 2) {
    if ((bits.mantissa & ((std::uint64_t{1} << step) - 1)) == 0) {
      bits.mantissa >>= step;
      bits.exponent += step;
    }
  }
  return bits.exponent;
}

// value 2**shift, which must be an integer.
inline Wide from_double(LimbPool& pool, double value, int shift) {
  if (value == 0.0) return {};
  Bits bits = bits_of(value);
  int up = bits.exponent + shift;
  if (up < 0) {
    bits.mantissa >>= -up;
    up = 0;
  }
  const int whole = up / 64, part = up % 64;
  std::uint64_t* out = pool.take(whole + 2);
  for (int i = 0; i < whole; ++i) out[i] = 0;
  out[whole] = bits.mantissa << part;
  out[whole + 1] = part == 0 ? 0 : bits.mantissa >> (64 - part);
  return trimmed(out, whole + 2, value > 0.0 ? 1 : -1);
}

// A number as mantissa 2**exponent, rounded: off by less than 2**-52 of itself.
struct Rounded {
  double mantissa = 0.0;
  int exponent = 0;
};

inline Rounded rounded(const Wide& a) {
  if (a.sign == 0) return {};
  double mantissa = static_cast<double>(a.limbs[a.size - 1]);
  if (a.size > 1) mantissa += std::ldexp(static_cast<double>(a.limbs[a.size - 2]), -64);
  return {a.sign * mantissa, 64 * (a.size - 1)};
}

// a / b 2**shift as a double, off by less than 2**-50 of itself where it is neither too large nor too small for one.
inline double quotient(const Rounded& a, const Rounded& b, int shift) {
  return a.mantissa == 0.0 ? 0.0 : std::ldexp(a.mantissa / b.mantissa, a.exponent - b.exponent + shift);
}

}  // namespace voxkernel
