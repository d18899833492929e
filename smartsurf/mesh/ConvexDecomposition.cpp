#include "smartsurf/mesh/ConvexDecomposition.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

#include "smartsurf/mesh/ClippedMesh.h"
#include "smartsurf/mesh/ConvexHull.h"
#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/mesh/MeshSimplification.h"
#include "smartsurf/scene/Axes.h"

namespace smartsurf::mesh {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double kMinConcaveAngle = std::numbers::pi / 6.0;  // smaller angles belong to round surfaces
constexpr std::size_t kMaxCutPlanes = 256, kMaxCutPlanesTried = 24;
constexpr int kSlicesPerAxis = 8;
// The best cut must remove at least this fraction of the part's excess volume; otherwise a fallback is used.
constexpr double kMinSaving = 0.01;
// A solid whose hulls exceed it by more than this fraction is taken for a hollow one.
constexpr double kHollowExcess = 0.1;
// The excess that the hulls of a hollow solid may have before, and after parts are merged.
constexpr double kHollowGoal = 0.05, kHollowMergedGoal = 0.065;
constexpr std::size_t kMaxHollowCutPlanes = 6;

struct CutPlane {
  Plane plane;
  double weight;  // sum of length × angle over its concave edges
};

// The planes of the faces at concave edges, sorted by descending weight.
class CutPlanes {
 public:
  explicit CutPlanes(const TriangleMesh& mesh) : mesh_(mesh), tolerance_(1e-5 * bounding_box_diagonal(mesh)) {
    std::map<std::array<std::uint32_t, 2>, std::uint32_t> triangle_of;  // by directed edge
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
      for (std::size_t i = 0; i < 3; ++i)
        triangle_of[{mesh.triangles[t][i], mesh.triangles[t][(i + 1) % 3]}] = t;
    for (const auto& [edge, triangle] : triangle_of) {
      const auto other = triangle_of.find({edge[1], edge[0]});
      if (other != triangle_of.end() && edge[0] < edge[1]) add(edge, triangle, other->second);
    }
    std::stable_sort(planes_.begin(), planes_.end(),
                     [](const CutPlane& a, const CutPlane& b) { return a.weight > b.weight; });
  }
  const std::vector<CutPlane>& planes() const { return planes_; }

 private:
  std::optional<Plane> plane_of(std::uint32_t triangle) const {
    const auto& t = mesh_.triangles[triangle];
    const Eigen::Vector3d a = mesh_.points[t[0]];
    const Eigen::Vector3d normal = (mesh_.points[t[1]] - a).cross(mesh_.points[t[2]] - a);
    if (!(normal.norm() > tolerance_ * tolerance_)) return std::nullopt;
    return Plane{normal.normalized(), normal.normalized().dot(a)};
  }

  void add(const std::array<std::uint32_t, 2>& edge, std::uint32_t first, std::uint32_t second) {
    const auto a = plane_of(first), b = plane_of(second);
    if (!a || !b) return;
    const double angle = std::acos(std::clamp(a->normal.dot(b->normal), -1.0, 1.0));
    double above = 0.0;  // height of the second triangle's apex above the first; positive = concave
    for (const std::uint32_t p : mesh_.triangles[second])
      above = std::max(above, a->signed_distance(mesh_.points[p]));
    if (angle < kMinConcaveAngle || above <= tolerance_) return;
    const double weight = angle * (mesh_.points[edge[0]] - mesh_.points[edge[1]]).norm();
    add(*a, weight);
    add(*b, weight);
  }

  void add(const Plane& plane, double weight) {
    for (CutPlane& known : planes_)
      for (const Plane& same : {known.plane, known.plane.flipped()})
        if ((same.normal - plane.normal).norm() < 1e-4 && std::abs(same.offset - plane.offset) < tolerance_) {
          known.weight += weight;
          return;
        }
    if (planes_.size() < kMaxCutPlanes) planes_.push_back({plane, weight});
  }

