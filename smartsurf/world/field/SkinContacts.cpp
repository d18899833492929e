#include "smartsurf/world/field/SkinContacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

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

// ---- nodes of an elastic skin inside a body, which keep it from passing between the contacts that are found
// on its surface

// How far nodes may reach into the body without a contact, u.
constexpr float kNodeAllowance = 0.01F;
// Least vertical component of a normal: beyond, the way out is straight up.
constexpr float kSteepest = 0.2F;

// Calls visit(node) for nodes in a box, at most about kMaxSamples: every n-th row and column, whatever lies
// on them.
template <class Visit>
void for_each_sampled_node(const Skin& s, const Vec3& low, const Vec3& high, Visit visit) {
  constexpr float kMaxSamples = 36.0F;
  const float across = (high.x() - low.x()) / s.spacing_x + 1.0F,
              along = (high.y() - low.y()) / s.spacing_y + 1.0F;
  const int stride = std::max(1, static_cast<int>(std::ceil(std::sqrt(across * along / kMaxSamples))));
  const NodeWindow nodes(s, low, high);
  const auto first = [stride](int i) { return (i + stride - 1) / stride * stride; };
  for (int r = first(nodes.row_begin); r < nodes.row_end; r += stride)
    for (int c = first(nodes.column_begin); c < nodes.column_end; c += stride) {
      const Vec3 node = s.node(r, c);
      if (node.z() >= low.z() && node.z() <= high.z()) visit(node);
    }
}

void add_sunken_node(const Skin& s, const Vec3& node, const Vec3& normal, float distance, const Vec3& centre,
                     std::vector<Contact>& out) {
  if (distance > -0.5F * kNodeAllowance) return;
  add_contact(s, node, normal.z() > kSteepest ? normal : Vec3::UnitZ(), centre, distance + kNodeAllowance,
              out);
}

// The points of the skin that are nearest to a sphere's centre among those around them.
class SphereOnSkin {
 public:
  SphereOnSkin(const Skin& skin, const Vec3& centre, float radius, float margin)
      : s_(skin), centre_(centre), radius_(radius), reach_(radius + margin) {}

  void collide(std::vector<Contact>& out) {
    find([&](const Vec3& normal, float separation) {
      add_contact(s_, centre_ - (separation + radius_) * normal, normal, centre_, separation, out);
      out.back().anchor = -radius_ * normal;
    });
    if (!s_.is_elastic) return;
    const Vec3 half = Vec3::Constant(radius_);
    for_each_sampled_node(s_, centre_ - half, centre_ + half, [&](const Vec3& node) {
      const Vec3 up = centre_ - node;
      const float distance = up.norm();
      add_sunken_node(s_, node, up / std::max(distance, 1e-6F), distance - radius_, centre_, out);
    });
  }

