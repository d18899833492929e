#include "smartsurf/world/field/ColumnSat.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "smartsurf/world/simd/Simd4.h"

namespace smartsurf::world {
namespace {

using scene::ShapeKind;

// A column has no bottom face, so normals do not point down. The tolerance admits rounding.
constexpr float kMinAxisZ = -0.01F;
// Edge axes must win by this much, so that the choice does not alternate with a face axis, u.
constexpr float kEdgeBias = 2e-3F;

}  // namespace

void ColumnSat::add(const Vec3& normal, float min_projection, float bias) {
  if (normal.z() >= kMinAxisZ) axes_.add(normal, min_projection, bias);
}

void ColumnSat::set(const ConvexProxy& proxy, const Vec3& low, const Vec3& high) {
  axes_.clear();
  const ConvexHullShape* const hull = proxy.part.hull;
  constexpr std::size_t kOfColumn = 5, kMaxOfPrimitive = 24;  // those of a box
  axes_.reserve(kOfColumn + (hull ? hull->hull->faces.size() + 3 * hull->edges.size() : kMaxOfPrimitive));
  faces_of_feature_.clear();
  separating_axis_ = 0;
  centre_ = proxy.centre;
  round_proxy_.reset();
  add(Vec3::UnitZ(), low.z(), 0.0F);
  if (hull)
    add_hull(proxy);
  else if (proxy.part.shape.kind == ShapeKind::kBox)
    add_box(proxy);
  else
    add_axisymmetric(proxy), round_proxy_.emplace(proxy);
  for (int i = 0; i < 2; ++i) {
    add(Vec3::Unit(i), low[i], 0.0F);
    add(-Vec3::Unit(i), -high[i], 0.0F);
  }
  axes_.pad();
}

// The axis added since the last call, if there is one, is that of a face, or of the edge between two.
void ColumnSat::note_feature(std::size_t left, std::size_t right) {
  if (faces_of_feature_.size() < axes_.size() - first_feature_)
    faces_of_feature_.push_back({static_cast<std::uint16_t>(left), static_cast<std::uint16_t>(right)});
}

void ColumnSat::add_box(const ConvexProxy& proxy) {
  const Vec3& half = proxy.part.shape.half_extents;
  auto add_both_ways = [&](const Vec3& n, float bias) {
    const float reach = (proxy.axes.transpose() * n).cwiseAbs().dot(half), at = n.dot(proxy.centre);
    add(n, at - reach, bias);
    add(-n, -at - reach, bias);
  };
  for (int i = 0; i < 3; ++i) add_both_ways(proxy.axes.col(i), 0.0F);
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) {
      const Vec3 n = proxy.axes.col(i).cross(Vec3::Unit(k));
      if (const float length = n.norm(); length > 0.05F) add_both_ways(n / length, kEdgeBias);
    }
}

void ColumnSat::add_hull(const ConvexProxy& proxy) {
  const ConvexHullShape& hull = *proxy.part.hull;
  const auto& faces = hull.hull->faces;
  const Vec3 down = -proxy.axes.row(2).transpose();  // in the hull's axes
  for (std::vector<float>& components : face_normals_) components.resize(faces.size());
  first_feature_ = axes_.size();
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) face_normals_[k][f] = proxy.axes.row(k) * faces[f].normal;
    if (faces[f].normal.dot(down) < kMinAxisZ) continue;
    const Vec3 n = proxy.axes * -faces[f].normal;
    add(n, n.dot(proxy.centre) - faces[f].offset, 0.0F);
    note_feature(f, f);
  }
  for (const ConvexHullShape::Edge& e : hull.edges)
    for (int k = 0; k < 3; ++k) {
      // The arc between the two face normals on the Gauss map contains a normal perpendicular to the column's
      // edge only if their components along that edge differ in sign.
      const float left = face_normals_[k][e.left], right = face_normals_[k][e.right];
      if (left * right >= 0.0F) continue;
      const Vec3 outward = faces[e.left].normal * std::abs(right) + faces[e.right].normal * std::abs(left);
      const float length = outward.norm();
      if (length < 1e-6F || outward.dot(down) < kMinAxisZ * length) continue;
      const Vec3 n = proxy.axes * (outward / -length);
      add(n, n.dot(proxy.centre) - outward.dot(hull.hull->vertices[e.corner]) / length, kEdgeBias);
      note_feature(e.left, e.right);
    }
}

void ColumnSat::add_axisymmetric(const ConvexProxy& proxy) {
  auto add_both_ways = [&](const Vec3& along) {
    const float length = along.norm();
    if (length < 0.05F) return;
    for (const Vec3& n : {Vec3(along / length), Vec3(along / -length)})
      if (n.z() >= kMinAxisZ) add(n, n.dot(proxy.sharp_support(-n)), 0.0F);
  };
  const Vec3 along = proxy.axes.col(2);
  add_both_ways(along);
  add_both_ways(Vec3::UnitZ() - along * along.z());
  for (int k = 0; k < 3; ++k) add_both_ways(along.cross(Vec3::Unit(k)));
}

void ColumnSat::AxisList::reserve(std::size_t axes) {
  const std::size_t padded = axes + kSimd4Width;
  if (x.size() >= padded) return;
  for (auto* v : {&x, &y, &z, &min_projection, &bias}) v->resize(padded);
}

void ColumnSat::AxisList::add(const Vec3& normal, float projection, float axis_bias) {
  x[count] = normal.x(), y[count] = normal.y(), z[count] = normal.z();
  min_projection[count] = projection;
  bias[count] = axis_bias;
  ++count;
}

