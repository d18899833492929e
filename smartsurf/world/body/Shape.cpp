#include "smartsurf/world/body/Shape.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// Moves each corner inwards so that all its faces move by `depth`. Solves in the least-squares sense if more
// than three faces meet.
std::vector<Vec3> inset_hull(const scene::ConvexHull& hull, float depth) {
  std::vector<Mat3> normal_matrices(hull.vertices.size(), Mat3::Identity() * 1e-4F);
  std::vector<Vec3> right_hand_sides(hull.vertices.size(), Vec3::Zero());
  for (const auto& face : hull.faces)
    for (std::uint32_t i = 0; i < face.vertex_count; ++i) {
      const std::size_t corner = hull.face_vertices[face.first_vertex + i];
      normal_matrices[corner] += face.normal * face.normal.transpose();
      right_hand_sides[corner] -= depth * face.normal;
    }
  std::vector<Vec3> inset(hull.vertices);
  for (std::size_t i = 0; i < inset.size(); ++i)
    inset[i] += normal_matrices[i].ldlt().solve(right_hand_sides[i]);
  return inset;
}

float min_width(const scene::ConvexHull& hull) {
  float width = std::numeric_limits<float>::max();
  for (const auto& face : hull.faces) {
    float extent = 0.0F;
    for (const Vec3& corner : hull.vertices) extent = std::max(extent, face.offset - face.normal.dot(corner));
    width = std::min(width, extent);
  }
  return width;
}

// The two faces of an edge traverse it in opposite directions.
std::vector<ConvexHullShape::Edge> find_edges(const scene::ConvexHull& hull) {
  std::map<std::pair<std::uint16_t, std::uint16_t>, std::uint16_t> face_along;
  std::vector<ConvexHullShape::Edge> edges;
  for (std::size_t f = 0; f < hull.faces.size(); ++f) {
    const auto& face = hull.faces[f];
    const auto* corners = &hull.face_vertices[face.first_vertex];
    for (std::uint32_t i = 0; i < face.vertex_count; ++i) {
      const std::uint16_t from = corners[i], to = corners[(i + 1) % face.vertex_count];
      face_along[{from, to}] = static_cast<std::uint16_t>(f);
      if (const auto other = face_along.find({to, from}); other != face_along.end())
        edges.push_back({from, static_cast<std::uint16_t>(f), other->second});
    }
  }
  return edges;
}

std::vector<ConvexHullShape> make_hulls(const scene::Solid& solid) {
  std::vector<ConvexHullShape> hulls;
  for (const auto& source : solid.hulls) {
    ConvexHullShape& hull = hulls.emplace_back();
    hull.hull = &source;
    hull.width = min_width(source);
    hull.convex_radius = std::min(0.03F, 0.1F * hull.width);
    hull.inset_corners = inset_hull(source, hull.convex_radius);
    hull.corner_blocks.assign(source.vertices);
    hull.inset_corner_blocks.assign(hull.inset_corners);
    std::vector<Vec3> normals;
    std::vector<float> offsets;
    for (const auto& face : source.faces) normals.push_back(face.normal), offsets.push_back(-face.offset);
    hull.face_normals.assign(normals);
    hull.face_planes.assign(normals, offsets);
    hull.edges = find_edges(source);
  }
  return hulls;
}

// The convex hulls of a solid, shared by all bodies made of it: with thousands of bodies and few solids, the
// hulls stay in the CPU caches.
std::shared_ptr<const std::vector<ConvexHullShape>> find_or_make_hulls(const scene::Solid& solid) {
  static std::mutex mutex;
  static std::map<const scene::Solid*, std::weak_ptr<const std::vector<ConvexHullShape>>> cache;
  const std::lock_guard lock(mutex);
  if (auto hulls = cache[&solid].lock()) return hulls;
  std::erase_if(cache, [](const auto& entry) { return entry.second.expired(); });
  auto hulls = std::make_shared<const std::vector<ConvexHullShape>>(make_hulls(solid));
  cache[&solid] = hulls;
  return hulls;
}

void add_hulls(Shape& shape) {
  shape.hull_list = find_or_make_hulls(*shape.solid);
  shape.hulls = *shape.hull_list;
  for (const ConvexHullShape& hull : shape.hulls)
    shape.width = shape.hulls.size() == 1 ? hull.width : std::max(shape.width, hull.width);
}

}  // namespace

