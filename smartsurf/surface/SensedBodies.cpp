#include "smartsurf/surface/SensedBodies.h"

#include <Eigen/Geometry>
#include <array>
#include <limits>
#include <numeric>

#include "smartsurf/surface/WorkerPool.h"

namespace smartsurf::surface {
namespace {

constexpr double kCost_ns = 10.0;  // of one body

Eigen::Vector3f extent_of(const scene::ObjectSpec& o) {
  if (o.shape == scene::ShapeKind::kCone)
    return {static_cast<float>(o.radius), static_cast<float>(o.height), 0.0F};
  return o.half_extents().cast<float>();
}

// Half edges of the box along the world's axes around a turned object. Corners of the box along its own axes
// stand out of a round one or a solid.
Eigen::Vector3f turned_reach(scene::ShapeKind shape, const Eigen::Vector3f& half, float farthest,
                             const Eigen::Matrix3f& to_world) {
  const Eigen::Array3f along = to_world.col(2).array().abs();
  if (shape == scene::ShapeKind::kCylinder)
    return half.z() * along + half.x() * (1.0F - along * along).max(0.0F).sqrt();
  if (shape == scene::ShapeKind::kCapsule) return (half.z() - half.x()) * along + half.x();
  return (to_world.cwiseAbs() * half).cwiseMin(farthest);
}

}  // namespace

void SensedBodies::update(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                          WorkerPool& pool) {
  for (std::size_t id = forms_.size(); id < catalogue.size(); ++id) {
    const scene::ObjectSpec& o = catalogue[id];
    const Eigen::Vector3f half = o.half_extents().cast<float>();
    forms_.push_back(
        {extent_of(o), half, o.solid ? o.solid->reach : half.norm(), o.shape, polyhedron_for(o)});
  }
  bodies_.resize(snapshot.objects());
  strip_.resize(snapshot.objects());
  order_.resize(snapshot.objects());
  sort(snapshot);
  bundles_.resize((bodies_.size() + kBundle - 1) / kBundle);
  // By where they go, so that threads write apart from each other.
  pool.for_rows(static_cast<int>(bundles_.size()), kCost_ns * static_cast<double>(snapshot.objects()),
                [this, &snapshot](int begin, int end) {
                  for (auto b = static_cast<std::size_t>(begin); b < static_cast<std::size_t>(end); ++b)
                    set_bundle(snapshot, b);
                });
}

// Solids are shared by many objects.
const Polyhedron* SensedBodies::polyhedron_for(const scene::ObjectSpec& o) {
  if (o.shape == scene::ShapeKind::kBox) return &boxes_.emplace_back(polyhedron_of(o));
  if (!o.solid) return nullptr;
  const auto known = solids_.find(o.solid.get());
  return known != solids_.end() ? &known->second
                                : &solids_.emplace(o.solid.get(), polyhedron_of(o)).first->second;
}

void SensedBodies::set_bundle(const scene::Snapshot& snapshot, std::size_t bundle) noexcept {
  Bundle all{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  const std::size_t end = std::min((bundle + 1) * kBundle, bodies_.size());
  for (std::size_t i = bundle * kBundle; i < end; ++i) {
    SensedBody& body = bodies_[i];
    set(snapshot, order_[i], body);
    if (body.nowhere()) continue;
    all.south = std::min(all.south, body.centre.y() - body.reach_y);
    all.north = std::max(all.north, body.centre.y() + body.reach_y);
  }
  bundles_[bundle] = all;
}

// By counting: the strips' sizes, then where each strip begins, then everybody's place.
void SensedBodies::sort(const scene::Snapshot& snapshot) noexcept {
  std::array<std::uint32_t, kStrips + 1> next{};
  for (std::size_t k = 0; k < strip_.size(); ++k) {
    const float share = (north_ - snapshot.position[k][1]) * per_u_;
    const float inside = share > 0.0F ? std::min(share, 1.0F) : 0.0F;  // 0 for a NaN
    strip_[k] = static_cast<std::uint32_t>(inside * static_cast<float>(kStrips - 1));
    ++next[strip_[k] + 1];
  }
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (std::size_t k = 0; k < strip_.size(); ++k) order_[next[strip_[k]]++] = static_cast<std::uint32_t>(k);
}

void SensedBodies::set(const scene::Snapshot& snapshot, std::uint32_t k, SensedBody& body) const noexcept {
  const std::uint32_t id = snapshot.id[k];
  const Form& form = forms_[id];
  body.centre = Eigen::Vector3f(snapshot.position[k].data());
  body.shape = form.shape;
  body.id = id;
  body.place = k;
  body.extent = form.extent;
  Eigen::Vector3f reach = form.half_extents;
  if (form.shape != scene::ShapeKind::kSphere) {
    const auto& q = snapshot.orientation[k];
    const Eigen::Matrix3f to_world = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).toRotationMatrix();
    body.to_local = to_world.transpose();
    body.polyhedron = form.polyhedron;
    reach = turned_reach(form.shape, form.half_extents, form.farthest, to_world);
  }
  const bool somewhere = body.centre.allFinite() && reach.allFinite();
  body.reach_x = somewhere ? reach.x() : -1.0F;
  body.reach_y = somewhere ? reach.y() : -1.0F;
  body.reach_z = somewhere ? reach.z() : -1.0F;
}

std::span<const float> numbered(std::span<const SensedBody> bodies, std::vector<float>& memory) {
  memory.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) memory[k] = static_cast<float>(bodies[k].place + 1);
  return memory;
}

}  // namespace smartsurf::surface
