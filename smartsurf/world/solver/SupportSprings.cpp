#include "smartsurf/world/solver/SupportSprings.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "smartsurf/world/solver/SupportPoints.h"

namespace smartsurf::world {
namespace {

using support::apply_wrench, support::Matrix3, support::Vector3;

// The body's resistance to changes of that velocity.
Matrix3 inertia_of(const BodyVelocity& m, const InverseInertia& w) {
  const double xx = w.xx, xy = w.xy, yy = w.yy, inverse_determinant = 1.0 / (xx * yy - xy * xy);
  Matrix3 inertia = Matrix3::Zero();
  inertia(0, 0) = 1.0 / static_cast<double>(m.inverse_mass);
  inertia(1, 1) = xx * inverse_determinant, inertia(2, 2) = yy * inverse_determinant;
  inertia(1, 2) = inertia(2, 1) = xy * inverse_determinant;
  return inertia;
}

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

// How the derivative of the energy along a step changes where a corner begins or ceases to bear.
struct Kink {
  double at = 0.0, change = 0.0;  // as a fraction of the step; of the second derivative
};

// The fraction of the step at which the energy is least: its derivative, −descent at 0, grows linearly from
// kink to kink.
double least_along(double descent, double curvature, std::vector<Kink>& kinks) {
  std::ranges::sort(kinks, {}, &Kink::at);
  double at = 0.0;
  for (const Kink& k : kinks) {
    const double ascent = curvature * (k.at - at);
    if (ascent >= descent) break;
    descent -= ascent, at = k.at;
    curvature += k.change;
  }
  return at + descent / curvature;
}

// The motion m with inertia·(m − start) = Σ J(m)·(1, x, y) − applied: Newton's method, each step as far as
// the energy falls. Stiff tops that all just touch make a full step overshoot by orders of magnitude.
Vector3 balance(std::span<const LinearLoad> loads, const Matrix3& inertia, const Vector3& start,
                const Vector3& applied) {
  constexpr int kMaxNewtonSteps = 100;
  thread_local std::vector<char> bears;
  thread_local std::vector<Kink> kinks;
  bears.assign(loads.size(), -1);
  Vector3 motion = start;
  for (int pass = 0; pass < kMaxNewtonSteps; ++pass) {
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
    if (is_same) break;  // the step within one piece was exact
    const Vector3 step = support::solve(stiffness, -residual);
    kinks.clear();
    for (std::size_t i = 0; i < loads.size(); ++i) {
      const LinearLoad& load = loads[i];
      const double fall = load.per_speed * load.at.dot(step), at = load.at_velocity(motion) / fall;
      if (at > 0.0)
        kinks.push_back(
            {at, (bears[i] ? -1.0 : 1.0) * load.per_speed * load.at.dot(step) * load.at.dot(step)});
    }
    motion += least_along(-residual.dot(step), step.dot(stiffness * step), kinks) * step;
  }
  return motion;
}

void add_to_step(SupportPatches& list, const SupportPatch& p, float sign) {
  for (SupportSpring& s : springs_of(list, p))
    for (const SupportSpring::Corner& c : s.corner) {
      const float impulse = sign * c.impulse;
      s.step_wrench[0] += impulse;
      s.step_wrench[1] += impulse * c.x, s.step_wrench[2] += impulse * c.y;
    }
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
  append_loads(list, p, params.h_s, is_soft, loads);
  const Vector3 motion = balance(loads, inertia_of(m, w), motion_of(m), Vector3(p.spring_wrench)),
                last_wrench(p.spring_wrench);
  take_loads(list, p, loads, motion);
  apply_wrench(Vector3(p.spring_wrench) - last_wrench, m, w);
}

void append_loads(const SupportPatches& list, const SupportPatch& p, float h_s, bool is_soft,
                  std::vector<LinearLoad>& to) {
  for (const SupportSpring& s : std::span(list.springs).subspan(p.first, p.count))
    for (const SupportSpring::Corner& c : s.corner)
      to.push_back(load_of(p, s, c, static_cast<double>(h_s), is_soft));
}

void take_loads(SupportPatches& list, SupportPatch& p, std::span<const LinearLoad> loads,
                const Vector3& motion) {
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
  Eigen::Map<Vector3>{p.spring_wrench} = wrench;
}

void end_spring_stage(SupportPatches& list, SupportPatch& p, bool is_soft, const BodyVelocity& m) {
  Eigen::Map<Vector3>{is_soft ? p.solve_motion : p.last_motion} = motion_of(m);
  if (!is_soft) add_to_step(list, p, 1.0F);
}

void take_back_spring_stage(SupportPatches& list, const SupportPatch& p, bool is_soft) {
  if (!is_soft) add_to_step(list, p, -1.0F);
}

}  // namespace smartsurf::world
