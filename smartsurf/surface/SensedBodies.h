// The objects of one moment as sensors meet them: flat, with bounds, in the order of the snapshot.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "smartsurf/scene/Snapshot.h"

namespace smartsurf::surface {

class WorkerPool;

// A sphere has no orientation: of its `to_local` nothing may be read.
struct SensedBody {
  Eigen::Vector3f centre;  // of mass, u
  float reach_x, reach_y,
      reach_z;  // half edges of a box about the centre, along the world's axes, that encloses it
  scene::ShapeKind shape;
  std::uint32_t id;
  Eigen::Vector3f extent;  // box: half edges; cylinder, capsule: radius, radius, half height; cone: radius,
                           // its own height, unused; sphere: the radius
  Eigen::Matrix3f to_local;  // world → object axes
  const scene::Solid* solid;

  // Never met by anything: its position was not a number.
  bool nowhere() const { return !(reach_x >= 0.0F); }
};

class SensedBodies {
 public:
  // catalogue[id] is the object `id`; it only grows from one call to the next, and its solids live as long as
  // this. Allocates only when there are more objects than before.
  void update(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, WorkerPool&);

  // One an object of the snapshot, in its order.
  std::span<const SensedBody> all() const noexcept { return bodies_; }

 private:
  // What never changes of an object.
  struct Form {
    Eigen::Vector3f extent, half_extents;
    scene::ShapeKind shape;
    const scene::Solid* solid;
  };
  void place(const scene::Snapshot&, std::size_t k) noexcept;

  std::vector<Form> forms_;  // index = id
  std::vector<SensedBody> bodies_;
};

}  // namespace smartsurf::surface
