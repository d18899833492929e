#include "tests/property/ColumnDepth.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace physics_fixture {

using namespace smartsurf;
using Vec = Eigen::Vector3d;
using scene::ShapeKind;
using surface::CellTip;

namespace {

// A convex body that answers how far it reaches in a direction.
struct Body {
  const scene::ObjectSpec& spec;
  const scene::ConvexHull* hull = nullptr;
  Vec position;
  Eigen::Matrix3d axes;

  double reach(const Vec& direction) const {
    const Vec d = axes.transpose() * direction;
    const double across = std::hypot(d.x(), d.y()), half = 0.5 * spec.height;
    double r = 0.0;
    switch (spec.shape) {
      case ShapeKind::kSphere:
        r = spec.radius * d.norm();
        break;
      case ShapeKind::kBox:
        r = 0.5 * spec.size.dot(d.cwiseAbs());
        break;
      case ShapeKind::kCylinder:
        r = spec.radius * across + half * std::abs(d.z());
        break;
      case ShapeKind::kCapsule:
        r = spec.radius * d.norm() + (half - spec.radius) * std::abs(d.z());
        break;
      case ShapeKind::kCone:  // its origin is the centre of mass
        r = std::max(0.75 * spec.height * d.z(), spec.radius * across - 0.25 * spec.height * d.z());
        break;
      case ShapeKind::kSolid:
        r = -std::numeric_limits<double>::infinity();
        for (const Eigen::Vector3f& v : hull->vertices) r = std::max(r, d.dot(v.cast<double>()));
    }
    return r + direction.dot(position);
  }

  // Directions along which a flat or a straight part of the surface may lie against a column.
  std::vector<Vec> normals() const {
    std::vector<Vec> n, edges;
    if (hull) {
      for (const auto& f : hull->faces) n.push_back(axes * f.normal.cast<double>());
      for (const auto& e : hull->unique_edge_directions) edges.push_back(axes * e.cast<double>());
    } else if (spec.shape != ShapeKind::kSphere) {
      for (int i = 0; i < 3; ++i) n.push_back(axes.col(i)), edges.push_back(axes.col(i));
    }
    for (const Vec& e : edges)
      for (int i = 0; i < 3; ++i) n.push_back(e.cross(Vec::Unit(i)));
    return n;
  }
};

// A bottomless column with its top; all functions hold for directions that do not point down.
struct ColumnBody {
  const surface::Field& field;
  int cell;
  double cos_angle, sin_angle;
  Vec top;

