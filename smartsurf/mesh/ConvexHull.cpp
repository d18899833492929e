#include "smartsurf/mesh/ConvexHull.h"

extern "C" {
#include <libqhull_r/qhull_ra.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>

namespace smartsurf::mesh {
namespace {

// Points within this fraction of the extent from a face lie on it, because single precision cannot resolve
// less.
constexpr double kFlatTolerance = 2e-6;

struct HullFaces {
  std::vector<std::uint32_t> corners;        // point indices, face by face
  std::vector<std::uint32_t> corner_counts;  // of each face
  double volume = 0.0;
};

void sort_and_deduplicate(std::vector<std::uint32_t>& indices) {
  std::sort(indices.begin(), indices.end());
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
}

double max_extent(const std::vector<double>& coordinates) {
  const Eigen::Map<const Eigen::Matrix3Xd> points(coordinates.data(), 3, std::ssize(coordinates) / 3);
  return points.cols() == 0 ? 0.0 : (points.rowwise().maxCoeff() - points.rowwise().minCoeff()).maxCoeff();
}

// RAII wrapper of one Qhull run. Qhull keeps pointers into the coordinates.
class QhullRun {
 public:
  QhullRun(std::vector<double>& coordinates, double size, bool merged) {
    qh_zero(&qh_, null_file_);
    char command[80];
    // C-: merge faces that are coplanar within the given distance. Qt: triangulate. Pp: no warnings.
    if (merged)
      std::snprintf(command, sizeof command, "qhull C-%.17g Pp", kFlatTolerance * size);
    else
      std::snprintf(command, sizeof command, "qhull Qt Pp");
    status_ = qh_new_qhull(&qh_, 3, static_cast<int>(coordinates.size() / 3), coordinates.data(), False,
                           command, nullptr, null_file_);
  }
  ~QhullRun() {
    qh_freeqhull(&qh_, qh_ALL);
    int left = 0, bytes = 0;
    qh_memfreeshort(&qh_, &left, &bytes);
    if (null_file_ != nullptr) std::fclose(null_file_);
  }
  QhullRun(const QhullRun&) = delete;
  QhullRun& operator=(const QhullRun&) = delete;

  bool succeeded() const { return status_ == 0; }
  const facetT* first_facet() const { return qh_.facet_list; }
  std::uint32_t index_of(const vertexT* v) { return static_cast<std::uint32_t>(qh_pointid(&qh_, v->point)); }

 private:
  FILE* null_file_ = std::fopen("/dev/null", "w");  // discards Qhull's messages
  qhT qh_{};
  int status_ = 0;
};

// The vertices of a face in order, chained along its ridges unless it is a triangle. Empty if the ridges do
// not form a single loop.
std::vector<std::uint32_t> face_loop(QhullRun& run, const facetT* facet) {
  std::vector<std::uint32_t> loop;
  if (facet->simplicial) {
    vertexT *vertex = nullptr, **vertexp = nullptr;
    FOREACHvertex_(facet->vertices) loop.push_back(run.index_of(vertex));
    return loop;
  }
  std::vector<std::array<std::uint32_t, 2>> ridges;
  ridgeT *ridge = nullptr, **ridgep = nullptr;
  FOREACHridge_(facet->ridges) {
    const auto end = [&](int i) { return run.index_of(static_cast<vertexT*>(ridge->vertices->e[i].p)); };
    ridges.push_back({end(0), end(1)});
  }
  if (ridges.size() < 3) return {};
  loop = {ridges.back()[0]};
  std::uint32_t next = ridges.back()[1];
  ridges.pop_back();
  while (!ridges.empty()) {
    loop.push_back(next);
    const auto on = std::find_if(ridges.begin(), ridges.end(),
                                 [&](const auto& r) { return r[0] == next || r[1] == next; });
    if (on == ridges.end()) return {};
    next = (*on)[0] == next ? (*on)[1] : (*on)[0];
    ridges.erase(on);
  }
  return next == loop.front() ? loop : std::vector<std::uint32_t>{};
}

Eigen::Vector3d point_at(const std::vector<double>& coordinates, std::uint32_t i) {
  return Eigen::Vector3d(&coordinates[3 * std::size_t{i}]);
}

// Twice the area vector of a polygon.
Eigen::Vector3d area_vector(const std::vector<double>& coordinates, const std::vector<std::uint32_t>& loop) {
  const Eigen::Vector3d origin = point_at(coordinates, loop[0]);
  Eigen::Vector3d area = Eigen::Vector3d::Zero();
  for (std::size_t i = 1; i + 1 < loop.size(); ++i)
    area += (point_at(coordinates, loop[i]) - origin).cross(point_at(coordinates, loop[i + 1]) - origin);
  return area;
}

// Nullopt if the points are coplanar or a face is not a simple polygon.
std::optional<HullFaces> compute_hull(std::vector<double> coordinates, bool merged) {
  const double size = max_extent(coordinates);
  if (coordinates.size() < 12 || !(size > 0.0)) return std::nullopt;
  QhullRun run(coordinates, size, merged);
  if (!run.succeeded()) return std::nullopt;
  HullFaces hull;
  double area = 0.0;
  const Eigen::Vector3d origin = point_at(coordinates, 0);
  for (const facetT* facet = run.first_facet(); facet != nullptr && facet->next != nullptr;
       facet = facet->next) {
    std::vector<std::uint32_t> loop = face_loop(run, facet);
    if (loop.size() < 3) return std::nullopt;
    Eigen::Vector3d normal = area_vector(coordinates, loop);
    if (normal.dot(Eigen::Vector3d(facet->normal[0], facet->normal[1], facet->normal[2])) < 0.0) {
      std::reverse(loop.begin(), loop.end());
      normal = -normal;
    }
    area += normal.norm() / 2.0;
    hull.volume += normal.dot(point_at(coordinates, loop[0]) - origin) / 6.0;
    hull.corners.insert(hull.corners.end(), loop.begin(), loop.end());
    hull.corner_counts.push_back(static_cast<std::uint32_t>(loop.size()));
  }
  // Treat a hull as flat if it is thinner than the merge distance.
  if (!(hull.volume > kFlatTolerance * size * area / 2.0)) return std::nullopt;
  return hull;
}

// Checks that the surface is closed and connected: each edge occurs once per direction, and Euler's formula
// holds.
bool is_closed_polyhedron(const HullFaces& hull) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  std::vector<std::uint32_t> corners = hull.corners;
  std::size_t first = 0;
  for (const std::uint32_t size : hull.corner_counts) {
    if (size < 3) return false;
    for (std::uint32_t i = 0; i < size; ++i)
      if (++edges[{hull.corners[first + i], hull.corners[first + (i + 1) % size]}] > 1) return false;
    first += size;
  }
  for (const auto& [edge, count] : edges)
    if (!edges.contains({edge.second, edge.first})) return false;
  sort_and_deduplicate(corners);
  return corners.size() + hull.corner_counts.size() == edges.size() / 2 + 2;
}

template <class Point>
std::vector<double> coordinates_of(std::span<const Point> points) {
  std::vector<double> numbers;
  numbers.reserve(3 * points.size());
  for (const Point& p : points) numbers.insert(numbers.end(), {p.x(), p.y(), p.z()});
  return numbers;
}

// The support points in kMaxHullCorners directions of a Fibonacci lattice on the sphere.
std::vector<Eigen::Vector3f> pick_spread_points(const std::vector<Eigen::Vector3f>& points) {
  std::vector<std::uint32_t> kept;
  for (std::size_t i = 0; i < kMaxHullCorners; ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(kMaxHullCorners);
    const double turn = static_cast<double>(i) * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double r = std::sqrt(1.0 - z * z);
    const Eigen::Vector3f d = Eigen::Vector3d(r * std::cos(turn), r * std::sin(turn), z).cast<float>();
    const auto best = std::max_element(points.begin(), points.end(),
                                       [&](const auto& a, const auto& b) { return d.dot(a) < d.dot(b); });
    kept.push_back(static_cast<std::uint32_t>(best - points.begin()));
  }
  sort_and_deduplicate(kept);
  std::vector<Eigen::Vector3f> few;
  for (const std::uint32_t i : kept) few.push_back(points[i]);
  return few;
}

}  // namespace

std::optional<scene::ConvexHull> convex_hull(std::span<const Eigen::Vector3f> points) {
  const std::vector<double> coordinates = coordinates_of(points);
  std::optional<HullFaces> hull = compute_hull(coordinates, true);
  // Merging of many almost coplanar faces may give an inconsistent surface. Triangulate in that case.
  if (hull && !is_closed_polyhedron(*hull)) hull = compute_hull(coordinates, false);
  if (!hull || !is_closed_polyhedron(*hull)) return std::nullopt;
  std::vector<std::uint32_t> used = hull->corners;
  sort_and_deduplicate(used);
  std::vector<Eigen::Vector3f> corners;
  for (const std::uint32_t i : used) corners.push_back(points[i]);
  if (corners.size() > kMaxHullCorners) return convex_hull(pick_spread_points(corners));
  std::vector<std::uint16_t> loops;
  for (const std::uint32_t i : hull->corners)
    loops.push_back(static_cast<std::uint16_t>(std::lower_bound(used.begin(), used.end(), i) - used.begin()));
  return scene::make_convex_hull(std::move(corners), std::move(loops), hull->corner_counts);
}

double hull_volume(std::span<const Eigen::Vector3d> points) {
  const std::optional<HullFaces> hull = compute_hull(coordinates_of(points), true);
  return hull ? hull->volume : 0.0;
}

}  // namespace smartsurf::mesh
