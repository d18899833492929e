#include "smartsurf/world/field/SkinContacts.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "smartsurf/world/field/SphereManifoldReducer.h"
#include "smartsurf/world/narrowphase/Distance.h"
#include "smartsurf/world/narrowphase/ManifoldReducer.h"
#include "smartsurf/world/narrowphase/SupportFeature.h"

namespace smartsurf::world {
namespace {

using surface::Skin;

// Sine of the angle by which a direction may miss a triangle's plane and still count as in it.
constexpr float kFlatness = 1e-3F;

// The neighbours of a node along the edges of its triangles: row and column steps.
constexpr std::array<std::array<int, 2>, 6> kNeighbours{{{0, 1}, {1, 1}, {1, 0}, {0, -1}, {-1, -1}, {-1, 0}}};

// Nodes [begin, end) of the rectangle that covers a box, in each direction.
struct NodeWindow {
  int row_begin, row_end, column_begin, column_end;

  NodeWindow(const Skin& s, const Vec3& low, const Vec3& high)
      : row_begin(std::clamp(floor_of((s.north - high.y()) / s.spacing_y), 0, s.rows)),
        row_end(std::clamp(floor_of((s.north - low.y()) / s.spacing_y) + 2, 0, s.rows)),
        column_begin(std::clamp(floor_of((low.x() - s.west) / s.spacing_x), 0, s.columns)),
        column_end(std::clamp(floor_of((high.x() - s.west) / s.spacing_x) + 2, 0, s.columns)) {}

 private:
  static int floor_of(float u) { return static_cast<int>(std::floor(std::clamp(u, -1e6F, 1e6F))); }
};

struct Triangle {
  Vec3 a, b, c;  // counter-clockwise from above
  Vec3 normal;   // upward, unit

  Triangle(const Vec3& p, const Vec3& q, const Vec3& r)
      : a(p), b(q), c(r), normal((q - p).cross(r - p).normalized()) {}
  float height_above(const Vec3& p) const { return normal.dot(p - a); }
  // True if the vertical through the point meets the triangle, its border included.
  bool is_under(const Vec3& p) const {
    const auto is_left = [&p](const Vec3& from, const Vec3& to) {
      const float x = to.x() - from.x(), y = to.y() - from.y();
      return x * (p.y() - from.y()) - y * (p.x() - from.x()) >= -1e-5F * (std::abs(x) + std::abs(y));
    };
    return is_left(a, b) && is_left(b, c) && is_left(c, a);
  }
};

// The triangles of the rectangle whose north-west node is (r, c).
Triangle northern_triangle(const Skin& s, int r, int c) {
  return {s.node(r, c), s.node(r + 1, c + 1), s.node(r, c + 1)};
}
Triangle southern_triangle(const Skin& s, int r, int c) {
  return {s.node(r, c), s.node(r + 1, c), s.node(r + 1, c + 1)};
}

float highest_node(const Skin& s, int r, int c) {
  return std::max(std::max(s.height[s.index(r, c)], s.height[s.index(r, c + 1)]),
                  std::max(s.height[s.index(r + 1, c)], s.height[s.index(r + 1, c + 1)]));
}

// True if the node is a local support point of the skin in `direction`.
bool is_extreme(const Skin& s, int r, int c, const Vec3& direction) {
  const Vec3 node = s.node(r, c);
  const float tolerance = kFlatness * std::min(s.spacing_x, s.spacing_y) * direction.norm();
  return std::ranges::all_of(kNeighbours, [&](const auto& step) {
    const int row = r + step[0], column = c + step[1];
    if (row < 0 || column < 0 || row >= s.rows || column >= s.columns) return true;
    return direction.dot(s.node(row, column) - node) <= tolerance;
  });
}

void add_contact(const Skin& s, const Vec3& point, const Vec3& normal, const Vec3& centre, float separation,
                 std::vector<Contact>& out) {
  const Skin::Location at = s.locate(point.x(), point.y());
  const auto nearest = std::max_element(at.weight, at.weight + 3) - at.weight;
  Contact& c = out.emplace_back();
  c.partner = s.is_elastic ? Partner::kElasticSkin : Partner::kSkin;
  c.feature_id = s.cell_of_node[at.node[nearest]];
  c.normal = normal;
  c.anchor = point - centre;
  c.separation = separation;
  c.surface_velocity = {0, 0, at.interpolate(s.speed)};
}

// The points of the skin that are nearest to a sphere's centre among those around them.
class SphereOnSkin {
 public:
  SphereOnSkin(const Skin& skin, const Vec3& centre, float radius, float margin)
      : s_(skin), centre_(centre), radius_(radius), reach_(radius + margin) {}

  void collide(std::vector<Contact>& out) {
    const Vec3 half = Vec3::Constant(reach_);
    const NodeWindow nodes(s_, centre_ - half, centre_ + half);
    for (int r = nodes.row_begin; r < nodes.row_end; ++r)
      for (int c = nodes.column_begin; c < nodes.column_end; ++c) visit_node(r, c);
    if (!is_above_) add_from_below();
    reducer_.reduce([&](const Candidate& k) {
      add_contact(s_, centre_ - (k.separation + radius_) * k.normal, k.normal, centre_, k.separation, out);
      out.back().anchor = -radius_ * k.normal;
    });
  }

 private:
  struct Candidate {
    Vec3 normal;
    float separation;
  };

