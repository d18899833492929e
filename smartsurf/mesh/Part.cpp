#include "smartsurf/mesh/Part.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace smartsurf::mesh {
namespace {

using Point = Eigen::Vector3d;

bool comes_before(const Point& a, const Point& b) {
  return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

// The same point to the bit from either end of an edge, so that neighbours stay joined.
Point crossing(const Point& a, double height_a, const Point& b, double height_b) {
  if (comes_before(b, a)) return crossing(b, height_b, a, height_a);
  return a + height_a / (height_a - height_b) * (b - a);
}

std::array<double, 3> heights(const std::array<Point, 3>& t, const Plane& plane, double snap) {
  std::array<double, 3> height{};
  for (std::size_t i = 0; i < 3; ++i) {
    height[i] = plane.height(t[i]);
    if (std::abs(height[i]) <= snap) height[i] = 0.0;
  }
  return height;
}

// What a plane leaves of a triangle.
struct Polygon {
  std::array<Point, 4> corner;
  std::array<bool, 4> in_plane;
  std::size_t size = 0;

  void add(const Point& p, bool lies_in_plane) {
    corner[size] = p;
    in_plane[size++] = lies_in_plane;
  }
};

void clip(const std::array<Point, 3>& t, const std::array<double, 3>& height, Polygon& kept) {
  kept.size = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    if (height[i] <= 0.0) kept.add(t[i], height[i] == 0.0);
    if ((height[i] < 0.0 && height[j] > 0.0) || (height[i] > 0.0 && height[j] < 0.0))
      kept.add(crossing(t[i], height[i], t[j], height[j]), true);
  }
}

void make_unique(std::vector<Point>& points) {
  std::sort(points.begin(), points.end(), comes_before);
  points.erase(std::unique(points.begin(), points.end()), points.end());
}

}  // namespace

struct Part::Cut {
  std::vector<Triangle> below;
  std::vector<std::array<Point, 2>> rim;  // directed sides of `below` that lie in the plane
};

Part::Part(const TriangleMesh& whole) : whole_(&whole), low_(whole.points.front()), high_(low_) {
  for (const Point& p : whole.points) {
    low_ = low_.cwiseMin(p);
    high_ = high_.cwiseMax(p);
  }
  snap_ = 1e-7 * (high_ - low_).norm();
  for (const auto& t : whole.triangles)
    surface_.push_back({whole.points[t[0]], whole.points[t[1]], whole.points[t[2]]});
}

Part::Cut Part::cut(const std::vector<Triangle>& triangles, const Plane& plane, std::size_t stride) const {
  Cut cut;
  Polygon kept;
  for (std::size_t n = 0; n < triangles.size(); n += stride) {
    const Triangle& t = triangles[n];
    const std::array<double, 3> height = heights(t, plane, snap_);
    const double lowest = std::min({height[0], height[1], height[2]});
    const double highest = std::max({height[0], height[1], height[2]});
    const bool flat = lowest == 0.0 && highest == 0.0;
    // A triangle in the plane belongs to the side that it bounds.
    if (lowest >= 0.0 && !(flat && (t[1] - t[0]).cross(t[2] - t[0]).dot(plane.normal) > 0.0)) continue;
    clip(t, height, kept);
    for (std::size_t i = 1; i + 1 < kept.size; ++i)
      cut.below.push_back({kept.corner[0], kept.corner[i], kept.corner[i + 1]});
    for (std::size_t i = 0; i < kept.size; ++i) {
      const std::size_t j = (i + 1) % kept.size;
      if (kept.in_plane[i] && kept.in_plane[j]) cut.rim.push_back({kept.corner[i], kept.corner[j]});
    }
  }
  return cut;
}

Part Part::below(const Plane& plane) const {
  Part part(*this);
  Cut surface = cut(surface_, plane), caps = cut(caps_, plane);
  part.surface_ = std::move(surface.below);
  part.caps_ = std::move(caps.below);
  surface.rim.insert(surface.rim.end(), caps.rim.begin(), caps.rim.end());
  for (const auto& [from, to] : surface.rim) {
    const Point& tip = surface.rim.front()[0];
    if (tip != from && tip != to) part.caps_.push_back({tip, to, from});
  }
  part.corners_ = corners_below(plane);
  part.planes_.push_back(plane);
  return part;
}

double Part::volume() const {
  double six_volumes = 0.0;
  for (const auto* triangles : {&surface_, &caps_})
    for (const Triangle& t : *triangles) six_volumes += (t[0] - low_).dot((t[1] - low_).cross(t[2] - low_));
  return six_volumes / 6.0;
}

std::vector<Point> Part::points() const {
  std::vector<Point> points = corners_;
  for (const Triangle& t : surface_) points.insert(points.end(), t.begin(), t.end());
  make_unique(points);
  return points;
}

std::vector<Point> Part::points_below(const Plane& plane) const {
  std::vector<Point> points = corners_below(plane);
  constexpr std::size_t kLookedAt = 4096;
  const std::size_t stride = 1 + surface_.size() / kLookedAt;
  for (const Triangle& t : cut(surface_, plane, stride).below)
    points.insert(points.end(), t.begin(), t.end());
  make_unique(points);
  return points;
}

bool Part::inside(const Point& p) const {
  constexpr double kSurelyInside = 0.9;  // on the surface, the surface's own points count
  return (p - low_).minCoeff() > 0.0 && (high_ - p).minCoeff() > 0.0 &&
         winding_number(*whole_, p) > kSurelyInside;
}

// A cell's corner inside the solid is a corner of the part, though no triangle of the surface is near it.
std::vector<Point> Part::corners_below(const Plane& plane) const {
  constexpr double kLeastAngle = 1e-4;
  std::vector<Point> corners;
  for (const Point& corner : corners_)
    if (plane.height(corner) <= snap_) corners.push_back(corner);
  for (std::size_t i = 0; i < planes_.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      Eigen::Matrix3d normals;
      normals << plane.normal.transpose(), planes_[i].normal.transpose(), planes_[j].normal.transpose();
      if (std::abs(normals.determinant()) < kLeastAngle) continue;
      const Point p = normals.inverse() * Point(plane.offset, planes_[i].offset, planes_[j].offset);
      const auto holds = [&](const Plane& cell) { return cell.height(p) <= snap_; };
      if (std::all_of(planes_.begin(), planes_.end(), holds) && inside(p)) corners.push_back(p);
    }
  return corners;
}

}  // namespace smartsurf::mesh
