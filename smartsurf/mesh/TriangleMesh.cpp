#include "smartsurf/mesh/TriangleMesh.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "common/index/UnionFind.h"

namespace smartsurf::mesh {
namespace {

using common::find_root;

// Maps each point to the lowest index of the points that it is merged with.
std::vector<std::uint32_t> weld_map(const std::vector<Eigen::Vector3d>& points, double distance) {
  // Sort and sweep along an oblique direction, on which few points of typical meshes coincide.
  const Eigen::Vector3d direction = Eigen::Vector3d(0.5377, 0.6873, 0.4886).normalized();
  std::vector<double> projection(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) projection[i] = direction.dot(points[i]);
  std::vector<std::uint32_t> order(points.size()), parent(points.size());
  std::iota(order.begin(), order.end(), 0U);
  std::iota(parent.begin(), parent.end(), 0U);
  std::sort(order.begin(), order.end(), [&](auto a, auto b) {
    return projection[a] != projection[b] ? projection[a] < projection[b] : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i)
    for (std::size_t j = i + 1; j < order.size() && projection[order[j]] - projection[order[i]] <= distance;
         ++j) {
      if ((points[order[i]] - points[order[j]]).norm() > distance) continue;
      const std::uint32_t a = find_root(parent, order[i]), b = find_root(parent, order[j]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  for (std::uint32_t i = 0; i < parent.size(); ++i) parent[i] = find_root(parent, i);
  return parent;
}

// Rotates the lowest index to the front, which makes cyclic permutations equal but keeps the orientation.
std::array<std::uint32_t, 3> canonical_rotation(std::array<std::uint32_t, 3> t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

void remove_duplicates(std::vector<std::array<std::uint32_t, 3>>& triangles) {
  std::vector<std::uint32_t> order(triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t i) { return canonical_rotation(triangles[i]); };
  std::sort(order.begin(), order.end(),
            [&](auto a, auto b) { return key(a) != key(b) ? key(a) < key(b) : a < b; });
  std::vector<char> repeated(triangles.size(), 0);
  for (std::size_t i = 1; i < order.size(); ++i) repeated[order[i]] = key(order[i]) == key(order[i - 1]);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < triangles.size(); ++i)
    if (repeated[i] == 0) triangles[kept++] = triangles[i];
  triangles.resize(kept);
}

void remove_unused_points(TriangleMesh& mesh) {
  std::vector<std::uint32_t> number(mesh.points.size(), 0);
  for (const auto& t : mesh.triangles)
    for (const std::uint32_t p : t) number[p] = 1;
  std::uint32_t kept = 0;
  for (std::size_t i = 0; i < number.size(); ++i) {
    if (number[i] == 0) continue;
    mesh.points[kept] = mesh.points[i];
    number[i] = kept++;
  }
  mesh.points.resize(kept);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& p : t) p = number[p];
}

// A. Van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30, 1983.
double solid_angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

Eigen::AlignedBox3d bounding_box(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const auto& p : mesh.points) box.extend(p);
  return box;
}

double bounding_box_diagonal(const TriangleMesh& mesh) {
  return mesh.points.empty() ? 0.0 : bounding_box(mesh).diagonal().norm();
}

void weld_points(TriangleMesh& mesh, double distance) {
  const std::vector<std::uint32_t> same = weld_map(mesh.points, distance);
  for (auto& t : mesh.triangles)
    for (std::uint32_t& p : t) p = same[p];
  std::erase_if(mesh.triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  remove_duplicates(mesh.triangles);
  remove_unused_points(mesh);
}

double winding_number(const TriangleMesh& mesh, const Eigen::Vector3d& point) {
  double angle = 0.0;
  for (const auto& t : mesh.triangles)
    angle += solid_angle(mesh.points[t[0]] - point, mesh.points[t[1]] - point, mesh.points[t[2]] - point);
  return angle / (4.0 * std::numbers::pi);
}

}  // namespace smartsurf::mesh
