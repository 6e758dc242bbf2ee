// Words and numbers of text files. A number is digits, a point and an exponent, rounded to the nearest double; what
// else a language takes for a number (nan, 1_000) is left to the caller.
#pragma once

#include <charconv>
#include <cstdlib>
#include <limits>
#include <string>
#include <system_error>

#include "spans.h"

namespace voxkernel {

inline bool is_line_end(char c) { return c == '\n' || c == '\r'; }
inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
inline bool is_space(char c) { return is_blank(c) || is_line_end(c); }
inline bool is_digit(char c) { return c >= '0' && c <= '9'; }
// Bytes that no text holds.
inline bool is_control(char c) { return (c >= 0 && c < ' ' && !is_space(c)) || c == '\x7f'; }

// A view of characters that moves on.
struct Text {
  const char* at = nullptr;
  const char* end = nullptr;

  bool is_empty() const { return at == end; }
  Index size() const { return end - at; }
  void skip_blanks() {
    while (at != end && is_blank(*at)) ++at;
  }
  void skip_spaces() {
    while (at != end && is_space(*at)) ++at;
  }
  // The characters up to the next space.
  Text take_word() {
    const char* start = at;
    while (at != end && !is_space(*at)) ++at;
    return {start, at};
  }
};

// A whole word as a finite double; false where it is none, or is out of range.
inline bool parse_double(Text word, double& value) {
  if (!word.is_empty() && *word.at == '+') ++word.at;
  const char* digits = word.at + (!word.is_empty() && *word.at == '-' ? 1 : 0);
  if (digits == word.end || !(is_digit(*digits) || *digits == '.')) return false;
  if (word.at != digits && word.at[-1] == '+') return false;
#if defined(__cpp_lib_to_chars)
  const auto [stop, fault] = std::from_chars(word.at, word.end, value);
  return stop == word.end && fault == std::errc();
#else
  for (const char* c = digits; c != word.end; ++c) {
    if (*c == 'x' || *c == 'X') return false;  // a hexadecimal number of C
  }
  const std::string copy(word.at, word.end);
  char* stop = nullptr;
  value = std::strtod(copy.c_str(), &stop);
  return stop == copy.c_str() + copy.size() && value - value == 0.0;
#endif
}

// Sign and digits as an integer below 2^53; false where the word is something else.
inline bool parse_integer(Text word, Index& value) {
  constexpr Index kMost = Index{1} << 53;
  const bool is_negative = !word.is_empty() && *word.at == '-';
  if (!word.is_empty() && (*word.at == '-' || *word.at == '+')) ++word.at;
  if (word.is_empty()) return false;
  value = 0;
  for (; word.at != word.end; ++word.at) {
    if (!is_digit(*word.at)) return false;
    value = 10 * value + (*word.at - '0');
    if (value >= kMost) return false;
  }
  if (is_negative) value = -value;
  return true;
}

// The next line that ends in the text, without its end; at the end of a file the last line needs none.
inline bool take_line(Text& text, bool is_last, Text& line) {
  const char* stop = text.at;
  while (stop != text.end && !is_line_end(*stop)) ++stop;
  if (stop == text.end && (!is_last || text.is_empty())) return false;
  line = {text.at, stop};
  text.at = stop == text.end ? stop : stop + 1;
  return true;
}

}  // namespace voxkernel
