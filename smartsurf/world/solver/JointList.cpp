// JointSolver between steps: it adds, removes and changes joints, and reports their state.
#include <algorithm>
#include <limits>
#include <utility>

#include "smartsurf/scene/Axes.h"
#include "smartsurf/world/solver/JointSolver.h"

namespace smartsurf::world {
const JointSolver::Joint* JointSolver::find(scene::JointId id) const {
  const auto it = std::ranges::lower_bound(joints_, id, {}, &Joint::id);
  return it != joints_.end() && it->id == id ? &*it : nullptr;
}

JointSolver::Pose JointSolver::pose_of(const BodyStore& bodies, std::int32_t body) {
  if (body < 0) return {Vec3d::Zero(), Quatd::Identity()};
  const Quatd orientation = bodies.is_sphere[body] ? bodies.orientation[body].cast<double>()
                                                   : Quatd(bodies.rotation_state[body].orientation);
  return {bodies.position[body].cast<double>() + bodies.position_remainder[body].cast<double>(),
          orientation.normalized()};
}

scene::JointId JointSolver::add(const scene::JointSpec& spec, BodyStore& bodies) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Joint j{};
  j.id = next_id_++;
  j.kind = spec.kind;
  j.collide = spec.collide;
  j.a = bodies.find(spec.a);
  j.b = spec.b ? bodies.find(*spec.b) : -1;
  const Pose a = pose_of(bodies, j.a), b = pose_of(bodies, j.b);
  const Quatd frame = scene::rotation_between(Vec3d::UnitZ(), spec.axis.normalized());  // z along the axis
  j.anchor_a = a.orientation.conjugate() * (spec.anchor - a.position);
  j.anchor_b = b.orientation.conjugate() * (spec.anchor - b.position);
  j.frame_a = a.orientation.conjugate() * frame;
  j.frame_b = b.orientation.conjugate() * frame;
  j.lower = spec.limits ? spec.limits->lower : -kInfinity;
  j.upper = spec.limits ? spec.limits->upper : kInfinity;
  j.friction = spec.friction;
  j.has_spring = spec.spring.has_value();
  j.spring = spec.spring.value_or(scene::JointSpring());
  j.has_motor = spec.motor.has_value();
  j.motor = spec.motor.value_or(scene::JointMotor());
  j.force_impulse.setZero();
  joints_.push_back(j);
  update_links(bodies);
  return j.id;
}

bool JointSolver::remove(scene::JointId id, BodyStore& bodies) {
  if (std::erase_if(joints_, [id](const Joint& j) { return j.id == id; }) == 0) return false;
  update_links(bodies);
  return true;
}

void JointSolver::set_motor(scene::JointId id, const scene::JointMotor& motor) {
  Joint& j = *find(id);
  j.has_motor = true;
  j.motor = motor;
}

void JointSolver::set_spring(scene::JointId id, const scene::JointSpring& spring) {
  Joint& j = *find(id);
  j.has_spring = true;
  j.spring = spring;
}

std::array<std::int32_t, 2> JointSolver::bodies_of(scene::JointId id) const {
  const Joint& j = *find(id);
  return {j.a, j.b};
}

scene::JointState JointSolver::state(scene::JointId id, const BodyStore& bodies, float dt_s) const {
  const Joint& j = *find(id);
  scene::JointState out;
  out.force = j.force_impulse / static_cast<double>(dt_s);
  if (j.kind != scene::JointKind::kHinge && j.kind != scene::JointKind::kSlider) return out;
  const Pose a = pose_of(bodies, j.a), b = pose_of(bodies, j.b);
  out.coordinate = coordinate_of(j, a, b);
  out.effort = j.effort_impulse / static_cast<double>(dt_s);
  auto velocity_of = [&](std::int32_t body) -> std::pair<Vec3d, Vec3d> {
    if (body < 0) return {Vec3d::Zero(), Vec3d::Zero()};
    return {bodies.velocity(body).cast<double>(), bodies.angular_velocity(body).cast<double>()};
  };
  const auto [va, wa] = velocity_of(j.a);
  const auto [vb, wb] = velocity_of(j.b);
  const Vec3d axis = b.orientation * (j.frame_b * Vec3d::UnitZ());
  if (j.kind == scene::JointKind::kHinge) {
    out.speed = axis.dot(wa - wb);
  } else {
    const Vec3d at = a.position + a.orientation * j.anchor_a;
    out.speed = axis.dot(va + wa.cross(at - a.position) - vb - wb.cross(at - b.position));
  }
  return out;
}

void JointSolver::on_body_removed(std::int32_t body, BodyStore& bodies) {
  std::erase_if(joints_, [body](const Joint& j) { return j.a == body || j.b == body; });
  for (Joint& j : joints_) j.a -= j.a > body ? 1 : 0, j.b -= j.b > body ? 1 : 0;
  update_links(bodies);
}

// Call whenever joints_ changes.
void JointSolver::update_links(BodyStore& bodies) {
  indexed_ = false;
  std::vector<BodyLink> links;
  for (const Joint& j : joints_) links.push_back({j.a, j.b, j.collide, j.kind == scene::JointKind::kFixed});
  bodies.set_links(std::move(links));
}

void JointSolver::archive(common::StateArchive& a) {
  a(next_id_, joints_);
  indexed_ = false;
}

}  // namespace smartsurf::world
