#include "smartsurf/world/Bodies.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>

namespace smartsurf::world {
namespace {

void put(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

template <class T>
void drop(std::vector<T>& values, std::size_t index) {
  values.erase(values.begin() + static_cast<std::ptrdiff_t>(index));
}

}  // namespace

void BodyStore::add(scene::ObjectId new_id, const scene::ObjectSpec& spec, const scene::Material& material) {
  id.push_back(new_id);
  position.push_back(spec.position.cast<float>());
  orientation.push_back(spec.orientation.cast<float>().normalized());
  mass.push_back(mass_of(spec, material));
  shape.push_back(std::make_unique<const Shape>(make_shape(spec)));
  reach.push_back(shape.back()->reach);
  round.push_back(shape.back()->round());
  revolves.push_back(shape.back()->revolves());
  width.push_back(shape.back()->width);
  grip.push_back({reach.back(), std::sqrt(static_cast<float>(material.friction)),
                  shape.back()->rolls ? std::sqrt(static_cast<float>(material.rolling_friction)) : 0.0F,
                  static_cast<float>(material.restitution)});
  const bool moves = mass.back() > 0.0F;
  own_inertia.push_back(moves ? inertia_of(spec, mass.back()) : Mat3::Zero());
  own_inverse_inertia.push_back(moves ? Mat3(own_inertia.back().inverse()) : Mat3::Zero());
  wrench.emplace_back();
  asleep.push_back(0);
  still_s.push_back(0.0F);
  Motion m;
  m.inverse_mass = moves ? 1.0F / mass.back() : 0.0F;
  m.inverse_inertia = own_inverse_inertia.back()(0, 0);
  if (moves) put(m.velocity, spec.velocity.cast<float>());
  if (moves) put(m.spin, spec.angular_velocity.cast<float>());
  motion.push_back(m);
  axes.emplace_back(Mat3::Identity());
  shift.emplace_back();
  inertia.emplace_back();
  turn_axes(id.size() - 1);
}

void BodyStore::erase(std::size_t i) {
  drop(id, i), drop(position, i), drop(orientation, i), drop(motion, i), drop(mass, i), drop(shape, i);
  drop(reach, i), drop(round, i), drop(revolves, i), drop(width, i), drop(grip, i);
  drop(own_inertia, i), drop(own_inverse_inertia, i), drop(wrench, i), drop(asleep, i), drop(still_s, i);
  drop(axes, i), drop(shift, i), drop(inertia, i);
}

int BodyStore::find(scene::ObjectId wanted) const {
  const auto it = std::lower_bound(id.begin(), id.end(), wanted);
  return it != id.end() && *it == wanted ? static_cast<int>(it - id.begin()) : -1;
}

void BodyStore::place(std::size_t i, const scene::Placement& p) {
  if (p.position) position[i] = p.position->cast<float>();
  if (p.orientation) orientation[i] = p.orientation->cast<float>().normalized();
  if (p.velocity && !fixed(i)) put(motion[i].velocity, p.velocity->cast<float>());
  if (p.angular_velocity && !fixed(i)) put(motion[i].spin, p.angular_velocity->cast<float>());
  turn_axes(i);
}

void BodyStore::turn_axes(std::size_t i) {
  if (round[i]) {
    const float inverse = motion[i].inverse_inertia;
    inertia[i] = {inverse, inverse, inverse, 0, 0, 0, {}};
    return;
  }
  set_axes(i, orientation[i].toRotationMatrix());
}

namespace {

// Axes with the z of one matrix that turn from the other's as little as may be.
Mat3 without_twist(const Mat3& to, const Mat3& from) {
  const Vec3 z = to.col(2);
  const Vec3 x = from.col(0) - z * z.dot(from.col(0));
  const float length = x.norm();
  if (!(length > 0.1F)) return to;
  Mat3 out;
  out << x / length, z.cross(x / length), z;
  return out;
}

}  // namespace

void BodyStore::set_axes(std::size_t i, const Mat3& to) {
  axes[i] = revolves[i] ? without_twist(to, axes[i]) : to;
  const Mat3 world = axes[i] * own_inverse_inertia[i] * axes[i].transpose();
  inertia[i] = {world(0, 0), world(1, 1), world(2, 2), world(0, 1), world(0, 2), world(1, 2), {}};
}

Quat turn_by(const Vec3& turn) {
  const float angle = turn.norm();
  if (!(angle > 0.0F)) return Quat::Identity();
  Quat q;
  q.w() = std::cos(0.5F * angle);
  q.vec() = turn * (std::sin(0.5F * angle) / angle);
  return q;
}

void BodyStore::fetch(std::size_t i) const {
  hwy::Prefetch(&motion[i]);
  hwy::Prefetch(&shift[i]);
  hwy::Prefetch(&grip[i]);
  hwy::Prefetch(&position[i]);
  hwy::Prefetch(&orientation[i]);
  hwy::Prefetch(&wrench[i]);
  hwy::Prefetch(&still_s[i]);
}

void BodyStore::fetch_turning(std::size_t i) const {
  if (round[i]) return;
  for (const auto* matrix : {&axes[i], &own_inertia[i], &own_inverse_inertia[i]}) {
    hwy::Prefetch(matrix->data());
    hwy::Prefetch(matrix->data() + 8);  // they need not begin where a line of the cache does
  }
  hwy::Prefetch(&inertia[i]);
}

void BodyStore::settle(std::size_t i, float dt_s) {
  position[i] += Vec3(shift[i].by);
  const Vec3 turn(shift[i].turn);
  if (!turn.isZero(0.0F)) orientation[i] = (turn_by(turn) * orientation[i]).normalized();
  if (round[i]) return;
  // One Newton step of implicit Euler on Euler's equations, in own axes: stable at any rate of turning.
  const Mat3 r = orientation[i].toRotationMatrix();
  const Mat3& own = own_inertia[i];
  const Vec3 w = r.transpose() * spin(i);
  const Vec3 momentum = own * w;
  Mat3 cross_w, cross_momentum;
  cross_w << 0, -w.z(), w.y(), w.z(), 0, -w.x(), -w.y(), w.x(), 0;
  cross_momentum << 0, -momentum.z(), momentum.y(), momentum.z(), 0, -momentum.x(), -momentum.y(),
      momentum.x(), 0;
  const Mat3 slope = own + dt_s * (cross_w * own - cross_momentum);
  Vec3 next = w - slope.inverse() * (dt_s * w.cross(momentum));
  // The step's matrix has a pole at a very fast turn about the middle axis; energy must never come from
  // there.
  const float energy = w.dot(momentum), next_energy = next.dot(own * next);
  if (!(next_energy <= energy)) next = next_energy > 0.0F ? Vec3(next * std::sqrt(energy / next_energy)) : w;
  put(motion[i].spin, r * next);
  set_axes(i, r);
}

}  // namespace smartsurf::world
