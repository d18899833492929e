#include "smartsurf/view/interaction/Picking.h"
#include "smartsurf/view/model/TableBounds.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace smartsurf::view {
namespace {

using scene::ObjectSpec;
using scene::ShapeKind;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Keeps the nearest of several candidate distances in front of the eye.
struct NearestHit {
  double distance = kInfinity;
  void add(double t) {
    if (t > 0.0 && t < distance) distance = t;
  }
  std::optional<double> result() const {
    return distance < kInfinity ? std::optional(distance) : std::nullopt;
  }
};

// Calls `visit` with both real roots of a·t² + 2·b·t + c = 0, if any.
template <class Take>
void solve_quadratic(double a, double b, double c, Take visit) {
  const double discriminant = b * b - a * c;
  if (std::abs(a) < 1e-12 || discriminant < 0.0) return;
  const double root = std::sqrt(discriminant);
  visit((-b - root) / a);
  visit((-b + root) / a);
}

std::optional<double> intersect_sphere(const Ray& ray, const Eigen::Vector3d& centre, double radius) {
  const Eigen::Vector3d o = ray.origin - centre;
  NearestHit nearest;
  solve_quadratic(1.0, o.dot(ray.direction), o.squaredNorm() - radius * radius,
                  [&](double t) { nearest.add(t); });
  return nearest.result();
}

// Slab method; 0 if the ray starts inside.
std::optional<double> intersect_box(const Ray& ray, const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  double from = 0.0, to = kInfinity;
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

// A cylinder, cone or frustum about z, centred on the origin; capped: with flat ends.
std::optional<double> intersect_frustum(const Ray& ray, double half_height, double bottom_radius,
                                        double top_radius, bool capped) {
  const Eigen::Vector3d &o = ray.origin, &d = ray.direction;
  const double slope = (top_radius - bottom_radius) / (2.0 * half_height),
               middle = 0.5 * (bottom_radius + top_radius);
  const double r = middle + slope * o.z(), dr = slope * d.z();
  NearestHit nearest;
  solve_quadratic(d.x() * d.x() + d.y() * d.y() - dr * dr, o.x() * d.x() + o.y() * d.y() - r * dr,
                  o.x() * o.x() + o.y() * o.y() - r * r, [&](double t) {
                    const double z = o.z() + t * d.z();
                    if (std::abs(z) <= half_height && middle + slope * z >= 0.0) nearest.add(t);
                  });
  for (const double end : {-half_height, half_height}) {
    if (!capped || std::abs(d.z()) < 1e-12) continue;
    const double t = (end - o.z()) / d.z(), radius = end < 0.0 ? bottom_radius : top_radius;
    if (std::hypot(o.x() + t * d.x(), o.y() + t * d.y()) <= radius) nearest.add(t);
  }
  return nearest.result();
}

std::optional<double> intersect_capsule(const Ray& ray, double half_height, double radius) {
  const double straight = std::max(half_height - radius, 1e-6);
  NearestHit nearest;
  if (const auto t = intersect_frustum(ray, straight, radius, radius, false)) nearest.add(*t);
  for (const double z : {-straight, straight})
    if (const auto t = intersect_sphere(ray, {0.0, 0.0, z}, radius)) nearest.add(*t);
  return nearest.result();
}

// Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
std::optional<double> intersect_mesh(const Ray& ray, const scene::Solid& solid) {
  NearestHit nearest;
  for (const auto& corners : solid.triangles) {
    const Eigen::Vector3d a = solid.vertices[corners[0]].cast<double>();
    const Eigen::Vector3d ab = solid.vertices[corners[1]].cast<double>() - a;
    const Eigen::Vector3d ac = solid.vertices[corners[2]].cast<double>() - a;
    const Eigen::Vector3d p = ray.direction.cross(ac);
    const double determinant = ab.dot(p);
    if (std::abs(determinant) < 1e-14) continue;
    const Eigen::Vector3d o = ray.origin - a, q = o.cross(ab);
    const double u = o.dot(p) / determinant, v = ray.direction.dot(q) / determinant;
    if (u >= 0.0 && v >= 0.0 && u + v <= 1.0) nearest.add(ac.dot(q) / determinant);
  }
  return nearest.result();
}

bool has_skin(const scene::SurfaceSpec& s, const scene::Snapshot& snapshot) {
  return s.skin && std::ssize(snapshot.skin_height) == std::ptrdiff_t{s.skin->rows} * s.skin->columns;
}

// Traverses the regular grid cell by cell until the ray falls below a cell's height. Cells under a skin are
// passed over.
std::optional<PickHit> pick_cell(const Ray& ray, const scene::SurfaceSpec& s,
                                 const scene::Snapshot& snapshot) {
  const double half = s.pitch / 2.0;
  const bool skinned = has_skin(s, snapshot);
  const Eigen::AlignedBox3d box = surface_bounding_box(s);
  const float top =
      snapshot.height.empty() ? 0.0F : *std::max_element(snapshot.height.begin(), snapshot.height.end());
  const auto entry_t =
      intersect_box(ray, {-half, -half, box.min().z()},
                    {(s.columns - 1) * s.pitch + half, (s.rows - 1) * s.pitch + half, double{top}});
  if (!entry_t) return std::nullopt;
  double t = *entry_t + 1e-9 * (1.0 + *entry_t);
  const int max_steps = 2 * (s.rows + s.columns);
  for (int i = 0; i < max_steps; ++i) {
    const Eigen::Vector3d at = ray.origin + t * ray.direction;
    const int column = static_cast<int>(std::floor(at.x() / s.pitch + 0.5));
    const int row = s.rows - 1 - static_cast<int>(std::floor(at.y() / s.pitch + 0.5));
    if (row < 0 || column < 0 || row >= s.rows || column >= s.columns) return std::nullopt;
    // The point at which the ray leaves the cell.
    double exit_t = kInfinity;
    const Eigen::Vector2d centre = s.centre(row, column);
    for (int axis = 0; axis < 2; ++axis) {
      const double d = ray.direction[axis];
      if (std::abs(d) < 1e-12) continue;
      exit_t = std::min(exit_t, (centre[axis] + (d > 0.0 ? half : -half) - ray.origin[axis]) / d);
    }
    const double height =
        skinned && s.is_under_skin(row, column) ? -kInfinity : snapshot.height[s.index(row, column)];
    const double low = ray.origin.z() + std::min(exit_t, 1e9) * ray.direction.z();
    if (at.z() <= height || low <= height) {
      if (at.z() > height) t = (height - ray.origin.z()) / ray.direction.z();
      return PickHit{{SceneItem::Kind::kCell, 0, row, column}, t, ray.origin + t * ray.direction};
    }
    if (exit_t == kInfinity) return std::nullopt;
    t = exit_t + 1e-6 * s.pitch;
  }
  return std::nullopt;
}

// A hit below the skin is one of the skin. Traverses the rectangles of nodes one by one, in which its height
// is linear on either side of the diagonal from the north-west to the south-east. The hit is on the cell with
// the nearest centre.
std::optional<PickHit> pick_skin(const Ray& ray, const scene::SurfaceSpec& s,
                                 const scene::Snapshot& snapshot) {
  const scene::SkinSpec& skin = *s.skin;
  const Eigen::AlignedBox2d extent = s.skin_extent();
  const double ground = s.ground_height();
  const auto entry_t = intersect_box(ray, {extent.min().x(), extent.min().y(), ground},
                                     {extent.max().x(), extent.max().y(), kInfinity});
  if (!entry_t) return std::nullopt;
  // x and y in columns and rows of nodes.
  const Eigen::Vector3d steps(extent.sizes().x() / (skin.columns - 1), -extent.sizes().y() / (skin.rows - 1),
                              1.0);
  const Eigen::Vector3d north_west(extent.min().x(), extent.max().y(), 0.0);
  const Eigen::Vector3d origin = (ray.origin - north_west).cwiseQuotient(steps),
                        direction = ray.direction.cwiseQuotient(steps);
  const auto height_above_skin = [&](double t, int row, int column) {
    const Eigen::Vector3d at = origin + t * direction;
    const float* const north = &snapshot.skin_height[row * skin.columns + column];
    const float* const south = north + skin.columns;
    const double x = at.x() - column, y = at.y() - row;
    return at.z() - north[0] -
           (x > y ? x * (north[1] - north[0]) + y * (south[1] - north[1])
                  : x * (south[1] - south[0]) + y * (south[0] - north[0]));
  };
  const auto hit_at = [&](double t) {
    const Eigen::Vector3d at = ray.origin + t * ray.direction;
    const int border = s.border_height ? 1 : 0;
    const auto nearest = [&](double along, int count) {
      return std::clamp(static_cast<int>(std::lround(along / s.pitch)), border, count - 1 - border);
    };
    const int row = s.rows - 1 - nearest(at.y(), s.rows), column = nearest(at.x(), s.columns);
    return PickHit{{SceneItem::Kind::kCell, 0, row, column}, t, at};
  };
  double t = *entry_t + 1e-9 * (1.0 + *entry_t);
  for (int i = 0; i < 2 * (skin.rows + skin.columns); ++i) {
    const Eigen::Vector3d at = origin + t * direction;
    const int row = static_cast<int>(std::floor(at.y())), column = static_cast<int>(std::floor(at.x()));
    if (row < 0 || column < 0 || row + 1 >= skin.rows || column + 1 >= skin.columns) return std::nullopt;
    double exit_t = ray.direction.z() < 0.0 ? (ground - ray.origin.z()) / ray.direction.z() : kInfinity;
    for (const auto& [from, along, cell] :
         {std::tuple{origin.x(), direction.x(), column}, {origin.y(), direction.y(), row}})
      if (std::abs(along) > 1e-12) exit_t = std::min(exit_t, (cell + (along > 0.0 ? 1 : 0) - from) / along);
    const double diagonal_t = (column - row - origin.x() + origin.y()) / (direction.x() - direction.y());
    double above = height_above_skin(t, row, column);
    if (above <= 0.0) return hit_at(t);
    for (const double end : {diagonal_t, exit_t}) {
      if (!(end > t && end <= exit_t) || end == kInfinity) continue;
      const double above_end = height_above_skin(end, row, column);
      if (above_end <= 0.0) return hit_at(t + (end - t) * above / (above - above_end));
      t = end;
      above = above_end;
    }
    t = exit_t + 1e-6 / std::max(direction.head<2>().cwiseAbs().maxCoeff(), 1e-12);
  }
  return std::nullopt;
}

// Free layouts have no grid: tests every cell's box in the cell's own frame.
std::optional<PickHit> pick_free_layout_cell(const Ray& ray, const scene::SurfaceSpec& s,
                                             const scene::Snapshot& snapshot) {
  std::optional<PickHit> nearest;
  const double base = surface_bounding_box(s).min().z();
  for (int row = 0; row < s.rows; ++row)
    for (int column = 0; column < s.columns; ++column) {
      const int cell = s.index(row, column);
      const double height = snapshot.height[cell];
      if (!std::isfinite(height)) continue;
      const scene::CellPose& pose = s.cell_poses[cell];
      const Eigen::AngleAxisd back(-pose.angle, Eigen::Vector3d::UnitZ());
      const Ray local{back * (ray.origin - Eigen::Vector3d(pose.x, pose.y, 0.0)), back * ray.direction};
      const auto t = intersect_box(local, {-s.pin.top_x / 2.0, -s.pin.top_y / 2.0, base},
                                   {s.pin.top_x / 2.0, s.pin.top_y / 2.0, height});
      if (t && (!nearest || *t < nearest->distance))
        nearest = PickHit{{SceneItem::Kind::kCell, 0, row, column}, *t, ray.origin + *t * ray.direction};
    }
  return nearest;
}

}  // namespace

std::optional<double> intersect(const ObjectSpec& object, const Ray& ray) {
  const Eigen::Vector3d half = object.half_extents();
  switch (object.shape) {
    case ShapeKind::kSphere:
      return intersect_sphere(ray, Eigen::Vector3d::Zero(), object.radius);
    case ShapeKind::kCylinder:
      return intersect_frustum(ray, half.z(), object.radius, object.radius, true);
    case ShapeKind::kCapsule:
      return intersect_capsule(ray, half.z(), object.radius);
    case ShapeKind::kCone: {  // the centre of mass is a quarter of the height above the base
      const Eigen::Vector3d middle(0.0, 0.0, object.height / 4.0);
      return intersect_frustum({ray.origin - middle, ray.direction}, object.height / 2.0, object.radius, 0.0,
                               true);
    }
    case ShapeKind::kSolid:
      return object.solid ? intersect_mesh(ray, *object.solid) : std::nullopt;
    default:
      return intersect_box(ray, -half, half);
  }
}

std::optional<PickHit> pick(const Ray& ray, const scene::SurfaceSpec& surface, const FrameInput& input) {
  const scene::Snapshot& snapshot = input.snapshot;
  std::optional<PickHit> nearest = surface.cell_poses.empty() ? pick_cell(ray, surface, snapshot)
                                                              : pick_free_layout_cell(ray, surface, snapshot);
  if (has_skin(surface, snapshot))
    if (const auto hit = pick_skin(ray, surface, snapshot);
        hit && (!nearest || hit->distance < nearest->distance))
      nearest = hit;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    const ObjectSpec& object = input.catalogue[snapshot.id[i]];
    const auto& q = snapshot.orientation[i];
    const Eigen::Quaterniond to_local = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).conjugate();
    const auto& p = snapshot.position[i];
    const Eigen::Vector3d centre(p[0], p[1], p[2]);
    const auto t = intersect(object, {to_local * (ray.origin - centre), to_local * ray.direction});
    if (t && (!nearest || *t < nearest->distance))
      nearest =
          PickHit{{SceneItem::Kind::kObject, snapshot.id[i], 0, 0}, *t, ray.origin + *t * ray.direction};
  }
  return nearest;
}

}  // namespace smartsurf::view
