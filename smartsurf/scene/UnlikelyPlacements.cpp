#include "smartsurf/scene/UnlikelyPlacements.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include "smartsurf/scene/SurfaceBounds.h"

namespace smartsurf::scene {
namespace {

// Fractions of the smaller object's smallest edge.
constexpr double kAllowedDepth = 0.25;
constexpr int kMaxTests = 1'000'000;  // pairs tested: enough to find thousands of objects at one place

// A part of space that an object certainly contains: a box about the origin (half edges, body frame) or, with
// half edges of 0 across, a segment along z, grown by a radius.
struct Core {
  Eigen::Vector3d half;
  double radius;
  double smallest_edge() const {
    const double across = std::min(half.x(), half.y());
    return 2 * (radius + (across > 0 ? std::min(across, half.z()) : 0.0));
  }
};

// The largest ball about the origin in a single piece; nullopt if the origin lies in none, as in a ring or a
// cup.
std::optional<Core> core_of_solid(const Solid& solid) {
  double largest = 0;
  for (const ConvexHull& hull : solid.hulls) {
    double radius = std::numeric_limits<double>::infinity();
    for (const ConvexHull::Face& face : hull.faces) radius = std::min(radius, double{face.offset});
    largest = std::max(largest, radius);
  }
  if (!(largest > 0)) return std::nullopt;
  return Core{Eigen::Vector3d::Zero(), largest};
}

std::optional<Core> core_of(const ObjectSpec& o) {
  switch (o.shape) {
    case ShapeKind::kSphere:
      return Core{Eigen::Vector3d::Zero(), o.radius};
    case ShapeKind::kCapsule:
      return Core{{0, 0, o.height / 2 - o.radius}, o.radius};
    case ShapeKind::kBox:
      return Core{o.size / 2, 0};
    case ShapeKind::kCylinder:
      return Core{{o.radius / std::sqrt(2.0), o.radius / std::sqrt(2.0), o.height / 2}, 0};
    case ShapeKind::kCone:
      return Core{Eigen::Vector3d::Zero(),
                  std::min(o.height / 4, 0.75 * o.radius * o.height / std::hypot(o.height, o.radius))};
    case ShapeKind::kSolid:
      return core_of_solid(*o.solid);
  }
  return std::nullopt;
}

// How far one of two cores must move along an axis until they part; the least over the axes on which boxes
// and segments part.
double overlap_depth(const ObjectSpec& a, const Core& core_a, const ObjectSpec& b, const Core& core_b) {
  const Eigen::Matrix3d axes_a = a.orientation.toRotationMatrix(), axes_b = b.orientation.toRotationMatrix();
  const Eigen::Vector3d between = b.position - a.position;
  double least = std::numeric_limits<double>::infinity();
  const auto test = [&](const Eigen::Vector3d& direction) {
    const double length = direction.norm();
    if (length < 1e-9) return;
    const Eigen::Vector3d axis = direction / length;
    const double reach = (axes_a.transpose() * axis).cwiseAbs().dot(core_a.half) + core_a.radius +
                         (axes_b.transpose() * axis).cwiseAbs().dot(core_b.half) + core_b.radius;
    least = std::min(least, reach - std::abs(between.dot(axis)));
  };
  for (int i = 0; i < 3; ++i) {
    test(axes_a.col(i)), test(axes_b.col(i));
    for (int k = 0; k < 3; ++k) test(axes_a.col(i).cross(axes_b.col(k)));
  }
  // Where a core is round, its closest point to the other one gives the axis.
  const auto closest = [](const ObjectSpec& from, const Core& core, const Eigen::Vector3d& point) {
    const Eigen::Vector3d local = from.orientation.conjugate() * (point - from.position);
    return Eigen::Vector3d(from.position + from.orientation * local.cwiseMax(-core.half).cwiseMin(core.half));
  };
  if (core_a.radius > 0 || core_b.radius > 0) {
    Eigen::Vector3d on_a = a.position, on_b = b.position;
    for (int round = 0; round < 20; ++round) on_b = closest(b, core_b, on_a), on_a = closest(a, core_a, on_b);
    test(on_b - on_a);
  }
  return least;
}

std::string name_of(const ObjectSpec& o, std::size_t i) {
  return fmt::format("object {}{} at ({:.4g}, {:.4g}, {:.4g})", i,
                     o.label.empty() ? "" : " '" + o.label + "'", o.position.x(), o.position.y(),
                     o.position.z());
}

// The first of several, and how many more.
struct Reported {
  std::string first;
  int others = 0;

