#include "smartsurf/view/model/Meshes.h"

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

namespace smartsurf::view {
namespace {

constexpr float kConeBase = -1.0F / 3.0F;    // z of the base if the tip is at 1 and the centre of mass at 0
constexpr float kCapSeam = 1e-4F;            // |z| of a capsule's two equators
constexpr float kSmoothCosine = 0.766F;      // faces that meet at less than 40° are one curved surface
constexpr std::size_t kMaxSmoothFaces = 64;  // around a corner; more are drawn flat
constexpr int kWireframeSteps = 36, kWireframeMeridians = 12;

// A flat disc at z that faces up (up = 1) or down (up = −1).
void add_disc(Mesh& mesh, int segments, float z, float up) {
  const std::uint32_t middle = mesh.add_vertex(0, 0, z, 0, 0, up);
  for (int i = 0; i < segments; ++i) {
    const auto [x, y] = circle_point(i, segments);
    mesh.add_vertex(x, y, z, 0, 0, up);
  }
  for (int i = 0; i < segments; ++i) {
    const auto a = middle + 1 + static_cast<std::uint32_t>(i);
    const auto b = middle + 1 + static_cast<std::uint32_t>((i + 1) % segments);
    mesh.add_triangle(middle, up > 0.0F ? a : b, up > 0.0F ? b : a);
  }
}

void add_point(std::vector<float>& wireframe, float x, float y, float z) {
  wireframe.insert(wireframe.end(), {x, y, z});
}

void add_ring(std::vector<float>& wireframe, float radius, float z) {
  for (int i = 0; i < kWireframeSteps; ++i)
    for (int end = 0; end < 2; ++end) {
      const auto [x, y] = circle_point(i + end, kWireframeSteps);
      add_point(wireframe, radius * x, radius * y, z);
    }
}

// Half a great circle from the north pole to the south pole. split: one equator point per cap.
void add_meridian(std::vector<float>& wireframe, int meridian, bool split) {
  const auto [mx, my] = circle_point(meridian, kWireframeMeridians);
  for (int i = 0; i < kWireframeSteps / 2; ++i)
    for (int end = 0; end < 2; ++end) {
      auto [z, r] = circle_point(i + end, kWireframeSteps);
      // A segment that ends at the equator stays in its own cap.
      if (split && std::abs(z) < kCapSeam) z = i < kWireframeSteps / 4 ? kCapSeam : -kCapSeam;
      add_point(wireframe, r * mx, r * my, z);
    }
}

Eigen::Vector3f face_normal(const scene::Solid& solid, const std::array<std::uint32_t, 3>& t) {
  const Eigen::Vector3f &a = solid.vertices[t[0]], &b = solid.vertices[t[1]], &c = solid.vertices[t[2]];
  return (b - a).cross(c - a).normalized();
}

}  // namespace

std::array<float, 2> circle_point(int step, int steps) {
  const double angle = 2.0 * std::numbers::pi * step / steps;
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
}

std::uint32_t Mesh::add_vertex(float x, float y, float z, float nx, float ny, float nz) {
  vertices.insert(vertices.end(), {x, y, z, nx, ny, nz});
  return static_cast<std::uint32_t>(vertices.size() / 6 - 1);
}

void Mesh::add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  indices.insert(indices.end(), {a, b, c});
}

