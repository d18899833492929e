#include "RayOracle.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

using namespace smartsurf;
using Eigen::Vector3d;
using scene::ShapeKind;
using surface::CellRay;
using surface::Field;

namespace oracle {
namespace {

// A segment that passes a shape's boundary at less than this distance may or may not hit it.
constexpr double kTolerance = 2e-4;

scene::ConvexHull make_hull(const std::vector<Eigen::Vector4f>& planes, const Eigen::Vector3f& low,
                            const Eigen::Vector3f& high) {
  scene::ConvexHull hull;
  for (const auto& p : planes)
    hull.faces.push_back({p.head<3>().normalized(), p.w() / p.head<3>().norm(), 0, 0});
  hull.bounds_min = low;
  hull.bounds_max = high;
  return hull;
}

scene::ConvexHull make_block(const Eigen::Vector3f& low, const Eigen::Vector3f& high) {
  return make_hull({{1, 0, 0, high.x()},
                    {-1, 0, 0, -low.x()},
                    {0, 1, 0, high.y()},
                    {0, -1, 0, -low.y()},
                    {0, 0, 1, high.z()},
                    {0, 0, -1, -low.z()}},
                   low, high);
}

// An L of two blocks, and a wedge beside it.
std::shared_ptr<const scene::Solid> make_compound_solid() {
  auto solid = std::make_shared<scene::Solid>();
  solid->hulls = {make_block({-1.5F, -1, -0.5F}, {0, 1, 0.5F}), make_block({0, -1, -0.5F}, {1, 0, 0.5F}),
                  make_hull({{-1, 0, 0, -1}, {1, 0, 2, 2}, {0, 1, 0, 0}, {0, -1, 0, 1}, {0, 0, -1, 0.5F}},
                            {1, -1, -0.5F}, {3, 0, 0.5F})};
  solid->bounds_min = {-1.5F, -1, -0.5F};
  solid->bounds_max = {3, 1, 0.5F};
  solid->bounding_radius = solid->bounds_max.norm();
  return solid;
}

double radius_at(const Vector3d& p) { return p.head<2>().norm(); }

// Where a segment enters the region in which the convex function is at most 0.
struct RayEntry {
  bool certain = true;
  std::optional<double> distance;
};
// Finds the minimum by golden-section search, then the entry by bisection.
template <class F>
RayEntry find_entry(F f, double range) {
  double a = 0, b = range;
  for (int i = 0; i < 45; ++i) {
    const double p = a + (b - a) * 0.382, q = a + (b - a) * 0.618;
    (f(p) < f(q) ? b : a) = f(p) < f(q) ? q : p;
  }
  const double least = std::min({f(0.0), f(a), f(range)});
  if (std::abs(least) < kTolerance) return {false, a};
  if (least > 0) return {};
  if (f(0.0) <= 0) return {true, 0.0};
  double out = 0, in = f(a) <= 0 ? a : range;
  for (int i = 0; i < 40; ++i) (f((out + in) / 2) > 0 ? out : in) = (out + in) / 2;
  return {true, in};
}

void merge_hit(ExpectedHit& e, std::vector<double>& uncertain, const RayEntry& found, float tag) {
  if (!found.distance) return;
  if (!found.certain) {
    uncertain.push_back(*found.distance);
    return;
  }
  if (std::abs(*found.distance - e.distance) < kTolerance && e.tag != 0)
    uncertain.push_back(e.distance);  // a tie
  if (*found.distance < e.distance || e.tag == 0) e = {*found.distance, tag, true};
}

}  // namespace

double signed_distance(const scene::ObjectSpec& o, std::size_t part, const Vector3d& p) {
  switch (o.shape) {
    case ShapeKind::kSphere:
      return p.norm() - o.radius;
    case ShapeKind::kBox:
      return (p.cwiseAbs() - o.size / 2).maxCoeff();
    case ShapeKind::kCylinder:
      return std::max(radius_at(p) - o.radius, std::abs(p.z()) - o.height / 2);
    case ShapeKind::kCapsule: {
      const double half = o.height / 2 - o.radius;
      return (p - Vector3d(0, 0, std::clamp(p.z(), -half, half))).norm() - o.radius;
    }
    case ShapeKind::kCone: {
      const double k = o.radius / o.height;
      const double side = (radius_at(p) - k * (0.75 * o.height - p.z())) / std::hypot(1.0, k);
      return std::max(side, -p.z() - o.height / 4);
    }
    case ShapeKind::kSolid: {
      double max_distance = -1e9;
      for (const auto& f : o.solid->hulls[part].faces)
        max_distance = std::max(max_distance, f.normal.cast<double>().dot(p) - static_cast<double>(f.offset));
      return max_distance;
    }
  }
  return 0;
}

ExpectedHit cast_ray(const Scene& s, const CellRay& ray, int cell) {
  const auto i = static_cast<std::size_t>(cell);
  const Field& f = s.field;
  const auto cell_position = [&](int k) {
    const auto n = static_cast<std::size_t>(k);
    return f.is_rectangular() ? Eigen::Vector2d(k % f.columns, f.rows - 1 - k / f.columns) * double{f.pitch}
                              : Eigen::Vector2d(f.x[n], f.y[n]);
  };
  const auto cell_rotation = [&](int k) {
    return Eigen::AngleAxisd(f.is_rectangular() ? 0.0 : f.angle[static_cast<std::size_t>(k)],
                             Vector3d::UnitZ());
  };
  const double base = ray.from_top ? f.height[i] : 0.0F;
  const Vector3d start = Vector3d(cell_position(cell).x(), cell_position(cell).y(), base) +
                         cell_rotation(cell) * ray.origin.cast<double>();
  const Vector3d along = cell_rotation(cell) * ray.direction.cast<double>();
  ExpectedHit e{ray.range};
  std::vector<double> uncertain;
  if (!std::isfinite(base)) return e;
  for (int k = 0; ray.hits_pins && k < f.cells(); ++k) {
    const double top = f.height[static_cast<std::size_t>(k)];
    // A segment that starts on its own pin and does not descend cannot hit that pin.
    if (k == cell && ray.from_top && ray.origin.z() >= 0 && along.z() >= 0) continue;
    if (!std::isfinite(top)) continue;
    const Vector3d foot(cell_position(k).x(), cell_position(k).y(), top);
    const auto column_distance = [&](double t) {
      const Vector3d p = cell_rotation(k).inverse() * (start + t * along - foot);
      return std::max({std::abs(p.x()) - f.half_top_x, std::abs(p.y()) - f.half_top_y, p.z()});
    };
    merge_hit(e, uncertain, find_entry(column_distance, ray.range), 1000);
  }
  for (std::size_t k = 0; k < s.snapshot.object_count(); ++k) {
    const auto& o = s.objects[s.snapshot.id[k]];
    const std::size_t parts = o.shape == ShapeKind::kSolid ? o.solid->hulls.size() : 1;
    for (std::size_t part = 0; part < parts; ++part) {
      const auto object_distance = [&](double t) {
        return signed_distance(o, part, o.orientation.inverse() * (start + t * along - o.position));
      };
      merge_hit(e, uncertain, find_entry(object_distance, ray.range), static_cast<float>(k + 1));
    }
  }
  e.certain = std::ranges::none_of(uncertain, [&](double t) { return t < e.distance + kTolerance; });
  return e;
}

scene::ObjectSpec random_object(std::mt19937& random, ShapeKind shape, double width, double depth) {
  std::uniform_real_distribution<double> u(0, 1);
  scene::ObjectSpec o;
  o.shape = shape;
  o.radius = 0.4 + u(random);
  o.height = (shape == ShapeKind::kCapsule ? 2 * o.radius : 0.4) + 2.5 * u(random);
  o.size = {0.5 + 3 * u(random), 0.5 + 3 * u(random), 0.5 + 2 * u(random)};
  if (shape == ShapeKind::kSolid) o.solid = make_compound_solid();
  // Rounded to float, so that the oracle and RayCaster see the same pose.
  o.position = Vector3d(width * u(random), depth * u(random), 1 + 5 * u(random)).cast<float>().cast<double>();
  o.orientation = Eigen::Quaternionf(Eigen::Vector4f::NullaryExpr([&] {
                                       return static_cast<float>(u(random) - 0.5);
                                     }).normalized())
                      .cast<double>();
  if (u(random) < 0.2) o.orientation.setIdentity();
  return o;
}

Scene random_scene(std::mt19937& random, int rows, int columns, bool free, float pitch) {
  std::uniform_real_distribution<float> u(0, 1);
  Scene s;
  s.field.pitch = pitch;
  s.field.rows = rows;
  s.field.columns = columns;
  s.field.half_top_x = 0.4F;
  s.field.half_top_y = 0.3F;
  for (int i = 0; i < rows * columns; ++i) {
    s.field.height.push_back(u(random) < 0.05F ? surface::kNoCellHeight : 2 * u(random));
    if (!free) continue;
    const int r = i / columns;
    s.field.x.push_back(pitch * (static_cast<float>(i % columns) + 0.5F * static_cast<float>(r % 2)));
    s.field.y.push_back(pitch * 0.9F * static_cast<float>(rows - 1 - r));
    s.field.angle.push_back(6 * u(random));
  }
  for (int k = 0; k < 2 * scene::kShapeKindCount; ++k) {
    const auto o =
        random_object(random, static_cast<ShapeKind>(k % scene::kShapeKindCount), columns - 1, rows - 1);
    const auto p = o.position.cast<float>();
    const auto q = o.orientation.cast<float>();
    s.snapshot.id.push_back(static_cast<scene::ObjectId>(k));
    s.snapshot.position.push_back({p.x(), p.y(), p.z()});
    s.snapshot.orientation.push_back({q.x(), q.y(), q.z(), q.w()});
    s.objects.push_back(o);
  }
  return s;
}

std::shared_ptr<const scene::Solid> make_drum(int faces) {
  constexpr float kRadius = 2.0F, kHalf = 1.5F;
  std::vector<Eigen::Vector4f> planes{{0, 0, 1, kHalf}, {0, 0, -1, kHalf}};
  for (int i = 2; i < faces; ++i) {
    const float angle = 6.2831853F * static_cast<float>(i) / static_cast<float>(faces - 2);
    planes.emplace_back(std::cos(angle), std::sin(angle), 0.0F, kRadius);
  }
  auto solid = std::make_shared<scene::Solid>();
  solid->bounds_max = {1.5F * kRadius, 1.5F * kRadius, kHalf};
  solid->bounds_min = -solid->bounds_max;
  solid->bounding_radius = solid->bounds_max.norm();
  solid->hulls = {make_hull(planes, solid->bounds_min, solid->bounds_max)};
  return solid;
}

void scale_object(scene::ObjectSpec& o, double factor) {
  if (o.shape == ShapeKind::kSolid) return;
  o.radius *= factor;
  o.height *= factor;
  o.size *= factor;
}

void move_to(Scene& s, std::size_t k, const Eigen::Vector3f& place) {
  s.objects[k].position = place.cast<double>();
  s.snapshot.position[k] = {place.x(), place.y(), place.z()};
}

}  // namespace oracle
