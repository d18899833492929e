// The objects of one snapshot prepared for ray casts: a flat array with bounds, sorted from north to south so
// that a cast accesses the cells in memory order.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <span>
#include <vector>

#include "common/threads/ThreadPool.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/raycast/Facets.h"

namespace smartsurf::surface {

struct RayBody {
  Eigen::Vector3f centre;  // of the origin, u
  // Half extents of the world-axis-aligned bounding box about `centre`, u.
  float aabb_half_x, aabb_half_y, aabb_half_z;
  scene::ShapeKind shape;
  std::uint32_t id, snapshot_index;  // object id; index in the snapshot
  // Sphere: radius in x. Box: half extents. Cylinder, capsule: radius, radius, half height. Cone: radius,
  // height, unused. All in u.
  Eigen::Vector3f dimensions;
  Eigen::Matrix3f to_local;      // rotation from world to object axes; undefined for a sphere
  const Polyhedron* polyhedron;  // of a box or a solid; undefined for other shapes

  // True if the pose was not finite. Rays never hit such a body.
  bool is_invalid() const { return !(aabb_half_x >= 0.0F); }
};

class RayBodies {
 public:
  RayBodies() = default;
  // Movable, not copyable: bodies point to polyhedra of this object, whose addresses survive a move.
  RayBodies(RayBodies&&) = default;
  RayBodies& operator=(RayBodies&&) = default;
  // Sorts the bodies of a surface that extends from y = south to y = north.
  RayBodies(float south, float north)
      : north_(north), inverse_length_(1.0F / std::max(north - south, 1.0F)) {}

  // Loads the objects of the snapshot. catalogue[id] describes object `id`; it may only grow between calls,
  // unless forget_objects() precedes. Its solids must outlive this object. Allocates only when objects are
  // added.
  void update(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, common::ThreadPool&);

  void forget_objects() { shapes_.clear(), solids_.clear(), boxes_.clear(); }

  // One entry per object of the snapshot, in strips from north to south, in snapshot order within a strip.
  operator std::span<const RayBody>() const noexcept { return bodies_; }
  std::size_t size() const noexcept { return bodies_.size(); }
  const RayBody& operator[](std::size_t k) const noexcept { return bodies_[k]; }

  // Bounds in y of kClusterSize consecutive bodies, so that a cast over some rows skips distant bodies at
  // once. south > north if all bodies of the cluster are invalid.
  static constexpr std::size_t kClusterSize = 16;
  struct Cluster {
    float south, north;
  };
  std::span<const Cluster> clusters() const noexcept { return clusters_; }

 private:
  // The constant properties of an object.
  struct ObjectShape {
    Eigen::Vector3f dimensions, half_extents;
    float bounding_radius;  // maximum distance of its points from the centre, u
    scene::ShapeKind shape;
    const Polyhedron* polyhedron;
  };
  static constexpr std::size_t kBuckets = 256;

  void sort_north_to_south(const scene::Snapshot&) noexcept;
  void update_body(const scene::Snapshot&, std::uint32_t k, RayBody&) const noexcept;
  void update_cluster(const scene::Snapshot&, std::size_t cluster) noexcept;

  float north_ = 0.0F, inverse_length_ = 1.0F;
  const Polyhedron* polyhedron_for(const scene::ObjectSpec&);

  std::vector<ObjectShape> shapes_;  // index = id
  std::map<const scene::Solid*, Polyhedron> solids_;
  std::deque<Polyhedron> boxes_;
  std::vector<std::uint32_t> bucket_;  // strip of each object of the snapshot
  std::vector<std::uint32_t> order_;   // snapshot index of each entry of bodies_
  std::vector<RayBody> bodies_;
  std::vector<Cluster> clusters_;
};

// Returns tags for RayCaster that identify the object hit: 1 + its index in the snapshot. Exact for up to 2²⁴
// objects. The span refers to `storage`, which grows with the number of objects.
std::span<const float> snapshot_index_tags(std::span<const RayBody>, std::vector<float>& storage);

}  // namespace smartsurf::surface
