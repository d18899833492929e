#include "smartsurf/mesh/ConvexParts.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "smartsurf/mesh/Hull.h"
#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/mesh/Part.h"

namespace smartsurf::mesh {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double kConcaveAngle = std::numbers::pi / 6.0;  // gentler edges are taken for a round surface
constexpr std::size_t kMostFeatures = 256, kMostFeaturesTried = 24;
constexpr int kSlices = 8;  // evenly spaced planes divide a part into so many
// Of the part's excess, what the best cut must save to be taken for its saving.
constexpr double kLeastSaving = 0.01;

struct Feature {
  Plane plane;
  double weight;  // length of its concave edges times their angle
};

// The faces' planes along the concave edges, the most weighty first.
class Features {
 public:
  explicit Features(const TriangleMesh& mesh) : mesh_(mesh), distance_(1e-5 * diagonal(mesh)) {
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> triangle_of;  // by directed edge
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
      for (std::size_t i = 0; i < 3; ++i)
        triangle_of[{mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3]}] = t;
    for (const auto& [edge, triangle] : triangle_of) {
      const auto other = triangle_of.find({edge[1], edge[0]});
      if (other != triangle_of.end() && edge[0] < edge[1]) add(edge, triangle, other->second);
    }
    std::stable_sort(found_.begin(), found_.end(),
                     [](const Feature& a, const Feature& b) { return a.weight > b.weight; });
  }
  const std::vector<Feature>& found() const { return found_; }

 private:
  std::optional<Plane> plane_of(std::uint32_t triangle) const {
    const auto& t = mesh_.triangles[triangle];
    const Eigen::Vector3d a = mesh_.points[t[0]];
    const Eigen::Vector3d normal = (mesh_.points[t[1]] - a).cross(mesh_.points[t[2]] - a);
    if (!(normal.norm() > distance_ * distance_)) return std::nullopt;
    return Plane{normal.normalized(), normal.normalized().dot(a)};
  }

  void add(const std::array<std::uint32_t, 2>& edge, std::uint32_t first, std::uint32_t second) {
    const auto a = plane_of(first), b = plane_of(second);
    if (!a || !b) return;
    const double angle = std::acos(std::clamp(a->normal.dot(b->normal), -1.0, 1.0));
    double above = 0.0;  // of the other triangle's tip over this one: concave
    for (const std::uint32_t p : mesh_.triangles[second]) above = std::max(above, a->height(mesh_.points[p]));
    if (angle < kConcaveAngle || above <= distance_) return;
    const double weight = angle * (mesh_.points[edge[0]] - mesh_.points[edge[1]]).norm();
    add(*a, weight);
    add(*b, weight);
  }

  void add(const Plane& plane, double weight) {
    for (Feature& known : found_)
      for (const Plane& same : {known.plane, known.plane.turned()})
        if ((same.normal - plane.normal).norm() < 1e-4 && std::abs(same.offset - plane.offset) < distance_) {
          known.weight += weight;
          return;
        }
    if (found_.size() < kMostFeatures) found_.push_back({plane, weight});
  }

  const TriangleMesh& mesh_;
  double distance_;
  std::vector<Feature> found_;
};

struct Piece {
  Part part;
  Points points;
  double hull, excess;
  bool final = false;  // no plane cuts it
};

Piece piece_of(Part part) {
  Points points = part.points();
  const double hull = hull_volume(points), excess = hull - part.volume();
  return {std::move(part), std::move(points), hull, excess};
}

// Whether points lie on both sides, so far away that neither is a sliver.
bool divides(const Plane& plane, const Points& points, double margin) {
  double lowest = INFINITY, highest = -INFINITY;
  for (const Eigen::Vector3d& p : points) {
    lowest = std::min(lowest, plane.height(p));
    highest = std::max(highest, plane.height(p));
  }
  return lowest < -margin && highest > margin;
}

std::vector<Plane> features_through(const Piece& piece, const Features& features, double margin) {
  std::vector<Plane> planes;
  for (const Feature& feature : features.found())
    if (planes.size() < kMostFeaturesTried && divides(feature.plane, piece.points, margin))
      planes.push_back(feature.plane);
  return planes;
}

std::vector<Plane> slices(const Piece& piece) {
  Eigen::Vector3d low = piece.points.front(), high = low;
  for (const Eigen::Vector3d& p : piece.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  std::vector<Plane> planes;
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 1; i < kSlices; ++i)
      planes.push_back({Eigen::Vector3d::Unit(axis), low[axis] + (high[axis] - low[axis]) * i / kSlices});
  return planes;
}

