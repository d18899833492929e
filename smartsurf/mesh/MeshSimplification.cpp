#include "smartsurf/mesh/MeshSimplification.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <compare>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace smartsurf::mesh {
namespace {

// Where planes leave a position open, as on flat surfaces, the middle of the edge is preferred with this
// weight relative to them.
constexpr double kMiddleWeight = 1e-4;
constexpr double kMinNormalCosine = 0.2;  // between a triangle's normals before and after a collapse

// The sum of squared distances from planes, weighted by area: xᵀ·a·x − 2·b·x + c.
struct Quadric {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double c = 0.0;

  void add_plane(const Eigen::Vector3d& normal, double offset, double weight) {
    a += weight * normal * normal.transpose();
    b += weight * offset * normal;
    c += weight * offset * offset;
  }
  void add(const Quadric& q) {
    a += q.a;
    b += q.b;
    c += q.c;
  }
  double at(const Eigen::Vector3d& x) const { return x.dot(a * x) - 2.0 * b.dot(x) + c; }
};

class Simplification {
 public:
  explicit Simplification(const TriangleMesh& mesh)
      : mesh_(mesh),
        left_(mesh.triangles.size()),
        vertices_(mesh.points.size()),
        marked_(mesh.points.size(), 0) {
    for (const auto& t : mesh.triangles)
      for (const std::uint32_t p : t) ++vertices_[p].triangle_count;
    std::size_t first = 0;
    for (Vertex& v : vertices_) {
      v.first_triangle = first;
      first += std::exchange(v.triangle_count, 0);
    }
    triangles_of_.resize(first);
    for (std::uint32_t n = 0; n < mesh.triangles.size(); ++n) {
      const Eigen::Vector3d normal = area_vector(n), unit = normal.normalized();
      for (const std::uint32_t p : mesh.triangles[n]) {
        triangles_of_[vertices_[p].first_triangle + vertices_[p].triangle_count++] = n;
        vertices_[p].quadric.add_plane(unit, unit.dot(mesh.points[mesh.triangles[n][0]]), normal.norm());
      }
    }
  }

  TriangleMesh run(std::size_t max_triangles) {
    while (left_ > max_triangles) {
      const std::vector<Collapse> collapses = sorted_collapses();
      const std::size_t cheap = collapses.size() / 2;
      const std::size_t before = left_;
      for (std::size_t i = 0; i < collapses.size() && left_ > max_triangles; ++i) {
        if (i >= cheap && left_ < before) break;
        collapse(collapses[i]);
      }
      if (left_ == before) break;
    }
    TriangleMesh result;
    std::vector<std::uint32_t> number(mesh_.points.size(), UINT32_MAX);
    for (auto t : mesh_.triangles) {
      if (is_removed(t)) continue;
      for (std::uint32_t& p : t) {
        if (number[p] == UINT32_MAX) {
          number[p] = static_cast<std::uint32_t>(result.points.size());
          result.points.push_back(mesh_.points[p]);
        }
        p = number[p];
      }
      result.triangles.push_back(t);
    }
    return result;
  }

 private:
  struct Vertex {
    Quadric quadric;
    std::size_t first_triangle = 0;  // in triangles_of_
    std::uint32_t triangle_count = 0;
    bool is_new = false;  // since the errors were computed
  };
  struct Collapse {
    double error;
    std::uint32_t from, to;
    auto operator<=>(const Collapse&) const = default;
  };

  static bool is_removed(const std::array<std::uint32_t, 3>& t) { return t[0] == t[1]; }
  std::span<const std::uint32_t> triangles_of(std::uint32_t p) const {
    return {triangles_of_.data() + vertices_[p].first_triangle, vertices_[p].triangle_count};
  }
  Eigen::Vector3d area_vector(std::uint32_t n) const {
    const auto& t = mesh_.triangles[n];
    const Eigen::Vector3d& a = mesh_.points[t[0]];
    return (mesh_.points[t[1]] - a).cross(mesh_.points[t[2]] - a);
  }

  Quadric quadric_of(std::uint32_t from, std::uint32_t to) const {
    Quadric sum = vertices_[from].quadric;
    sum.add(vertices_[to].quadric);
    return sum;
  }

  // The position of least error for both vertices together.
  Eigen::Vector3d position(std::uint32_t from, std::uint32_t to, const Quadric& q) const {
    const Eigen::Vector3d middle = 0.5 * (mesh_.points[from] + mesh_.points[to]);
    const double weight = kMiddleWeight * q.a.trace();
    if (!(weight > 0.0)) return middle;
    const Eigen::Matrix3d a = q.a + weight * Eigen::Matrix3d::Identity();
    return middle + a.llt().solve(q.b - q.a * middle);
  }

