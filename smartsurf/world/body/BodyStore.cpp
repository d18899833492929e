#include "smartsurf/world/body/BodyStore.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <numeric>
#include <utility>

#include "common/memory/Prefetch.h"
#include "smartsurf/scene/Axes.h"
#include "smartsurf/world/body/RotationKernels.h"

namespace smartsurf::world {
namespace {

// A needle's moments are further apart than single precision resolves; its spin would grow without bound.
constexpr double kMinMoment = 1e-6;  // as a share of the greatest; a rod of 1200 times its diameter has it

void store(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

// Principal axes of an inertia tensor in body axes. Those of a diagonal tensor are taken from it exactly.
PrincipalInertia principal_inertia(const Mat3& tensor) {
  Eigen::Vector3d moments = tensor.diagonal().cast<double>();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  if (!tensor.isDiagonal(0.0F)) {
    const scene::PrincipalAxes principal = scene::principal_axes(tensor.cast<double>());
    moments = principal.moments;
    axes = principal.axes;
  }
  std::array<int, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(), [&](int i, int j) { return moments[i] < moments[j]; });
  PrincipalInertia result;
  std::copy_n(axes.col(order[0]).data(), 3, result.least_axis);
  std::copy_n(axes.col(order[2]).data(), 3, result.greatest_axis);
  const double least = kMinMoment * moments[order[2]];
  for (std::size_t i = 0; i < 3; ++i) result.moments[i] = std::max(moments[order[i]], least);
  return result;
}

template <class... Arrays>
void erase_at(std::size_t index, Arrays&... arrays) {
  (arrays.erase(arrays.begin() + index), ...);
}

}  // namespace

void BodyStore::add(scene::ObjectId new_id, const scene::ObjectSpec& spec, const scene::Material& material) {
  const Eigen::Vector3d to_centre = spec.orientation.normalized() * spec.centre_of_mass;
  const bool has_offset = !spec.centre_of_mass.isZero(0.0);
  has_offsets |= has_offset;
  id.push_back(new_id);
  position_remainder.push_back(Vec3::Zero());
  position.push_back((has_offset ? spec.position + to_centre : spec.position).cast<float>());
  local_origin.push_back(-spec.centre_of_mass.cast<float>());
  origin_offset.emplace_back(0, 0, 0);
  orientation.push_back(spec.orientation.cast<float>().normalized());
  mass.push_back(mass_of(spec, material));
  shape.push_back(std::make_unique<const Shape>(make_shape(spec)));
  bounding_radius.push_back(shape.back()->bounding_radius + local_origin.back().norm());
  is_sphere.push_back(shape.back()->is_sphere());
  is_axisymmetric.push_back(shape.back()->is_axisymmetric() && !has_offset && !spec.inertia);
  rolls_unevenly.push_back(shape.back()->is_axisymmetric() && !is_axisymmetric.back());
  width.push_back(shape.back()->width);
  surface_material.push_back(
      {bounding_radius.back(), std::sqrt(static_cast<float>(spec.friction.value_or(material.friction))),
       shape.back()->has_rolling_friction ? std::sqrt(static_cast<float>(material.rolling_friction)) : 0.0F,
       static_cast<float>(material.restitution)});
  const bool is_dynamic = mass.back() > 0.0F;
  rotation_state.emplace_back();
  inertia.push_back(is_dynamic ? principal_inertia(inertia_of(spec, mass.back())) : PrincipalInertia());
  wrench.emplace_back();
  asleep.push_back(0);
  sleep_timer_s.push_back(0.0F);
  rest_motion.emplace_back();
  is_jointed.push_back(0);
  BodyVelocity m;
  m.inverse_mass = is_dynamic ? 1.0F / mass.back() : 0.0F;
  m.inverse_inertia = is_dynamic && is_sphere.back() ? inverse_inertia_of_sphere(id.size() - 1) : 0.0F;
  if (is_dynamic)
    store(
        m.velocity,
        (has_offset ? spec.velocity + spec.angular_velocity.cross(to_centre) : spec.velocity).cast<float>());
  if (is_dynamic) store(m.angular_velocity, spec.angular_velocity.cast<float>());
  body_velocity.push_back(m);
  axes.emplace_back(Mat3::Identity());
  delta_pose.emplace_back();
  world_inverse_inertia.emplace_back();
  update_axes(id.size() - 1);
  count_kind(id.size() - 1, 1);
}

void BodyStore::count_kind(std::size_t i, int count) {
  if (!is_sphere[i]) non_spheres += count;
  if (surface_material[i].restitution > 0.0F) restituting += count;
}

void BodyStore::erase(std::size_t i) {
  count_kind(i, -1);
  erase_at(i, id, position, position_remainder, orientation, body_velocity, mass, shape, bounding_radius,
           is_sphere, is_axisymmetric, rolls_unevenly, width, surface_material, inertia, rotation_state,
           wrench, asleep, sleep_timer_s, rest_motion, is_jointed, local_origin, origin_offset, axes,
           delta_pose, world_inverse_inertia);
}

void BodyStore::set_links(std::vector<BodyLink> new_links) {
  links = std::move(new_links);
  is_jointed.assign(id.size(), 0);
  excluded_pairs_.clear();
  for (const BodyLink& link : links) {
    for (const std::int32_t body : {link.a, link.b})
      if (body >= 0) is_jointed[body] = 1;
    if (link.b >= 0 && !link.collide)
      excluded_pairs_.push_back({std::min(link.a, link.b), std::max(link.a, link.b)});
  }
  std::ranges::sort(excluded_pairs_);
  index_links();
}

void BodyStore::index_links() {
  first_linked_.assign(id.size() + 1, 0);
  for (const BodyLink& link : links)
    if (link.b >= 0) ++first_linked_[link.a + 1], ++first_linked_[link.b + 1];
  std::partial_sum(first_linked_.begin(), first_linked_.end(), first_linked_.begin());
  linked_.resize(first_linked_.back());
  std::vector<std::int32_t> next = first_linked_;
  for (const BodyLink& link : links)
    if (link.b >= 0) linked_[next[link.a]++] = link.b, linked_[next[link.b]++] = link.a;
}

bool BodyStore::is_excluded(std::size_t i, std::size_t j) const {
  return std::ranges::binary_search(excluded_pairs_, BodyPair{static_cast<std::int32_t>(std::min(i, j)),
                                                              static_cast<std::int32_t>(std::max(i, j))});
}

int BodyStore::find(scene::ObjectId wanted) const {
  const auto it = std::lower_bound(id.begin(), id.end(), wanted);
  return it != id.end() && *it == wanted ? static_cast<int>(it - id.begin()) : -1;
}

void BodyStore::set_state(std::size_t i, const scene::ObjectStateUpdate& p) {
  const Vec3 old_origin = origin(i), old_velocity = origin_velocity(i);
  if (p.position) position[i] = p.position->cast<float>(), position_remainder[i].setZero();
  if (p.orientation) orientation[i] = p.orientation->cast<float>().normalized();
  if (p.velocity && !is_static(i)) store(body_velocity[i].velocity, p.velocity->cast<float>());
  if (p.angular_velocity && !is_static(i))
    store(body_velocity[i].angular_velocity, p.angular_velocity->cast<float>());
  update_axes(i);
  if (local_origin[i].isZero(0.0F)) return;
  position[i] = (p.position ? position[i] : old_origin) - origin_offset[i];
  if (!is_static(i))
    store(body_velocity[i].velocity,
          (p.velocity ? velocity(i) : old_velocity) - angular_velocity(i).cross(origin_offset[i]));
}

void BodyStore::update_axes(std::size_t i) {
  if (is_sphere[i]) {
    const float inverse = body_velocity[i].inverse_inertia;
    world_inverse_inertia[i] = {inverse, inverse, inverse, 0, 0, 0, {}};
    return;
  }
  // The kernel also writes orientation and angular velocity, with rounding errors even without motion.
  const BodyVelocity velocity_before = body_velocity[i];
  const Quat orientation_before = orientation[i];
  delta_pose[i] = {};
  rotation_state[i] = {};
  std::copy_n(orientation_before.coeffs().data(), 4, rotation_state[i].orientation);
  integrate_rotations({{{i, 0.0F}}});
  body_velocity[i] = velocity_before;
  orientation[i] = orientation_before;
  std::copy_n(velocity_before.angular_velocity, 3, rotation_state[i].angular_velocity);
}

Quat rotation_from_vector(const Vec3& rotation_vector) {
  const float angle = rotation_vector.norm();
  if (!(angle > 0.0F)) return Quat::Identity();
  Quat q;
  q.w() = std::cos(0.5F * angle);
  q.vec() = rotation_vector * (std::sin(0.5F * angle) / angle);
  return q;
}

void BodyStore::prefetch(std::size_t i) const {
  common::prefetch(&body_velocity[i]);
  common::prefetch(&delta_pose[i]);
  common::prefetch(&surface_material[i]);
  common::prefetch(&position[i]);
  common::prefetch(&position_remainder[i]);
  common::prefetch(&orientation[i]);
  common::prefetch(&wrench[i]);
  common::prefetch(&sleep_timer_s[i]);
}

void BodyStore::prefetch_rotation(std::size_t i) const {
  if (is_sphere[i]) return;
  // Unaligned: each array may span two cache lines.
  common::prefetch(axes[i].data());
  common::prefetch(axes[i].data() + 8);
  common::prefetch(inertia[i].least_axis);
  common::prefetch(inertia[i].moments + 2);
  common::prefetch(rotation_state[i].orientation);
  common::prefetch(rotation_state[i].angular_velocity + 2);
  common::prefetch(&world_inverse_inertia[i]);
}

void BodyStore::translate(std::size_t i) {
  const Vec3 before = position[i], by = position_remainder[i] + Vec3(delta_pose[i].translation);
  position[i] += by;
  position_remainder[i] = by - (position[i] - before);
}

void BodyStore::integrate_pose(std::size_t i) {
  translate(i);
  const Vec3 rotation(delta_pose[i].rotation);
  if (!rotation.isZero(0.0F)) orientation[i] = (rotation_from_vector(rotation) * orientation[i]).normalized();
}

void BodyStore::integrate_poses(std::span<const Rotating> bodies) {
  for (const Rotating& r : bodies) translate(r.body);
  integrate_rotations(bodies);
}

void BodyStore::load_rotation(RotationBatch& batch, std::size_t lane, const Rotating& rotating,
                              const BodyVelocity& solved, const DeltaPose& delta) const {
  static constexpr PrincipalInertia kStatic{.moments = {1, 1, 1}};
  const auto [i, free_time_s] = rotating;
  auto store_lane = [lane](auto& to, const auto& from) {
    for (std::size_t k = 0; k < std::size(to); ++k) to[k][lane] = from[k];
  };
  const PrincipalInertia& principal = is_static(i) ? kStatic : inertia[i];
  store_lane(batch.least_axis, principal.least_axis);
  store_lane(batch.greatest_axis, principal.greatest_axis);
  store_lane(batch.moments, principal.moments);
  store_lane(batch.rotation, delta.rotation);
  store_lane(batch.previous_x_axis, axes[i].data());
  const RotationState& state = rotation_state[i];
  store_lane(batch.orientation, state.orientation);
  store_lane(batch.momentum, state.momentum);
  store_lane(batch.angular_velocity, solved.angular_velocity);
  for (int k = 0; k < 3; ++k)
    batch.angular_velocity_change[k][lane] =
        static_cast<double>(solved.angular_velocity[k]) - static_cast<double>(state.angular_velocity[k]);
  batch.free_time[lane] = free_time_s;
  batch.is_axisymmetric[lane] = is_axisymmetric[i] ? 1.0F : 0.0F;
  // The momentum that joints leave is that of the end.
  batch.slenderness[lane] = is_jointed[i] ? 0.0 : principal.slenderness();
}

Vec3 BodyStore::turn_in_step(std::size_t i, const BodyVelocity& solved, const DeltaPose& delta,
                             float dt_s) const {
  RotationBatch batch;
  for (std::size_t lane = 0; lane < kLanes; ++lane) load_rotation(batch, lane, {i, dt_s}, solved, delta);
  integrate_rotation(batch);
  const auto quaternion = [](const auto& at) { return Eigen::Quaterniond(at(3), at(0), at(1), at(2)); };
  const Eigen::Quaterniond turned =
      quaternion([&](int k) { return batch.orientation[k][0]; }) *
      quaternion([&](int k) { return rotation_state[i].orientation[k]; }).conjugate();
  const double sine = turned.vec().norm();
  if (!(sine > 0.0)) return Vec3::Zero();
  const Eigen::Vector3d axis = turned.vec() / sine;
  const double angle = 2.0 * std::atan2(sine, turned.w());
  // Several whole turns look alike.
  const double turns =
      std::round((axis.dot(Vec3(delta.rotation).cast<double>()) - angle) / (2.0 * std::numbers::pi));
  return ((angle + 2.0 * std::numbers::pi * turns) * axis).cast<float>();
}

void BodyStore::integrate_rotations(std::span<const Rotating> bodies) {
  RotationBatch batch;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const Rotating& r = bodies[std::min(lane, bodies.size() - 1)];
    load_rotation(batch, lane, r, body_velocity[r.body], delta_pose[r.body]);
  }
  integrate_rotation(batch);
  for (std::size_t lane = 0; lane < bodies.size(); ++lane) {
    const std::size_t i = bodies[lane].body;
    RotationState& state = rotation_state[i];
    for (int k = 0; k < 3; ++k) {
      state.momentum[k] = batch.momentum[k][lane];
      body_velocity[i].angular_velocity[k] = state.angular_velocity[k] =
          static_cast<float>(batch.angular_velocity[k][lane]);
    }
    for (int k = 0; k < 4; ++k) {
      state.orientation[k] = batch.orientation[k][lane];
      orientation[i].coeffs()[k] = static_cast<float>(state.orientation[k]);
    }
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) axes[i](r, c) = static_cast<float>(batch.axes[c][r][lane]);
    if (has_offsets) origin_offset[i] = axes[i] * local_origin[i];
    InverseInertia& inverse = world_inverse_inertia[i];
    inverse = {};
    if (is_static(i)) continue;
    auto entry = [&](int k) { return static_cast<float>(batch.world_inverse_inertia[k][lane]); };
    inverse = {entry(0), entry(1), entry(2), entry(3), entry(4), entry(5), {}};
  }
}

}  // namespace smartsurf::world