  // Calls take(normal, separation) for each point.
  template <class Take>
  void find(Take take) {
    const Vec3 half = Vec3::Constant(reach_);
    const NodeWindow nodes(s_, centre_ - half, centre_ + half);
    for (int r = nodes.row_begin; r < nodes.row_end; ++r)
      for (int c = nodes.column_begin; c < nodes.column_end; ++c) visit_node(r, c);
    if (!is_above_) add_from_below();
    reducer_.reduce([&](const Candidate& k) { take(k.normal, k.separation); });
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

// Collides one convex part of a body: its corners and rims with the triangles under them, and the nodes of
// the skin with it.
class PartOnSkin {
 public:
  PartOnSkin(const Skin& skin, const ConvexPart& part, const Vec3& centre, const Mat3& axes,
             const Vec3& extent, float margin)
      : s_(skin),
        part_(part),
        centre_(centre),
        axes_(axes),
        low_(centre - extent),
        high_(centre + extent),
        margin_(margin),
        deepest_(-2.0F * part.shape.bounding_radius) {}

  void collide(std::vector<Contact>& out) {
    candidates_.clear();
    add_features();
    const auto take = [&](const ManifoldCandidate& c) {
      add_contact(s_, c.point, c.normal, centre_, c.separation, out);
    };
    ManifoldReducer reducer;
    if (s_.is_elastic)
      take_outermost(take);
    else
      for (const ManifoldCandidate& c : candidates_) reducer.add(c);
    add_nodes(reducer);
    reducer.reduce(take);
    if (!s_.is_elastic) return;
    for_each_sampled_node(s_, low_, high_, [&](const Vec3& node) {
      const SignedDistance d = signed_distance(part_, axes_.transpose() * (node - centre_), 0.0F);
      add_sunken_node(s_, node, axes_ * -d.normal, d.distance, centre_, out);
    });
  }

 private:
  static constexpr int kRimSamples = 16;

  void add_features() {
    const Shape& shape = part_.shape;
    const float end = std::max(0.0F, shape.high - shape.radius);
    switch (shape.kind) {
      case scene::ShapeKind::kSphere:
        return add_ball(0.0F);
      case scene::ShapeKind::kCapsule:
        add_ball(-end), add_ball(end);
        return;
      case scene::ShapeKind::kBox:
        for (int i = 0; i < 8; ++i)
          add_local(shape.half_extents.cwiseProduct(
              Vec3(i & 1 ? 1.0F : -1.0F, i & 2 ? 1.0F : -1.0F, i & 4 ? 1.0F : -1.0F)));
        return;
      case scene::ShapeKind::kCylinder:
        add_rim(shape.low), add_rim(shape.high);
        return;
      case scene::ShapeKind::kCone:
        add_rim(shape.low);
        add_local({0, 0, shape.high});
        return;
      case scene::ShapeKind::kSolid:
        for (const Vec3& corner : part_.hull->hull->vertices) add_local(corner);
        return;
    }
  }

  void add_local(const Vec3& p) { add_point(centre_ + axes_ * p); }

  // Calls each(triangle) for the triangles over or under a point: several on their borders.
  template <class Each>
  void for_each_triangle(const Vec3& p, Each each) const {
    const float u = (p.x() - s_.west) / s_.spacing_x, v = (s_.north - p.y()) / s_.spacing_y;
    constexpr float kBorder = 1e-4F;
    const auto first = [](float w) {
      return static_cast<int>(std::floor(std::clamp(w - kBorder, -1e6F, 1e6F)));
    };
    const auto last = [](float w) {
      return static_cast<int>(std::floor(std::clamp(w + kBorder, -1e6F, 1e6F)));
    };
    for (int r = std::max(0, first(v)); r <= std::min(s_.rows - 2, last(v)); ++r)
      for (int c = std::max(0, first(u)); c <= std::min(s_.columns - 2, last(u)); ++c)
        for (const Triangle& t : {northern_triangle(s_, r, c), southern_triangle(s_, r, c)})
          if (t.is_under(p)) each(t);
  }

  void add_point(const Vec3& p, float limit = std::numeric_limits<float>::infinity()) {
    for_each_triangle(p, [&](const Triangle& t) {
      const float separation = t.height_above(p);
      if (separation <= std::min(margin_, limit) && separation > deepest_)
        candidates_.push_back({p, t.normal, separation, 0});
    });
  }

  // A circle of the part: points that are fixed in the body, so that a body at rest keeps its contacts, and
  // the point that is deepest in the triangles under it, where the two are not parallel. What rolls touches
  // with that one.
  void add_rim(float z) {
    const Vec3 axis = axes_.col(2), middle = centre_ + z * axis;
    const float radius = part_.shape.radius;
    Vec3 normal = Vec3::UnitZ();
    float least = std::numeric_limits<float>::infinity();
    std::array<Vec3, kRimSamples> rim;
    for (int i = 0; i < kRimSamples; ++i) {
      const float angle = static_cast<float>(i) * (2.0F * std::numbers::pi_v<float> / kRimSamples);
      rim[i] = middle + radius * (std::cos(angle) * axes_.col(0) + std::sin(angle) * axes_.col(1));
      for_each_triangle(rim[i], [&](const Triangle& t) {
        if (const float separation = t.height_above(rim[i]); separation < least)
          least = separation, normal = t.normal;
      });
    }
    const bool is_flat = std::abs(axis.dot(normal)) > kFaceAlignment;
    for (const Vec3& p : rim) add_point(p, is_flat ? margin_ : 0.0F);
    constexpr float kParallel = 0.02F;
    Vec3 deepest = middle;
    for (int i = 0; i < 3; ++i) {
      const Vec3 down = axis * axis.dot(normal) - normal;
      const float across = down.norm();
      if (across < kParallel) return;
      deepest = middle + (radius / across) * down;
      for_each_triangle(deepest, [&](const Triangle& t) { normal = t.normal; });
    }
    add_point(deepest);
  }

  // The end of a capsule.
  void add_ball(float z) {
    const Vec3 middle = centre_ + z * axes_.col(2);
    SphereOnSkin(s_, middle, part_.shape.radius, margin_).find([&](const Vec3& normal, float separation) {
      candidates_.push_back({middle - part_.shape.radius * normal, normal, separation, 0});
    });
  }

  // The nodes that reach into the body farther than those around them; of an elastic skin those on supports.
  void add_nodes(ManifoldReducer& reducer) const {
    const NodeWindow nodes(s_, low_, high_);
    for (int r = nodes.row_begin; r < nodes.row_end; ++r)
      for (int c = nodes.column_begin; c < nodes.column_end; ++c) {
        const Vec3 node = s_.node(r, c);
        if ((node.array() < low_.array()).any() || (node.array() > high_.array()).any()) continue;
        if (s_.is_elastic && !std::isfinite(s_.support_height[s_.index(r, c)])) continue;
        const SignedDistance d = signed_distance(part_, axes_.transpose() * (node - centre_), margin_);
        if (d.distance > margin_ || d.distance <= deepest_) continue;
        const Vec3 normal = axes_ * -d.normal;
        if (normal.z() > 0.0F && is_extreme(s_, r, c, normal)) reducer.add({node, normal, d.distance, 0});
      }
  }

  // An elastic skin answers to each contact by a dip, so the body needs many of them, and always the same:
  // the outermost in directions that are fixed in it.
  template <class Take>
  void take_outermost(Take take) const {
    thread_local std::vector<std::size_t> chosen;
    chosen.clear();
    const auto choose = [&](auto measure) {
      std::size_t best = 0;
      for (std::size_t i = 1; i < candidates_.size(); ++i)
        if (measure(candidates_[i]) > measure(candidates_[best]) + kSameMeasure) best = i;
      if (std::ranges::find(chosen, best) == chosen.end()) chosen.push_back(best);
    };
    if (candidates_.empty()) return;
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          if (x != 0 || y != 0 || z != 0) {
            const Vec3 direction =
                axes_ * Vec3(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
            choose([&](const ManifoldCandidate& c) { return direction.dot(c.point - centre_); });
          }
    choose([](const ManifoldCandidate& c) { return -c.separation; });
    for (const std::size_t i : chosen) take(candidates_[i]);
  }

  static constexpr float kSameMeasure = 1e-3F;  // u

  const Skin& s_;
  const ConvexPart& part_;
  const Vec3& centre_;
  const Mat3& axes_;
  const Vec3 low_, high_;
  const float margin_, deepest_;
  std::vector<ManifoldCandidate>& candidates_ = reused_candidates();

  static std::vector<ManifoldCandidate>& reused_candidates() {
    thread_local std::vector<ManifoldCandidate> candidates;
    return candidates;
  }
};

}  // namespace

void collide_with_skin(const Skin& skin, const Shape& shape, const Vec3& centre, const Mat3& axes,
                       float margin, std::vector<Contact>& out) {
  if (shape.is_sphere()) return SphereOnSkin(skin, centre, shape.radius, margin).collide(out);
  const Vec3 extent = Vec3(axes.cwiseAbs() * shape.half_extents) + Vec3::Constant(margin);
  for_each_part(shape, [&](const ConvexPart& part) {
    PartOnSkin(skin, part, centre, axes, extent, margin).collide(out);
  });
}

}  // namespace smartsurf::world
