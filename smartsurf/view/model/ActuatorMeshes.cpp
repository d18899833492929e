#include "smartsurf/view/model/ActuatorMeshes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <vector>

#include "smartsurf/view/model/Meshes.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;

void add_vertex(TwoColourMesh& mesh, const Vec& p, const Vec& n, float accent) {
  mesh.indices.push_back(static_cast<std::uint32_t>(mesh.vertices.size() / 7));
  mesh.vertices.insert(mesh.vertices.end(), {p.x(), p.y(), p.z(), n.x(), n.y(), n.z(), accent});
}

void add_flat_triangle(TwoColourMesh& mesh, const Vec& a, const Vec& b, const Vec& c, float accent) {
  const Vec n = (b - a).cross(c - a).normalized();
  for (const Vec& p : {a, b, c}) add_vertex(mesh, p, n, accent);
}

void add_quad(TwoColourMesh& mesh, const Vec& a, const Vec& b, const Vec& c, const Vec& d, float accent) {
  add_flat_triangle(mesh, a, b, c, accent);
  add_flat_triangle(mesh, a, c, d, accent);
}

Vec circle_point(int step, int steps, float radius, float z) {
  const auto [x, y] = view::circle_point(step, steps);
  return {radius * x, radius * y, z};
}

// A band about z between two circles. Its front faces outwards if z0 < z1, inwards if z0 > z1.
void add_band(TwoColourMesh& mesh, int segments, float r0, float z0, float r1, float z1, float accent) {
  for (int i = 0; i < segments; ++i)
    add_quad(mesh, circle_point(i, segments, r0, z0), circle_point(i + 1, segments, r0, z0),
             circle_point(i + 1, segments, r1, z1), circle_point(i, segments, r1, z1), accent);
}

void add_box(TwoColourMesh& mesh, const Vec& low, const Vec& high, float accent) {
  const auto at = [&](int i) {
    return Vec(i & 1 ? high.x() : low.x(), i & 2 ? high.y() : low.y(), i & 4 ? high.z() : low.z());
  };
  static constexpr int kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                       {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& f : kFaces) add_quad(mesh, at(f[0]), at(f[1]), at(f[2]), at(f[3]), accent);
}

// A body of revolution with a bore from above: height 1, radius 1 at its foot.
struct Cup {
  float lip, bore;              // outer and inner radius at the top
  float floor;                  // z of the bottom of the bore
  float outside, wall, bottom;  // share of the accent colour: outside and lip, wall of the bore, its floor
};

TwoColourMesh cup_mesh(int segments, const Cup& cup) {
  TwoColourMesh mesh;
  add_band(mesh, segments, 1, 0, cup.lip, 1, cup.outside);
  add_band(mesh, segments, cup.lip, 1, cup.bore, 1, cup.outside);
  add_band(mesh, segments, cup.bore, 1, cup.bore, cup.floor, cup.wall);
  add_band(mesh, segments, cup.bore, cup.floor, 0, cup.floor, cup.bottom);
  return mesh;
}

}  // namespace

TwoColourMesh ball_mesh(int segments) {
  // Multiples of four, so that the coloured fields end at grid lines.
  const int around = (segments + 3) / 4 * 4, up = around / 2;
  TwoColourMesh mesh;
  const auto at = [&](int ring, int step) {
    const double z = std::numbers::pi * ring / up;
    return Vec(circle_point(step, around, static_cast<float>(std::sin(z)), static_cast<float>(-std::cos(z))));
  };
  for (int ring = 0; ring < up; ++ring)
    for (int step = 0; step < around; ++step) {
      const bool accent = (step / (around / 4) + ring / (up / 2)) % 2 != 0;
      const Vec a = at(ring, step), b = at(ring, step + 1), c = at(ring + 1, step + 1),
                d = at(ring + 1, step);
      for (const Vec* p : {&a, &b, &c})
        if (ring > 0) add_vertex(mesh, *p, *p, accent);
      for (const Vec* p : {&a, &c, &d})
        if (ring + 1 < up || ring == 0) add_vertex(mesh, *p, *p, accent);
    }
  return mesh;
}

TwoColourMesh wheel_mesh(int segments) {
  const int around = (segments + 7) / 8 * 8;
  TwoColourMesh mesh;
  const auto at = [&](int step, float y) {
    const Vec p = circle_point(step, around, 1, 0);
    return Vec(p.x(), y, p.y());
  };
  for (int i = 0; i < around; ++i) {
    const float accent = i / (around / 8) % 2 == 0 ? 0.0F : 1.0F;
    add_quad(mesh, at(i, 1), at(i + 1, 1), at(i + 1, -1), at(i, -1), accent);
    for (const float side : {-1.0F, 1.0F}) {
      const Vec hub(0, side, 0);
      if (side < 0)
        add_flat_triangle(mesh, hub, at(i, side), at(i + 1, side), accent);
      else
        add_flat_triangle(mesh, hub, at(i + 1, side), at(i, side), accent);
    }
  }
  return mesh;
}

