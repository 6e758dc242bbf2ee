#include "surface_text.h"

#include <algorithm>
#include <cstddef>

namespace voxkernel {

namespace {

// A word in any case.
bool is_word(Text word, const char* wanted) {
  for (; word.at != word.end && *wanted != '\0'; ++word.at, ++wanted) {
    const char c = *word.at >= 'A' && *word.at <= 'Z' ? static_cast<char>(*word.at - 'A' + 'a') : *word.at;
    if (c != *wanted) return false;
  }
  return word.at == word.end && *wanted == '\0';
}

// The words of a facet, one state each; '#' is a number of a corner, '*' any word.
constexpr const char* kFacet[] = {"facet",  "normal", "*", "*", "*",      "outer",   "loop",
                                  "vertex", "#",      "#", "#", "vertex", "#",       "#",
                                  "#",      "vertex", "#", "#", "#",      "endloop", "endfacet"};
constexpr int kFacetWords = static_cast<int>(sizeof(kFacet) / sizeof(kFacet[0]));

}  // namespace

// ---------------------------------------------------------------- .obj

Index ObjReader::feed(Text text, bool is_last, Stop& stop) {
  const char* start = text.at;
  Text line;
  while (take_line(text, is_last, line)) {
    stop.poll();
    if (!read_line(line)) return kUnusual;
  }
  return text.at - start;
}

bool ObjReader::read_line(Text line) {
  const char* comment = line.end;
  for (const char* c = line.at; c != line.end; ++c) {
    if (is_control(*c)) return false;
    if (comment != line.end) continue;
    if (*c == '\\') return false;  // it goes on in the next line
    if (*c == '#') comment = c;
  }
  line.end = comment;
  line.skip_blanks();
  while (!line.is_empty() && is_blank(line.end[-1])) --line.end;
  if (line.is_empty()) return true;
  const char* stop = std::find_if(line.at, line.end, [](char c) { return c == ' ' || c == '\t'; });
  const Text rest{stop, line.end};
  word_.assign(line.at, stop);
  if (word_ == "v") return read_vertex(rest);
  if (word_ == "f" || word_ == "fo") return read_face(rest);
  return passed_over_.count(word_) != 0;
}

bool ObjReader::read_vertex(Text rest) {
  double values[7];
  int n = 0;
  for (rest.skip_blanks(); !rest.is_empty(); rest.skip_blanks()) {
    if (n == 7 || !parse_double(rest.take_word(), values[n])) return false;
    ++n;
  }
  if (n != 3 && n != 4 && n != 6 && n != 7) return false;
  for (int k = 0; k < 3; ++k) found.points.push(values[k]);
  return true;
}

bool ObjReader::read_face(Text rest) {
  int pattern = -1;
  Index n = 0;
  for (rest.skip_blanks(); !rest.is_empty(); rest.skip_blanks(), ++n) {
    if (!read_corner(rest.take_word(), pattern)) return false;
  }
  if (n == 0) return false;
  found.sizes.push(n);
  return true;
}

// n, n/n, n//n or n/n/n, all corners of a face alike.
bool ObjReader::read_corner(Text word, int& pattern) {
  int parts = 0;
  int filled = 0;
  Index first = 0;
  for (const char* start = word.at;; ++parts) {
    const char* stop = std::find(start, word.end, '/');
    Index value = 0;
    if (parts == 3) return false;
    if (stop != start) {
      if (!parse_integer({start, stop}, value)) return false;
      filled |= 1 << parts;
    }
    if (parts == 0) first = value;
    if (stop == word.end) break;
    start = stop + 1;
  }
  const int seen = 8 * parts + filled;
  if (seen != 1 && seen != 8 + 3 && seen != 16 + 5 && seen != 16 + 7) return false;
  if (pattern >= 0 && seen != pattern) return false;
  pattern = seen;
  const Index before = n_points();
  if (first == 0 || first < -before) return false;
  const Index id = first > 0 ? first - 1 : before + first;
  highest_ = std::max(highest_, id);
  found.flat.push(id);
  return true;
}

// ---------------------------------------------------------------- .stl

Index StlReader::feed(Text text, bool is_last, Stop& stop) {
  const char* start = text.at;
  // Words may be cut where the stretch ends, but not at the last end of a line.
  while (!is_last && !text.is_empty() && !is_line_end(text.end[-1])) --text.end;
  for (text.skip_spaces(); !text.is_empty(); text.skip_spaces()) {
    stop.poll();
    const Text word = text.take_word();
    if (!read_word(word, text)) return kUnusual;
  }
  return text.end - start;
}

// What follows `solid` and `endsolid` is a name, up to the end of the line.
bool StlReader::end_of_solid_line(Text& text) {
  if (!text.is_empty() && !is_line_end(*text.at) && *text.at != ' ' && *text.at != '\t') return false;
  while (!text.is_empty() && !is_line_end(*text.at)) ++text.at;
  return true;
}

bool StlReader::read_word(Text word, Text& text) {
  if (state_ == 0) {
    if (!is_word(word, "solid")) return false;
    state_ = 1;
    return end_of_solid_line(text);
  }
  if (state_ == 1) {
    bool is_end = is_word(word, "endsolid");
    if (is_word(word, "end") && !text.is_empty() && (*text.at == ' ' || *text.at == '\t')) {
      ++text.at;
      is_end = is_word(text.take_word(), "solid");
    }
    if (is_end) {
      state_ = 0;
      return end_of_solid_line(text);
    }
  }
  const char* wanted = kFacet[state_ - 1];
  if (*wanted == '#') {
    const int k = (state_ - 1) % 4;  // corners are numbers 8 to 10, 12 to 14 and 16 to 18 of the words
    if (!parse_double(word, corner_[k])) return false;
    if (is_soup_) {
      found.points.push(corner_[k]);
    } else if (k == 2) {
      found.flat.push(corners_.number_of(corner_, found.points));
    }
  } else if (*wanted != '*' && !is_word(word, wanted)) {
    return false;
  }
  if (state_ < kFacetWords) {
    ++state_;
  } else {
    if (!is_soup_) found.sizes.push(3);
    state_ = 1;
  }
  return true;
}

}  // namespace voxkernel
