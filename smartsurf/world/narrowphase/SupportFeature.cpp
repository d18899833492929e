#include "smartsurf/world/narrowphase/SupportFeature.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "smartsurf/world/narrowphase/FeaturePoints.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

struct FeatureBuilder {
  const Vec3& centre;
  const Mat3& axes;
  SupportFeature feature;
  void add(const Vec3& local_point) { feature.add(centre + axes * local_point); }
};

void add_box_face(FeatureBuilder& b, const Vec3& half, const Vec3& d) {
  Eigen::Index axis = 0;
  d.cwiseAbs().maxCoeff(&axis);
  const float side = std::copysign(1.0F, d[axis]);
  const Eigen::Index u = (axis + 1) % 3, v = (axis + 2) % 3;
  static constexpr float kCorner[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (int i = 0; i < 4; ++i) {
    const auto& corner = kCorner[side > 0 ? i : 3 - i];
    Vec3 p;
    p[axis] = side * half[axis];
    p[u] = corner[0] * half[u];
    p[v] = corner[1] * half[v];
    b.add(p);
  }
  b.feature.normal = b.axes.col(axis) * side;
}

void add_disc(FeatureBuilder& b, float radius, float z, float side, const Vec3& d) {
  constexpr float kDiagonal = 0.70710678F;
  static constexpr float kCosine[kRimPoints] = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
  const float across = length_of(d.x(), d.y());
  const float x = across > 1e-9F ? radius * d.x() / across : radius;
  const float y = across > 1e-9F ? radius * d.y() / across : 0.0F;
  for (int i = 0; i < kRimPoints; ++i) {
    const float u = kCosine[i], v = side * kCosine[(i + 6) % kRimPoints];
    b.add({x * u - y * v, x * v + y * u, z});
  }
  b.feature.normal = b.axes.col(2) * side;
}

void add_hull_face(FeatureBuilder& b, const ConvexHullShape& hull, const Vec3& d) {
  const scene::ConvexHull& source = *hull.hull;
  const scene::ConvexHull::Face* best_face = &source.faces[hull.face_normals.argmax(d)];
  // A face with more corners than fit is subsampled.
  const std::uint32_t stride =
      (best_face->vertex_count + SupportFeature::kMaxPoints / 2 - 1) / (SupportFeature::kMaxPoints / 2);
  for (std::uint32_t i = 0; i < best_face->vertex_count; i += stride)
    b.add(source.vertices[source.face_vertices[best_face->first_vertex + i]]);
  b.feature.normal = b.axes * best_face->normal;
}

// Adds the ends of the overlap of two parallel edges.
void add_parallel_edges(const SupportFeature& a, const SupportFeature& b, const Vec3& normal, float margin,
                        PatchPoints points, ManifoldReducer& out) {
  const Vec3 along_a = a.point[1] - a.point[0], along_b = b.point[1] - b.point[0];
  const float length = along_a.norm(), length_b = along_b.norm();
  if (length < 1e-6F || length_b < 1e-6F || along_a.cross(along_b).norm() > 0.05F * length * length_b) return;
  const Vec3 u = along_a / length;
  const float s0 = u.dot(b.point[0] - a.point[0]), s1 = u.dot(b.point[1] - a.point[0]);
  const float low = std::max(0.0F, std::min(s0, s1)), high = std::min(length, std::max(s0, s1));
  if (low >= high) return;
  for (const float s : {low, high}) {
    const Vec3 on_a = a.point[0] + s * u;
    const Vec3 on_b = b.point[0] + along_b * ((s - s0) / (s1 - s0));
    const float separation = normal.dot(on_a - on_b);
    const Vec3 point = points == PatchPoints::kOnB ? on_b : Vec3(0.5F * (on_a + on_b));
    if (separation <= margin) out.add({point, normal, separation, 0});
  }
}

}  // namespace

SupportFeature support_feature(const ConvexPart& part, const Vec3& centre, const Mat3& axes,
                               const Vec3& direction) {
  const Shape& s = part.shape;
  const Vec3 d = axes.transpose() * direction;
  FeatureBuilder b{centre, axes, {}};
  const float across = length_of(d.x(), d.y());
  const Vec3 radial = across > 1e-9F ? Vec3(d.x() / across, d.y() / across, 0) : Vec3(1, 0, 0);
  switch (s.kind) {
    case ShapeKind::kSphere:
      b.add(s.radius * d);
      break;
    case ShapeKind::kBox:
      add_box_face(b, s.half_extents, d);
      break;
    case ShapeKind::kCylinder:
      if (std::abs(d.z()) > across) {
        add_disc(b, s.radius, std::copysign(s.high, d.z()), std::copysign(1.0F, d.z()), d);
      } else {
        b.add(radial * s.radius + Vec3(0, 0, s.low));
        b.add(radial * s.radius + Vec3(0, 0, s.high));
      }
      break;
    case ShapeKind::kCapsule: {
      const float end = std::max(0.0F, s.high - s.radius);
      b.add(Vec3(0, 0, -end) + s.radius * d);
      b.add(Vec3(0, 0, end) + s.radius * d);
      break;
    }
    case ShapeKind::kCone:
      // The base if the direction is more than 45° below the horizontal, else a line of the lateral surface.
      if (-d.z() > across) {
        add_disc(b, s.radius, s.low, -1.0F, d);
      } else {
        b.add(radial * s.radius + Vec3(0, 0, s.low));
        b.add({0, 0, s.high});
      }
      break;
    case ShapeKind::kSolid:
      add_hull_face(b, *part.hull, d);
      break;
  }
  return b.feature;
}

