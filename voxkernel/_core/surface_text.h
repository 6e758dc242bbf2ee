// Surfaces in text files, read in stretches of whole lines. What is unusual in a file, right or wrong, ends the
// reading: the caller has a slower reader that knows all of the format and names the line.
#pragma once

#include <string>
#include <unordered_set>

#include "corner_table.h"
#include "growing_array.h"
#include "spans.h"
#include "stop.h"
#include "text_numbers.h"

namespace voxkernel {

// Polygons as files hold them: coordinates, all vertex ids in a row, and the number of each polygon's corners.
struct PolygonArrays {
  GrowingArray<double> points;
  GrowingArray<Index> flat;
  GrowingArray<Index> sizes;
};

constexpr Index kUnusual = -1;

// Wavefront .obj: `v` and `f` lines, and the words that are passed over.
class ObjReader {
 public:
  explicit ObjReader(std::unordered_set<std::string> passed_over) : passed_over_(std::move(passed_over)) {}
  // Characters used of a stretch, or kUnusual.
  Index feed(Text text, bool is_last, Stop& stop);
  // Whether the file is whole, at its end.
  bool is_whole() const { return highest_ < n_points(); }
  // To be called before what was found is taken: what follows is numbered behind it.
  void before_take() { n_taken_ = n_points(); }
  PolygonArrays found;

 private:
  bool read_line(Text line);
  bool read_vertex(Text rest);
  bool read_face(Text rest);
  bool read_corner(Text word, int& pattern);
  Index n_points() const { return n_taken_ + found.points.size() / 3; }

  std::unordered_set<std::string> passed_over_;
  std::string word_;
  Index highest_ = -1;
  Index n_taken_ = 0;
};

// Text .stl: triangles, whose equal corners become one vertex in the order of their first appearance; of a soup the
// corners are points, three a triangle, and nothing else.
class StlReader {
 public:
  explicit StlReader(bool is_soup) : is_soup_(is_soup) {}
  Index feed(Text text, bool is_last, Stop& stop);
  bool is_whole() const { return state_ == 0; }
  void before_take() {}
  PolygonArrays found;

 private:
  bool read_word(Text word, Text& text);
  bool end_of_solid_line(Text& text);

  bool is_soup_;
  int state_ = 0;  // 0 outside of a solid, 1 inside, then the words of a facet
  double corner_[3] = {};
  CornerTable corners_;
};

}  // namespace voxkernel
