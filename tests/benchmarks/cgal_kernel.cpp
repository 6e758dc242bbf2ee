// CGAL's kernel of a closed triangle surface, for `kernel_rivals.py`: faces and volume, and the CPU seconds of the call.
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/kernel.h>
#include <CGAL/Polygon_mesh_processing/measure.h>
#include <CGAL/Polygon_mesh_processing/triangulate_faces.h>
#include <CGAL/Surface_mesh.h>

#include <time.h>

#include <cstdint>

namespace {

using Point = CGAL::Exact_predicates_inexact_constructions_kernel::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
namespace pmp = CGAL::Polygon_mesh_processing;

double cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

// A surface ready for CGAL, or nothing where it takes a face for one that does not fit.
extern "C" void* cgal_surface(const double* vertices, std::int64_t n_vertices, const std::int64_t* faces,
                              std::int64_t n_faces) {
  auto* mesh = new Mesh;
  for (std::int64_t i = 0; i < n_vertices; ++i) {
    mesh->add_vertex(Point(vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]));
  }
  for (std::int64_t i = 0; i < n_faces; ++i) {
    const auto corner = [&](int k) { return Mesh::Vertex_index(static_cast<Mesh::size_type>(faces[3 * i + k])); };
    if (mesh->add_face(corner(0), corner(1), corner(2)) == Mesh::null_face()) {
      delete mesh;
      return nullptr;
    }
  }
  return mesh;
}

extern "C" void cgal_free(void* surface) { delete static_cast<Mesh*>(surface); }

// The CPU seconds of one call; its answer is measured afterwards.
extern "C" double cgal_kernel(void* surface, std::int64_t* n_faces, double* volume) {
  const Mesh& mesh = *static_cast<Mesh*>(surface);
  Mesh found;
  const double begin = cpu_seconds();
  pmp::kernel(mesh, found);
  const double seconds = cpu_seconds() - begin;
  *n_faces = static_cast<std::int64_t>(found.number_of_faces());
  *volume = 0.0;
  if (found.number_of_faces() > 3) {
    pmp::triangulate_faces(found);
    *volume = pmp::volume(found);
  }
  return seconds;
}
