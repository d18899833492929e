#include "smartsurf/world/Bodies.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "smartsurf/world/TurnKernels.h"

namespace smartsurf::world {
namespace {

void put(float (&to)[3], const Vec3& from) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

// The six entries of a symmetric matrix.
void put(float (&to)[6], const Mat3& m) {
  const float entries[] = {m(0, 0), m(1, 1), m(2, 2), m(0, 1), m(0, 2), m(1, 2)};
  std::copy_n(entries, 6, to);
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
  own_inertia.emplace_back();
  if (moves) {
    const Mat3 own = inertia_of(spec, mass.back());
    put(own_inertia.back().inertia, own);
    put(own_inertia.back().inverse, own.inverse());
  }
  wrench.emplace_back();
  asleep.push_back(0);
  still_s.push_back(0.0F);
  Motion m;
  m.inverse_mass = moves ? 1.0F / mass.back() : 0.0F;
  m.inverse_inertia = own_inertia.back().inverse[0];
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
  drop(own_inertia, i), drop(wrench, i), drop(asleep, i), drop(still_s, i);
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
  const Motion before = motion[i];
  turn_freely({{i}}, 0.0F);
  motion[i] = before;
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
  // They need not begin where a line of the cache does.
  hwy::Prefetch(axes[i].data());
  hwy::Prefetch(axes[i].data() + 8);
  hwy::Prefetch(own_inertia[i].inertia);
  hwy::Prefetch(own_inertia[i].inverse + 5);
  hwy::Prefetch(&inertia[i]);
}

void BodyStore::settle(std::size_t i) {
  position[i] += Vec3(shift[i].by);
  const Vec3 turn(shift[i].turn);
  if (!turn.isZero(0.0F)) orientation[i] = (turn_by(turn) * orientation[i]).normalized();
}

void BodyStore::turn_freely(std::span<const std::size_t> bodies, float dt_s) {
  Turns turns;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const std::size_t i = bodies[std::min(lane, bodies.size() - 1)];
    auto put_lane = [lane](auto& to, const auto& from) {
      for (std::size_t k = 0; k < std::size(to); ++k) to[k][lane] = from[k];
    };
    put_lane(turns.orientation, orientation[i].coeffs().data());
    put_lane(turns.inertia, own_inertia[i].inertia);
    put_lane(turns.inverse, own_inertia[i].inverse);
    put_lane(turns.x_axis, axes[i].data());
    put_lane(turns.spin, motion[i].spin);
    turns.revolves[lane] = revolves[i] ? 1.0F : 0.0F;
  }
  world::turn_freely(turns, dt_s);
  for (std::size_t lane = 0; lane < bodies.size(); ++lane) {
    const std::size_t i = bodies[lane];
    for (int k = 0; k < 3; ++k) motion[i].spin[k] = turns.spin[k][lane];
    for (int c = 0; c < 3; ++c)
      for (int r = 0; r < 3; ++r) axes[i](r, c) = turns.axes[c][r][lane];
    const auto& w = turns.world_inverse;
    inertia[i] = {w[0][lane], w[1][lane], w[2][lane], w[3][lane], w[4][lane], w[5][lane], {}};
  }
}

}  // namespace smartsurf::world
