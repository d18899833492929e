// A body's collision shape, prepared once from its ObjectSpec.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/world/body/Vec.h"

namespace smartsurf::world {

// Half extents of the bounding box, in world axes, of a box that is turned: |axes|·half_extents. Eigen's
// product rounds alike, but GCC does not inline it.
inline Vec3 turned_extents(const Mat3& axes, const Vec3& half_extents) {
  Vec3 out;
  for (int i = 0; i < 3; ++i)
    out[i] = std::abs(axes(i, 0)) * half_extents[0] +
             (std::abs(axes(i, 1)) * half_extents[1] + std::abs(axes(i, 2)) * half_extents[2]);
  return out;
}

// Linear functions n · p + w of a point p, evaluated four at a time to find the greatest. With w = 0 this is
// the support function of the points n. The last block is padded with copies of the last function.
class LinearFunctions {
 public:
  void assign(const std::vector<Vec3>& n, const std::vector<float>& w = {});
  // Index of the greatest value, up to a relative error of 1e-5.
  std::size_t argmax(const Vec3& p) const;
  // Calls each(i) for the functions greater than `threshold` at p.
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
  // Compiler vectors: the loop is too short for Highway's dynamic dispatch.
  using Float4 [[gnu::vector_size(16)]] = float;
  using Int4 [[gnu::vector_size(16)]] = std::int32_t;
  struct Block {
    Float4 x, y, z, w;
    Float4 evaluate(const Vec3& p) const { return ((x * p.x() + y * p.y()) + z * p.z()) + w; }
  };
  std::vector<Block> blocks_;
  std::size_t last_index_ = 0;
};

// A convex hull of a solid and its core: the corners inset so far that every face moves by convex_radius.
struct ConvexHullShape {
  const scene::ConvexHull* hull = nullptr;
  std::vector<Vec3> inset_corners;
  float convex_radius = 0.0F, width = 0.0F;
  LinearFunctions corner_blocks, inset_corner_blocks, face_normals;
  LinearFunctions face_planes;  // signed distance of a point to each face's plane
  struct Edge {
    std::uint16_t corner, left, right;  // one end point, and the adjacent faces
  };
  std::vector<Edge> edges;
};

struct Shape {
  scene::ShapeKind kind = scene::ShapeKind::kSphere;
  float radius = 0.0F;
  Vec3 half_extents{0, 0, 0};    // about the origin, body axes, u
  Vec3 centre_of_mass{0, 0, 0};  // from the origin, body axes, u
  float low = 0, high = 0;       // ends along the body's z axis, from the origin, u
  float bounding_radius = 0.0F;  // about the origin, u
  float width = 0.0F;            // least width, u: a body narrower than a gap between cells falls into it
  float convex_radius = 0.0F;    // GJK works on the shape shrunk by this, u
  bool has_rolling_friction = false;
  std::shared_ptr<const scene::Solid> solid;
  // Convex parts of a solid, shared by all bodies made of it; null for other shapes.
  std::shared_ptr<const std::vector<ConvexHullShape>> hull_list;
  std::span<const ConvexHullShape> hulls;

  // True if the shape is symmetric about its z axis.
  bool is_axisymmetric() const {
    return kind == scene::ShapeKind::kCylinder || kind == scene::ShapeKind::kCapsule ||
           kind == scene::ShapeKind::kCone;
  }
  bool is_sphere() const { return kind == scene::ShapeKind::kSphere; }
};

// A sphere that does not turn as one, because its centre of mass or its inertia is not that of a sphere,
// becomes a capsule without a cylinder.
Shape make_shape(const scene::ObjectSpec&);
// A shape other than a solid. `height` is that of a round shape; `half_extents` are those of the bounding box
// about the origin, u.
Shape make_primitive(scene::ShapeKind, float radius, float height, const Vec3& half_extents);

// The object's mass if given, else density times volume; 0 for a fixed object.
float mass_of(const scene::ObjectSpec&, const scene::Material&);
// Inertia tensor about the centre of mass in body axes, mass·u²: the object's if given, else that of the
// homogeneous shape about its own, in closed form.
Mat3 inertia_of(const scene::ObjectSpec&, float mass);

}  // namespace smartsurf::world
