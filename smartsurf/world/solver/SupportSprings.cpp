#include "smartsurf/world/solver/SupportSprings.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "smartsurf/world/solver/SupportPoints.h"

namespace smartsurf::world {
namespace {

using support::apply_wrench, support::Matrix3, support::Vector3;

// The velocity of the face as a + b·x + c·y.
Vector3 motion_of(const BodyVelocity& m) {
  return Vec3(m.velocity[2], -m.angular_velocity[1], m.angular_velocity[0]).cast<double>();
}

// The body's resistance to changes of that velocity.
Matrix3 inertia_of(const BodyVelocity& m, const InverseInertia& w) {
  const double xx = w.xx, xy = w.xy, yy = w.yy, inverse_determinant = 1.0 / (xx * yy - xy * xy);
  Matrix3 inertia = Matrix3::Zero();
  inertia(0, 0) = 1.0 / static_cast<double>(m.inverse_mass);
  inertia(1, 1) = xx * inverse_determinant, inertia(2, 2) = yy * inverse_determinant;
  inertia(1, 2) = inertia(2, 1) = xy * inverse_determinant;
  return inertia;
}

// The load of one corner as max(0, at_rest − per_speed·v), with the velocity v of the face there.
struct LinearLoad {
  Vector3 at;  // 1, x, y
  double at_rest = 0.0, per_speed = 0.0;
  double at_velocity(const Vector3& motion) const { return at_rest - per_speed * at.dot(motion); }
};

constexpr double kCornerShare = 0.25;

std::span<SupportSpring> springs_of(SupportPatches& list, const SupportPatch& p) {
  return std::span(list.springs).subspan(p.first, p.count);
}

Vector3 place_of(const SupportPatches& list, Index sample) {
  return {1.0, static_cast<double>(list.samples.x[sample]), static_cast<double>(list.samples.y[sample])};
}

void measure_depths(SupportPatches& list, SupportPatch& p, const SubstepParams& params, const BodyVelocity& m,
                    const DeltaPose& delta) {
  double stiffness = 0.0;
  for (SupportSpring& s : springs_of(list, p))
    for (SupportSpring::Corner& c : s.corner) {
      c.depth = s.rise * params.elapsed_s - c.separation - delta.translation[2] -
                (delta.rotation[0] * c.y - delta.rotation[1] * c.x);
      if (c.depth > 0.0F) stiffness += kCornerShare * static_cast<double>(s.stiffness);
    }
  const double h_s = params.h_s, kappa = h_s * h_s * stiffness * static_cast<double>(m.inverse_mass);
  p.implicit_share = kappa * kappa / (1.0 + kappa * kappa);
}

LinearLoad load_of(const SupportPatch& p, const SupportSpring& s, const SupportSpring::Corner& corner,
                   double h_s, bool is_soft) {
  const Vector3 at(1.0, static_cast<double>(corner.x), static_cast<double>(corner.y));
  const double k = kCornerShare * static_cast<double>(s.stiffness),
               c = kCornerShare * static_cast<double>(s.damping), rise = s.rise, depth = corner.depth;
  const double alpha = 0.25 + 0.75 * p.implicit_share, beta = 0.25 * (1.0 - p.implicit_share);
  LinearLoad load{.at = at};
  if (depth > 0.0) {
    load.at_rest = h_s * k * (depth - beta * h_s * (rise - at.dot(Vector3(p.last_motion))));
    load.per_speed = h_s * (c + alpha * h_s * k);
  } else if (is_soft) {
    load.at_rest = (h_s * k + c) * depth;
    load.per_speed = (h_s * k + c) * h_s;
  } else {
    const double reached = depth + h_s * (rise - at.dot(Vector3(p.solve_motion)));
    if (!(reached > 0.0)) return load;
    load.at_rest = h_s * k * reached;
    load.per_speed = h_s * (c + alpha * h_s * k);
  }
  load.at_rest += load.per_speed * rise;
  return load;
}

// The motion m with inertia·(m − start) = Σ J(m)·(1, x, y) − applied, by Newton's method with a line search.
Vector3 balance(std::span<const LinearLoad> loads, const Matrix3& inertia, const Vector3& start,
                const Vector3& applied) {
  constexpr int kMaxNewtonSteps = 40;
  thread_local std::vector<char> bears;
  bears.assign(loads.size(), -1);
  support::LineSearch search{.point = start};
  for (int pass = 0; pass < kMaxNewtonSteps; ++pass) {
    const Vector3& motion = search.point;
    Vector3 residual = inertia * (motion - start) + applied;
    Matrix3 stiffness = inertia;
    bool is_same = true;
    for (std::size_t i = 0; i < loads.size(); ++i) {
      const LinearLoad& load = loads[i];
      const double impulse = load.at_velocity(motion);
      const char bearing = impulse > 0.0 ? 1 : 0;
      is_same &= bearing == bears[i];
      bears[i] = bearing;
      if (!bearing) continue;
      residual -= impulse * load.at;
      stiffness += load.per_speed * load.at * load.at.transpose();
    }
    if (is_same && search.fraction == 1.0) return motion;  // a full step within one piece is exact
    if (search.accept(residual)) search.take(support::solve(stiffness, -residual), residual);
  }
  return search.best;
}

}  // namespace

void prepare_springs(SupportPatches& list, SupportPatch& p, const BodyVelocity& m, float substep_fraction) {
  Eigen::Map<Vector3>{p.start_motion} = Eigen::Map<Vector3>{p.last_motion} = motion_of(m);
  Vector3 wrench = Vector3::Zero();
  for (Index i = p.first; i < p.first + p.count; ++i) {
    float& load = list.samples.load[i];
    load *= substep_fraction;
    wrench += static_cast<double>(load) * place_of(list, i);
  }
  Eigen::Map<Vector3>{p.spring_wrench} = wrench;
}

void warm_start_springs(const SupportPatch& p, BodyVelocity& m, const InverseInertia& w) {
  apply_wrench(Vector3(p.spring_wrench), m, w);
}

void solve_springs(SupportPatches& list, SupportPatch& p, const SubstepParams& params, bool is_soft,
                   BodyVelocity& m, const DeltaPose& delta, const InverseInertia& w) {
  if (!(m.inverse_mass > 0.0F) || !(w.xx * w.yy - w.xy * w.xy > 0.0F)) return;
  if (is_soft) measure_depths(list, p, params, m, delta);
  thread_local std::vector<LinearLoad> loads;
  loads.clear();
  for (const SupportSpring& s : springs_of(list, p))
    for (const SupportSpring::Corner& c : s.corner)
      loads.push_back(load_of(p, s, c, static_cast<double>(params.h_s), is_soft));
  const Vector3 motion = balance(loads, inertia_of(m, w), motion_of(m), Vector3(p.spring_wrench));
  Vector3 wrench = Vector3::Zero();
  const LinearLoad* load = loads.data();
  Index sample = p.first;
  for (SupportSpring& s : springs_of(list, p)) {
    double sum = 0.0;
    for (SupportSpring::Corner& c : s.corner) {
      const double impulse = std::max(0.0, load->at_velocity(motion));
      c.impulse = static_cast<float>(impulse);
      sum += impulse;
      wrench += impulse * (load++)->at;
    }
    list.samples.load[sample++] = static_cast<float>(sum);
  }
  apply_wrench(wrench - Vector3(p.spring_wrench), m, w);
  Eigen::Map<Vector3>{p.spring_wrench} = wrench;
}

void end_spring_stage(SupportPatches& list, SupportPatch& p, bool is_soft, const BodyVelocity& m) {
  if (is_soft) {
    Eigen::Map<Vector3>{p.solve_motion} = motion_of(m);
    return;
  }
  Eigen::Map<Vector3>{p.last_motion} = motion_of(m);
  for (SupportSpring& s : springs_of(list, p))
    for (const SupportSpring::Corner& c : s.corner) {
      s.step_wrench[0] += c.impulse;
      s.step_wrench[1] += c.impulse * c.x, s.step_wrench[2] += c.impulse * c.y;
    }
}

}  // namespace smartsurf::world
