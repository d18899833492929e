#include "smartsurf/mesh/MakeSolid.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "smartsurf/mesh/ConvexParts.h"
#include "smartsurf/mesh/Hull.h"
#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {
namespace {

constexpr double kSmallest = 1e-3, kLargest = 1e6;  // of a solid's longest edge, u
constexpr double kJoined = 1e-6;                    // points nearer than this share of the diagonal are one
constexpr double kWorthANote = 0.02;                // of the pieces' difference from the mesh
constexpr double kThin = 1e-6;  // a solid this thin, its volume over its surface and extent, is a sheet

[[noreturn]] void refuse(const std::string& clause) { throw scene::InputError(clause); }

std::string percent(double share) {
  std::ostringstream out;
  out << std::round(1000.0 * share) / 10.0 << " %";
  return out.str();
}

std::string number(double value) {
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
  if (!(size >= kSmallest && size <= kLargest))
    refuse("is " + number(size) + " u across: must be in [0.001, 1000000]; set its scale");
}

double area_of(const TriangleMesh& mesh) {
  double area = 0.0;
  for (const auto& t : mesh.triangles)
    area += (mesh.points[t[1]] - mesh.points[t[0]]).cross(mesh.points[t[2]] - mesh.points[t[0]]).norm() / 2.0;
  return area;
}

// Moves the centre of mass to the origin.
void centre(TriangleMesh& mesh) {
  const Eigen::Vector3d near = mesh.points.front();
  for (auto& p : mesh.points) p -= near;
  MassProperties properties;
  properties.add(mesh);
  if (!(properties.volume() > kThin * area_of(mesh) * diagonal(mesh)))
    refuse("encloses next to no volume: " + number(properties.volume()) + " u^3");
  const Eigen::Vector3d centre_of_mass = properties.centre();
  for (auto& p : mesh.points) p -= centre_of_mass;
}

std::vector<Eigen::Vector3f> in_single(const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector3f> single;
  for (const auto& p : points) single.push_back(p.cast<float>());
  return single;
}

scene::ConvexPiece moved(const scene::ConvexPiece& piece, const Eigen::Vector3f& by) {
  std::vector<Eigen::Vector3f> corners = piece.corners;
  for (auto& corner : corners) corner += by;
  std::vector<std::uint32_t> sizes;
  for (const auto& face : piece.faces) sizes.push_back(face.count);
  return scene::make_piece(std::move(corners), piece.face_corners, sizes);
}

// The pieces beside the mesh, whose centre of mass is the origin.
struct Difference {
  double volume, centre, inertia;  // as shares: of the volume, of the reach, of the inertia's norm
  double worst() const { return std::max(std::abs(volume), inertia); }
};

Difference difference(const scene::Solid& solid) {
  MassProperties pieces;
  for (const auto& piece : solid.pieces) pieces.add(piece);
  return {pieces.volume() / solid.volume - 1.0, pieces.centre().norm() / static_cast<double>(solid.reach),
          (pieces.inertia(Eigen::Vector3d::Zero()) - solid.inertia).norm() / solid.inertia.norm()};
}

void check_pieces(const scene::Solid& solid, const SolidOptions& options, std::vector<std::string>& notes) {
  const Difference d = difference(solid);
  if (d.worst() <= kWorthANote) return;
  const std::string pieces =
      std::to_string(solid.pieces.size()) + (solid.pieces.size() == 1 ? " piece" : " pieces");
  const std::string what = "what collides, " + pieces + ", has " + percent(std::abs(d.volume)) +
                           (d.volume < 0.0 ? " less" : " more") + " volume than the mesh (inertia " +
                           percent(d.inertia) + " off, centre of mass " + percent(d.centre) +
                           " of its reach)";
  if (options.decompose && d.worst() > options.tolerance)
    refuse(what + ", more than the tolerance of " + percent(options.tolerance) +
           ": raise pieces = " + std::to_string(options.pieces) + " or tolerance, or simplify the mesh");
  notes.push_back(what);
}

std::vector<scene::ConvexPiece> pieces_of(const TriangleMesh& mesh, const SolidOptions& options) {
  std::vector<std::vector<Eigen::Vector3d>> parts{mesh.points};
  if (options.decompose) parts = convex_parts(mesh, {.parts = options.pieces});
  std::vector<scene::ConvexPiece> pieces;
  for (const auto& part : parts)
    if (auto piece = convex_hull(in_single(part))) pieces.push_back(std::move(*piece));
  if (pieces.empty()) refuse("encloses next to no volume");
  return pieces;
}

}  // namespace

scene::Solid solid_of(TriangleMesh mesh, const SolidOptions& options, std::vector<std::string>& notes) {
  if (mesh.triangles.empty()) refuse("has points but no triangles; hull{file = ...} takes its convex hull");
  check_size(mesh.points);
  join_points(mesh, kJoined * diagonal(mesh));
  if (mesh.triangles.empty()) refuse("has no triangle with an area");
  const std::vector<std::string> turned = close_and_orient(mesh);
  notes.insert(notes.end(), turned.begin(), turned.end());

  for (int pass = 0; pass < 2; ++pass) centre(mesh);  // the second time hardly anything cancels
  MassProperties properties;
  properties.add(mesh);
  scene::Solid solid;
  solid.vertices = in_single(mesh.points);
  solid.triangles = mesh.triangles;
  solid.volume = properties.volume();
  solid.inertia = properties.inertia(Eigen::Vector3d::Zero());
  scene::set_bounds(solid);
  solid.pieces = pieces_of(mesh, options);
  check_pieces(solid, options, notes);
  return solid;
}

scene::Solid hull_solid(std::span<const Eigen::Vector3d> points) {
  if (points.size() < 4)
    refuse("has " + std::to_string(points.size()) + " points: a hull needs four or more");
  check_size(points);
  std::vector<Eigen::Vector3d> near(points.begin(), points.end());
  for (auto& p : near) p -= points.front();
  const auto rough = convex_hull(in_single(near));
  if (!rough) refuse("is flat: its points enclose no volume");
  MassProperties about_first;
  about_first.add(*rough);
  scene::Solid solid;
  solid.pieces.push_back(moved(*rough, -about_first.centre().cast<float>()));
  const scene::ConvexPiece& piece = solid.pieces.front();
  MassProperties properties;
  properties.add(piece);
  solid.volume = properties.volume();
  solid.inertia = properties.inertia(properties.centre());
  solid.vertices = piece.corners;
  for (const auto& face : piece.faces)
    for (std::uint32_t i = 1; i + 1 < face.count; ++i)
      solid.triangles.push_back({piece.face_corners[face.first], piece.face_corners[face.first + i],
                                 piece.face_corners[face.first + i + 1]});
  scene::set_bounds(solid);
  return solid;
}

}  // namespace smartsurf::mesh