  // Each edge of the closed mesh has one triangle in which it leads from its lower to its higher point.
  std::vector<Collapse> sorted_collapses() {
    std::vector<Collapse> collapses;
    collapses.reserve(left_ * 3 / 2);
    for (const auto& t : mesh_.triangles)
      for (std::size_t i = 0; i < 3; ++i) {
        const std::uint32_t from = t[i], to = t[(i + 1) % 3];
        if (from >= to) continue;
        const Quadric q = quadric_of(from, to);
        collapses.push_back({q.at(position(from, to, q)), from, to});
      }
    std::sort(collapses.begin(), collapses.end());
    for (Vertex& v : vertices_) v.is_new = false;
    return collapses;
  }

  static bool has(const std::array<std::uint32_t, 3>& t, std::uint32_t p) {
    return t[0] == p || t[1] == p || t[2] == p;
  }

  // The link condition: the only vertices next to both are those of the triangles at the edge.
  bool keeps_topology(std::uint32_t from, std::uint32_t to) {
    ++mark_;
    std::size_t shared = 0, common = 0;
    for (const std::uint32_t n : triangles_of(from)) {
      shared += has(mesh_.triangles[n], to);
      for (const std::uint32_t p : mesh_.triangles[n]) marked_[p] = mark_;
    }
    for (const std::uint32_t p : {from, to}) marked_[p] = 0;
    for (const std::uint32_t n : triangles_of(to))
      for (const std::uint32_t p : mesh_.triangles[n])
        if (std::exchange(marked_[p], marked_[p] == mark_ ? 0U : marked_[p]) == mark_) ++common;
    return shared == 2 && common == 2 && vertices_[from].triangle_count + vertices_[to].triangle_count > 6;
  }

  bool folds(std::uint32_t moved, std::uint32_t other, const Eigen::Vector3d& position) {
    for (const std::uint32_t n : triangles_of(moved)) {
      const auto& t = mesh_.triangles[n];
      if (has(t, other)) continue;
      const Eigen::Vector3d before = area_vector(n);
      const Eigen::Vector3d kept = std::exchange(mesh_.points[moved], position);
      const Eigen::Vector3d after = area_vector(n);
      mesh_.points[moved] = kept;
      if (!(before.dot(after) > kMinNormalCosine * before.norm() * after.norm())) return true;
    }
    return false;
  }

  void collapse(const Collapse& c) {
    if (vertices_[c.from].is_new || vertices_[c.to].is_new || !keeps_topology(c.from, c.to)) return;
    const Quadric q = quadric_of(c.from, c.to);
    const Eigen::Vector3d at = position(c.from, c.to, q);
    if (folds(c.from, c.to, at) || folds(c.to, c.from, at)) return;
    const std::size_t first = triangles_of_.size();
    for (const std::uint32_t p : {c.from, c.to})
      for (std::size_t i = 0; i < vertices_[p].triangle_count; ++i) {
        const std::uint32_t n = triangles_of_[vertices_[p].first_triangle + i];
        auto& t = mesh_.triangles[n];
        if (is_removed(t)) continue;
        if (has(t, c.from) && has(t, c.to)) {
          remove(n, c);
          continue;
        }
        std::replace(t.begin(), t.end(), c.from, c.to);
        triangles_of_.push_back(n);
      }
    vertices_[c.from].triangle_count = 0;
    Vertex& merged = vertices_[c.to];
    merged.quadric = q;
    merged.first_triangle = first;
    merged.triangle_count = static_cast<std::uint32_t>(triangles_of_.size() - first);
    merged.is_new = true;
    mesh_.points[c.to] = at;
  }

  // Removes a triangle at the edge that collapses, also from the list of its third vertex.
  void remove(std::uint32_t n, const Collapse& c) {
    auto& t = mesh_.triangles[n];
    for (const std::uint32_t p : t) {
      if (p == c.from || p == c.to) continue;
      const auto list = triangles_of_.begin() + static_cast<std::ptrdiff_t>(vertices_[p].first_triangle);
      std::remove(list, list + vertices_[p].triangle_count, n);
      --vertices_[p].triangle_count;
    }
    t = {0, 0, 0};
    --left_;
  }

  TriangleMesh mesh_;
  std::size_t left_;  // triangles
  std::vector<Vertex> vertices_;
  std::vector<std::uint32_t> triangles_of_;  // lists of the vertices; abandoned ones remain
  std::vector<std::uint32_t> marked_;
  std::uint32_t mark_ = 0;
};

}  // namespace

TriangleMesh simplified(const TriangleMesh& mesh, std::size_t max_triangles) {
  if (mesh.triangles.size() <= max_triangles) return mesh;
  return Simplification(mesh).run(max_triangles);
}

}  // namespace smartsurf::mesh