struct Choice {
  Plane plane;
  double hulls = INFINITY;  // of both sides together
};

Choice best_of(const std::vector<Plane>& planes, const Piece& piece, Choice best) {
  for (const Plane& plane : planes) {
    const double below = hull_volume(piece.part.points_below(plane));
    if (below >= best.hulls) continue;
    const double hulls = below + hull_volume(piece.part.points_below(plane.turned()));
    if (hulls < best.hulls) best = {plane, hulls};
  }
  return best;
}

Plane middle(const Piece& piece) {
  const std::vector<Plane> all = slices(piece);
  std::size_t longest = 0;
  double most = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t first = axis * (kSlices - 1);
    const double length = all[first + 1].offset - all[first].offset;
    if (length > most) most = length, longest = first;
  }
  return all[longest + kSlices / 2 - 1];
}

// None when no plane makes two parts with volume.
std::optional<std::pair<Piece, Piece>> divide(const Piece& piece, const Features& features, double margin) {
  const std::vector<Plane> along_faces = features_through(piece, features, margin);
  Choice best = best_of(along_faces, piece, {});
  // A cut along the faces that leaves next to nothing needs no comparison.
  if (!(piece.hull - best.hulls > 0.9 * piece.excess)) best = best_of(slices(piece), piece, best);
  // Around a cavity the first cuts save nothing yet.
  if (!(piece.hull - best.hulls > kLeastSaving * piece.excess))
    best.plane = along_faces.empty() ? middle(piece) : along_faces.front();
  const Plane& plane = best.plane;
  std::pair<Piece, Piece> halves{piece_of(piece.part.below(plane)),
                                 piece_of(piece.part.below(plane.turned()))};
  if (halves.first.points.size() < 4 || halves.second.points.size() < 4) return std::nullopt;
  return halves;
}

// Joins pairs whose common hull is hardly larger than their two, the best first.
void join_neighbours(std::vector<Points>& parts, double allowed) {
  std::vector<double> hull;
  for (const Points& part : parts) hull.push_back(hull_volume(part));
  const auto joined = [&](std::size_t i, std::size_t j) {
    Points both = parts[i];
    both.insert(both.end(), parts[j].begin(), parts[j].end());
    return both;
  };
  std::map<std::pair<std::size_t, std::size_t>, double> growth;
  const auto measure = [&](std::size_t i, std::size_t j) {
    growth[std::minmax(i, j)] = hull_volume(joined(i, j)) - hull[i] - hull[j];
  };
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) measure(i, j);
  while (!growth.empty()) {
    const auto best = std::min_element(growth.begin(), growth.end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    if (best->second > allowed) break;
    allowed -= std::max(0.0, best->second);
    const auto [i, j] = best->first;
    parts[i] = joined(i, j);
    hull[i] = hull_volume(parts[i]);
    parts[j].clear();
    std::erase_if(growth, [j = j](const auto& g) { return g.first.first == j || g.first.second == j; });
    for (std::size_t k = 0; k < parts.size(); ++k)
      if (k != i && !parts[k].empty()) measure(i, k);
  }
  std::erase_if(parts, [](const Points& part) { return part.empty(); });
}

}  // namespace

std::vector<Points> convex_parts(const TriangleMesh& mesh, const PartLimits& limits) {
  const double margin = 1e-4 * diagonal(mesh);
  const Features features(mesh);
  std::vector<Piece> pieces;
  pieces.push_back(piece_of(Part(mesh)));
  const double allowed = limits.excess * (pieces[0].hull - pieces[0].excess);
  const auto excess = [&] {
    double sum = 0.0;
    for (const Piece& piece : pieces) sum += std::max(0.0, piece.excess);
    return sum;
  };
  while (static_cast<int>(pieces.size()) < limits.parts && excess() > allowed) {
    const auto worst = std::max_element(pieces.begin(), pieces.end(), [](const Piece& a, const Piece& b) {
      return (a.final ? -1.0 : a.excess) < (b.final ? -1.0 : b.excess);
    });
    if (worst->final || !(worst->excess > 0.0)) break;
    auto halves = divide(*worst, features, margin);
    if (!halves) {
      worst->final = true;
      continue;
    }
    *worst = std::move(halves->first);
    pieces.push_back(std::move(halves->second));
  }
  std::vector<Points> parts;
  for (Piece& piece : pieces) parts.push_back(std::move(piece.points));
  join_neighbours(parts, std::max(0.0, allowed - excess()) + 1e-6 * allowed);
  return parts;
}

}  // namespace smartsurf::mesh
