#include "element_rows.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace voxkernel {

namespace {

// Whether a double is one of the whole numbers that it can tell apart.
bool as_index(double value, Index& index) {
  constexpr double kMost = 9007199254740992.0;
  if (!(value > -kMost && value < kMost)) return false;
  index = static_cast<Index>(value);
  return static_cast<double>(index) == value;
}

}  // namespace

Index ElementRows::feed(Text text, bool is_last, Stop& stop) {
  const char* start = text.at;
  if (layout_ == Layout::text) {
    Text line;
    while (left_ > 0 && take_line(text, is_last, line)) {
      stop.poll();
      if (std::any_of(line.at, line.end, is_control)) return kUnusual;
      if (comment_ != '\0') line.end = std::find(line.at, line.end, comment_);
      line.skip_blanks();
      if (line.is_empty()) continue;
      if (!read_text_row(line)) return kUnusual;
      --left_;
    }
    return text.at - start;
  }
  for (; left_ > 0; --left_) {
    stop.poll();
    const Index bytes = row_bytes(text);
    if (bytes == kUnusual) return kUnusual;
    if (bytes > text.size()) break;
    if (!read_binary_row(text.at)) return kUnusual;
    text.at += bytes;
  }
  return text.at - start;
}

// ---------------------------------------------------------------- text

bool ElementRows::read_text_row(Text line) {
  bool has_point = false;
  for (const Property& property : properties_) {
    line.skip_blanks();
    if (property.is_list()) {
      if (!read_text_list(line, property)) return false;
      continue;
    }
    double value = 0.0;
    if (!parse_double(line.take_word(), value)) return false;
    Index whole = 0;
    if (property.type.kind != 'f' && !as_index(value, whole)) return false;
    if (property.role >= 0) {
      point_[property.role] = value;
      has_point = true;
    }
  }
  unsigned extra = 0;
  for (line.skip_blanks(); !line.is_empty(); line.skip_blanks(), ++extra) {
    double value = 0.0;
    if (extra >= 8 || !parse_double(line.take_word(), value)) return false;
  }
  if ((extra_ >> extra & 1U) == 0) return false;
  if (has_point) {
    for (const double value : point_) found.points.push(value);
  }
  return true;
}

bool ElementRows::read_text_list(Text& line, const Property& property) {
  Index n = 0;
  if (!parse_integer(line.take_word(), n) || n < 0 || n > line.size()) return false;
  for (Index k = 0; k < n; ++k) {
    line.skip_blanks();
    const Text word = line.take_word();
    if (property.role == 3) {
      Index index = 0;
      if (!parse_integer(word, index)) return false;
      found.flat.push(index);
    } else {
      double value = 0.0;
      if (!parse_double(word, value)) return false;
    }
  }
  if (property.role == 3) found.sizes.push(n);
  return true;
}

// ---------------------------------------------------------------- binary

template <typename T>
T ElementRows::load(const char* at) const {
  constexpr std::uint16_t kOne = 1;
  char first = 0;
  std::memcpy(&first, &kOne, 1);
  const bool is_little_machine = first == 1;
  char bytes[sizeof(T)];
  std::memcpy(bytes, at, sizeof(T));
  if (is_little_machine != (layout_ == Layout::little_endian)) std::reverse(bytes, bytes + sizeof(T));
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

double ElementRows::number_at(const char* at, NumberType type) const {
  if (type.kind == 'f') return type.bytes == 4 ? static_cast<double>(load<float>(at)) : load<double>(at);
  if (type.kind == 'u' && type.bytes == 8) return static_cast<double>(load<std::uint64_t>(at));
  Index value = 0;
  integer_at(at, type, value);
  return static_cast<double>(value);
}

// False where the number is no integer of 64 bits with a sign.
bool ElementRows::integer_at(const char* at, NumberType type, Index& value) const {
  if (type.kind == 'f') return as_index(number_at(at, type), value);
  const bool has_sign = type.kind == 'i';
  switch (type.bytes) {
    case 1:
      value = has_sign ? static_cast<Index>(load<std::int8_t>(at)) : static_cast<Index>(load<std::uint8_t>(at));
      break;
    case 2:
      value = has_sign ? static_cast<Index>(load<std::int16_t>(at)) : static_cast<Index>(load<std::uint16_t>(at));
      break;
    case 4:
      value = has_sign ? static_cast<Index>(load<std::int32_t>(at)) : static_cast<Index>(load<std::uint32_t>(at));
      break;
    default:
      value = load<std::int64_t>(at);
      return has_sign || value >= 0;
  }
  return true;
}

// Bytes of the row that starts here: more than there are if its end cannot be seen yet.
Index ElementRows::row_bytes(Text data) const {
  Index at = 0;
  for (const Property& property : properties_) {
    if (!property.is_list()) {
      at += property.type.bytes;
      continue;
    }
    if (at + property.count.bytes > data.size()) return data.size() + 1;
    Index n = 0;
    if (!integer_at(data.at + at, property.count, n) || n < 0 || n > (Index{1} << 40)) return kUnusual;
    at += property.count.bytes + n * property.type.bytes;
    if (at > data.size()) return data.size() + 1;
  }
  return at;
}

bool ElementRows::read_binary_row(const char* at) {
  constexpr Index kMost = Index{1} << 53;
  bool has_point = false;
  for (const Property& property : properties_) {
    if (!property.is_list()) {
      if (property.role >= 0) {
        point_[property.role] = number_at(at, property.type);
        has_point = true;
      }
      at += property.type.bytes;
      continue;
    }
    Index n = 0;
    integer_at(at, property.count, n);
    at += property.count.bytes;
    for (Index k = 0; property.role == 3 && k < n; ++k) {
      Index index = 0;
      if (!integer_at(at + k * property.type.bytes, property.type, index)) return false;
      if (index <= -kMost || index >= kMost) return false;
      found.flat.push(index);
    }
    if (property.role == 3) found.sizes.push(n);
    at += n * property.type.bytes;
  }
  if (has_point) {
    for (const double value : point_) found.points.push(value);
  }
  return true;
}

}  // namespace voxkernel