TwoColourMesh arrow_mesh() {
  TwoColourMesh mesh;
  constexpr float kNeck = 0.1F, kHalf = 0.35F;
  add_box(mesh, Vec(-1, -kHalf, -kHalf), Vec(kNeck, kHalf, kHalf), 0.0F);
  const Vec tip(1, 0, 0);
  const Vec base[4] = {{kNeck, -1, -1}, {kNeck, 1, -1}, {kNeck, 1, 1}, {kNeck, -1, 1}};
  for (int i = 0; i < 4; ++i) add_flat_triangle(mesh, base[i], base[(i + 1) % 4], tip, 1.0F);
  add_quad(mesh, base[0], base[3], base[2], base[1], 1.0F);
  return mesh;
}

TwoColourMesh coil_mesh(int segments) {
  return cup_mesh(segments, {.lip = 1, .bore = 0.72F, .floor = 0.6F, .outside = 1, .wall = 1, .bottom = 0});
}

TwoColourMesh nozzle_mesh(int segments) {
  return cup_mesh(segments,
                  {.lip = 0.85F, .bore = 0.55F, .floor = 0.1F, .outside = 0, .wall = 1, .bottom = 1});
}

TwoColourMesh plume_mesh(int segments) {
  TwoColourMesh mesh;
  for (int i = 0; i < segments; ++i) {
    const Vec a = circle_point(i, segments, 0.4F, 0), b = circle_point(i + 1, segments, 0.4F, 0),
              c = circle_point(i + 1, segments, 1, 1), d = circle_point(i, segments, 1, 1);
    const Vec n = (b - a).cross(c - a).normalized();
    add_vertex(mesh, a, n, 0), add_vertex(mesh, b, n, 0), add_vertex(mesh, c, n, 1);
    add_vertex(mesh, a, n, 0), add_vertex(mesh, c, n, 1), add_vertex(mesh, d, n, 1);
  }
  return mesh;
}

TwoColourMesh plate_mesh() {
  TwoColourMesh mesh;
  add_box(mesh, Vec(-1, -1, -1), Vec(1, 1, 1), 0.0F);
  constexpr float kInset = 0.55F, kOver = 1.04F;
  add_quad(mesh, {-kInset, -kInset, kOver}, {kInset, -kInset, kOver}, {kInset, kInset, kOver},
           {-kInset, kInset, kOver}, 1.0F);
  return mesh;
}

TwoColourMesh turned_mesh(int segments, std::span<const Eigen::Vector2f> outline, float shaft_z) {
  TwoColourMesh mesh;
  for (std::size_t i = 0; i + 1 < outline.size(); ++i) {
    const Eigen::Vector2f &upper = outline[i], &lower = outline[i + 1];
    add_band(mesh, segments, lower.x(), lower.y(), upper.x(), upper.y(), lower.y() >= shaft_z ? 1.0F : 0.0F);
  }
  return mesh;
}

TwoColourMesh rounded_prism_mesh(int segments, const Eigen::Vector2f& half_edges, float corner_radius,
                                 float depth) {
  const int around = (segments + 3) / 4 * 4;
  std::vector<Vec> rim;
  for (int quarter = 0; quarter < 4; ++quarter)
    for (int k = 0; k <= around / 4; ++k) {
      const Vec arc = circle_point(quarter * around / 4 + k, around, corner_radius, 0);
      const float east = quarter == 0 || quarter == 3 ? 1.0F : -1.0F, north = quarter < 2 ? 1.0F : -1.0F;
      rim.push_back(
          arc + Vec(east * (half_edges.x() - corner_radius), north * (half_edges.y() - corner_radius), 0));
    }
  TwoColourMesh mesh;
  const Vec down(0, 0, -depth);
  for (std::size_t i = 0; i < rim.size(); ++i) {
    const Vec &a = rim[i], &b = rim[(i + 1) % rim.size()];
    if ((b - a).norm() < 1e-6F) continue;
    add_flat_triangle(mesh, Vec::Zero(), a, b, 1.0F);
    add_quad(mesh, a + down, b + down, b, a, 0.0F);
  }
  return mesh;
}

// Brute force: a triple of points is in a hull face if all other points lie on one side of its plane. The
// triples of a face with more corners overlap, in one colour.
TwoColourMesh hull_mesh(std::span<const Vec> points) {
  TwoColourMesh mesh;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t j = i + 1; j < points.size(); ++j)
      for (std::size_t k = j + 1; k < points.size(); ++k) {
        const Vec n = (points[j] - points[i]).cross(points[k] - points[i]);
        const float thin = 1e-4F * n.norm();
        if (!(thin > 1e-9F)) continue;
        bool above = false, below = false;
        for (const Vec& p : points) {
          above |= n.dot(p - points[i]) > thin;
          below |= n.dot(p - points[i]) < -thin;
        }
        if (above && below) continue;
        const float accent = (above ? -n : n).dot(Vec(1.0F, 0.7F, 0.5F)) > 0.0F ? 1.0F : 0.0F;
        if (above)
          add_flat_triangle(mesh, points[i], points[k], points[j], accent);
        else
          add_flat_triangle(mesh, points[i], points[j], points[k], accent);
      }
  return mesh;
}

}  // namespace smartsurf::view
