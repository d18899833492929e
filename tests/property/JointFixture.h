// Bodies that hang from joints, far above the table.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "tests/property/PhysicsFixture.h"

namespace physics_fixture {

using Eigen::Vector3d;
using smartsurf::scene::JointId;
using smartsurf::scene::JointKind;
using smartsurf::scene::JointSpec;
using smartsurf::scene::ObjectId;

inline bool on_bullet() { return std::getenv("PHYSICS_ENGINE") != nullptr; }

// Complete elliptic integral of the first kind of the modulus k, by the arithmetic-geometric mean.
inline double elliptic_k(double k) {
  double a = 1.0, b = std::sqrt(1.0 - k * k);
  while (std::abs(a - b) > 1e-15) {
    const double mean = 0.5 * (a + b);
    b = std::sqrt(a * b);
    a = mean;
  }
  return M_PI / (2.0 * a);
}
struct JointFixture : PhysicsFixture {
  explicit JointFixture(double dt) { scene.world.dt_s = dt; }

  JointId join(JointKind kind, ObjectId a, std::optional<ObjectId> b, const Vector3d& anchor,
               const Vector3d& axis = Vector3d::UnitY()) {
    return join({.kind = kind, .a = a, .b = b, .anchor = anchor, .axis = axis});
  }
  JointId join(const JointSpec& spec) { return world().add_joint(spec); }
  double coordinate(JointId id) { return world().joint_state(id).coordinate; }
  double speed(JointId id) { return world().joint_state(id).speed; }
  double effort(JointId id) { return world().joint_state(id).effort; }

  // Mean time between upward passages of a joint's coordinate through `level`.
  double period(JointId id, double level, double seconds) {
    double t = 0, before = coordinate(id), first = -1, last = -1;
    int count = -1;
    run(seconds, [&] {
      t += scene.world.dt_s;
      const double now = coordinate(id);
      if (before < level && now >= level) {
        last = t - scene.world.dt_s * (now - level) / (now - before);
        if (first < 0) first = last;
        ++count;
      }
      before = now;
    });
    return count > 0 ? (last - first) / count : 0.0;
  }
};

// A rod that hangs from a hinge along y at its upper end, turned by `angle` from the vertical.
struct PendulumFixture : JointFixture {
  static constexpr double kLength = 2.0, kWidth = 0.3;
  const Vector3d pivot{15, 15, 50};
  JointId hinge;

  PendulumFixture(double dt, double angle, JointKind kind = JointKind::kHinge) : JointFixture(dt) {
    const Eigen::Quaterniond turned(Eigen::AngleAxisd(angle, Vector3d::UnitY()));
    auto rod = box({kWidth, kWidth, kLength}, pivot + turned * Vector3d(0, 0, -0.5 * kLength));
    rod.orientation = turned;
    hinge = join(kind, add(rod), std::nullopt, pivot);
  }
  static double mass() { return kWidth * kWidth * kLength; }
  // About the pivot.
  static double moment() {
    return mass() * ((kWidth * kWidth + kLength * kLength) / 12.0 + 0.25 * kLength * kLength);
  }
  static double torque() { return mass() * kGravity * 0.5 * kLength; }
  static double period_at(double amplitude) {
    return 4.0 * std::sqrt(moment() / torque()) * elliptic_k(std::sin(0.5 * amplitude));
  }
};

}  // namespace physics_fixture
