#include "smartsurf/mesh/SolidBuilder.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "smartsurf/mesh/ConvexDecomposition.h"
#include "smartsurf/mesh/ConvexHull.h"
#include "smartsurf/mesh/DecompositionCache.h"
#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

constexpr double kMinSize = 1e-3, kMaxSize = 1e6;  // longest edge of the bounding box, u
constexpr double kWeldDistance = 1e-6;             // relative to the diagonal of the bounding box
constexpr double kReportThreshold = 0.02;          // relative deviation of the hulls from the mesh
constexpr double kMinThickness = 1e-6;  // volume / (surface area × diagonal); a flat mesh has less

[[noreturn]] void refuse(const std::string& clause) { throw scene::InputError(clause); }

std::string format_percent(double share) {
  std::ostringstream out;
  out << std::round(1000.0 * share) / 10.0 << " %";
  return out.str();
}

std::string format_number(double value) {
  std::ostringstream out;
  out.precision(6);
  out << value;
  return out.str();
}

void check_size(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d low = points.front(), high = low;
  for (const auto& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double size = (high - low).maxCoeff();
  if (!(size >= kMinSize && size <= kMaxSize))
    refuse("is " + format_number(size) + " u across: must be in [0.001, 1000000]; set its scale");
}

double surface_area(const TriangleMesh& mesh) {
  double area = 0.0;
  for (const auto& t : mesh.triangles)
    area += (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]).norm() / 2.0;
  return area;
}

// Moves the centre of mass to the origin. Returns where it was.
Eigen::Vector3d move_to_centre_of_mass(TriangleMesh& mesh) {
  const Eigen::Vector3d near = mesh.points.front();
  for (auto& p : mesh.points) p -= near;
  MassProperties properties;
  properties.add(mesh);
  if (!(properties.volume() > kMinThickness * surface_area(mesh) * bounding_box_diagonal(mesh)))
    refuse("encloses almost no volume: " + format_number(properties.volume()) + " u^3");
  const Eigen::Vector3d centre_of_mass = properties.centre();
  for (auto& p : mesh.points) p -= centre_of_mass;
  return near + centre_of_mass;
}

std::vector<Eigen::Vector3f> to_single_precision(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3f> converted;
  for (const auto& p : points) converted.push_back(p.cast<float>());
  return converted;
}

scene::ConvexHull translated(const scene::ConvexHull& hull, const Eigen::Vector3f& by) {
  std::vector<Eigen::Vector3f> corners = hull.vertices;
  for (auto& corner : corners) corner += by;
  return with_vertices(hull, std::move(corners));
}

// The relative deviation of the hulls from the mesh, whose centre of mass is the origin.
struct ApproximationError {
  double volume, centre, inertia;  // relative to the volume, the bounding radius and the norm of the inertia
  double worst() const { return std::max(std::abs(volume), inertia); }
};

ApproximationError approximation_error(const scene::Solid& solid) {
  MassProperties hulls;
  for (const auto& hull : solid.hulls) hulls.add(hull);
  return {hulls.volume() / solid.volume - 1.0,
          hulls.centre().norm() / static_cast<double>(solid.bounding_radius),
          (hulls.inertia(Eigen::Vector3d::Zero()) - solid.inertia).norm() / solid.inertia.norm()};
}

void check_approximation(const scene::Solid& solid, const SolidOptions& options,
                         std::vector<std::string>& notes) {
  const ApproximationError d = approximation_error(solid);
  if (d.worst() <= kReportThreshold) return;
  const std::string pieces =
      std::to_string(solid.hulls.size()) + (solid.hulls.size() == 1 ? " piece" : " pieces");
  const std::string what = "the collision shape, " + pieces + ", has " + format_percent(std::abs(d.volume)) +
                           (d.volume < 0.0 ? " less" : " more") + " volume than the mesh (inertia off by " +
                           format_percent(d.inertia) + ", centre of mass by " + format_percent(d.centre) +
                           " of the radius)";
  if (options.decompose && d.worst() > options.tolerance) {
    const int pieces_allowed = std::max(options.max_hulls, options.max_hollow_hulls);
    refuse(what + ", more than the tolerance of " + format_percent(options.tolerance) +
           (pieces_allowed < scene::kMaxHulls
                ? ": raise pieces = " + std::to_string(pieces_allowed) + " or tolerance, or simplify the mesh"
                : ", and a solid has at most " + std::to_string(scene::kMaxHulls) +
                      " pieces: raise tolerance, thicken the walls or simplify the mesh"));
  }
  notes.push_back(what);
}

