#include "smartsurf/world/solver/SupportSolver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "smartsurf/world/solver/ContactLaw-inl.h"
#include "smartsurf/world/solver/SupportKernels.h"
#include "smartsurf/world/solver/SupportPoints.h"

namespace smartsurf::world {
namespace {

using support::Matrix3, support::Vector3, support::points_of, support::for_each_share;

// Compliance against a moment that no loads can balance, relative to that of the samples: the loads then
// concentrate at the edge of the patch.
constexpr double kMomentCompliance = 1e-4;
// Convergence tolerance of the loads, as a fraction of the total force.
constexpr double kLoadTolerance = 1e-4;
// Friction uses the last loads in proportion while the centre of force has moved by less, relative to the
// patch's extent.
constexpr double kCentreTolerance = 0.01;
constexpr int kMaxLoadPasses = 12, kMaxLimitedLoadPasses = 40, kMaxFrictionPasses = 5;

SupportSampleView view(SupportSamples& s, const SupportPatch& p) {
  const std::int32_t first = p.first;
  auto &friction = s.friction[p.current], &new_friction = s.friction[1 - p.current];
  return {.x = &s.x[first],
          .y = &s.y[first],
          .arm = &s.arm[first],
          .velocity_x = &s.velocity_x[first],
          .velocity_y = &s.velocity_y[first],
          .spin = &s.spin[first],
          .weight = &s.weight[first],
          .friction = {&friction[0][first], &friction[1][first], &friction[2][first]},
          .new_friction = {&new_friction[0][first], &new_friction[1][first], &new_friction[2][first]},
          .load = &s.load[first],
          .limit = p.has_shares || p.is_elastic ? &s.limit[first] : nullptr,
          .count = (p.count + kLanes - 1) / kLanes * kLanes};
}

// A symmetric matrix from its entries xx, yy, zz, xy, xz, yz, and back.
Matrix3 symmetric(const double (&k)[6]) {
  Matrix3 m;
  m << k[0], k[3], k[4], k[3], k[1], k[5], k[4], k[5], k[2];
  return m;
}
void store(const Matrix3& m, double (&k)[6]) {
  const double entries[6] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
  std::copy_n(entries, 6, k);
}

// A load a + b·u + c·v in scaled coordinates, as one in x and y.
void in_world_axes(const SupportPatch& p, const double (&load)[3], double factor, float (&out)[3]) {
  const double b = load[1] / p.scale, c = load[2] / p.scale;
  out[0] = static_cast<float>(factor * (load[0] - b * p.centre_x - c * p.centre_y));
  out[1] = static_cast<float>(factor * b);
  out[2] = static_cast<float>(factor * c);
}

// The sums of a patch's loads in scaled coordinates.
struct ScaledSums {
  Vector3 load;
  Matrix3 stiffness;
};
ScaledSums scaled(const SupportPatch& p, const LoadSums& s) {
  const double x = p.centre_x, y = p.centre_y, inverse = 1.0 / p.scale, square = inverse * inverse;
  const double w = s.stiffness[0], wx = s.stiffness[1], wy = s.stiffness[2];
  ScaledSums out;
  out.load = {s.load[0], (s.load[1] - x * s.load[0]) * inverse, (s.load[2] - y * s.load[0]) * inverse};
  const double u = (wx - x * w) * inverse, v = (wy - y * w) * inverse;
  const double uu = (s.stiffness[3] - 2.0 * x * wx + x * x * w) * square,
               uv = (s.stiffness[4] - x * wy - y * wx + x * y * w) * square,
               vv = (s.stiffness[5] - 2.0 * y * wy + y * y * w) * square;
  out.stiffness << w, u, v, u, uu, uv, v, uv, vv;
  return out;
}

// Finds the loads with the given force and moments, Σ N·(1, u, v): Newton's method with a line search on the
// dual of the least-squares problem, which is convex and piecewise quadratic. With limits, loads that are not
// in equilibrium may remain.
void distribute(const SupportSampleView& samples, SupportPatch& p, const Vector3& target) {
  const double force = target[0], weight = p.total_weight;
  if (!(force > 0.0)) {
    p.force = 0.0;
    return;
  }
  for (int i = 0; i < 2; ++i) p.centre_of_force[i] = target[i + 1] / force;
  if (p.count == 1) {
    p.load[0] = force / weight, p.load[1] = p.load[2] = 0.0;
    p.offset_x = target[1] / force * p.scale, p.offset_y = target[2] / force * p.scale;
    p.force = force;
    return;
  }
  const Vector3 uniform(force / weight, 0.0, 0.0);
  const bool is_limited = samples.limit != nullptr;
  const Vector3 compliance(0.0, kMomentCompliance * weight, kMomentCompliance * weight);
  auto newton_step = [&](const Vector3& residual, Matrix3 stiffness) {
    stiffness.diagonal() += compliance + Vector3::Constant(1e-9 * weight);
    return Vector3(-support::solve(stiffness, residual));
  };
  Vector3 load = uniform;
  if (p.force > 0.0) {
    // The last sums hold for the last loads in proportion, so the first step needs no pass.
    const double ratio = force / p.force;
    load = ratio * Vector3(p.load);
    const Vector3 sums = ratio * Vector3(p.load_sums);
    load += newton_step(sums + compliance.cwiseProduct(load) - target, symmetric(p.load_stiffness));
  }
  support::LineSearch search{.point = load};
  double total = 0.0;
  for (int pass = 0; pass < (is_limited ? kMaxLimitedLoadPasses : kMaxLoadPasses); ++pass) {
    float in_world[3];
    const double coefficients[3] = {search.point[0], search.point[1], search.point[2]};
    in_world_axes(p, coefficients, 1.0, in_world);
    LoadSums raw;
    support_kernels().sum_loads(samples, in_world, raw);
    if (pass == 0 && !(raw.load[0] > 0.0)) {  // no sample bears: only a warm start can be that far off
      search.point = uniform;
      continue;
    }
    const ScaledSums sums = scaled(p, raw);
    const Vector3 residual = sums.load + compliance.cwiseProduct(search.point) - target;
    if (!search.accept(residual)) continue;
    total = raw.load[0];
    for (int i = 0; i < 3; ++i) p.load_sums[i] = sums.load[i];
    store(sums.stiffness, p.load_stiffness);
    const double inverse_total = total > 0.0 ? 1.0 / total : 0.0;
    p.offset_x = (target[1] / force - sums.load[1] * inverse_total) * p.scale;
    p.offset_y = (target[2] / force - sums.load[2] * inverse_total) * p.scale;
    if (residual.cwiseAbs().maxCoeff() <= kLoadTolerance * force) break;
    search.take(newton_step(residual, sums.stiffness), residual);
  }
  if (total > 0.0 && !is_limited) {
    search.best *= force / total;
    for (double& sum : p.load_sums) sum *= force / total;
  }
  for (int i = 0; i < 3; ++i) p.load[i] = search.best[i];
  p.force = force;
}

Vector3 scaled_wrench(const SupportPatch& p, double force, double moment_x, double moment_y) {
  return {force, (moment_x - p.centre_x * force) / p.scale, (moment_y - p.centre_y * force) / p.scale};
}

void apply_friction(const SupportPatch& p, const Vector3& impulse, BodyVelocity& m, const InverseInertia& w) {
  const Vec3 f = impulse.cast<float>();  // force along x and y, torque
  m.velocity[0] += f.x() * m.inverse_mass;
  m.velocity[1] += f.y() * m.inverse_mass;
  Eigen::Map<Vec3>(m.angular_velocity) += multiply(w, {-p.z * f.y(), p.z * f.x(), f.z()});
}

// A planar force field f = force + rate·ẑ × r with a given resultant, over weighted points.
struct PlanarField {
  double force_x = 0, force_y = 0, rate = 0, x = 0, y = 0;  // x, y: weighted mean of the points
  // `moment`: about the origin. `polar`: Σ weight·r² about the mean.
  PlanarField(const Vector3& impulse, double weight, double mean_x, double mean_y, double polar)
      : force_x(impulse[0] / weight), force_y(impulse[1] / weight), x(mean_x), y(mean_y) {
    const double moment = impulse[2] - (mean_x * impulse[1] - mean_y * impulse[0]);
    if (polar > 1e-6) rate = moment / polar;
  }
  double fx(double at_y) const { return force_x - rate * (at_y - y); }
  double fy(double at_x) const { return force_y + rate * (at_x - x); }
};

// The force and moments of the normal impulses at a patch's points.
Vector3 wrench_of_points(const SupportPatches& list, const SupportPatch& p, BatchPoints points) {
  double force = 0.0, moment_x = 0.0, moment_y = 0.0;
  for (const std::int32_t i : points_of(list, p)) {
    const std::int32_t k = p.batch_point + i;
    const double impulse = points.point[k].normal_impulse[p.lane];
    const float(&anchor)[3][kLanes] = points.detail[k].anchor_a;
    force += impulse;
    moment_x += impulse * static_cast<double>(anchor[0][p.lane]);
    moment_y += impulse * static_cast<double>(anchor[1][p.lane]);
  }
  return {force, moment_x, moment_y};
}

// Distributes the normal impulses of a patch's points over its samples, within what their cells can give. The
// points of each cell take over its load if `is_final`. The contact solver's own loads remain if the new ones
// are not in equilibrium with them, which happens where a body tips over its last cell.
void distribute_within_limits(SupportPatches& list, SupportPatch& p, BatchPoints points,
                              const Vector3& target, bool is_final) {
  constexpr float kWrenchTolerance = 1e-3F;  // relative to the force
  const SupportSampleView samples = view(list.samples, p);
  const int lane = p.lane;
  for_each_share(list, p, points, [&](std::int32_t k, const BatchPointLimit* limit, const PointShare& share) {
    float& most = list.samples.limit[p.first + share.sample];
    most = limit ? limit->capacity[lane] : kUnlimitedLoad;
    if (points.point[k].normal_mass[lane] == 0.0F) most = 0.0F;  // an impact, at the end of the step
  });
  distribute(samples, p, target);
  if (p.force == 0.0) return;
  float load[3];
  in_world_axes(p, p.load, 1.0, load);
  support_kernels().store_loads(samples, load);
  const auto offset_x = static_cast<float>(p.offset_x), offset_y = static_cast<float>(p.offset_y);
  auto impulse_of = [&](const PointShare& s) {
    return samples.load[s.sample] * std::max(0.0F, s.share + s.share_x * offset_x + s.share_y * offset_y);
  };
  double error[3] = {};
  for_each_share(list, p, points, [&](std::int32_t k, BatchPointLimit*, const PointShare& share) {
    const float change = impulse_of(share) - points.point[k].normal_impulse[lane];
    const float(&anchor)[3][kLanes] = points.detail[k].anchor_a;
    error[0] += static_cast<double>(change);
    error[1] += static_cast<double>(change * anchor[0][lane]);
    error[2] += static_cast<double>(change * anchor[1][lane]);
  });
  const double tolerance = static_cast<double>(kWrenchTolerance) * p.force;
  const bool is_balanced = std::abs(error[0]) <= tolerance && std::abs(error[1]) <= tolerance * p.scale &&
                           std::abs(error[2]) <= tolerance * p.scale;
  if (!is_balanced) {
    std::fill_n(samples.load, p.count, 0.0F);
    p.offset_x = p.offset_y = 0.0;
  }
  for_each_share(list, p, points, [&](std::int32_t k, BatchPointLimit* limit, const PointShare& share) {
    BatchPoint& point = points.point[k];
    const float old_impulse = point.normal_impulse[lane];
    if (!is_balanced) {
      samples.load[share.sample] += old_impulse;
      return;
    }
    if (!is_final) return;
    const float impulse = impulse_of(share);
    point.normal_impulse[lane] = impulse;
    point.total_normal_impulse[lane] += impulse - old_impulse;
    if (limit) limit->load[lane] += impulse - old_impulse;
  });
}

// True if no cell had a load near its limit in the last step.
bool is_lightly_loaded(SupportPatches& list, const SupportPatch& p, float substep_fraction,
                       std::span<const Contact> contacts) {
  constexpr float kLightLoadFraction = 0.7F;  // of the limit
  float* const load = &list.samples.load[p.first];
  std::fill_n(load, p.count, 0.0F);
  bool is_light = true;
  for (int i = 0; i < p.point_count; ++i) {
    const std::int32_t k = p.first_point + i;
    const Contact& c = contacts[list.points[k]];
    float& sum = load[list.shares[k].sample];
    sum += c.normal_impulse;
    is_light &= sum <= kLightLoadFraction * substep_fraction * c.max_cell_impulse;
  }
  return is_light;
}

// The samples' areas about the weighted mean. `polar`: Σ weight·r² of their centres.
void set_extent(const SupportSamples& s, SupportPatch& p, double polar) {
  double reach_squared = 0.0, arms = 0.0;
  p.min_arm = std::numeric_limits<double>::max();
  for (int i = p.first; i < p.first + p.count; ++i) {
    const double x = static_cast<double>(s.x[i]) - p.centre_x, y = static_cast<double>(s.y[i]) - p.centre_y,
                 arm = s.arm[i], arm_squared = arm * arm;
    reach_squared = std::max(reach_squared, x * x + y * y + arm_squared);
    arms += static_cast<double>(s.weight[i]) * arm_squared;
    p.min_arm = std::min(p.min_arm, arm);
  }
  p.reach = std::sqrt(reach_squared);
  p.gyration_squared = (std::max(0.0, polar) + arms) / p.total_weight;
}

// Copies what the kernels of friction read of a patch.
void copy_to_lane(const SupportPatch& p, int lane, SupportFriction& to) {
  for (int i = 0; i < 6; ++i)
    to.response[i][lane] = p.response[i], to.inverse_response[i][lane] = p.inverse_response[i];
  to.tangent_mass[lane] = p.tangent_mass;
  to.centre[0][lane] = p.centre_x, to.centre[1][lane] = p.centre_y, to.scale[lane] = p.scale;
  to.reach[lane] = p.reach, to.min_arm[lane] = p.min_arm;
  to.z[lane] = p.z, to.friction[lane] = p.friction;
  to.belt[0][lane] = p.belt_x, to.belt[1][lane] = p.belt_y;
  to.lumps[lane] = p.may_lump() ? 1.0F : 0.0F;
}

// Finds the loads under the normal impulses of a patch's points, and from them the cones of its samples.
// False if nothing rubs.
bool prepare_friction(SupportPatches& list, SupportPatch& p, const SupportSampleView& samples,
                      BatchPoints points, bool is_soft, int lane, SupportFrictionStage& stage) {
  const double force = stage.wrench[0][lane], moment_x = stage.wrench[1][lane],
               moment_y = stage.wrench[2][lane];
  if (p.is_lumped && p.may_lump()) spread_friction(list.samples, p);
  if (p.is_elastic) p.force = force;    // with the loads of its springs
  double moved_x = 0.0, moved_y = 0.0;  // the centre of force since the loads were distributed
  const bool keeps_loads = p.is_elastic || (p.force > 0.0 && force > 0.0);
  if (keeps_loads && !p.is_elastic)
    moved_x = moment_x / force - p.centre_of_force[0], moved_y = moment_y / force - p.centre_of_force[1];
  const bool has_moved = std::max(std::abs(moved_x), std::abs(moved_y)) > kCentreTolerance;
  if (!keeps_loads || (!is_soft && has_moved && !p.has_shares)) {
    const Vector3 target(force, moment_x, moment_y);
    if (p.has_shares)
      distribute_within_limits(list, p, points, target, false);
    else
      distribute(samples, p, target);
    moved_x = moved_y = 0.0;
  }
  float(&cone)[3] = stage.cone[lane];
  std::fill_n(cone, 3, 0.0F);
  const double friction = static_cast<double>(p.friction) * (p.force > 0.0 ? force / p.force : 0.0);
  if (p.has_shares || p.is_elastic)
    cone[0] = static_cast<float>(friction);
  else if (p.force > 0.0)
    in_world_axes(p, p.load, friction, cone);
  stage.offset[lane][0] = static_cast<float>(p.offset_x + moved_x * p.scale);
  stage.offset[lane][1] = static_cast<float>(p.offset_y + moved_y * p.scale);
  return p.force != 0.0 || !Vector3(p.friction_sum).isZero(0.0);
}

// Finds the friction of the patches in a set of lanes. stick(stage) applies the friction of sticking patches
// and returns their lanes; rub(stage, lanes) applies that of sliding ones, if there are any.
template <class Stick, class Rub>
std::uint32_t solve_friction(SupportBatch& batch, std::uint32_t lanes, BatchPoints points, bool is_soft,
                             Stick stick, Rub rub) {
  const auto bit = [](int lane) { return std::uint32_t{1} << static_cast<unsigned>(lane); };
  const auto for_each_of = [&](std::uint32_t set, auto each) {
    batch.for_each([&](SupportPatches& list, SupportPatch& p, int lane) {
      if ((set & bit(lane)) != 0) each(list, p, lane);
    });
  };
  SupportFrictionStage stage;
  for_each_of(lanes, [&](SupportPatches& list, SupportPatch& p, int lane) {
    for (int i = 0; i < 3; ++i) stage.impulse[i][lane] = p.friction_sum[i];
    stage.lumps[lane] = batch.friction.lumps[lane];
    if (batch.friction.points[lane] != 0) return;
    const Vector3 wrench = p.is_elastic ? Vector3(p.spring_wrench) : wrench_of_points(list, p, points);
    for (int i = 0; i < 3; ++i) stage.wrench[i][lane] = wrench[i];
  });
  const std::uint32_t sticks = stick(stage);
  std::uint32_t rubs = 0;
  for_each_of(lanes & ~sticks, [&](SupportPatches& list, SupportPatch& p, int lane) {
    if (prepare_friction(list, p, batch.friction.samples[lane], points, is_soft, lane, stage))
      rubs |= bit(lane);
  });
  if (rubs != 0) rub(stage, rubs);
  for_each_of(sticks | rubs, [&](SupportPatches&, SupportPatch& p, int lane) {
    if ((sticks & bit(lane)) != 0) {
      p.is_lumped = true;
    } else {
      SupportSampleView& samples = batch.friction.samples[lane];
      std::swap(samples.friction, samples.new_friction);
      p.current = 1 - p.current;
    }
    for (int i = 0; i < 3; ++i) p.friction_sum[i] = stage.impulse[i][lane];
  });
  return sticks;
}

// Loads that grow linearly over the covered areas do not balance a body that bears on slivers of some cells
// and covers more of others: kMomentCompliance yields before the slivers bear. Nor do they where a blow is to
// cells that the face is tilted away from. Then each point loads its own cell, and what is left is its offset
// from the middle of the area there. Returns whether they do.
bool load_cells_of_points(SupportPatches& list, const SupportPatch& p, std::span<const Contact> contacts,
                          bool any_load) {
  constexpr double kOffsetTolerance = 0.05;  // u
  const double offset = std::hypot(p.offset_x, p.offset_y);
  if (any_load && offset <= kOffsetTolerance) return false;
  SupportSamples& s = list.samples;
  const std::ptrdiff_t end = p.first + p.count + p.outlier_count;
  // The sample of the contact's cell, or the nearest one if the face only touches that cell's rim.
  const auto sample_of = [&](const Contact& c) {
    std::ptrdiff_t nearest = p.first;
    double least = std::numeric_limits<double>::infinity();
    for (std::ptrdiff_t k = p.first; k < end; ++k) {
      if (s.cell[k] == c.feature_id) return k;
      const double distance = std::hypot(c.anchor.x() - s.x[k], c.anchor.y() - s.y[k]);
      if (distance < least) least = distance, nearest = k;
    }
    return nearest;
  };
  double offset_x = 0.0, offset_y = 0.0;
  for (const std::int32_t i : points_of(list, p)) {
    const Contact& c = contacts[i];
    if (c.total_normal_impulse == 0.0F) continue;
    const std::ptrdiff_t k = sample_of(c);
    const double share = c.total_normal_impulse / p.force;
    offset_x += share * static_cast<double>(c.anchor.x() - s.x[k]);
    offset_y += share * static_cast<double>(c.anchor.y() - s.y[k]);
  }
  if (any_load && offset <= std::hypot(offset_x, offset_y) + kOffsetTolerance) return false;
  std::fill_n(&s.load[p.first], p.count + p.outlier_count, 0.0F);
  for (const std::int32_t i : points_of(list, p))
    if (contacts[i].total_normal_impulse != 0.0F)
      s.load[sample_of(contacts[i])] += contacts[i].total_normal_impulse;
  return true;
}

}  // namespace

// As a planar field.
void spread_friction(SupportSamples& s, SupportPatch& p) {
  p.is_lumped = false;
  const Vector3 impulse(p.friction_sum);
  const PlanarField field(impulse, p.total_weight, p.centre_x, p.centre_y,
                          p.total_weight * p.gyration_squared);
  auto& f = s.friction[p.current];
  for (int i = p.first; i < p.first + p.count; ++i) {
    const double weight = s.weight[i];
    f[0][i] = static_cast<float>(weight * field.fx(static_cast<double>(s.y[i])));
    f[1][i] = static_cast<float>(weight * field.fy(static_cast<double>(s.x[i])));
    f[2][i] = static_cast<float>(weight * field.rate * static_cast<double>(s.arm[i]));
  }
}

void prepare_support(SupportBatch& batch, int lane, const BodyVelocity& m, const InverseInertia& w,
                     float friction, float substep_fraction) {
  SupportPatches& list = *batch.list[lane];
  SupportPatch& p = *batch.patch[lane];
  const std::span<const Contact> contacts = batch.contacts[lane];
  SupportSamples& s = list.samples;
  const SupportSampleView& samples = batch.friction.samples[lane] = view(s, p);
  const float ones[3] = {1.0F, 0.0F, 0.0F};
  LoadSums sums;
  support_kernels().sum_loads(samples, ones, sums);
  p.friction = friction;
  if (p.has_shares) p.is_lightly_loaded = is_lightly_loaded(list, p, substep_fraction, contacts);
  p.total_weight = sums.stiffness[0];
  p.centre_x = sums.stiffness[1] / p.total_weight;
  p.centre_y = sums.stiffness[2] / p.total_weight;
  const double polar = (sums.stiffness[3] + sums.stiffness[5]) -
                       p.total_weight * (p.centre_x * p.centre_x + p.centre_y * p.centre_y);
  p.scale = std::max(1e-3, std::sqrt(std::max(0.0, polar) / p.total_weight));
  set_extent(s, p, polar);
  p.force = 0.0;
  const double z = p.z, inverse_mass = m.inverse_mass;
  const double xx = w.xx, yy = w.yy, zz = w.zz, xy = w.xy, xz = w.xz, yz = w.yz;
  const double k[6] = {
      inverse_mass + z * z * yy, inverse_mass + z * z * xx, zz, -z * z * xy, z * yz, -z * xz};
  std::copy_n(k, 6, p.response);
  store(symmetric(k).inverse(), p.inverse_response);
  p.tangent_mass = kTangentMassFactor / (p.total_weight * 0.5 * (k[0] + k[1]));
  batch.lanes.set_body(lane, m.inverse_mass, w);
  copy_to_lane(p, lane, batch.friction);
  batch.friction.lanes |= std::uint32_t{1} << static_cast<unsigned>(lane);
  if (!p.has_friction) {
    for (const std::int32_t i : points_of(list, p)) {
      const Contact& c = contacts[i];
      const Vector3 f = c.friction_impulse.cast<double>(), r = c.anchor.cast<double>();
      p.friction_sum[0] += f.x(), p.friction_sum[1] += f.y();
      p.friction_sum[2] += r.x() * f.y() - r.y() * f.x();
    }
    p.is_lumped = true;
  }
  if (p.is_lumped && p.may_lump()) return;
  if (p.is_lumped) spread_friction(s, p);
  support_kernels().sum_friction(samples, p.friction_sum);
}

void warm_start_support(const SupportPatch& p, BodyVelocity& m, const InverseInertia& w) {
  apply_friction(p, Vector3(p.friction_sum), m, w);
}

void add_support(const SupportBatch& from, int from_lane, SupportBatch& to, int lane) {
  to.list[lane] = from.list[from_lane], to.patch[lane] = from.patch[from_lane];
  to.contacts[lane] = from.contacts[from_lane];
  copy_to_lane(*to.patch[lane], lane, to.friction);
  to.friction.samples[lane] = from.friction.samples[from_lane];
  to.friction.lanes |= std::uint32_t{1} << static_cast<unsigned>(lane);
  to.lanes.lane_count = lane + 1;
  std::fill(to.lanes.row + lane, to.lanes.row + kLanes, to.patch[lane]->row);
}

void solve_supports(SupportBatch& batch, std::uint32_t lanes, BatchPoints points, bool is_soft,
                    BodyVelocity* velocity, const InverseInertia* inverse_inertia) {
  const SupportKernelTable& kernels = support_kernels();
  solve_friction(
      batch, lanes, points, is_soft,
      [&](SupportFrictionStage& stage) {
        return kernels.stick(batch.lanes, batch.friction, stage, points, velocity, inverse_inertia);
      },
      [&](SupportFrictionStage& stage, std::uint32_t rubs) {
        kernels.solve_friction(batch.lanes, batch.friction, stage, rubs, kMaxFrictionPasses, points, nullptr,
                               velocity, inverse_inertia);
      });
}

void solve_points_and_friction(SupportBatch& batch, BatchPoints points, const SubstepParams& params,
                               bool is_soft, BodyVelocity* velocity, const DeltaPose* delta_pose,
                               const InverseInertia* inverse_inertia) {
  const SupportKernelTable& kernels = support_kernels();
  bool any_rubs = false;
  const std::uint32_t sticks = solve_friction(
      batch, kAllLanes, points, is_soft,
      [&](SupportFrictionStage& stage) {
        return kernels.solve_points_and_stick(batch.lanes, batch.friction, stage, points, params, is_soft,
                                              velocity, delta_pose, inverse_inertia);
      },
      [&](SupportFrictionStage& stage, std::uint32_t rubs) {
        any_rubs = true;
        kernels.solve_friction(batch.lanes, batch.friction, stage, rubs, kMaxFrictionPasses, points,
                               is_soft ? nullptr : &params, velocity, inverse_inertia);
      });
  if (!is_soft && !any_rubs && sticks != batch.friction.lanes)
    kernels.solve_points(batch.lanes, points, params, is_soft, velocity, delta_pose, inverse_inertia);
}

void share_loads(SupportPatches& list, SupportPatch& p, BatchPoints points) {
  if (!p.has_shares) return;
  const Vector3 wrench = wrench_of_points(list, p, points);
  distribute_within_limits(list, p, points, scaled_wrench(p, wrench[0], wrench[1], wrench[2]), true);
}

void store_loads(SupportPatches& list, SupportPatch& p, std::span<const Contact> contacts) {
  const SupportSampleView samples = view(list.samples, p);
  if (p.is_elastic) {
    // Samples move to where their corners bear.
    for (Index i = p.first; i < p.first + p.count; ++i) {
      const auto [load, moment_x, moment_y] = list.springs[i].step_wrench;
      list.samples.load[i] = load;
      if (load > 0.0F) list.samples.x[i] = moment_x / load, list.samples.y[i] = moment_y / load;
    }
    return;
  }
  if (p.has_shares) {
    std::fill_n(samples.load, p.count, 0.0F);
    for (int i = 0; i < p.point_count; ++i) {
      const std::int32_t k = p.first_point + i;
      samples.load[list.shares[k].sample] += contacts[list.points[k]].total_normal_impulse;
    }
    return;
  }
  double force = 0.0, moment_x = 0.0, moment_y = 0.0;
  for (const std::int32_t i : points_of(list, p)) {
    const Contact& c = contacts[i];
    const double impulse = c.total_normal_impulse, at_x = c.anchor.x(), at_y = c.anchor.y();
    force += impulse, moment_x += impulse * at_x, moment_y += impulse * at_y;
  }
  distribute(samples, p, scaled_wrench(p, force, moment_x, moment_y));
  float load[3] = {};
  if (p.force > 0.0) in_world_axes(p, p.load, 1.0, load);
  support_kernels().store_loads(samples, load);
  std::fill_n(samples.load + p.count, p.outlier_count, 0.0F);
  const std::span loads(samples.load, static_cast<std::size_t>(p.count));
  const double sum = std::accumulate(loads.begin(), loads.end(), 0.0);
  if (!(p.force > 0.0) || load_cells_of_points(list, p, contacts, sum > 0.0) || samples.limit != nullptr)
    return;
  // Steep loads over slivers are differences of great numbers.
  constexpr double kRounding = 1e-5;
  if (std::abs(sum - p.force) <= kRounding * p.force) return;
  for (float& l : loads) l *= static_cast<float>(p.force / sum);
}

void store_friction(const SupportPatches& list, const SupportPatch& p, std::span<Contact> contacts) {
  double x = 0.0, y = 0.0, squares = 0.0;
  for (const std::int32_t i : points_of(list, p)) {
    const double at_x = contacts[i].anchor.x(), at_y = contacts[i].anchor.y();
    x += at_x, y += at_y, squares += at_x * at_x + at_y * at_y;
  }
  const double count = p.point_count;
  x /= count, y /= count;
  const PlanarField field(Vector3(p.friction_sum), count, x, y, squares - count * (x * x + y * y));
  for (const std::int32_t i : points_of(list, p)) {
    Contact& c = contacts[i];
    c.friction_impulse = {static_cast<float>(field.fx(static_cast<double>(c.anchor.y()))),
                          static_cast<float>(field.fy(static_cast<double>(c.anchor.x()))), 0.0F};
  }
}

}  // namespace smartsurf::world
