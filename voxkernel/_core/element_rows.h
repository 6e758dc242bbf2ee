// The rows of one element of a .ply or .off file, text or binary, read in stretches: coordinates and lists of indices
// are kept, the rest is passed over. What is wrong or unusual ends the reading.
#pragma once

#include <vector>

#include "growing_array.h"
#include "spans.h"
#include "stop.h"
#include "surface_text.h"
#include "text_numbers.h"

namespace voxkernel {

// Type of a number of a file: 'i', 'u' or 'f', and its bytes.
struct NumberType {
  char kind = 'f';
  int bytes = 8;
};

struct Property {
  NumberType type;
  NumberType count;  // of a list; no bytes of a single number
  int role = -1;     // 0, 1, 2: a coordinate; 3: the indices of a polygon; -1: passed over
  bool is_list() const { return count.bytes > 0; }
};

enum class Layout { text, little_endian, big_endian };

class ElementRows {
 public:
  // Text: what follows `comment` in a line is none (0: there are no comments); a row may be followed by as many further
  // numbers as `extra` has the bit of.
  ElementRows(std::vector<Property> properties, Index n, Layout layout, char comment, unsigned extra)
      : properties_(std::move(properties)), left_(n), layout_(layout), comment_(comment), extra_(extra) {}
  // Bytes used of a stretch, or kUnusual.
  Index feed(Text text, bool is_last, Stop& stop);
  Index rows_left() const { return left_; }
  void before_take() {}
  PolygonArrays found;

 private:
  bool read_text_row(Text line);
  bool read_text_list(Text& line, const Property& property);
  Index row_bytes(Text data) const;
  bool read_binary_row(const char* at);
  double number_at(const char* at, NumberType type) const;
  bool integer_at(const char* at, NumberType type, Index& value) const;
  template <typename T>
  T load(const char* at) const;

  std::vector<Property> properties_;
  Index left_;
  Layout layout_;
  char comment_;
  unsigned extra_;
  double point_[3] = {};
};

}  // namespace voxkernel