  // The node, the edges to its east, south and south-east, and the triangles between them.
  void visit_node(int r, int c) {
    const bool has_east = c + 1 < s_.columns, has_south = r + 1 < s_.rows;
    if (has_east && has_south) {
      if (!may_reach(r, c)) return;
      add_face(northern_triangle(s_, r, c));
      add_face(southern_triangle(s_, r, c));
      add_edge(r, c, r + 1, c + 1, {r, c + 1}, {r + 1, c});
    }
    if (has_east) add_edge(r, c, r, c + 1, {r + 1, c + 1}, {r - 1, c});
    if (has_south) add_edge(r, c, r + 1, c, {r + 1, c + 1}, {r, c - 1});
    add_vertex(r, c);
  }

  // False only if no point of a rectangle, its edges and its nodes is within reach.
  bool may_reach(int r, int c) const {
    const float west = s_.west + static_cast<float>(c) * s_.spacing_x,
                north = s_.north - static_cast<float>(r) * s_.spacing_y;
    const float x = centre_.x() - std::clamp(centre_.x(), west, west + s_.spacing_x),
                y = centre_.y() - std::clamp(centre_.y(), north - s_.spacing_y, north);
    const float squared = reach_ * reach_ - x * x - y * y;
    return squared >= 0.0F && highest_node(s_, r, c) >= centre_.z() - std::sqrt(squared);
  }

  void add(const Vec3& normal, float distance) {
    reducer_.add({normal, distance - radius_});
    is_above_ = true;
  }

  void add_face(const Triangle& t) {
    const float distance = t.height_above(centre_);
    if (distance > 0.0F && distance < reach_ && t.is_under(centre_ - distance * t.normal))
      add(t.normal, distance);
  }

  struct Node {
    int row, column;
  };
  void add_edge(int r0, int c0, int r1, int c1, Node one, Node other) {
    const Vec3 from = s_.node(r0, c0), along = s_.node(r1, c1) - from;
    const float fraction = along.dot(centre_ - from) / along.squaredNorm();
    if (!(fraction > 0.0F && fraction < 1.0F)) return;
    const Vec3 foot = from + fraction * along, up = centre_ - foot;
    const float distance = up.norm();
    if (!(up.z() > 0.0F && distance < reach_)) return;
    for (const Node& n : {one, other}) {
      if (n.row < 0 || n.column < 0 || n.row >= s_.rows || n.column >= s_.columns) continue;
      const Vec3 across = s_.node(n.row, n.column) - foot;
      if (up.dot(across) > kFlatness * distance * across.norm()) return;
    }
    add(up / distance, distance);
  }

  void add_vertex(int r, int c) {
    const Vec3 up = centre_ - s_.node(r, c);
    const float distance = up.norm();
    if (up.z() > 0.0F && distance < reach_ && is_extreme(s_, r, c, up)) add(up / distance, distance);
  }

  // The centre may be below the skin: the triangle there pushes the sphere up.
  void add_from_below() {
    if (centre_.x() < s_.west || centre_.x() > s_.east() || centre_.y() < s_.south() ||
        centre_.y() > s_.north)
      return;
    const Eigen::Vector2f slope = s_.slope_at(centre_.x(), centre_.y());
    const Vec3 normal = Vec3(-slope.x(), -slope.y(), 1.0F).normalized();
    const float distance =
        normal.z() * (centre_.z() - s_.locate(centre_.x(), centre_.y()).interpolate(s_.height));
    if (distance <= 0.0F && distance > -radius_) reducer_.add({normal, distance - radius_});
  }

  const Skin& s_;
  const Vec3& centre_;
  const float radius_, reach_;
  bool is_above_ = false;
  SphereManifoldReducer<Candidate> reducer_;
};

void collide_part(const Skin& s, const ConvexPart& part, const Vec3& centre, const Mat3& axes,
                  const Vec3& extent, float margin, std::vector<Contact>& out) {
  const Vec3 low = centre - extent, high = centre + extent;
  const NodeWindow nodes(s, low, high);
  const float deepest = -part.shape.bounding_radius;
  ManifoldReducer candidates;
  Vec3 direction(0, 0, 0);
  SupportFeature feature;
  const auto add_corners = [&](const Triangle& t) {
    if (t.normal != direction) {
      direction = t.normal;
      feature = support_feature(part, centre, axes, -direction);
    }
    for (int i = 0; i < feature.count; ++i) {
      const Vec3& p = feature.point[i];
      const float separation = t.height_above(p);
      if (separation <= margin && separation > deepest && t.is_under(p))
        candidates.add({p, t.normal, separation, 0});
    }
  };
  for (int r = nodes.row_begin; r < nodes.row_end; ++r)
    for (int c = nodes.column_begin; c < nodes.column_end; ++c) {
      if (r + 1 < s.rows && c + 1 < s.columns && highest_node(s, r, c) >= low.z()) {
        add_corners(northern_triangle(s, r, c));
        add_corners(southern_triangle(s, r, c));
      }
      const Vec3 node = s.node(r, c);
      if ((node.array() < low.array()).any() || (node.array() > high.array()).any()) continue;
      const SignedDistance d = signed_distance(part, axes.transpose() * (node - centre), margin);
      if (d.distance > margin || d.distance <= deepest) continue;
      const Vec3 normal = axes * -d.normal;
      if (normal.z() > 0.0F && is_extreme(s, r, c, normal)) candidates.add({node, normal, d.distance, 0});
    }
  candidates.reduce(
      [&](const ManifoldCandidate& c) { add_contact(s, c.point, c.normal, centre, c.separation, out); });
}

}  // namespace

void collide_with_skin(const Skin& skin, const Shape& shape, const Vec3& centre, const Mat3& axes,
                       float margin, std::vector<Contact>& out) {
  if (shape.is_sphere()) return SphereOnSkin(skin, centre, shape.radius, margin).collide(out);
  const Vec3 extent = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  for_each_part(shape,
                [&](const ConvexPart& part) { collide_part(skin, part, centre, axes, extent, margin, out); });
}

}  // namespace smartsurf::world