  const TriangleMesh& mesh_;
  double tolerance_;
  std::vector<CutPlane> planes_;
};

struct DecompositionPart {
  ClippedMesh mesh;
  Points points;
  double hull_volume, excess_volume;
  std::size_t body = 0;      // the one of several solids that it is a part of
  bool indivisible = false;  // no plane splits it into two solids
};

DecompositionPart make_part(ClippedMesh mesh, std::size_t body = 0) {
  Points points = mesh.hull_points();
  const double volume_of_hull = hull_volume(points), excess = volume_of_hull - mesh.volume();
  return {std::move(mesh), std::move(points), volume_of_hull, excess, body};
}

double total_excess(const std::vector<DecompositionPart>& parts) {
  double sum = 0.0;
  for (const DecompositionPart& part : parts) sum += std::max(0.0, part.excess_volume);
  return sum;
}

using Halves = std::optional<std::pair<DecompositionPart, DecompositionPart>>;

// Nullopt if the plane does not make two parts with volume.
Halves cut(const DecompositionPart& part, const Plane& plane) {
  std::pair<DecompositionPart, DecompositionPart> halves{
      make_part(part.mesh.clip_below(plane), part.body),
      make_part(part.mesh.clip_below(plane.flipped()), part.body)};
  if (halves.first.points.size() < 4 || halves.second.points.size() < 4) return std::nullopt;
  return halves;
}

// Splits the part with the largest excess until all together exceed the solid by at most `allowed`.
template <class Split>
void refine(std::vector<DecompositionPart>& parts, double allowed, int max_parts, const Split& split) {
  while (static_cast<int>(parts.size()) < max_parts && total_excess(parts) > allowed) {
    const auto worst = std::max_element(
        parts.begin(), parts.end(), [](const DecompositionPart& a, const DecompositionPart& b) {
          return (a.indivisible ? -1.0 : a.excess_volume) < (b.indivisible ? -1.0 : b.excess_volume);
        });
    if (worst->indivisible || !(worst->excess_volume > 0.0)) break;
    Halves halves = split(*worst);
    if (!halves) {
      worst->indivisible = true;
      continue;
    }
    *worst = std::move(halves->first);
    parts.push_back(std::move(halves->second));
  }
}

// True if the plane has points on both sides at a distance above `margin`, so that neither side is a sliver.
bool splits(const Plane& plane, const Points& points, double margin) {
  double lowest = INFINITY, highest = -INFINITY;
  for (const Eigen::Vector3d& p : points) {
    lowest = std::min(lowest, plane.signed_distance(p));
    highest = std::max(highest, plane.signed_distance(p));
  }
  return lowest < -margin && highest > margin;
}

std::vector<Plane> cut_planes_through(const DecompositionPart& part, const CutPlanes& cut_planes,
                                      double margin, std::size_t most = kMaxCutPlanesTried) {
  std::vector<Plane> planes;
  for (const CutPlane& cut_plane : cut_planes.planes())
    if (planes.size() < most && splits(cut_plane.plane, part.points, margin))
      planes.push_back(cut_plane.plane);
  return planes;
}

std::vector<Plane> axis_slices(const DecompositionPart& part) {
  Eigen::Vector3d low = part.points.front(), high = low;
  for (const Eigen::Vector3d& p : part.points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  std::vector<Plane> planes;
  for (int axis = 0; axis < 3; ++axis)
    for (int i = 1; i < kSlicesPerAxis; ++i)
      planes.push_back(
          {Eigen::Vector3d::Unit(axis), low[axis] + (high[axis] - low[axis]) * i / kSlicesPerAxis});
  return planes;
}

struct BestCut {
  Plane plane;
  double total_hull_volume = INFINITY;  // of both sides
};

BestCut best_cut(const std::vector<Plane>& planes, const DecompositionPart& part, BestCut best) {
  for (const Plane& plane : planes) {
    const double below = hull_volume(part.mesh.hull_points_below(plane));
    if (below >= best.total_hull_volume) continue;
    const double total = below + hull_volume(part.mesh.hull_points_below(plane.flipped()));
    if (total < best.total_hull_volume) best = {plane, total};
  }
  return best;
}

Plane middle_slice(const DecompositionPart& part) {
  const std::vector<Plane> all = axis_slices(part);
  std::size_t longest = 0;
  double most = 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t first = axis * (kSlicesPerAxis - 1);
    const double length = all[first + 1].offset - all[first].offset;
    if (length > most) most = length, longest = first;
  }
  return all[longest + kSlicesPerAxis / 2 - 1];
}

Halves split(const DecompositionPart& part, const CutPlanes& cut_planes, double margin) {
  const std::vector<Plane> along_faces = cut_planes_through(part, cut_planes, margin);
  BestCut best = best_cut(along_faces, part, {});
  // Skip the slices if a cut along a face removes almost all of the excess.
  if (!(part.hull_volume - best.total_hull_volume > 0.9 * part.excess_volume))
    best = best_cut(axis_slices(part), part, best);
  // The first cuts around a cavity do not reduce the excess yet, so cut anyway.
  if (!(part.hull_volume - best.total_hull_volume > kMinSaving * part.excess_volume))
    best.plane = along_faces.empty() ? middle_slice(part) : along_faces.front();
  return cut(part, best.plane);
}

// Planes across the principal axes of the part's surface, through its centre and through its middle, the
// longest axis last. They halve arcs and bowls, however these lie.
std::vector<Plane> principal_planes(const DecompositionPart& part, double margin) {
  double area = 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (const ClippedMesh::Triangle& t : part.mesh.surface()) {
    const Eigen::Vector3d a = t[0] - part.points[0], b = t[1] - part.points[0], c = t[2] - part.points[0],
                          sum = a + b + c;
    const double weight = (b - a).cross(c - a).norm();
    area += weight;
    centre += weight * sum / 3.0;
    spread +=
        weight / 12.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (!(area > 0.0)) return {};
  centre /= area;
  spread = spread / area - centre * centre.transpose();
  centre += part.points[0];
  const Eigen::Matrix3d axes = scene::principal_axes(spread).axes;
  std::vector<Plane> planes;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d normal = axes.col(axis);
    double low = INFINITY, high = -INFINITY;
    for (const Eigen::Vector3d& p : part.points) {
      low = std::min(low, normal.dot(p));
      high = std::max(high, normal.dot(p));
    }
    const double middle = 0.5 * (low + high), mean = normal.dot(centre);
    planes.push_back({normal, middle});
    if (std::abs(mean - middle) > 0.02 * (high - low)) planes.push_back({normal, mean});
  }
  std::erase_if(planes, [&](const Plane& plane) { return !splits(plane, part.points, margin); });
  return planes;
}

// The plane after which the best cuts of both halves leave the least hull volume.
BestCut best_after_next_cut(const std::vector<Plane>& planes, const DecompositionPart& part, double margin) {
  BestCut best;
  for (const Plane& plane : planes) {
    const Halves halves = cut(part, plane);
    if (!halves) continue;
    double total = 0.0;
    for (const DecompositionPart* half : {&halves->first, &halves->second})
      total +=
          std::min(half->hull_volume, best_cut(principal_planes(*half, margin), *half, {}).total_hull_volume);
    if (total < best.total_hull_volume) best = {plane, total};
  }
  return best;
}

// False if a point of the part is missing in its hull, which is then smaller than the part.
bool is_covered(const DecompositionPart& part) { return part.excess_volume > -1e-6 * part.hull_volume; }

// Halves a hollow part.
Halves halve(const DecompositionPart& part, const CutPlanes& cut_planes, double margin) {
  const std::vector<Plane> principal = principal_planes(part, margin);
  std::vector<Plane> planes = cut_planes_through(part, cut_planes, margin, kMaxHollowCutPlanes);
  planes.insert(planes.end(), principal.begin(), principal.end());
  const auto saves = [&](const BestCut& best) {
    return part.hull_volume - best.total_hull_volume > kMinSaving * part.excess_volume;
  };
  bool looked_ahead = false;
  while (!planes.empty()) {
    BestCut best = best_cut(planes, part, {});
    // The first cuts through a tube or a bowl save nothing yet.
    if (!saves(best) && !std::exchange(looked_ahead, true))
      best = best_after_next_cut(principal, part, margin);
    if (!saves(best)) best.plane = planes.back();
    Halves halves = cut(part, best.plane);
    if (halves && is_covered(halves->first) && is_covered(halves->second)) return halves;
    std::erase_if(planes, [&](const Plane& plane) {
      return plane.normal == best.plane.normal && plane.offset == best.plane.offset;
    });
  }
  return std::nullopt;
}

// The shells that lie outside each other, each with the cavities in it.
std::vector<TriangleMesh> separate_bodies(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> shell(mesh.points.size());
  std::iota(shell.begin(), shell.end(), 0U);
  const auto root = [&](std::uint32_t p) {
    while (shell[p] != p) p = shell[p] = shell[shell[p]];
    return p;
  };
  for (const auto& t : mesh.triangles)
    for (const std::size_t i : {1, 2}) shell[root(t[i])] = root(t[0]);
  std::map<std::uint32_t, TriangleMesh> shells;
  std::vector<std::uint32_t> index(mesh.points.size());
  for (std::uint32_t p = 0; p < mesh.points.size(); ++p) {
    TriangleMesh& own = shells[root(p)];
    index[p] = static_cast<std::uint32_t>(own.points.size());
    own.points.push_back(mesh.points[p]);
  }
  for (const auto& t : mesh.triangles)
    shells[root(t[0])].triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
  struct Body {
    TriangleMesh mesh;
    double volume;
  };
  std::vector<Body> bodies;
  std::vector<TriangleMesh> cavities;
  for (auto& [first, one] : shells) {
    MassProperties properties;
    properties.add(one);
    if (properties.volume() > 0.0)
      bodies.push_back({std::move(one), properties.volume()});
    else
      cavities.push_back(std::move(one));
  }
  std::vector<TriangleMesh> joined;
  for (const Body& body : bodies) joined.push_back(body.mesh);
  for (const TriangleMesh& cavity : cavities) {
    std::optional<std::size_t> around;
    for (std::size_t i = 0; i < bodies.size(); ++i)
      if (winding_number(bodies[i].mesh, cavity.points[0]) > 0.5 &&
          (!around || bodies[i].volume < bodies[*around].volume))
        around = i;
    TriangleMesh& to = joined[around.value_or(0)];
    const auto first = static_cast<std::uint32_t>(to.points.size());
    to.points.insert(to.points.end(), cavity.points.begin(), cavity.points.end());
    for (const auto& t : cavity.triangles) to.triangles.push_back({first + t[0], first + t[1], first + t[2]});
  }
  return joined;
}

// Merges pairs of parts in order of the volume that their common hull adds, while the total stays within
// `allowed`. touching: only pairs whose bounding boxes touch.
void merge_parts(std::vector<Points>& parts, double allowed, bool touching = false) {
  const auto box_of = [](const Points& points) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : points) box.extend(p);
    return box;
  };
  std::vector<double> hull;
  for (const Points& part : parts) hull.push_back(hull_volume(part));
  const auto merged_points = [&](std::size_t i, std::size_t j) {
    Points both = parts[i];
    both.insert(both.end(), parts[j].begin(), parts[j].end());
    return both;
  };
  std::map<std::pair<std::size_t, std::size_t>, double> growth;
  const auto update_growth = [&](std::size_t i, std::size_t j) {
    if (touching) {
      const Eigen::AlignedBox3d a = box_of(parts[i]), b = box_of(parts[j]);
      if (a.exteriorDistance(b) > 1e-4 * a.diagonal().norm()) return;
    }
    growth[std::minmax(i, j)] = hull_volume(merged_points(i, j)) - hull[i] - hull[j];
  };
  for (std::size_t i = 0; i < parts.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) update_growth(i, j);
  while (!growth.empty()) {
    const auto best = std::min_element(growth.begin(), growth.end(),
                                       [](const auto& a, const auto& b) { return a.second < b.second; });
    if (best->second > allowed) break;
    allowed -= std::max(0.0, best->second);
    const auto [i, j] = best->first;
    parts[i] = merged_points(i, j);
    hull[i] = hull_volume(parts[i]);
    parts[j].clear();
    std::erase_if(growth, [j = j](const auto& g) { return g.first.first == j || g.first.second == j; });
    for (std::size_t k = 0; k < parts.size(); ++k)
      if (k != i && !parts[k].empty()) update_growth(i, k);
  }
  std::erase_if(parts, [](const Points& part) { return part.empty(); });
}

}  // namespace