SupportFeature farthest_edge(const SupportFeature& face, const Vec3& direction) {
  const auto end_of = [&](int i) -> const Vec3& { return face.point[i + 1 < face.count ? i + 1 : 0]; };
  int best = 0;
  for (int i = 1; i < face.count; ++i)
    if (direction.dot(face.point[i] + end_of(i)) > direction.dot(face.point[best] + end_of(best))) best = i;
  SupportFeature edge;
  edge.add(face.point[best]);
  edge.add(end_of(best));
  return edge;
}

float face_alignment(const ConvexPart& part, const Mat3& axes, const Vec3& direction) {
  const Vec3 d = axes.transpose() * direction;
  const float across = length_of(d.x(), d.y());
  switch (part.shape.kind) {
    case ShapeKind::kSphere:
    case ShapeKind::kCapsule:
      return 0.0F;
    case ShapeKind::kBox:
      return d.cwiseAbs().maxCoeff();
    case ShapeKind::kCylinder:
      return std::abs(d.z()) > across ? std::abs(d.z()) : 0.0F;
    case ShapeKind::kCone:
      return -d.z() > across ? -d.z() : 0.0F;
    case ShapeKind::kSolid:
      break;
  }
  return d.dot(part.hull->hull->faces[part.hull->face_normals.argmax(d)].normal);
}

namespace {

// Clips a polygon or an edge against one plane (Sutherland and Hodgman): removes points with a positive
// distance.
void clip_polygon(const SupportFeature& input, const float* distances, SupportFeature& output) {
  output.count = 0;
  // An edge has one segment, a polygon as many as corners.
  const int sides = input.count > 2 ? input.count : input.count - 1;
  for (int k = 0; k < input.count; ++k) {
    const Vec3& p = input.point[k];
    if (distances[k] <= 0.0F) output.add(p);
    if (k >= sides) continue;
    const int next = k + 1 < input.count ? k + 1 : 0;
    const Vec3& q = input.point[next];
    if ((distances[k] < 0.0F && distances[next] > 0.0F) || (distances[k] > 0.0F && distances[next] < 0.0F))
      output.add(p + (q - p) * (distances[k] / (distances[k] - distances[next])));
  }
}

// Clips a polygon or an edge against one plane after another.
class FaceClipper {
 public:
  explicit FaceClipper(const SupportFeature& feature) : current_(&feature) {}
  // distance_beyond(p): distance of a point beyond the plane; only the sign and the ratio matter.
  template <class Over>
  void clip(Over distance_beyond) {
    float distances[SupportFeature::kMaxPoints];
    float max_distance = 0.0F;
    for (int k = 0; k < current_->count; ++k) {
      distances[k] = distance_beyond(current_->point[k]);
      max_distance = std::max(max_distance, distances[k]);
    }
    if (max_distance == 0.0F) return;
    SupportFeature& output = current_ == &buffer_[0] ? buffer_[1] : buffer_[0];
    clip_polygon(*current_, distances, output);
    current_ = &output;
  }
  const SupportFeature& result() const { return *current_; }

 private:
  SupportFeature buffer_[2];
  const SupportFeature* current_;
};

}  // namespace

SupportFeature clip_to_face(const SupportFeature& feature, const SupportFeature& face) {
  FaceClipper clipper(feature);
  for (int i = 0; i < face.count && clipper.result().count > 0; ++i) {
    const Vec3& a = face.point[i];
    const Vec3& b = face.point[i + 1 < face.count ? i + 1 : 0];
    const Vec3 out = (b - a).cross(face.normal);
    clipper.clip([&](const Vec3& p) { return out.dot(p - a); });
  }
  return clipper.result();
}

SupportFeature clip_to_rectangle(const SupportFeature& feature, float west, float east, float south,
                                 float north) {
  FaceClipper clipper(feature);
  clipper.clip([west](const Vec3& p) { return west - p.x(); });
  clipper.clip([east](const Vec3& p) { return p.x() - east; });
  clipper.clip([south](const Vec3& p) { return south - p.y(); });
  clipper.clip([north](const Vec3& p) { return p.y() - north; });
  return clipper.result();
}

void add_contact_patch(const SupportFeature& on_a, const SupportFeature& on_b, const Vec3& normal,
                       float margin, PatchPoints points, ManifoldReducer& out) {
  const float alignment_a = on_a.is_face() ? -on_a.normal.dot(normal) : 0.0F;
  const float alignment_b = on_b.is_face() ? on_b.normal.dot(normal) : 0.0F;
  if (std::max(alignment_a, alignment_b) <= kFaceAlignment) {
    if (on_a.count == 2 && on_b.count == 2) add_parallel_edges(on_a, on_b, normal, margin, points, out);
    return;
  }
  // Ties go to b, so that the choice does not alternate from step to step.
  const bool from_a = alignment_a > alignment_b + 1e-3F;
  const SupportFeature &face = from_a ? on_a : on_b, &other = from_a ? on_b : on_a;
  const SupportFeature patch = clip_to_face(other, face);
  const Vec3 contact_normal = from_a ? Vec3(-face.normal) : face.normal;
  for (int i = 0; i < patch.count; ++i) {
    const Vec3& p = patch.point[i];
    const float separation = face.normal.dot(p - face.point[0]);
    if (separation > margin) continue;
    const bool move_to_b = points == PatchPoints::kOnB && !from_a;
    out.add({move_to_b ? Vec3(p - separation * contact_normal) : p, contact_normal, separation, 0});
  }
}

}  // namespace smartsurf::world
