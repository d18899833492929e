// The shape of one kind of body: what the physics needs to know of an ObjectSpec, prepared once.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/Vec.h"

namespace smartsurf::world {

// Functions n · p + w of a point p, in blocks of four, the last one filled up with copies of the last: which
// of them is greatest is found four at a time. With w = 0: which vector n reaches farthest along p.
class LinearFunctions {
 public:
  void assign(const std::vector<Vec3>& n, const std::vector<float>& w = {});
  // One of the greatest, to a share of 1e-5 of its value.
  std::size_t argmax(const Vec3& p) const;
  // Calls each(i) for those greater than `least`.
  template <class Each>
  void for_each_above(const Vec3& p, float threshold, Each each) const {
    for (std::size_t k = 0; k < blocks_.size(); ++k) {
      const Int4 above = blocks_[k].evaluate(p) > threshold;
      for (std::size_t i = 0; i < kBlockSize; ++i)
        if (above[i] != 0 && kBlockSize * k + i <= last_index_) each(kBlockSize * k + i);
    }
  }

 private:
  static constexpr std::size_t kBlockSize = 4;
  // The compiler's own vectors: the job is too short for a call through Highway's table of instruction sets.
  using Float4 [[gnu::vector_size(16)]] = float;
  using Int4 [[gnu::vector_size(16)]] = std::int32_t;
  struct Block {
    Float4 x, y, z, w;
    Float4 evaluate(const Vec3& p) const { return ((x * p.x() + y * p.y()) + z * p.z()) + w; }
  };
  std::vector<Block> blocks_;
  std::size_t last_index_ = 0;
};

// A convex piece of a solid and its core: the corners drawn in so far that every face moves by `rounding`.
struct ConvexHullShape {
  const scene::ConvexHull* hull = nullptr;
  std::vector<Vec3> inset_corners;
  float convex_radius = 0.0F, width = 0.0F;
  LinearFunctions corner_blocks, inset_corner_blocks, face_normals;
  LinearFunctions face_planes;  // of a point above the faces' planes
  struct Edge {
    std::uint16_t corner, left, right;  // one of its corners, and the faces that meet in it
  };
  std::vector<Edge> edges;
};

struct Shape {
  scene::ShapeKind kind = scene::ShapeKind::kSphere;
  float radius = 0.0F;
  Vec3 half_extents{0, 0, 0};         // half extents about the centre of mass, own axes
  float low = 0, high = 0;            // ends along the own z axis, from the centre of mass
  float bounding_radius = 0.0F;       // of the farthest point from the centre of mass
  float width = 0.0F;                 // what is narrower than a gap of the surface falls into it
  float convex_radius = 0.0F;         // GJK works on the shape drawn in by this much, u
  bool has_rolling_friction = false;  // whether rolling friction acts on it
  std::shared_ptr<const scene::Solid> solid;
  // Of a solid; kept once for all bodies that are made of it.
  std::shared_ptr<const std::vector<ConvexHullShape>> hull_list;
  std::span<const ConvexHullShape> hulls;

  // Whether it looks the same however it is turned about its own z axis.
  bool is_axisymmetric() const {
    return kind == scene::ShapeKind::kCylinder || kind == scene::ShapeKind::kCapsule ||
           kind == scene::ShapeKind::kCone;
  }
  bool is_sphere() const { return kind == scene::ShapeKind::kSphere; }
};

Shape make_shape(const scene::ObjectSpec&);

// Of a body of this density or mass; 0 when it is fixed.
float mass_of(const scene::ObjectSpec&, const scene::Material&);
// Moments of inertia about the centre of mass in own axes, closed forms.
Mat3 inertia_of(const scene::ObjectSpec&, float mass);

}  // namespace smartsurf::world