std::vector<scene::ConvexHull> make_convex_hulls(const TriangleMesh& mesh, const SolidOptions& options) {
  std::vector<std::vector<Eigen::Vector3d>> parts{mesh.points};
  if (options.decompose) {
    const DecompositionLimits limits{.max_parts = options.max_hulls,
                                     .max_hollow_parts = options.max_hollow_hulls};
    parts =
        options.cache != nullptr ? options.cache->decompose(mesh, limits) : decompose_convex(mesh, limits);
  }
  std::vector<scene::ConvexHull> hulls;
  for (const auto& part : parts)
    if (auto hull = convex_hull(to_single_precision(part))) hulls.push_back(std::move(*hull));
  if (hulls.empty()) refuse("encloses almost no volume");
  return hulls;
}

// Sets what follows from the hulls, which are what is drawn, too.
void describe_hulls(scene::Solid& solid) {
  MassProperties properties;
  for (const scene::ConvexHull& hull : solid.hulls) {
    properties.add(hull);
    const auto first = static_cast<std::uint32_t>(solid.vertices.size());
    solid.vertices.insert(solid.vertices.end(), hull.vertices.begin(), hull.vertices.end());
    for (const auto& face : hull.faces)
      for (std::uint32_t i = 1; i + 1 < face.vertex_count; ++i)
        solid.triangles.push_back({first + hull.face_vertices[face.first_vertex],
                                   first + hull.face_vertices[face.first_vertex + i],
                                   first + hull.face_vertices[face.first_vertex + i + 1]});
  }
  solid.volume = properties.volume();
  solid.inertia = properties.inertia(properties.centre());
  scene::compute_bounds(solid);
}

}  // namespace

scene::Solid build_solid(TriangleMesh mesh, const SolidOptions& options, std::vector<std::string>& notes) {
  if (mesh.triangles.empty()) refuse("has points but no triangles; hull{file = ...} takes its convex hull");
  check_size(mesh.points);
  weld_points(mesh, kWeldDistance * bounding_box_diagonal(mesh));
  if (mesh.triangles.empty()) refuse("has no triangle with an area");
  const std::vector<std::string> repairs = orient_shells(mesh);
  notes.insert(notes.end(), repairs.begin(), repairs.end());

  scene::Solid solid;
  for (int pass = 0; pass < 2; ++pass)  // the second pass has less cancellation
    solid.centroid += move_to_centre_of_mass(mesh);
  MassProperties properties;
  properties.add(mesh);
  solid.vertices = to_single_precision(mesh.points);
  solid.triangles = mesh.triangles;
  solid.volume = properties.volume();
  solid.inertia = properties.inertia(Eigen::Vector3d::Zero());
  scene::compute_bounds(solid);
  solid.hulls = make_convex_hulls(mesh, options);
  check_approximation(solid, options, notes);
  return solid;
}

scene::Solid build_hull_solid(std::span<const Eigen::Vector3d> points) {
  if (points.size() < 4)
    refuse("has " + std::to_string(points.size()) + " points: a hull needs at least four");
  check_size(points);
  std::vector<Eigen::Vector3d> shifted(points.begin(), points.end());
  for (auto& p : shifted) p -= points.front();
  const auto rough_hull = convex_hull(to_single_precision(shifted));
  if (!rough_hull) refuse("is flat: its points enclose no volume");
  MassProperties about_first;
  about_first.add(*rough_hull);
  scene::Solid solid;
  solid.hulls.push_back(translated(*rough_hull, -about_first.centre().cast<float>()));
  solid.centroid = points.front() + about_first.centre();
  describe_hulls(solid);
  return solid;
}

scene::Solid build_compound(std::span<const std::vector<Eigen::Vector3d>> parts) {
  std::vector<Eigen::Vector3d> all;
  for (const auto& part : parts) all.insert(all.end(), part.begin(), part.end());
  if (all.empty()) refuse("has no points");
  check_size(all);
  std::vector<scene::ConvexHull> hulls;
  MassProperties about_first;
  for (const auto& part : parts) {
    std::vector<Eigen::Vector3d> shifted(part);
    for (auto& p : shifted) p -= all.front();
    auto hull = convex_hull(to_single_precision(shifted));
    if (!hull) refuse("has a flat part: its points enclose no volume");
    about_first.add(*hull);
    hulls.push_back(std::move(*hull));
  }
  scene::Solid solid;
  solid.centroid = all.front() + about_first.centre();
  for (const auto& hull : hulls) solid.hulls.push_back(translated(hull, -about_first.centre().cast<float>()));
  describe_hulls(solid);
  return solid;
}

}  // namespace smartsurf::mesh
