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

#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/surface/Facets.h"

namespace smartsurf::surface {

class WorkerPool;

// A sphere has no orientation: of its `to_local` nothing may be read.
struct SensedBody {
  Eigen::Vector3f centre;  // of mass, u
  float reach_x, reach_y,
      reach_z;  // half edges of a box about the centre, along the world's axes, that encloses it
  scene::ShapeKind shape;
  std::uint32_t id, place;   // of the object; index in the snapshot
  Eigen::Vector3f extent;    // box: half edges; cylinder, capsule: radius, radius, half height; cone: radius,
                             // its own height, unused; sphere: the radius
  Eigen::Matrix3f to_local;  // world → object axes
  const Polyhedron* polyhedron;  // of a box or a solid

  // Never met by anything: its position was not a number.
  bool nowhere() const { return !(reach_x >= 0.0F); }
};

class SensedBodies {
 public:
  SensedBodies() = default;
  // Bodies point to what this keeps of them; it may move, for that stays where it is.
  SensedBodies(SensedBodies&&) = default;
  SensedBodies& operator=(SensedBodies&&) = default;
  // Of a table that lies between these two y.
  SensedBodies(float south, float north) : north_(north), per_u_(1.0F / std::max(north - south, 1.0F)) {}

  // catalogue[id] is the object `id`; it only grows from one call to the next, and its solids live as long as
  // this. Allocates only when there are more objects than before.
  void update(const scene::Snapshot&, std::span<const scene::ObjectSpec> catalogue, WorkerPool&);

  // One an object of the snapshot: by strips of the table from north to south, in the snapshot's order within
  // each.
  operator std::span<const SensedBody>() const noexcept { return bodies_; }
  std::size_t size() const noexcept { return bodies_.size(); }
  const SensedBody& operator[](std::size_t k) const noexcept { return bodies_[k]; }

  // Between which y all of so many that follow each other are: who cares for a part of the table passes over
  // the others without looking at each. south > north: none is anywhere.
  static constexpr std::size_t kBundle = 16;
  struct Bundle {
    float south, north;
  };
  std::span<const Bundle> bundles() const noexcept { return bundles_; }

 private:
  // What never changes of an object.
  struct Form {
    Eigen::Vector3f extent, half_extents;
    float farthest;  // of its points from the centre, at most
    scene::ShapeKind shape;
    const Polyhedron* polyhedron;
  };
  static constexpr std::size_t kStrips = 256;

  void sort(const scene::Snapshot&) noexcept;
  void set(const scene::Snapshot&, std::uint32_t k, SensedBody&) const noexcept;
  void set_bundle(const scene::Snapshot&, std::size_t bundle) noexcept;

  float north_ = 0.0F, per_u_ = 1.0F;
  const Polyhedron* polyhedron_for(const scene::ObjectSpec&);

  std::vector<Form> forms_;  // index = id
  std::map<const scene::Solid*, Polyhedron> solids_;
  std::deque<Polyhedron> boxes_;
  std::vector<std::uint32_t> strip_;  // of each of the snapshot's objects
  std::vector<std::uint32_t> order_;  // which of them goes where
  std::vector<SensedBody> bodies_;
  std::vector<Bundle> bundles_;
};

// Marks for FirstHit that tell the object met: 1 + its index in the snapshot, of up to 16 million objects.
// They lie in `memory`, which grows with the number of objects.
std::span<const float> numbered(std::span<const SensedBody>, std::vector<float>& memory);

}  // namespace smartsurf::surface