  ColumnBody(const surface::Field& f, int i)
      : field(f), cell(i), cos_angle(std::cos(f.angle_of(i))), sin_angle(std::sin(f.angle_of(i))) {
    top.head<2>() = f.centre(i).cast<double>();
    top.z() = f.height[static_cast<std::size_t>(i)];
  }
  double reach(const Vec& d) const {
    const double x = std::abs(cos_angle * d.x() + sin_angle * d.y()),
                 y = std::abs(cos_angle * d.y() - sin_angle * d.x());
    const double from_top = d.dot(top), across = std::hypot(x, y);
    if (!field.has_tips() || field.tip_of_cell[static_cast<std::size_t>(cell)] < 0)
      return from_top + x * field.half_top_x + y * field.half_top_y;
    const CellTip& tip = field.tip_at(static_cast<std::size_t>(cell));
    const double r = tip.radius;
    switch (tip.shape) {
      case CellTip::Shape::kHemisphere:
        return from_top + r * (d.norm() - d.z());
      case CellTip::Shape::kCone:
        return from_top + std::max(0.0, r * across - tip.height * d.z());
      case CellTip::Shape::kRoundedSquare:
        return from_top + x * (field.half_top_x - r) + y * (field.half_top_y - r) + r * across;
      default:
        return from_top + x * field.half_top_x + y * field.half_top_y;
    }
  }
};

double depth_along(const ColumnBody& column, const Body& body, const Vec& n) {
  return column.reach(n) + body.reach(-n);
}

// The least depth over all directions that do not point down: candidates of flat faces and edges, directions
// spread over the hemisphere, and a descent from the best of them.
double depth(const ColumnBody& column, const Body& body) {
  constexpr int kSpread = 150, kStarts = 6;
  struct Start {
    double depth;
    Vec n;
  };
  std::array<Start, kStarts> best;
  best.fill({std::numeric_limits<double>::infinity(), Vec::UnitZ()});
  bool apart = false;
  const auto visit = [&](Vec n) {
    if (apart || n.norm() < 1e-9) return;
    n.normalize();
    if (n.z() < 0.0) {
      if (n.z() < -1e-9) return;
      n.z() = 0.0;
    }
    const double d = depth_along(column, body, n);
    if (d <= 0.0) apart = true;
    if (d >= best.back().depth) return;
    best.back() = {d, n};
    for (std::size_t i = kStarts - 1; i > 0 && best[i].depth < best[i - 1].depth; --i)
      std::swap(best[i], best[i - 1]);
  };
  visit(Vec::UnitZ());
  const Vec east(column.cos_angle, column.sin_angle, 0.0), north(-column.sin_angle, column.cos_angle, 0.0);
  for (const Vec& n : {east, north}) visit(n), visit(-n);
  if (apart) return 0.0;
  for (const Vec& n : body.normals()) visit(n), visit(-n);
  for (int i = 0; i < kSpread && !apart; ++i) {
    const double z = (i + 0.5) / kSpread, angle = i * std::numbers::pi * (3.0 - std::sqrt(5.0));
    visit({std::sqrt(1 - z * z) * std::cos(angle), std::sqrt(1 - z * z) * std::sin(angle), z});
  }
  double least = best[0].depth;
  for (const Start& start : best) {
    Vec n = start.n;
    double here = start.depth;
    for (double step = 0.15; step > 1e-3 && !apart;) {
      const Vec u = n.unitOrthogonal(), v = n.cross(u);
      Vec better = n;
      double least_here = here;
      for (int k = 0; k < 8; ++k) {
        const double a = k * std::numbers::pi / 4;
        Vec m = (n + step * (std::cos(a) * u + std::sin(a) * v)).normalized();
        if (m.z() < 0.0) m.z() = 0.0, m.normalize();
        const double d = depth_along(column, body, m);
        if (d < least_here) least_here = d, better = m;
      }
      if (least_here < here)
        here = least_here, n = better;
      else
        step *= 0.5;
      apart |= here <= 0.0;
    }
    least = std::min(least, here);
  }
  return apart ? 0.0 : least;
}

}  // namespace

double depth_in_columns(const surface::Field& f, const scene::ObjectSpec& spec,
                        const scene::Snapshot& snapshot, std::size_t index) {
  const auto& q = snapshot.orientation[index];
  Body body{spec, nullptr, Eigen::Vector3f(snapshot.position[index].data()).cast<double>(),
            Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().toRotationMatrix()};
  double deepest = 0.0;
  const auto visit_part = [&] {
    const double top_reach = std::hypot(f.half_top_x, f.half_top_y);
    const Eigen::Vector2d low(-body.reach(-Vec::UnitX()) - top_reach, -body.reach(-Vec::UnitY()) - top_reach),
        high(body.reach(Vec::UnitX()) + top_reach, body.reach(Vec::UnitY()) + top_reach);
    const double bottom = -body.reach(-Vec::UnitZ());
    for (int i = 0; i < f.cells(); ++i) {
      if (f.height[static_cast<std::size_t>(i)] <= bottom) continue;
      const Eigen::Vector2d centre = f.centre(i).cast<double>();
      if ((centre.array() < low.array()).any() || (centre.array() > high.array()).any()) continue;
      deepest = std::max(deepest, depth(ColumnBody(f, i), body));
    }
  };
  if (!spec.solid) {
    visit_part();
  } else {
    for (const scene::ConvexHull& hull : spec.solid->hulls) body.hull = &hull, visit_part();
  }
  return deepest;
}

}  // namespace physics_fixture
