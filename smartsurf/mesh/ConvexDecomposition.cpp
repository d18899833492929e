#include "smartsurf/mesh/ConvexDecomposition.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>

#include "smartsurf/mesh/ClippedMesh.h"
#include "smartsurf/mesh/ConvexHull.h"
#include "smartsurf/mesh/MassProperties.h"

namespace smartsurf::mesh {
namespace {

using Points = std::vector<Eigen::Vector3d>;

constexpr double kMinConcaveAngle = std::numbers::pi / 6.0;  // smaller angles belong to round surfaces
constexpr std::size_t kMaxCutPlanes = 256, kMaxCutPlanesTried = 24;
constexpr int kSlicesPerAxis = 8;
// The best cut must remove at least this fraction of the part's excess volume; otherwise a fallback is used.
constexpr double kMinSaving = 0.01;

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
  bool indivisible = false;  // no plane splits it into two solids
};

DecompositionPart make_part(ClippedMesh mesh) {
  Points points = mesh.hull_points();
  const double volume_of_hull = hull_volume(points), excess = volume_of_hull - mesh.volume();
  return {std::move(mesh), std::move(points), volume_of_hull, excess};
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
                                      double margin) {
  std::vector<Plane> planes;
  for (const CutPlane& cut_plane : cut_planes.planes())
    if (planes.size() < kMaxCutPlanesTried && splits(cut_plane.plane, part.points, margin))
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

// Nullopt if no plane makes two parts with volume.
std::optional<std::pair<DecompositionPart, DecompositionPart>> split(const DecompositionPart& part,
                                                                     const CutPlanes& cut_planes,
                                                                     double margin) {
  const std::vector<Plane> along_faces = cut_planes_through(part, cut_planes, margin);
  BestCut best = best_cut(along_faces, part, {});
  // Skip the slices if a cut along a face removes almost all of the excess.
  if (!(part.hull_volume - best.total_hull_volume > 0.9 * part.excess_volume))
    best = best_cut(axis_slices(part), part, best);
  // The first cuts around a cavity do not reduce the excess yet, so cut anyway.
  if (!(part.hull_volume - best.total_hull_volume > kMinSaving * part.excess_volume))
    best.plane = along_faces.empty() ? middle_slice(part) : along_faces.front();
  const Plane& plane = best.plane;
  std::pair<DecompositionPart, DecompositionPart> halves{make_part(part.mesh.clip_below(plane)),
                                                         make_part(part.mesh.clip_below(plane.flipped()))};
  if (halves.first.points.size() < 4 || halves.second.points.size() < 4) return std::nullopt;
  return halves;
}

// Merges pairs of parts in order of the volume that their common hull adds, while the total stays within
// `allowed`.
void merge_parts(std::vector<Points>& parts, double allowed) {
  std::vector<double> hull;
  for (const Points& part : parts) hull.push_back(hull_volume(part));
  const auto merged_points = [&](std::size_t i, std::size_t j) {
    Points both = parts[i];
    both.insert(both.end(), parts[j].begin(), parts[j].end());
    return both;
  };
  std::map<std::pair<std::size_t, std::size_t>, double> growth;
  const auto update_growth = [&](std::size_t i, std::size_t j) {
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

std::vector<Points> decompose_convex(const TriangleMesh& mesh, const DecompositionLimits& limits) {
  const double margin = 1e-4 * bounding_box_diagonal(mesh);
  const CutPlanes cut_planes(mesh);
  std::vector<DecompositionPart> work_parts;
  work_parts.push_back(make_part(ClippedMesh(mesh)));
  const double allowed = limits.max_excess * (work_parts[0].hull_volume - work_parts[0].excess_volume);
  const auto excess = [&] {
    double sum = 0.0;
    for (const DecompositionPart& part : work_parts) sum += std::max(0.0, part.excess_volume);
    return sum;
  };
  while (static_cast<int>(work_parts.size()) < limits.max_parts && excess() > allowed) {
    const auto worst = std::max_element(
        work_parts.begin(), work_parts.end(), [](const DecompositionPart& a, const DecompositionPart& b) {
          return (a.indivisible ? -1.0 : a.excess_volume) < (b.indivisible ? -1.0 : b.excess_volume);
        });
    if (worst->indivisible || !(worst->excess_volume > 0.0)) break;
    auto halves = split(*worst, cut_planes, margin);
    if (!halves) {
      worst->indivisible = true;
      continue;
    }
    *worst = std::move(halves->first);
    work_parts.push_back(std::move(halves->second));
  }
  std::vector<Points> parts;
  for (DecompositionPart& part : work_parts) parts.push_back(std::move(part.points));
  merge_parts(parts, std::max(0.0, allowed - excess()) + 1e-6 * allowed);
  return parts;
}

}  // namespace smartsurf::mesh