Mesh box_mesh() {
  Mesh mesh;
  static constexpr float kQuad[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (float side : {-1.0F, 1.0F}) {
      const auto first = static_cast<std::uint32_t>(mesh.vertices.size() / 6);
      for (const auto& q : kQuad) {
        std::array<float, 3> p{}, n{};
        p[axis] = n[axis] = side;
        p[(axis + 1) % 3] = q[0];
        p[(axis + 2) % 3] = q[1];
        mesh.add_vertex(p[0], p[1], p[2], n[0], n[1], n[2]);
      }
      const std::uint32_t next = side > 0.0F ? 1 : 3, last = 4 - next;
      mesh.add_triangle(first, first + next, first + 2);
      mesh.add_triangle(first, first + 2, first + last);
    }
  return mesh;
}

Mesh cylinder_mesh(int segments) {
  Mesh mesh;
  const auto vertex_count = static_cast<std::uint32_t>(2 * segments);
  for (int i = 0; i < segments; ++i) {
    const auto [x, y] = circle_point(i, segments);
    const std::uint32_t low = mesh.add_vertex(x, y, -1, x, y, 0), next = (low + 2) % vertex_count;
    mesh.add_vertex(x, y, 1, x, y, 0);
    mesh.add_triangle(low, next, next + 1);
    mesh.add_triangle(low, next + 1, low + 1);
  }
  add_disc(mesh, segments, -1, -1);
  add_disc(mesh, segments, 1, 1);
  return mesh;
}

Mesh cone_mesh(int segments) {
  Mesh mesh;
  const auto vertex_count = static_cast<std::uint32_t>(2 * segments);
  const float high = 1.0F - kConeBase, slant = std::hypot(high, 1.0F);
  for (int i = 0; i < segments; ++i) {
    // One tip vertex per segment, so that the normals vary smoothly around the cone.
    const auto [x, y] = circle_point(i, segments);
    const std::uint32_t low =
        mesh.add_vertex(x, y, kConeBase, x * high / slant, y * high / slant, 1.0F / slant);
    mesh.add_vertex(0, 0, 1, x * high / slant, y * high / slant, 1.0F / slant);
    mesh.add_triangle(low, (low + 2) % vertex_count, low + 1);
  }
  add_disc(mesh, segments, kConeBase, -1);
  return mesh;
}

Mesh capsule_mesh(int segments) {
  Mesh mesh;
  const int quarter = segments / 4;
  // Rows from the south pole to the north pole; the equator appears twice, once per cap.
  for (int row = 0; row < 2 * (quarter + 1); ++row) {
    const bool upper = row > quarter;
    const double angle = std::numbers::pi / 2.0 * (upper ? row - quarter - 1 : row - quarter) / quarter;
    const auto z = static_cast<float>(std::sin(angle)), r = static_cast<float>(std::cos(angle));
    const float edge = std::abs(z) > kCapSeam ? z : upper ? kCapSeam : -kCapSeam;
    for (int i = 0; i < segments; ++i) {
      const auto [x, y] = circle_point(i, segments);
      mesh.add_vertex(r * x, r * y, edge, r * x, r * y, z);
    }
  }
  for (int row = 0; row + 1 < 2 * (quarter + 1); ++row)
    for (int i = 0; i < segments; ++i) {
      const auto at = [&](int r, int c) { return static_cast<std::uint32_t>(r * segments + c % segments); };
      mesh.add_triangle(at(row, i), at(row, i + 1), at(row + 1, i + 1));
      mesh.add_triangle(at(row, i), at(row + 1, i + 1), at(row + 1, i));
    }
  return mesh;
}

Mesh solid_mesh(const scene::Solid& solid) {
  // Faces by the position of a corner: files often repeat a vertex for each of its faces.
  std::map<std::array<float, 3>, std::vector<std::size_t>> faces_at;
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(solid.triangles.size());
  const auto place = [&](std::uint32_t vertex) {
    const Eigen::Vector3f& p = solid.vertices[vertex];
    return std::array<float, 3>{p.x(), p.y(), p.z()};
  };
  for (const auto& triangle : solid.triangles) {
    for (const std::uint32_t vertex : triangle) faces_at[place(vertex)].push_back(normals.size());
    normals.push_back(face_normal(solid, triangle));
  }
  // The mean normal of the faces around a corner that continue this face smoothly.
  const auto smooth_normal = [&](std::size_t face, std::uint32_t vertex) {
    const std::vector<std::size_t>& around = faces_at[place(vertex)];
    Eigen::Vector3f sum = normals[face];
    if (around.size() > kMaxSmoothFaces) return sum;
    for (const std::size_t other : around)
      if (other != face && normals[other].dot(normals[face]) > kSmoothCosine) sum += normals[other];
    return Eigen::Vector3f(sum.normalized());
  };
  Mesh mesh;
  for (std::size_t face = 0; face < solid.triangles.size(); ++face) {
    const auto& triangle = solid.triangles[face];
    std::array<std::uint32_t, 3> corners{};
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3f& p = solid.vertices[triangle[i]];
      const Eigen::Vector3f n = smooth_normal(face, triangle[i]);
      corners[i] = mesh.add_vertex(p.x(), p.y(), p.z(), n.x(), n.y(), n.z());
    }
    mesh.add_triangle(corners[0], corners[1], corners[2]);
  }
  return mesh;
}

