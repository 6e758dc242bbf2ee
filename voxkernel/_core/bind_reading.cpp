#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <stdexcept>
#include <string>
#include <tuple>
#include <unordered_set>
#include <utility>
#include <vector>

#include "bind.h"
#include "corner_table.h"
#include "element_rows.h"
#include "surface_text.h"

namespace voxkernel {

namespace {

Array2<double, 3> take_points(GrowingArray<double>& values) {
  const auto n = static_cast<std::size_t>(values.size()) / 3;
  double* data = values.release();
  nb::capsule owner(data, [](void* p) noexcept { std::free(p); });
  return Array2<double, 3>(data, {n, 3}, owner);
}

using Bytes = Array1<const std::uint8_t>;

template <typename Reader>
Index feed(Reader& reader, const Bytes& bytes, bool is_last) {
  const char* data = reinterpret_cast<const char*>(bytes.data());
  const Text text{data, data + bytes.shape(0)};
  return without_lock([&](Stop& stop) { return reader.feed(text, is_last, stop); });
}

template <typename Reader>
auto take(Reader& reader) {
  reader.before_take();
  return std::make_tuple(take_points(reader.found.points), take_array(reader.found.flat),
                         take_array(reader.found.sizes));
}

using PropertyRow = std::tuple<std::string, int, std::string, int, int>;

std::vector<Property> properties_of(const std::vector<PropertyRow>& rows) {
  std::vector<Property> found;
  for (const auto& [kind, bytes, count_kind, count_bytes, role] : rows) {
    if (kind.empty() || (count_bytes > 0 && count_kind.empty())) throw std::invalid_argument("a number has no type");
    found.push_back({{kind[0], bytes}, {count_bytes > 0 ? count_kind[0] : 'u', count_bytes}, role});
  }
  return found;
}

}  // namespace

void bind_reading(nb::module_& m) {
  nb::class_<ObjReader>(m, "ObjReader", "Reads usual .obj files in stretches that end where lines end.")
      .def(
          "__init__",
          [](ObjReader* self, const std::vector<std::string>& passed_over) {
            new (self) ObjReader(std::unordered_set<std::string>(passed_over.begin(), passed_over.end()));
          },
          nb::arg("passed_over"), "Words whose lines are passed over.")
      .def("feed", &feed<ObjReader>, array("data"), nb::arg("is_last"), "Bytes used, or -1: something is unusual.")
      .def_prop_ro("is_whole", &ObjReader::is_whole, "Whether all vertices of the faces are there.")
      .def("take", &take<ObjReader>,
           "Points (n, 3), vertex ids of all polygons, and their sizes; the reader is empty and goes on.");
  nb::class_<StlReader>(m, "StlReader", "Reads usual text .stl files in stretches; equal corners become one vertex.")
      .def(nb::init<bool>(), nb::arg("is_soup") = false)
      .def("feed", &feed<StlReader>, array("data"), nb::arg("is_last"), "Bytes used, or -1: something is unusual.")
      .def_prop_ro("is_whole", &StlReader::is_whole, "Whether the last solid has ended.")
      .def("take", &take<StlReader>,
           "Points (n, 3), vertex ids of all triangles, and their sizes; the reader is empty and goes on.");
  nb::class_<ElementRows>(m, "ElementRows", "Reads the rows of an element of a .ply or .off file in stretches.")
      .def(
          "__init__",
          [](ElementRows* self, const std::vector<PropertyRow>& properties, Index n, const std::string& layout,
             const std::string& comment, unsigned extra) {
            const Layout chosen = layout == "<"   ? Layout::little_endian
                                  : layout == ">" ? Layout::big_endian
                                                  : Layout::text;
            new (self) ElementRows(properties_of(properties), n, chosen, comment.empty() ? '\0' : comment[0], extra);
          },
          nb::arg("properties"), nb::arg("n"), nb::arg("layout"), nb::arg("comment"), nb::arg("extra"),
          "Properties (kind, bytes, kind of the count, bytes of the count or 0, role); layout '<', '>' or '' for text.")
      .def("feed", &feed<ElementRows>, array("data"), nb::arg("is_last"), "Bytes used, or -1: something is unusual.")
      .def_prop_ro("rows_left", &ElementRows::rows_left, "Rows that have not come yet.")
      .def("take", &take<ElementRows>,
           "Points (n, 3), all indices, and the sizes of their lists; the reader is empty and goes on.");
  m.def(
      "equal_corners",
      [](Array2<const double, 3> points) {
        GrowingArray<double> kept;
        GrowingArray<Index> ids;
        without_lock([&](Stop& stop) {
          CornerTable table;
          for (Index i = 0; i < static_cast<Index>(points.shape(0)); ++i) {
            stop.poll();
            ids.push(table.number_of(points.data() + 3 * i, kept));
          }
          return 0;
        });
        return std::make_tuple(take_points(kept), take_array(ids));
      },
      array("points"), "Different positions in the order of their first appearance, and which of them each point is.");
}

}  // namespace voxkernel
