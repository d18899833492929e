#include "smartsurf/mesh/ClippedMesh.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace smartsurf::mesh {
namespace {

using Point = Eigen::Vector3d;

bool lexicographically_less(const Point& a, const Point& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

// Bit-identical for both directions of an edge, so that adjacent triangles stay connected.
Point edge_intersection(const Point& a, double height_a, const Point& b, double height_b) {
  if (lexicographically_less(b, a)) return edge_intersection(b, height_b, a, height_a);
  return a + height_a / (height_a - height_b) * (b - a);
}

std::array<double, 3> signed_distances(const std::array<Point, 3>& t, const Plane& plane, double snap) {
  std::array<double, 3> height{};
  for (std::size_t i = 0; i < 3; ++i) {
    height[i] = plane.signed_distance(t[i]);
    if (std::abs(height[i]) <= snap) height[i] = 0.0;
  }
  return height;
}

// A clipped triangle.
struct Polygon {
  std::array<Point, 4> corner;
  std::array<bool, 4> in_plane;
  std::size_t size = 0;

  void add(const Point& p, bool lies_in_plane) {
    corner[size] = p;
    in_plane[size++] = lies_in_plane;
  }
};

void clip_triangle(const std::array<Point, 3>& t, const std::array<double, 3>& height, Polygon& kept) {
  kept.size = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    if (height[i] <= 0.0) kept.add(t[i], height[i] == 0.0);
    if ((height[i] < 0.0 && height[j] > 0.0) || (height[i] > 0.0 && height[j] < 0.0))
      kept.add(edge_intersection(t[i], height[i], t[j], height[j]), true);
  }
}

void sort_and_deduplicate(std::vector<Point>& points) {
  std::sort(points.begin(), points.end(), lexicographically_less);
  points.erase(std::unique(points.begin(), points.end()), points.end());
}

}  // namespace

struct ClippedMesh::ClipResult {
  std::vector<Triangle> below;
  std::vector<std::array<Point, 2>> cap_edges;  // directed edges of `below` in the plane
};

ClippedMesh::ClippedMesh(const TriangleMesh& source)
    : source_(&source), bounds_(bounding_box(source)), snap_distance_(1e-7 * bounds_.diagonal().norm()) {
  for (const auto& t : source.triangles)
    surface_.push_back({source.points[t[0]], source.points[t[1]], source.points[t[2]]});
}

ClippedMesh::ClipResult ClippedMesh::clip_triangles(const std::vector<Triangle>& triangles,
                                                    const Plane& plane, std::size_t stride) const {
  ClipResult result;
  Polygon kept;
  for (std::size_t n = 0; n < triangles.size(); n += stride) {
    const Triangle& t = triangles[n];
    const std::array<double, 3> height = signed_distances(t, plane, snap_distance_);
    const double lowest = std::min({height[0], height[1], height[2]});
    const double highest = std::max({height[0], height[1], height[2]});
    const bool flat = lowest == 0.0 && highest == 0.0;
    // A triangle in the plane belongs to the half-space that its normal points away from.
    if (lowest >= 0.0 && !(flat && (t[1] - t[0]).cross(t[2] - t[0]).dot(plane.normal) > 0.0)) continue;
    clip_triangle(t, height, kept);
    for (std::size_t i = 1; i + 1 < kept.size; ++i)
      result.below.push_back({kept.corner[0], kept.corner[i], kept.corner[i + 1]});
    for (std::size_t i = 0; i < kept.size; ++i) {
      const std::size_t j = (i + 1) % kept.size;
      if (kept.in_plane[i] && kept.in_plane[j]) result.cap_edges.push_back({kept.corner[i], kept.corner[j]});
    }
  }
  return result;
}

ClippedMesh ClippedMesh::clip_below(const Plane& plane) const {
  ClippedMesh clipped(*this);
  ClipResult surface = clip_triangles(surface_, plane), caps = clip_triangles(caps_, plane);
  clipped.surface_ = std::move(surface.below);
  clipped.caps_ = std::move(caps.below);
  surface.cap_edges.insert(surface.cap_edges.end(), caps.cap_edges.begin(), caps.cap_edges.end());
  for (const auto& [from, to] : surface.cap_edges) {
    const Point& tip = surface.cap_edges.front()[0];
    if (tip != from && tip != to) clipped.caps_.push_back({tip, to, from});
  }
  clipped.interior_corners_ = interior_corners_below(plane);
  clipped.planes_.push_back(plane);
  return clipped;
}

double ClippedMesh::volume() const {
  double six_volumes = 0.0;
  const Point& low = bounds_.min();
  for (const auto* triangles : {&surface_, &caps_})
    for (const Triangle& t : *triangles) six_volumes += (t[0] - low).dot((t[1] - low).cross(t[2] - low));
  return six_volumes / 6.0;
}

std::vector<Point> ClippedMesh::hull_points() const {
  std::vector<Point> points = interior_corners_;
  for (const Triangle& t : surface_) points.insert(points.end(), t.begin(), t.end());
  sort_and_deduplicate(points);
  return points;
}

std::vector<Point> ClippedMesh::hull_points_below(const Plane& plane) const {
  std::vector<Point> points = interior_corners_below(plane);
  constexpr std::size_t kMaxSampledTriangles = 4096;
  const std::size_t stride = 1 + surface_.size() / kMaxSampledTriangles;
  for (const Triangle& t : clip_triangles(surface_, plane, stride).below)
    points.insert(points.end(), t.begin(), t.end());
  sort_and_deduplicate(points);
  return points;
}

bool ClippedMesh::is_inside_source(const Point& p) const {
  constexpr double kInsideThreshold = 0.9;  // excludes the surface, whose vertices are hull points already
  return (p - bounds_.min()).minCoeff() > 0.0 && (bounds_.max() - p).minCoeff() > 0.0 &&
         winding_number(*source_, p) > kInsideThreshold;
}

// Intersections of three cutting planes inside the source are vertices of the clipped solid that do not lie
// on its surface triangles.
std::vector<Point> ClippedMesh::interior_corners_below(const Plane& plane) const {
  constexpr double kMinDeterminant = 1e-4;
  std::vector<Point> corners;
  for (const Point& corner : interior_corners_)
    if (plane.signed_distance(corner) <= snap_distance_) corners.push_back(corner);
  for (std::size_t i = 0; i < planes_.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      Eigen::Matrix3d normals;
      normals << plane.normal.transpose(), planes_[i].normal.transpose(), planes_[j].normal.transpose();
      if (std::abs(normals.determinant()) < kMinDeterminant) continue;
      const Point p = normals.inverse() * Point(plane.offset, planes_[i].offset, planes_[j].offset);
      const auto holds = [&](const Plane& cell) { return cell.signed_distance(p) <= snap_distance_; };
      if (std::all_of(planes_.begin(), planes_.end(), holds) && is_inside_source(p)) corners.push_back(p);
    }
  return corners;
}

}  // namespace smartsurf::mesh