  void add(const std::string& what) {
    if (first.empty())
      first = what;
    else
      ++others;
  }
  void report(std::vector<std::string>& lines) const {
    if (first.empty()) return;
    lines.push_back(others == 0 ? first : fmt::format("{}; and {} more", first, others));
  }
};

// z below which a point over the table is inside cells, if none is empty.
double lowest_top(const SurfaceSpec& surface) {
  return std::min(surface.pin.min_height, surface.border_height.value_or(surface.pin.min_height));
}

// True if the point is within the wall around the cells.
bool is_in_border(const SurfaceSpec& surface, const Eigen::Vector3d& p) {
  if (!surface.border_height || !surface.cell_poses.empty() || p.z() >= *surface.border_height) return false;
  const auto column = static_cast<int>(std::lround(p.x() / surface.pitch)),
             row = surface.rows - 1 - static_cast<int>(std::lround(p.y() / surface.pitch));
  return row >= 0 && column >= 0 && row < surface.rows && column < surface.columns &&
         surface.is_border(row, column);
}

// Depth of the object's core below `top` in cells that are at least that high, u. 0 if the depth is below the
// allowed fraction, or if there may be no cell there.
double depth_in_cells(const SurfaceSpec& surface, const ObjectSpec& o, double top) {
  const std::optional<Core> core = core_of(o);
  if (!core) return 0.0;
  const Eigen::Vector3d down = o.orientation.conjugate() * Eigen::Vector3d::UnitZ();
  const double depth = top - (o.position.z() - down.cwiseAbs().dot(core->half) - core->radius);
  if (depth <= kAllowedDepth * core->smallest_edge()) return 0.0;
  const auto holds = [&](const CellPose& cell) {
    return std::hypot(cell.x - o.position.x(), cell.y - o.position.y()) < surface.pitch / 2;
  };
  const bool is_over_a_cell = surface.cell_poses.empty() || std::ranges::any_of(surface.cell_poses, holds);
  return is_over_a_cell ? depth : 0.0;
}

}  // namespace

PlacementCheck::PlacementCheck(const SurfaceSpec& surface)
    : surface_(surface),
      bounds_(compute_surface_bounds(surface)),
      lowest_top_(lowest_top(surface)),
      is_solid_(!surface.has_empty_cells() && !surface.skin) {}

std::optional<PlacementCheck::Mistake> PlacementCheck::operator()(const ObjectSpec& o, std::size_t id) const {
  const double diagonal = std::hypot(bounds_.width(), bounds_.height());
  const double gap = surface_.pitch - std::max(surface_.pin.top_x, surface_.pin.top_y);
  const double feet = surface_.ground_height(), hole = std::numbers::sqrt2 * gap;
  if (o.fixed) return std::nullopt;
  const Eigen::Vector3d& p = o.position;
  const double dx = std::max({bounds_.west - p.x(), 0.0, p.x() - bounds_.east}),
               dy = std::max({bounds_.south - p.y(), 0.0, p.y() - bounds_.north}),
               off_table = std::hypot(dx, dy);
  const auto mistake = [&](Kind kind, const std::string& what) {
    return Mistake{kind, name_of(o, id) + " " + what};
  };
  if (o.half_extents().minCoeff() > diagonal) return mistake(Kind::kLarge, "is larger than the table");
  if (off_table > o.half_extents().norm() && o.velocity.isZero())
    return mistake(Kind::kBeside,
                   fmt::format("is beside the table (x {:.4g} … {:.4g}, y {:.4g} … {:.4g}) and will fall",
                               bounds_.west, bounds_.east, bounds_.south, bounds_.north));
  if (p.z() < feet && off_table == 0)
    return mistake(Kind::kBelow, fmt::format("is below the cells, whose feet are at z = {:.4g}", feet));
  if (off_table == 0 && is_solid_ && o.velocity.isZero()) {
    if (p.z() < lowest_top_)
      return mistake(Kind::kAmong,
                     fmt::format("is inside the cells, whose tops are at z = {:.4g} or higher", lowest_top_));
    if (const double depth = depth_in_cells(surface_, o, lowest_top_); depth > 0)
      return mistake(Kind::kAmong,
                     fmt::format("is {:.4g} u deep inside the cells, whose tops are at z = {:.4g} or higher",
                                 depth, lowest_top_));
  }
  if (is_in_border(surface_, p) && o.velocity.isZero())
    return mistake(Kind::kWalled,
                   fmt::format("is inside the border, which is {:.4g} u high", *surface_.border_height));
  if (2 * o.half_extents().maxCoeff() < hole && is_solid_)
    return mistake(
        Kind::kSmall,
        fmt::format("is smaller than the holes of {:.4g} u between four cells and may fall into one", hole));
  return std::nullopt;
}

std::vector<std::string> unlikely_placements(const SceneSpec& scene) {
  std::vector<bool> may_be_anywhere(scene.objects.size());
  for (const JointSpec& joint : scene.joints) {
    may_be_anywhere[joint.a] = true;
    if (joint.b) may_be_anywhere[*joint.b] = true;
  }
  std::array<Reported, PlacementCheck::kKinds> single;
  Reported inside;
  const PlacementCheck check(scene.surface);
  for (std::size_t i = 0; i < scene.objects.size(); ++i)
    if (const auto mistake = may_be_anywhere[i] ? std::nullopt : check(scene.objects[i], i))
      single[static_cast<std::size_t>(mistake->kind)].add(mistake->line);
  // Sweep along x over the objects' extents.
  std::vector<std::size_t> order(scene.objects.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto west = [&](std::size_t i) {
    return scene.objects[i].position.x() - scene.objects[i].half_extents().norm();
  };
  std::ranges::sort(order, {}, west);
  std::vector<std::pair<std::size_t, std::size_t>> overlaps;
  int tests = 0;
  for (std::size_t k = 0; k < order.size() && tests < kMaxTests; ++k) {
    const std::size_t i = order[k];
    const ObjectSpec& a = scene.objects[i];
    const std::optional<Core> core_a = core_of(a);
    if (!core_a || may_be_anywhere[i]) continue;
    const double reach = a.half_extents().norm();
    for (std::size_t n = k + 1; n < order.size() && west(order[n]) < a.position.x() + reach; ++n) {
      ++tests;
      const std::size_t j = order[n];
      const ObjectSpec& b = scene.objects[j];
      if ((a.fixed && b.fixed) || may_be_anywhere[j]) continue;
      if ((a.position - b.position).norm() > reach + b.half_extents().norm()) continue;
      const std::optional<Core> core_b = core_of(b);
      if (!core_b) continue;
      const double allowed = kAllowedDepth * std::min(core_a->smallest_edge(), core_b->smallest_edge());
      if (overlap_depth(a, *core_a, b, *core_b) > allowed)
        overlaps.emplace_back(std::min(i, j), std::max(i, j));
    }
  }
  std::ranges::sort(overlaps);
  for (const auto& [i, j] : overlaps)
    inside.add(fmt::format("{} is inside object {}{}: they will be thrown apart",
                           name_of(scene.objects[i], i), j,
                           scene.objects[j].label.empty() ? "" : " '" + scene.objects[j].label + "'"));
  std::vector<std::string> lines;
  for (const Reported& reported : single) reported.report(lines);
  inside.report(lines);
  return lines;
}

}  // namespace smartsurf::scene