void ColumnSat::AxisList::pad() {
  for (std::size_t i = count; i < count + kSimd4Width; ++i)
    x[i] = x[0], y[i] = y[0], z[i] = z[0], min_projection[i] = min_projection[0], bias[i] = bias[0];
}

inline float ColumnSat::AxisList::separation(std::size_t i, const Column& q) const {
  return min_projection[i] -
         ((x[i] > 0 ? q.east : q.west) * x[i] + (y[i] > 0 ? q.north : q.south) * y[i] + q.top * z[i]);
}

float ColumnSat::AxisList::separations(const Column& q, float* out) const {
  const Float4 west = broadcast4(q.west), east = broadcast4(q.east), south = broadcast4(q.south),
               north = broadcast4(q.north), top = broadcast4(q.top);
  Float4 greatest = broadcast4(-std::numeric_limits<float>::infinity());
  for (std::size_t i = 0; i < count; i += kSimd4Width) {
    const Float4 nx = load4(&x[i]), ny = load4(&y[i]), nz = load4(&z[i]);
    const Float4 of_column = (nx > 0.0F ? east : west) * nx + (ny > 0.0F ? north : south) * ny + top * nz;
    const Float4 value = load4(&min_projection[i]) - of_column;
    store4(value, out + i);
    greatest = max(value, greatest);
  }
  return horizontal_max(greatest);
}

// The horizontal axis from a vertical edge of the column to the centre of a round part. False if a side is
// closer.
bool ColumnSat::find_radial_axis(const Column& q, BestAxis& out) const {
  const Vec3& centre = round_proxy_->centre;
  const Vec3 edge(std::clamp(centre.x(), q.west, q.east), std::clamp(centre.y(), q.south, q.north), q.top);
  const Vec3 away(centre.x() - edge.x(), centre.y() - edge.y(), 0.0F);
  if (away.x() == 0.0F || away.y() == 0.0F) return false;
  out.normal = away.normalized();
  out.separation = out.normal.dot(round_proxy_->sharp_support(-out.normal) - edge);
  return true;
}

bool ColumnSat::find_best_axis(const Column& q, float margin, bool beside, BestAxis& out) {
  // The axis that separated the last column often separates its neighbour too.
  if (axes_.separation(separating_axis_, q) > margin) return false;
  const std::size_t count = axes_.size();
  separation_.resize(count + kSimd4Width);
  if (axes_.separations(q, separation_.data()) > margin) {
    separating_axis_ =
        std::ranges::find_if(separation_, [&](float s) { return s > margin; }) - separation_.begin();
    return false;
  }
  float max_biased_separation = -std::numeric_limits<float>::max(), over_bridge = max_biased_separation;
  std::size_t chosen = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (separation_[i] - axes_.bias[i] <= max_biased_separation) continue;
    if (q.leans_over_bridge(axes_.x[i], axes_.y[i], kLeanTolerance)) {
      over_bridge = std::max(over_bridge, separation_[i]);
      continue;
    }
    max_biased_separation = separation_[i] - axes_.bias[i];
    chosen = i;
  }
  BestAxis radial;
  if (round_proxy_ && find_radial_axis(q, radial)) {
    if (radial.separation > margin) return false;
    if (radial.separation - kEdgeBias > max_biased_separation &&
        !q.leans_over_bridge(radial.normal.x(), radial.normal.y(), kLeanTolerance)) {
      out = radial;
      return true;
    }
  }
  chosen_ = chosen;
  // In a concave corner the neighbours hold the part; this column's outer sides are no way out.
  out = {Vec3(axes_.x[chosen], axes_.y[chosen], axes_.z[chosen]), separation_[chosen]};
  const Vec3 from_column(centre_.x() - 0.5F * (q.west + q.east), centre_.y() - 0.5F * (q.south + q.north),
                         0.0F);
  const bool is_side = out.normal.z() < kLeanTolerance;
  if ((is_side ? out.normal.dot(from_column) < 0.0F : beside) &&
      over_bridge > out.separation + kBridgeShortcut)
    return false;
  return true;
}

std::optional<ColumnSat::BestAxis> ColumnSat::nearer_edge_axis() const {
  std::size_t nearest = chosen_;
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (axes_.bias[i] > 0.0F && separation_[i] > separation_[nearest]) nearest = i;
  if (nearest == chosen_) return std::nullopt;
  return BestAxis{Vec3(axes_.x[nearest], axes_.y[nearest], axes_.z[nearest]), separation_[nearest]};
}

int ColumnSat::find_face(const Vec3& face_normal) const {
  constexpr float kSameSquared = 1e-6F;
  for (std::size_t k = 0; k < faces_of_feature_.size(); ++k) {
    const std::size_t i = first_feature_ + k;
    if ((Vec3(axes_.x[i], axes_.y[i], axes_.z[i]) + face_normal).squaredNorm() < kSameSquared)
      return faces_of_feature_[k][0];
  }
  return -1;
}

float ColumnSat::separation_of_other_features(int face) const {
  constexpr float kMinLowerZ = 0.8F;
  float greatest = -std::numeric_limits<float>::infinity();
  for (std::size_t k = 0; k < faces_of_feature_.size(); ++k) {
    const std::size_t i = first_feature_ + k;
    if (separation_[i] > greatest && i != chosen_ && axes_.z[i] > kMinLowerZ &&
        faces_of_feature_[k][0] != face && faces_of_feature_[k][1] != face)
      greatest = separation_[i];
  }
  return greatest;
}

}  // namespace smartsurf::world
