#include "smartsurf/surface/raycast/RayBodies.h"

#include <Eigen/Geometry>
#include <array>
#include <limits>
#include <numeric>

#include "common/threads/ThreadPool.h"

namespace smartsurf::surface {
namespace {

constexpr double kBodyUpdateCost_ns = 25.0;  // per body, with the order of the bodies

Eigen::Vector3f dimensions_of(const scene::ObjectSpec& o) {
  if (o.shape == scene::ShapeKind::kCone)
    return {static_cast<float>(o.radius), static_cast<float>(o.height), 0.0F};
  return o.half_extents().cast<float>();
}

// Half extents of the world-axis-aligned box around a rotated object. The object's own box overestimates
// round shapes and solids, so theirs is bounded by closed forms or the bounding radius.
Eigen::Vector3f rotated_half_extents(scene::ShapeKind shape, const Eigen::Vector3f& half,
                                     float bounding_radius, const Eigen::Matrix3f& to_world) {
  const Eigen::Array3f along = to_world.col(2).array().abs();
  if (shape == scene::ShapeKind::kCylinder)
    return half.z() * along + half.x() * (1.0F - along * along).max(0.0F).sqrt();
  if (shape == scene::ShapeKind::kCapsule) return (half.z() - half.x()) * along + half.x();
  return (to_world.cwiseAbs() * half).cwiseMin(bounding_radius);
}

}  // namespace

void RayBodies::update(const scene::Snapshot& snapshot, std::span<const scene::ObjectSpec> catalogue,
                       common::ThreadPool& pool) {
  for (std::size_t id = shapes_.size(); id < catalogue.size(); ++id) {
    const scene::ObjectSpec& o = catalogue[id];
    const Eigen::Vector3f half = o.half_extents().cast<float>();
    shapes_.push_back({dimensions_of(o), half, o.solid ? o.solid->bounding_radius : half.norm(), o.shape,
                       polyhedron_for(o)});
  }
  bodies_.resize(snapshot.object_count());
  bucket_.resize(snapshot.object_count());
  order_.resize(snapshot.object_count());
  sort_north_to_south(snapshot);
  clusters_.resize((bodies_.size() + kClusterSize - 1) / kClusterSize);
  // In output order, so that each thread writes a contiguous range.
  pool.parallel_for_rows(static_cast<int>(clusters_.size()),
                         kBodyUpdateCost_ns * static_cast<double>(snapshot.object_count()),
                         [this, &snapshot](int begin, int end) {
                           for (int b = begin; b < end; ++b) update_cluster(snapshot, b);
                         });
}

// Objects share the polyhedron of a solid.
const Polyhedron* RayBodies::polyhedron_for(const scene::ObjectSpec& o) {
  if (o.shape == scene::ShapeKind::kBox) return &boxes_.emplace_back(polyhedron_of(o));
  if (!o.solid) return nullptr;
  const auto known = solids_.find(o.solid.get());
  return known != solids_.end() ? &known->second
                                : &solids_.emplace(o.solid.get(), polyhedron_of(o)).first->second;
}

void RayBodies::update_cluster(const scene::Snapshot& snapshot, std::size_t cluster) noexcept {
  Cluster cluster_bounds{std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
  const std::size_t end = std::min((cluster + 1) * kClusterSize, bodies_.size());
  for (std::size_t i = cluster * kClusterSize; i < end; ++i) {
    RayBody& body = bodies_[i];
    update_body(snapshot, order_[i], body);
    if (body.is_invalid()) continue;
    cluster_bounds.south = std::min(cluster_bounds.south, body.centre.y() - body.aabb_half_y);
    cluster_bounds.north = std::max(cluster_bounds.north, body.centre.y() + body.aabb_half_y);
  }
  clusters_[cluster] = cluster_bounds;
}

// Sorts into strips: a few objects by insertion, many by counting. Both are stable.
void RayBodies::sort_north_to_south(const scene::Snapshot& snapshot) noexcept {
  for (std::size_t k = 0; k < bucket_.size(); ++k) {
    const float fraction = (north_ - snapshot.position[k][1]) * inverse_length_;
    const float clamped = fraction > 0.0F ? std::min(fraction, 1.0F) : 0.0F;  // 0 for a NaN
    bucket_[k] = static_cast<std::uint32_t>(clamped * static_cast<float>(kBuckets - 1));
  }
  constexpr std::size_t kFew = 16;
  if (bucket_.size() <= kFew) {
    for (std::size_t k = 0; k < bucket_.size(); ++k) {
      std::size_t at = k;
      for (; at > 0 && bucket_[order_[at - 1]] > bucket_[k]; --at) order_[at] = order_[at - 1];
      order_[at] = static_cast<std::uint32_t>(k);
    }
    return;
  }
  std::array<std::uint32_t, kBuckets + 1> next{};
  for (const std::uint32_t bucket : bucket_) ++next[bucket + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  for (std::size_t k = 0; k < bucket_.size(); ++k) order_[next[bucket_[k]]++] = static_cast<std::uint32_t>(k);
}

void RayBodies::update_body(const scene::Snapshot& snapshot, std::uint32_t k, RayBody& body) const noexcept {
  const std::uint32_t id = snapshot.id[k];
  const ObjectShape& object_shape = shapes_[id];
  body.centre = Eigen::Vector3f(snapshot.position[k].data());
  body.shape = object_shape.shape;
  body.id = id;
  body.snapshot_index = k;
  body.dimensions = object_shape.dimensions;
  Eigen::Vector3f aabb_half = object_shape.half_extents;
  if (object_shape.shape != scene::ShapeKind::kSphere) {
    const auto& q = snapshot.orientation[k];
    const Eigen::Matrix3f to_world = Eigen::Quaternionf(q[3], q[0], q[1], q[2]).toRotationMatrix();
    body.to_local = to_world.transpose();
    body.polyhedron = object_shape.polyhedron;
    aabb_half = rotated_half_extents(object_shape.shape, object_shape.half_extents,
                                     object_shape.bounding_radius, to_world);
  }
  const bool finite = body.centre.allFinite() && aabb_half.allFinite();
  body.aabb_half_x = finite ? aabb_half.x() : -1.0F;
  body.aabb_half_y = finite ? aabb_half.y() : -1.0F;
  body.aabb_half_z = finite ? aabb_half.z() : -1.0F;
}

std::span<const float> snapshot_index_tags(std::span<const RayBody> bodies, std::vector<float>& storage) {
  storage.resize(bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k)
    storage[k] = static_cast<float>(bodies[k].snapshot_index + 1);
  return storage;
}

}  // namespace smartsurf::surface
