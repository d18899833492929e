#include "smartsurf/scene/Solid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace smartsurf::scene {
namespace {

// Directions are parallel below this sine of their angle, which single precision can still resolve.
constexpr float kParallelTolerance = 1e-4F;

void add_unique_direction(std::vector<Eigen::Vector3f>& directions, const Eigen::Vector3f& d) {
  for (const Eigen::Vector3f& known : directions)
    if (known.cross(d).squaredNorm() < kParallelTolerance * kParallelTolerance) return;
  directions.push_back(d);
}

// Newell's method: twice the area vector of a polygon that need not be exactly planar.
Eigen::Vector3d area_vector(const ConvexHull& hull, std::uint32_t first, std::uint32_t count) {
  const auto vertex = [&](std::uint32_t i) {
    return hull.vertices[hull.face_vertices[first + i % count]].cast<double>().eval();
  };
  const Eigen::Vector3d origin = vertex(0);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::uint32_t i = 1; i + 1 < count; ++i) sum += (vertex(i) - origin).cross(vertex(i + 1) - origin);
  return sum;
}

// The plane passes through the face's outermost vertex, so that the hull contains all its vertices.
ConvexHull::Face make_face(const ConvexHull& hull, std::uint32_t first, std::uint32_t count) {
  ConvexHull::Face face{area_vector(hull, first, count).normalized().cast<float>(), 0.0F, first, count};
  face.offset = face.normal.dot(hull.vertices[hull.face_vertices[first]]);
  for (std::uint32_t i = 1; i < count; ++i)
    face.offset = std::max(face.offset, face.normal.dot(hull.vertices[hull.face_vertices[first + i]]));
  return face;
}

// Each edge occurs in two faces with opposite directions. Adds it only in the direction of increasing
// indices.
void add_edges(ConvexHull& hull, const ConvexHull::Face& face) {
  for (std::uint32_t i = 0; i < face.vertex_count; ++i) {
    const std::uint16_t a = hull.face_vertices[face.first_vertex + i];
    const std::uint16_t b = hull.face_vertices[face.first_vertex + (i + 1) % face.vertex_count];
    if (a > b) continue;
    hull.edges.push_back({a, b});
    add_unique_direction(hull.unique_edge_directions, (hull.vertices[b] - hull.vertices[a]).normalized());
  }
}

}  // namespace

ConvexHull make_convex_hull(std::vector<Eigen::Vector3f> vertices, std::vector<std::uint16_t> face_loops,
                            std::span<const std::uint32_t> face_sizes) {
  assert(vertices.size() >= 4 && face_sizes.size() >= 4);
  ConvexHull hull;
  hull.vertices = std::move(vertices);
  hull.face_vertices = std::move(face_loops);
  std::uint32_t first = 0;
  for (const std::uint32_t count : face_sizes) {
    hull.faces.push_back(make_face(hull, first, count));
    add_unique_direction(hull.unique_normals, hull.faces.back().normal);
    add_edges(hull, hull.faces.back());
    first += count;
  }
  assert(first == hull.face_vertices.size());
  hull.bounds_min = hull.bounds_max = hull.vertices.front();
  for (const Eigen::Vector3f& vertex : hull.vertices) {
    hull.bounds_min = hull.bounds_min.cwiseMin(vertex);
    hull.bounds_max = hull.bounds_max.cwiseMax(vertex);
  }
  return hull;
}

ConvexHull with_vertices(const ConvexHull& hull, std::vector<Eigen::Vector3f> vertices) {
  std::vector<std::uint32_t> face_sizes;
  for (const ConvexHull::Face& face : hull.faces) face_sizes.push_back(face.vertex_count);
  return make_convex_hull(std::move(vertices), hull.face_vertices, face_sizes);
}

void compute_bounds(Solid& solid) {
  solid.bounds_min = solid.bounds_max = solid.vertices.front();
  solid.bounding_radius = 0.0F;
  for (const auto& v : solid.vertices) {
    solid.bounds_min = solid.bounds_min.cwiseMin(v);
    solid.bounds_max = solid.bounds_max.cwiseMax(v);
    solid.bounding_radius = std::max(solid.bounding_radius, v.norm());
  }
}

Solid scaled(const Solid& solid, double factor) {
  const auto scale = [f = static_cast<float>(factor)](std::vector<Eigen::Vector3f> points) {
    for (Eigen::Vector3f& point : points) point *= f;
    return points;
  };
  Solid result = solid;
  result.vertices = scale(std::move(result.vertices));
  for (ConvexHull& hull : result.hulls) hull = with_vertices(hull, scale(hull.vertices));
  result.centroid *= factor;
  result.volume *= std::pow(factor, 3);
  result.inertia *= std::pow(factor, 5);
  compute_bounds(result);
  return result;
}

}  // namespace smartsurf::scene
