// The objects of one moment as sensors meet them: flat, with bounds, from north to south, so that sweeps
// touch the table in the order of memory.
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

// A sphere has no orientation: of its `to_local` nothing may be read.
struct RayBody {
  Eigen::Vector3f centre;  // of mass, u
  float aabb_half_x, aabb_half_y,
      aabb_half_z;  // half edges of a box about the centre, along the world's axes, that encloses it
  scene::ShapeKind shape;
  std::uint32_t id, snapshot_index;  // of the object; index in the snapshot
  Eigen::Vector3f
      dimensions;            // box: half edges; cylinder, capsule: radius, radius, half height; cone: radius,
                             // its own height, unused; sphere: the radius
  Eigen::Matrix3f to_local;  // world → object axes
  const Polyhedron* polyhedron;  // of a box or a solid

  // Never met by anything: its position was not a number.
  bool is_invalid() const { return !(aabb_half_x >= 0.0F); }
};

class RayBodies {
 public:
  RayBodies() = default;
  // Bodies point to what this keeps of them; it may move, for that stays where it is.
  RayBodies(RayBodies&&) = default;
  RayBodies& operator=(RayBodies&&) = default;
  // Of a table that lies between these two y.
  RayBodies(float south, float north)
      : north_(north), inverse_length_(1.0F / std::max(north - south, 1.0F)) {}

  // catalogue[id] is the object `id`; it only grows from one call to the next, and its solids live as long as
  // this. Allocates only when there are more objects than before.
  void update(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, common::ThreadPool&);

  // One an object of the snapshot: by strips of the table from north to south, in the snapshot's order within
  // each.
  operator std::span<const RayBody>() const noexcept { return bodies_; }
  std::size_t size() const noexcept { return bodies_.size(); }
  const RayBody& operator[](std::size_t k) const noexcept { return bodies_[k]; }

  // Between which y all of so many that follow each other are: who cares for a part of the table passes over
  // the others without looking at each. south > north: none is anywhere.
  static constexpr std::size_t kClusterSize = 16;
  struct Cluster {
    float south, north;
  };
  std::span<const Cluster> clusters() const noexcept { return clusters_; }

 private:
  // What never changes of an object.
  struct ObjectShape {
    Eigen::Vector3f dimensions, half_extents;
    float bounding_radius;  // of its points from the centre, at most
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
  std::vector<std::uint32_t> bucket_;  // of each of the snapshot's objects
  std::vector<std::uint32_t> order_;   // which of them goes where
  std::vector<RayBody> bodies_;
  std::vector<Cluster> clusters_;
};

// Marks for FirstHit that tell the object met: 1 + its index in the snapshot, of up to 16 million objects.
// They lie in `memory`, which grows with the number of objects.
std::span<const float> snapshot_index_tags(std::span<const RayBody>, std::vector<float>& storage);

}  // namespace smartsurf::surface
