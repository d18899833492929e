#include "smartsurf/world/solver/SupportPoints.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "smartsurf/world/solver/ContactLaw-inl.h"

namespace smartsurf::world {
namespace {

// A point of a patch that bears a load.
struct Point {
  std::int32_t index;  // in BatchPoints
  double x, y;
  double stiffness, error, impulse, impulse_change = 0.0;  // error: of the speed, u/s
  BatchPointLimit* limit;
  bool lifts = false;
};

// The impulses with which no bearing point lacks speed: the change of velocity v + b·x + c·y at the points,
// with compliances as springs in series with the rigid body: (body's inertia + Σ stiffness) · (v, b, c) = Σ
// stiffness · error. Points that would pull lose their impulse. False: not found; with `all_bear`, as soon as
// a point would pull.
bool solve_impulses(std::span<Point> bearing, double mass, const InverseInertia& w, bool all_bear) {
  using support::Matrix3, support::Vector3;
  const double xx = w.xx, xy = w.xy, yy = w.yy, inverse_determinant = 1.0 / (xx * yy - xy * xy);
  constexpr int kActiveSetPasses = 6;
  for (int pass = 0; pass < kActiveSetPasses; ++pass) {
    double s = mass, sx = 0.0, sy = 0.0, sxx = xx * inverse_determinant, sxy = xy * inverse_determinant,
           syy = yy * inverse_determinant;
    double error = 0.0, error_x = 0.0, error_y = 0.0;
    for (const Point& b : bearing) {
      const double force = b.lifts ? -b.impulse : b.stiffness * b.error;
      error += force, error_x += force * b.x, error_y += force * b.y;
      if (b.lifts) continue;
      const double kx = b.stiffness * b.x, ky = b.stiffness * b.y;
      s += b.stiffness, sx += kx, sy += ky, sxx += kx * b.x, sxy += kx * b.y, syy += ky * b.y;
    }
    Matrix3 sum;
    sum << s, sx, sy, sx, sxx, sxy, sy, sxy, syy;
    const Vector3 change = support::solve(sum, Vector3(error, error_x, error_y));
    bool changed = false;
    for (Point& b : bearing) {
      b.impulse_change = b.stiffness * (b.error - (change[0] + b.x * change[1] + b.y * change[2]));
      const bool lifts = b.impulse + b.impulse_change <= 0.0;
      if (lifts) b.impulse_change = -b.impulse;
      changed |= lifts != b.lifts;
      b.lifts = lifts;
    }
    if (!changed) return true;
    if (all_bear) return false;
  }
  return false;
}

}  // namespace

void SupportLanes::set_body(int lane, float inverse_mass, const InverseInertia& w) {
  const double xx = w.xx, xy = w.xy, yy = w.yy, determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0) || !(inverse_mass > 0.0F)) {
    points[lane] = 0;
    return;
  }
  const double inverse_determinant = 1.0 / determinant;
  mass[lane] = 1.0 / static_cast<double>(inverse_mass);
  stiffness[lane] = mass[lane] / kSupportCompliance;
  inertia[0][lane] = xx * inverse_determinant;
  inertia[1][lane] = yy * inverse_determinant;
  inertia[2][lane] = xy * inverse_determinant;
}

void solve_support_points(const SupportPatches& list, const SupportPatch& p, BatchPoints points,
                          const SubstepParams& params, bool is_soft, BodyVelocity& m, const DeltaPose& delta,
                          const InverseInertia& w) {
  // A cell whose load comes near to what it can give may slow down under it: that is left to the sweeps.
  constexpr float kExhaustedLoadFraction = 0.9F;
  bool any_exhausted = p.has_shares && !p.is_lightly_loaded;
  constexpr int kFewPoints = 8;
  Point few[kFewPoints];
  Point* bearing = few;
  int count = 0;
  if (p.point_count > kFewPoints) {
    thread_local std::vector<Point> many;
    many.resize(p.point_count);
    bearing = many.data();
  }
  const int lane = p.lane;
  const double inverse_mass = m.inverse_mass, xx = w.xx, xy = w.xy, yy = w.yy;
  if (!(xx * yy - xy * xy > 0.0) || !(inverse_mass > 0.0)) return;
  const double mass = 1.0 / inverse_mass, hard_stiffness = mass / kSupportCompliance;
  const double inverse_softness = 1.0 / static_cast<double>(params.impulse_scale / params.mass_scale);
  double greatest_error = 0.0;
  auto add = [&](std::int32_t k, BatchPointLimit* limit) {
    const BatchPoint& point = points.point[k];
    const float impulse = point.normal_impulse[lane];
    if (!(impulse > 0.0F && point.normal_mass[lane] > 0.0F)) return;
    const BatchPointDetail& d = points.detail[k];
    const float x = d.anchor_a[0][lane], y = d.anchor_a[1][lane], rise = d.surface_velocity[2][lane];
    float speed = m.velocity[2] + (m.angular_velocity[0] * y - m.angular_velocity[1] * x) - rise, lag = 0.0F;
    if (limit) {
      any_exhausted |= limit->load[lane] > kExhaustedLoadFraction * limit->capacity[lane];
      speed += points.limit[k].planned_speed[lane] - limit->speed[lane];
      lag = limit->lag[lane];
    }
    double stiffness = hard_stiffness;
    float target_speed = point.relax_target_speed[lane];
    if (is_soft) {
      const float separation = point.separation[lane] + delta.translation[2] +
                               (delta.rotation[0] * y - delta.rotation[1] * x) - rise * params.elapsed_s +
                               lag;
      target_speed = law::soft_target_speed(separation, impulse, d.steady_impulse[lane],
                                            point.normal_mass[lane], params);
      if (separation <= 0.0F) stiffness = inverse_softness * static_cast<double>(point.normal_mass[lane]);
    }
    const double error = static_cast<double>(target_speed - speed);
    greatest_error = std::max(greatest_error, std::abs(error));
    bearing[count++] = {.index = k,
                        .x = static_cast<double>(x),
                        .y = static_cast<double>(y),
                        .stiffness = stiffness,
                        .error = error,
                        .impulse = static_cast<double>(impulse),
                        .limit = limit};
  };
  if (p.has_shares)
    support::for_each_share(
        list, p, points, [&](std::int32_t k, BatchPointLimit* limit, const PointShare&) { add(k, limit); });
  else
    for (const std::int32_t i : support::points_of(list, p)) add(p.batch_point + i, nullptr);
  if (count < 2 || any_exhausted || greatest_error <= kSupportSolved) return;
  const std::span<Point> all(bearing, count);
  if (!solve_impulses(all, mass, w, !p.has_shares)) return;
  double force = 0.0, moment_x = 0.0, moment_y = 0.0;
  for (const Point& b : all) {
    BatchPoint& point = points.point[b.index];
    const auto impulse_change = static_cast<float>(b.impulse_change);
    point.normal_impulse[lane] += impulse_change;
    if (!is_soft) point.total_normal_impulse[lane] += impulse_change;
    if (b.limit) b.limit->load[lane] += impulse_change;
    force += b.impulse_change, moment_x += b.impulse_change * b.x, moment_y += b.impulse_change * b.y;
  }
  support::apply_wrench({force, moment_x, moment_y}, m, w);
}

}  // namespace smartsurf::world
