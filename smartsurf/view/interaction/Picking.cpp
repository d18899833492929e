#include "smartsurf/view/interaction/Picking.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartsurf::view {
namespace {

using scene::ObjectSpec;
using scene::ShapeKind;

constexpr double kFar = std::numeric_limits<double>::infinity();

// Collects the nearest of several candidates in front of the eye.
struct Nearest {
  double distance = kFar;
  void offer(double t) {
    if (t > 0.0 && t < distance) distance = t;
  }
  std::optional<double> found() const { return distance < kFar ? std::optional(distance) : std::nullopt; }
};

// Both roots of a·t² + 2·b·t + c = 0.
template <class Take>
void roots(double a, double b, double c, Take take) {
  const double under = b * b - a * c;
  if (std::abs(a) < 1e-12 || under < 0.0) return;
  const double root = std::sqrt(under);
  take((-b - root) / a);
  take((-b + root) / a);
}

std::optional<double> enter_sphere(const Ray& ray, const Eigen::Vector3d& centre, double radius) {
  const Eigen::Vector3d o = ray.origin - centre;
  Nearest nearest;
  roots(1.0, o.dot(ray.direction), o.squaredNorm() - radius * radius, [&](double t) { nearest.offer(t); });
  return nearest.found();
}

std::optional<double> enter_box(const Ray& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  double from = 0.0, to = kFar;
  for (int axis = 0; axis < 3; ++axis) {
    const double o = ray.origin[axis], d = ray.direction[axis];
    if (std::abs(d) < 1e-12) {
      if (o < low[axis] || o > high[axis]) return std::nullopt;
      continue;
    }
    const double a = (low[axis] - o) / d, b = (high[axis] - o) / d;
    from = std::max(from, std::min(a, b));
    to = std::min(to, std::max(a, b));
  }
  return from <= to ? std::optional(from) : std::nullopt;
}

// The side of a cylinder or cone whose radius at height z is base + slope·z, and flat ends.
std::optional<double> enter_turned(const Ray& ray, double half, double low_radius, double high_radius,
                                   bool ends) {
  const Eigen::Vector3d &o = ray.origin, &d = ray.direction;
  const double slope = (high_radius - low_radius) / (2.0 * half), middle = 0.5 * (low_radius + high_radius);
  const double r = middle + slope * o.z(), dr = slope * d.z();
  Nearest nearest;
  roots(d.x() * d.x() + d.y() * d.y() - dr * dr, o.x() * d.x() + o.y() * d.y() - r * dr,
        o.x() * o.x() + o.y() * o.y() - r * r, [&](double t) {
          const double z = o.z() + t * d.z();
          if (std::abs(z) <= half && middle + slope * z >= 0.0) nearest.offer(t);
        });
  for (const double end : {-half, half}) {
    if (!ends || std::abs(d.z()) < 1e-12) continue;
    const double t = (end - o.z()) / d.z(), radius = end < 0.0 ? low_radius : high_radius;
    if (std::hypot(o.x() + t * d.x(), o.y() + t * d.y()) <= radius) nearest.offer(t);
  }
  return nearest.found();
}

std::optional<double> enter_capsule(const Ray& ray, double half, double radius) {
  const double straight = std::max(half - radius, 1e-6);
  Nearest nearest;
  if (const auto t = enter_turned(ray, straight, radius, radius, false)) nearest.offer(*t);
  for (const double z : {-straight, straight})
    if (const auto t = enter_sphere(ray, {0.0, 0.0, z}, radius)) nearest.offer(*t);
  return nearest.found();
}

std::optional<double> enter_solid(const Ray& ray, const scene::Solid& solid) {
  Nearest nearest;
  for (const auto& corners : solid.triangles) {
    const Eigen::Vector3d a = solid.vertices[corners[0]].cast<double>();
    const Eigen::Vector3d ab = solid.vertices[corners[1]].cast<double>() - a;
    const Eigen::Vector3d ac = solid.vertices[corners[2]].cast<double>() - a;
    const Eigen::Vector3d p = ray.direction.cross(ac);
    const double volume = ab.dot(p);
    if (std::abs(volume) < 1e-14) continue;
    const Eigen::Vector3d o = ray.origin - a, q = o.cross(ab);
    const double u = o.dot(p) / volume, v = ray.direction.dot(q) / volume;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0) nearest.offer(ac.dot(q) / volume);
  }
  return nearest.found();
}

