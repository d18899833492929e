#include "smartsurf/scene/Solid.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>

namespace smartsurf::scene {
namespace {

// Directions closer than this (the sine of the angle between them) are parallel: single precision tells no
// less.
constexpr float kParallel = 1e-4F;

void add_direction(std::vector<Eigen::Vector3f>& directions, const Eigen::Vector3f& d) {
  for (const Eigen::Vector3f& known : directions)
    if (known.cross(d).squaredNorm() < kParallel * kParallel) return;
  directions.push_back(d);
}

// Newell's sum: twice the area vector of a polygon, also of one that is only nearly flat.
Eigen::Vector3d area_vector(const ConvexPiece& piece, std::uint32_t first, std::uint32_t count) {
  const auto corner = [&](std::uint32_t i) {
    return piece.corners[piece.face_corners[first + i % count]].cast<double>().eval();
  };
  const Eigen::Vector3d origin = corner(0);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::uint32_t i = 1; i + 1 < count; ++i) sum += (corner(i) - origin).cross(corner(i + 1) - origin);
  return sum;
}

// The plane touches the face's outermost corner, so that the piece holds all its corners.
ConvexPiece::Face make_face(const ConvexPiece& piece, std::uint32_t first, std::uint32_t count) {
  ConvexPiece::Face face{area_vector(piece, first, count).normalized().cast<float>(), 0.0F, first, count};
  face.offset = face.normal.dot(piece.corners[piece.face_corners[first]]);
  for (std::uint32_t i = 1; i < count; ++i)
    face.offset = std::max(face.offset, face.normal.dot(piece.corners[piece.face_corners[first + i]]));
  return face;
}

// Each edge is met twice, once from either side; the way from the lower to the higher index counts.
void add_edges(ConvexPiece& piece, const ConvexPiece::Face& face) {
  for (std::uint32_t i = 0; i < face.count; ++i) {
    const std::uint16_t a = piece.face_corners[face.first + i];
    const std::uint16_t b = piece.face_corners[face.first + (i + 1) % face.count];
    if (a > b) continue;
    piece.edges.push_back({a, b});
    add_direction(piece.edge_directions, (piece.corners[b] - piece.corners[a]).normalized());
  }
}

}  // namespace

ConvexPiece make_piece(std::vector<Eigen::Vector3f> corners, std::vector<std::uint16_t> loops,
                       std::span<const std::uint32_t> sizes) {
  assert(corners.size() >= 4 && sizes.size() >= 4);
  ConvexPiece piece;
  piece.corners = std::move(corners);
  piece.face_corners = std::move(loops);
  std::uint32_t first = 0;
  for (const std::uint32_t count : sizes) {
    piece.faces.push_back(make_face(piece, first, count));
    add_direction(piece.face_normals, piece.faces.back().normal);
    add_edges(piece, piece.faces.back());
    first += count;
  }
  assert(first == piece.face_corners.size());
  piece.low = piece.high = piece.corners.front();
  for (const Eigen::Vector3f& corner : piece.corners) {
    piece.low = piece.low.cwiseMin(corner);
    piece.high = piece.high.cwiseMax(corner);
  }
  return piece;
}

void set_bounds(Solid& solid) {
  solid.low = solid.high = solid.vertices.front();
  for (const auto& v : solid.vertices) {
    solid.low = solid.low.cwiseMin(v);
    solid.high = solid.high.cwiseMax(v);
    solid.reach = std::max(solid.reach, v.norm());
  }
}

}  // namespace smartsurf::scene