void LinearFunctions::assign(const std::vector<Vec3>& n, const std::vector<float>& w) {
  last_index_ = n.size() - 1;
  blocks_.resize((n.size() + kBlockSize - 1) / kBlockSize);
  for (std::size_t i = 0; i < kBlockSize * blocks_.size(); ++i) {
    const std::size_t k = std::min(i, last_index_);
    Block& b = blocks_[i / kBlockSize];
    b.x[i % kBlockSize] = n[k].x(), b.y[i % kBlockSize] = n[k].y(), b.z[i % kBlockSize] = n[k].z();
    b.w[i % kBlockSize] = w.empty() ? 0.0F : w[k];
  }
}

// Branch-free, because the outcome is unpredictable: the lowest bits of each value are replaced by its index.
std::size_t LinearFunctions::argmax(const Vec3& p) const {
  constexpr std::size_t kBlocksPerGroup = 16;  // in blocks; limits the index to six bits
  constexpr Int4 kLaneIndex = {0, 1, 2, 3};
  std::size_t best = 0;
  float max_value = -std::numeric_limits<float>::max();
  for (std::size_t group = 0; group < blocks_.size(); group += kBlocksPerGroup) {
    const std::size_t count = std::min(kBlocksPerGroup, blocks_.size() - group);
    const std::int32_t index_mask = static_cast<std::int32_t>(kBlockSize * std::bit_ceil(count)) - 1;
    Float4 best_lanes = {max_value, max_value, max_value, max_value};
    for (std::size_t k = 0; k < count; ++k) {
      const Float4 values = blocks_[group + k].evaluate(p);
      const Int4 indices = kLaneIndex + static_cast<std::int32_t>(kBlockSize * k);
      const auto tagged = std::bit_cast<Float4>((std::bit_cast<Int4>(values) & ~index_mask) | indices);
      best_lanes = tagged > best_lanes ? tagged : best_lanes;
    }
    const float group_max =
        std::max(std::max(best_lanes[0], best_lanes[1]), std::max(best_lanes[2], best_lanes[3]));
    if (!(group_max > max_value)) continue;
    max_value = group_max;
    best = kBlockSize * group + (std::bit_cast<std::int32_t>(group_max) & index_mask);
  }
  return std::min(best, last_index_);
}

Shape make_primitive(ShapeKind kind, float radius, float height, const Vec3& half_extents) {
  Shape s;
  s.kind = kind;
  s.radius = radius;
  s.half_extents = half_extents;
  s.high = s.half_extents.z();
  s.low = -s.high;
  s.width = 2.0F * s.half_extents.minCoeff();
  s.convex_radius = std::min(0.03F, 0.1F * s.half_extents.minCoeff());
  s.has_rolling_friction = kind != ShapeKind::kBox && kind != ShapeKind::kSolid;
  switch (kind) {
    case ShapeKind::kSphere:
      s.bounding_radius = s.convex_radius = s.radius;
      break;
    case ShapeKind::kBox:
      s.bounding_radius = s.half_extents.norm();
      break;
    case ShapeKind::kCylinder:
      s.bounding_radius = std::hypot(s.radius, s.high);
      break;
    case ShapeKind::kCapsule:
      s.bounding_radius = s.high;
      s.convex_radius = s.radius;
      break;
    case ShapeKind::kCone:
      s.low = -0.25F * height;
      s.high = 0.75F * height;
      s.bounding_radius = std::max(s.high, std::hypot(s.radius, s.low));
      s.convex_radius = std::min(0.03F, 0.05F * std::min(s.radius, height));
      break;
    case ShapeKind::kSolid:
      break;
  }
  return s;
}

Shape make_shape(const scene::ObjectSpec& o) {
  const bool turns_as_sphere =
      o.centre_of_mass.isZero(0.0) &&
      (!o.inertia || o.inertia->isApprox(Eigen::Matrix3d::Identity() * (*o.inertia)(0, 0)));
  const ShapeKind kind = o.shape == ShapeKind::kSphere && !turns_as_sphere ? ShapeKind::kCapsule : o.shape;
  Shape s = make_primitive(kind, static_cast<float>(o.radius), static_cast<float>(o.height),
                           o.half_extents().cast<float>());
  s.centre_of_mass = o.centre_of_mass.cast<float>();
  if (o.shape != ShapeKind::kSolid) return s;
  s.solid = o.solid;
  s.bounding_radius = o.solid->bounding_radius;
  add_hulls(s);
  return s;
}

float mass_of(const scene::ObjectSpec& o, const scene::Material& m) {
  return o.fixed ? 0.0F : static_cast<float>(o.mass.value_or(m.density * o.volume()));
}

Mat3 inertia_of(const scene::ObjectSpec& o, float mass) {
  return (o.inertia ? *o.inertia : o.homogeneous_inertia(static_cast<double>(mass))).cast<float>();
}

}  // namespace smartsurf::world
