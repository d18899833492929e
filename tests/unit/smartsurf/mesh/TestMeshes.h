// Closed, outward-oriented test meshes with known volumes.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/mesh/TriangleMesh.h"
#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::mesh {

using Quad = std::array<std::uint32_t, 4>;

inline void add_quad(TriangleMesh& mesh, const Quad& q) {
  mesh.triangles.push_back({q[0], q[1], q[2]});
  mesh.triangles.push_back({q[0], q[2], q[3]});
}

inline void add(TriangleMesh& mesh, const TriangleMesh& other) {
  const auto first = static_cast<std::uint32_t>(mesh.points.size());
  mesh.points.insert(mesh.points.end(), other.points.begin(), other.points.end());
  for (const auto& t : other.triangles) mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
}

inline TriangleMesh box_mesh(const Eigen::Vector3d& low, const Eigen::Vector3d& high) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.points.emplace_back(((i & 1) != 0 ? high : low).x(), ((i & 2) != 0 ? high : low).y(),
                             ((i & 4) != 0 ? high : low).z());
  for (const Quad& q : {Quad{0, 2, 3, 1}, Quad{4, 5, 7, 6}, Quad{0, 1, 5, 4}, Quad{2, 6, 7, 3},
                        Quad{0, 4, 6, 2}, Quad{1, 3, 7, 5}})
    add_quad(mesh, q);
  return mesh;
}

inline TriangleMesh tetrahedron() {
  return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

// Extrudes a counter-clockwise polygon from z = 0 to `height`; `caps` is the polygon's triangulation.
inline TriangleMesh prism(const std::vector<Eigen::Vector2d>& outline,
                          const std::vector<std::array<std::uint32_t, 3>>& caps, double height) {
  TriangleMesh mesh;
  const auto n = static_cast<std::uint32_t>(outline.size());
  for (const double z : {0.0, height})
    for (const auto& p : outline) mesh.points.emplace_back(p.x(), p.y(), z);
  for (const auto& t : caps) {
    mesh.triangles.push_back({t[0], t[2], t[1]});
    mesh.triangles.push_back({n + t[0], n + t[1], n + t[2]});
  }
  for (std::uint32_t i = 0; i < n; ++i) add_quad(mesh, {i, (i + 1) % n, n + (i + 1) % n, n + i});
  return mesh;
}

// An L of two boxes: 3 × 1 × 1, and 1 × 2 × 1 at its west end. Volume 5.
inline TriangleMesh l_mesh() {
  return prism({{0, 0}, {3, 0}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}, {{0, 1, 2}, {0, 2, 3}, {0, 3, 5}, {3, 4, 5}},
               1.0);
}

inline double volume_of(const TriangleMesh& mesh) {
  MassProperties properties;
  properties.add(mesh);
  return properties.volume();
}

// Splits each triangle into four; middle(a, b) returns the point in the middle of an edge.
template <class Middle>
void split_triangles(TriangleMesh& mesh, const Middle& middle) {
  std::vector<std::array<std::uint32_t, 3>> finer;
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const auto& t :
         {std::array{a, ab, ca}, std::array{b, bc, ab}, std::array{c, ca, bc}, std::array{ab, bc, ca}})
      finer.push_back(t);
  }
  mesh.triangles = std::move(finer);
}

// A unit sphere: an icosahedron whose triangles are split into four, `rounds` times.
inline TriangleMesh icosphere(int rounds) {
  const double g = (1.0 + std::sqrt(5.0)) / 2.0;
  TriangleMesh mesh{{{-1, g, 0},
                     {1, g, 0},
                     {-1, -g, 0},
                     {1, -g, 0},
                     {0, -1, g},
                     {0, 1, g},
                     {0, -1, -g},
                     {0, 1, -g},
                     {g, 0, -1},
                     {g, 0, 1},
                     {-g, 0, -1},
                     {-g, 0, 1}},
                    {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                     {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                     {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
  for (auto& p : mesh.points) p.normalize();
  for (; rounds > 0; --rounds) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    split_triangles(mesh, [&](std::uint32_t a, std::uint32_t b) {
      const auto [it, is_new] = middles.try_emplace(std::minmax(a, b), mesh.points.size());
      if (is_new) mesh.points.push_back((mesh.points[a] + mesh.points[b]).normalized());
      return it->second;
    });
  }
  return mesh;
}

// A torus about z with radii `major` and `minor`.
inline TriangleMesh torus(double major, double minor, std::uint32_t around, std::uint32_t across) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j) {
      const double a = 2.0 * std::numbers::pi * i / around, b = 2.0 * std::numbers::pi * j / across;
      const double r = major + minor * std::cos(b);
      mesh.points.emplace_back(r * std::cos(a), r * std::sin(a), minor * std::sin(b));
    }
  const auto at = [&](std::uint32_t i, std::uint32_t j) { return (i % around) * across + j % across; };
  for (std::uint32_t i = 0; i < around; ++i)
    for (std::uint32_t j = 0; j < across; ++j)
      add_quad(mesh, {at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
  return mesh;
}

inline void invert_orientation(TriangleMesh& mesh) {
  for (auto& t : mesh.triangles) std::swap(t[1], t[2]);
}

// The message of the InputError that the call throws; "" if none.
template <typename Call>
std::string error_message_of(Call call) {
  try {
    call();
  } catch (const scene::InputError& e) {
    return e.what();
  }
  return "";
}

}  // namespace smartsurf::mesh