// Marches from cell to cell over the table, as far as the ray is above it.
std::optional<Hit> pick_cell(const Ray& ray, const scene::SurfaceSpec& s, const scene::Snapshot& snapshot) {
  const double half = s.pitch / 2.0;
  const Eigen::AlignedBox3d box = Camera::extent(s);
  const float top =
      snapshot.height.empty() ? 0.0F : *std::max_element(snapshot.height.begin(), snapshot.height.end());
  const auto start =
      enter_box(ray, {-half, -half, box.min().z()},
                {(s.columns - 1) * s.pitch + half, (s.rows - 1) * s.pitch + half, double{top}});
  if (!start) return std::nullopt;
  double t = *start + 1e-9 * (1.0 + *start);
  const int most_cells = 2 * (s.rows + s.columns);
  for (int i = 0; i < most_cells; ++i) {
    const Eigen::Vector3d at = ray.origin + t * ray.direction;
    const int column = static_cast<int>(std::floor(at.x() / s.pitch + 0.5));
    const int row = s.rows - 1 - static_cast<int>(std::floor(at.y() / s.pitch + 0.5));
    if (row < 0 || column < 0 || row >= s.rows || column >= s.columns) return std::nullopt;
    // Where the ray leaves the cell's square.
    double leave = kFar;
    const Eigen::Vector2d centre = s.centre(row, column);
    for (int axis = 0; axis < 2; ++axis) {
      const double d = ray.direction[axis];
      if (std::abs(d) < 1e-12) continue;
      leave = std::min(leave, (centre[axis] + (d > 0.0 ? half : -half) - ray.origin[axis]) / d);
    }
    const double height = snapshot.height[static_cast<std::size_t>(s.index(row, column))];
    const double low = ray.origin.z() + std::min(leave, 1e9) * ray.direction.z();
    if (at.z() <= height || low <= height) {
      if (at.z() > height) t = (height - ray.origin.z()) / ray.direction.z();
      return Hit{{Thing::Kind::kCell, 0, row, column}, t, ray.origin + t * ray.direction};
    }
    t = leave + 1e-6 * s.pitch;
  }
  return std::nullopt;
}

// Of cells that stand anywhere, turned: each by itself.
std::optional<Hit> pick_free_cell(const Ray& ray, const scene::SurfaceSpec& s,
                                  const scene::Snapshot& snapshot) {
  std::optional<Hit> first;
  const double base = Camera::extent(s).min().z();
  for (int row = 0; row < s.rows; ++row)
    for (int column = 0; column < s.columns; ++column) {
      const auto cell = static_cast<std::size_t>(s.index(row, column));
      const double height = snapshot.height[cell];
      if (!std::isfinite(height)) continue;
      const scene::CellPose& place = s.cell_poses[cell];
      const Eigen::AngleAxisd back(-place.angle, Eigen::Vector3d::UnitZ());
      const Ray local{back * (ray.origin - Eigen::Vector3d(place.x, place.y, 0.0)), back * ray.direction};
      const auto t = enter_box(local, {-s.pin.top_x / 2.0, -s.pin.top_y / 2.0, base},
                               {s.pin.top_x / 2.0, s.pin.top_y / 2.0, height});
      if (t && (!first || *t < first->distance))
        first = Hit{{Thing::Kind::kCell, 0, row, column}, *t, ray.origin + *t * ray.direction};
    }
  return first;
}

}  // namespace

std::optional<double> enter(const ObjectSpec& object, const Ray& ray) {
  const Eigen::Vector3d half = object.half_extents();
  switch (object.shape) {
    case ShapeKind::kSphere:
      return enter_sphere(ray, Eigen::Vector3d::Zero(), object.radius);
    case ShapeKind::kCylinder:
      return enter_turned(ray, half.z(), object.radius, object.radius, true);
    case ShapeKind::kCapsule:
      return enter_capsule(ray, half.z(), object.radius);
    case ShapeKind::kCone: {  // its centre of mass lies a quarter of the height above the base
      const Eigen::Vector3d middle(0.0, 0.0, object.height / 4.0);
      return enter_turned({ray.origin - middle, ray.direction}, object.height / 2.0, object.radius, 0.0,
                          true);
    }
    case ShapeKind::kSolid:
      return object.solid ? enter_solid(ray, *object.solid) : std::nullopt;
    default:
      return enter_box(ray, -half, half);
  }
}

std::optional<Hit> pick(const Ray& ray, const scene::SurfaceSpec& surface, const FrameInput& moment) {
  const scene::Snapshot& snapshot = moment.snapshot;
  std::optional<Hit> first =
      surface.cell_poses.empty() ? pick_cell(ray, surface, snapshot) : pick_free_cell(ray, surface, snapshot);
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const ObjectSpec& object = moment.catalogue[snapshot.id[i]];
    const auto& q = snapshot.orientation[i];
    const Eigen::Quaterniond to_local = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).conjugate();
    const auto& p = snapshot.position[i];
    const Eigen::Vector3d centre(p[0], p[1], p[2]);
    const auto t = enter(object, {to_local * (ray.origin - centre), to_local * ray.direction});
    if (t && (!first || *t < first->distance))
      first = Hit{{Thing::Kind::kObject, snapshot.id[i], 0, 0}, *t, ray.origin + *t * ray.direction};
  }
  return first;
}

std::optional<std::size_t> index_of(const scene::Snapshot& snapshot, scene::ObjectId id) {
  const auto found = std::lower_bound(snapshot.id.begin(), snapshot.id.end(), id);
  if (found == snapshot.id.end() || *found != id) return std::nullopt;
  return static_cast<std::size_t>(found - snapshot.id.begin());
}

}  // namespace smartsurf::view