namespace {

std::vector<Points> take_points(std::vector<DecompositionPart>& parts) {
  std::vector<Points> points;
  for (DecompositionPart& part : parts) points.push_back(std::move(part.points));
  return points;
}

// Nullopt unless fewer than max_parts parts exceed the solid by less than `excess`.
std::optional<std::vector<Points>> decompose_hollow(const TriangleMesh& mesh, int max_parts, double volume,
                                                    double excess) {
  const double margin = 1e-4 * bounding_box_diagonal(mesh);
  const std::vector<TriangleMesh> bodies = separate_bodies(mesh);
  std::vector<CutPlanes> cut_planes;
  std::vector<DecompositionPart> parts;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    cut_planes.emplace_back(bodies[i]);
    parts.push_back(make_part(ClippedMesh(bodies[i]), i));
  }
  if (static_cast<int>(parts.size()) > max_parts) return std::nullopt;
  refine(parts, kHollowGoal * volume, max_parts,
         [&](const DecompositionPart& part) { return halve(part, cut_planes[part.body], margin); });
  const double left = total_excess(parts);
  if (!(left < excess)) return std::nullopt;
  std::vector<Points> points = take_points(parts);
  merge_parts(points, std::max(0.0, kHollowMergedGoal * volume - left) + 1e-6 * volume, true);
  return points;
}

}  // namespace

std::vector<Points> decompose_convex(const TriangleMesh& fine, const DecompositionLimits& limits) {
  const TriangleMesh mesh = simplified(fine, kMaxDecomposedTriangles);
  const double margin = 1e-4 * bounding_box_diagonal(mesh);
  const CutPlanes cut_planes(mesh);
  std::vector<DecompositionPart> parts;
  parts.push_back(make_part(ClippedMesh(mesh)));
  const double volume = parts[0].hull_volume - parts[0].excess_volume, allowed = limits.max_excess * volume;
  refine(parts, allowed, limits.max_parts,
         [&](const DecompositionPart& part) { return split(part, cut_planes, margin); });
  const double excess = total_excess(parts);
  if (excess > std::max(kHollowExcess, limits.max_excess) * volume)
    if (auto hollow =
            decompose_hollow(mesh, std::max(limits.max_parts, limits.max_hollow_parts), volume, excess))
      return std::move(*hollow);
  std::vector<Points> points = take_points(parts);
  merge_parts(points, std::max(0.0, allowed - excess) + 1e-6 * allowed);
  return points;
}

}  // namespace smartsurf::mesh