std::vector<float> sphere_wireframe() {
  std::vector<float> wireframe;
  constexpr int kParallels = 7;
  for (int p = 1; p <= kParallels; ++p) {
    const double angle = std::numbers::pi * (static_cast<double>(p) / (kParallels + 1) - 0.5);
    add_ring(wireframe, static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle)));
  }
  for (int m = 0; m < kWireframeMeridians; ++m) add_meridian(wireframe, m, false);
  return wireframe;
}

std::vector<float> capsule_wireframe() {
  std::vector<float> wireframe;
  const float high = std::sqrt(0.5F);
  add_ring(wireframe, high, -high);
  add_ring(wireframe, 1.0F, -kCapSeam);
  add_ring(wireframe, 1.0F, kCapSeam);
  add_ring(wireframe, high, high);
  for (int m = 0; m < kWireframeMeridians; ++m) {
    add_meridian(wireframe, m, true);
    const auto [x, y] = circle_point(m, kWireframeMeridians);
    add_point(wireframe, x, y, -kCapSeam);
    add_point(wireframe, x, y, kCapSeam);
  }
  return wireframe;
}

std::vector<float> box_wireframe() {
  std::vector<float> wireframe;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (float a : {-1.0F, 1.0F})
      for (float b : {-1.0F, 1.0F})
        for (float along : {-1.0F, 1.0F}) {
          std::array<float, 3> p{};
          p[axis] = along;
          p[(axis + 1) % 3] = a;
          p[(axis + 2) % 3] = b;
          add_point(wireframe, p[0], p[1], p[2]);
        }
  return wireframe;
}

std::vector<float> cylinder_wireframe() {
  std::vector<float> wireframe;
  for (float z : {-1.0F, 0.0F, 1.0F}) add_ring(wireframe, 1.0F, z);
  for (int i = 0; i < kWireframeMeridians; ++i) {
    const auto [x, y] = circle_point(i, kWireframeMeridians);
    add_point(wireframe, x, y, -1);
    add_point(wireframe, x, y, 1);
  }
  return wireframe;
}

std::vector<float> cone_wireframe() {
  std::vector<float> wireframe;
  add_ring(wireframe, 1.0F, kConeBase);
  add_ring(wireframe, 0.5F, (kConeBase + 1.0F) / 2.0F);
  for (int i = 0; i < kWireframeMeridians; ++i) {
    const auto [x, y] = circle_point(i, kWireframeMeridians);
    add_point(wireframe, x, y, kConeBase);
    add_point(wireframe, 0, 0, 1);
  }
  return wireframe;
}

std::vector<float> solid_wireframe(const scene::Solid& solid) {
  constexpr float kCoplanarCosine = 0.9995F;  // minimum cosine between the normals of coplanar faces
  struct Edge {
    Eigen::Vector3f normal;  // of the first face
    bool sharp = true;       // false once a coplanar second face is found
  };
  std::map<std::array<std::uint32_t, 2>, Edge> edges;
  for (const auto& t : solid.triangles) {
    const Eigen::Vector3f n = face_normal(solid, t);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      const auto [entry, first] = edges.try_emplace({std::min(a, b), std::max(a, b)}, Edge{n});
      if (!first && entry->second.normal.dot(n) > kCoplanarCosine) entry->second.sharp = false;
    }
  }
  std::vector<float> wireframe;
  for (const auto& [ends, edge] : edges) {
    if (!edge.sharp) continue;
    for (const std::uint32_t end : ends)
      add_point(wireframe, solid.vertices[end].x(), solid.vertices[end].y(), solid.vertices[end].z());
  }
  return wireframe;
}

}  // namespace smartsurf::view
