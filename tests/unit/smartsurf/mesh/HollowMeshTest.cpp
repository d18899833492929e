// Hollow meshes, drawn from seeds: by default their pieces exceed them by at most a tenth and leave them
// hollow.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <functional>
#include <random>

#include "smartsurf/mesh/ConvexDecomposition.h"
#include "smartsurf/mesh/MassProperties.h"
#include "smartsurf/mesh/SolidBuilder.h"
#include "tests/unit/common/SanitizedCases.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

using Profile = std::vector<Eigen::Vector2d>;  // distance from the axis, height; counter-clockwise

// A closed profile turned about z. Points on the axis become one point.
TriangleMesh revolved(const Profile& profile, std::uint32_t around) {
  TriangleMesh mesh;
  std::vector<std::vector<std::uint32_t>> rings;
  for (const Eigen::Vector2d& p : profile) {
    rings.emplace_back();
    for (std::uint32_t i = 0; i < (p.x() > 0.0 ? around : 1U); ++i) {
      const double a = 2.0 * std::numbers::pi * i / around;
      rings.back().push_back(static_cast<std::uint32_t>(mesh.points.size()));
      mesh.points.emplace_back(p.x() * std::cos(a), p.x() * std::sin(a), p.y());
    }
  }
  for (std::size_t k = 0; k < rings.size(); ++k) {
    const auto &a = rings[k], &b = rings[(k + 1) % rings.size()];
    if (a.size() == 1 && b.size() == 1) continue;
    for (std::uint32_t i = 0; i < around; ++i) {
      const std::uint32_t j = (i + 1) % around;
      if (a.size() == 1)
        mesh.triangles.push_back({a[0], b[j], b[i]});
      else if (b.size() == 1)
        mesh.triangles.push_back({a[i], a[j], b[0]});
      else
        add_quad(mesh, {a[i], a[j], b[j], b[i]});
    }
  }
  return mesh;
}

// A bent rod along a circle in the xz-plane about `centre`, from angle `from` to `to` from x towards z.
TriangleMesh bent_rod(const Eigen::Vector3d& centre, double radius, double thickness, double from,
                      double to) {
  constexpr std::uint32_t kAlong = 24, kAcross = 12;
  TriangleMesh mesh;
  const auto axis_at = [&](double a) {
    return Eigen::Vector3d(centre + radius * Eigen::Vector3d(std::cos(a), 0, std::sin(a)));
  };
  for (std::uint32_t i = 0; i <= kAlong; ++i) {
    const double a = from + (to - from) * i / kAlong;
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      const double b = 2.0 * std::numbers::pi * j / kAcross;
      mesh.points.push_back(axis_at(a) + thickness / 2 *
                                             (std::cos(b) * Eigen::Vector3d(std::cos(a), 0, std::sin(a)) +
                                              std::sin(b) * Eigen::Vector3d(0, 1, 0)));
    }
  }
  for (std::uint32_t i = 0; i < kAlong; ++i)
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      const std::uint32_t k = (j + 1) % kAcross;
      add_quad(mesh, {i * kAcross + j, i * kAcross + k, (i + 1) * kAcross + k, (i + 1) * kAcross + j});
    }
  for (const std::uint32_t end : {0U, kAlong}) {
    const auto middle = static_cast<std::uint32_t>(mesh.points.size());
    mesh.points.push_back(axis_at(end == 0 ? from : to));
    for (std::uint32_t j = 0; j < kAcross; ++j) {
      const std::uint32_t a = end * kAcross + j, b = end * kAcross + (j + 1) % kAcross;
      if (end == 0)
        mesh.triangles.push_back({middle, b, a});
      else
        mesh.triangles.push_back({middle, a, b});
    }
  }
  return mesh;
}

struct Draw {
  explicit Draw(unsigned seed) : random(seed) {}
  double operator()(double low, double high) { return std::uniform_real_distribution(low, high)(random); }
  std::mt19937 random;
};

TriangleMesh cup(Draw& draw, double wall) {
  const double r = 1.0, taper = draw(0.7, 1.0), h = draw(0.8, 3.0), floor = draw(0.8, 1.5) * wall;
  return revolved({{0, 0}, {taper * r, 0}, {r, h}, {r - wall, h}, {taper * r - wall, floor}, {0, floor}},
                  40 + draw.random() % 40);
}

// The handle's ends lie in the wall.
TriangleMesh mug(Draw& draw, double wall) {
  const double h = draw(1.4, 2.4), handle = draw(0.3, 0.45) * h;
  TriangleMesh mesh =
      revolved({{0, 0}, {1, 0}, {1, h}, {1 - wall, h}, {1 - wall, 1.2 * wall}, {0, 1.2 * wall}}, 64);
  add(mesh, bent_rod({1 - 0.4 * wall, 0, h / 2}, handle, draw(0.8, 1.4) * wall, -std::numbers::pi / 2,
                     std::numbers::pi / 2));
  return mesh;
}

TriangleMesh bowl(Draw& draw, double wall) {
  const double depth = draw(0.5, 1.0) * std::numbers::pi / 2;  // of the sphere's angle
  Profile profile;
  constexpr int kSteps = 14;
  for (int i = 0; i <= kSteps; ++i) {
    const double a = depth * i / kSteps;
    profile.emplace_back(std::sin(a), -std::cos(a));
  }
  for (int i = kSteps; i >= 0; --i) {
    const double a = depth * i / kSteps;
    profile.emplace_back((1 - wall) * std::sin(a), -(1 - wall) * std::cos(a));
  }
  return revolved(profile, 48);
}

TriangleMesh tube(Draw& draw, double wall) {
  const double h = draw(0.3, 4.0);
  return revolved({{1 - wall, 0}, {1, 0}, {1, h}, {1 - wall, h}}, 32 + draw.random() % 64);
}

TriangleMesh ring(Draw& draw, double wall) { return torus(1.0, draw(1.0, 2.0) * wall, 64, 16); }

// A box without its top, and the lid beside it or open above it.
TriangleMesh box_with_lid(Draw& draw, double wall) {
  const double w = draw(1.0, 3.0), d = draw(1.0, 3.0), h = draw(0.6, 2.0);
  TriangleMesh mesh;
  const auto add_corners = [&](double inset, double z) {
    for (const auto& [x, y] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
      mesh.points.emplace_back(x == 0 ? inset : w - inset, y == 0 ? inset : d - inset, z);
  };
  add_corners(0, 0), add_corners(0, h), add_corners(wall, h), add_corners(wall, wall);
  add_quad(mesh, {3, 2, 1, 0});
  for (const std::uint32_t level : {0U, 4U, 8U})  // outside, rim, inside
    for (std::uint32_t i = 0; i < 4; ++i) {
      const std::uint32_t j = (i + 1) % 4;
      add_quad(mesh, {level + i, level + j, level + 4 + j, level + 4 + i});
    }
  add_quad(mesh, {12, 13, 14, 15});
  TriangleMesh lid = box_mesh({0, 0, 0}, {w, d, wall});
  const Eigen::AngleAxisd opened(draw(0.4, 1.6), Eigen::Vector3d::UnitX());
  for (auto& p : lid.points) p = opened * p + Eigen::Vector3d(0, 0, 1.02 * h + wall);
  add(mesh, lid);
  return mesh;
}

void turn(TriangleMesh& mesh, Draw& draw) {
  const Eigen::Quaterniond q =
      Eigen::Quaterniond(draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1)).normalized();
  for (auto& p : mesh.points) p = q * p;
}

bool lies_in(const scene::Solid& solid, const Eigen::Vector3f& p) {
  return std::ranges::any_of(solid.hulls, [&](const scene::ConvexHull& hull) {
    return std::ranges::all_of(hull.faces,
                               [&](const auto& face) { return face.normal.dot(p) <= face.offset + 1e-4F; });
  });
}

struct Shape {
  const char* name;
  std::function<TriangleMesh(Draw&, double wall)> make;
};
const Shape kShapes[] = {{"cup", cup},   {"mug", mug},   {"bowl", bowl},
                         {"tube", tube}, {"ring", ring}, {"box with a lid", box_with_lid}};

TEST(HollowMeshes, PiecesAreWithinATenthOfTheVolume) {
  for (const Shape& shape : kShapes)
    for (unsigned seed = 1; seed <= 1U; ++seed) {
      Draw draw(seed);
      TriangleMesh mesh = shape.make(draw, draw(0.06, 0.2));
      turn(mesh, draw);
      orient_shells(mesh);
      SCOPED_TRACE(std::string(shape.name) + ", seed " + std::to_string(seed));
      std::vector<std::string> notes;
      const scene::Solid solid = build_solid(mesh, {.max_hollow_hulls = scene::kMaxHulls}, notes);
      MassProperties pieces;
      for (const scene::ConvexHull& hull : solid.hulls) pieces.add(hull);
      EXPECT_NEAR(pieces.volume() / solid.volume, 1.0, 0.1);
      EXPECT_LE(solid.hulls.size(), 256U);
      // Points of the mesh's box: those in the mesh are in a piece, and of the others few are.
      for (auto& p : mesh.points) p -= solid.centroid;
      const Eigen::AlignedBox3d box = bounding_box(mesh);
      int in_mesh = 0, beside = 0;
      for (int n = 0; n < 500; ++n) {
        const Eigen::Vector3d p(draw(box.min().x(), box.max().x()), draw(box.min().y(), box.max().y()),
                                draw(box.min().z(), box.max().z()));
        const bool in_piece = lies_in(solid, p.cast<float>());
        if (winding_number(mesh, p) > 0.5) {
          ++in_mesh;
          EXPECT_TRUE(in_piece) << p.transpose();
        } else {
          beside += in_piece;
        }
      }
      EXPECT_GT(in_mesh, 8);
      EXPECT_LT(beside, 0.16 * in_mesh + 8);
    }
}

TEST(HollowMeshes, ShellsInsideAreCavities) {
  // A hollow ball with a loose ball in it, and another beside it.
  TriangleMesh mesh = icosphere(3), cavity = icosphere(3), loose = icosphere(2), other = icosphere(2);
  for (auto& p : cavity.points) p *= 0.9;
  invert_orientation(cavity);
  for (auto& p : loose.points) p *= 0.4;
  for (auto& p : other.points) p = 0.5 * p + Eigen::Vector3d(3, 0, 0);
  for (const TriangleMesh* part : {&cavity, &loose, &other}) add(mesh, *part);
  std::vector<std::string> notes;
  const scene::Solid solid = build_solid(mesh, {.max_hollow_hulls = scene::kMaxHulls}, notes);
  MassProperties pieces;
  for (const scene::ConvexHull& hull : solid.hulls) pieces.add(hull);
  EXPECT_NEAR(pieces.volume() / solid.volume, 1.0, 0.1);
  EXPECT_TRUE(lies_in(solid, -solid.centroid.cast<float>()));
  EXPECT_FALSE(lies_in(solid, (Eigen::Vector3d(0, 0, 0.65) - solid.centroid).cast<float>()));
}

TEST(HollowMeshes, MessageNamesTheLimit) {
  Draw draw(1);
  const TriangleMesh thin = bowl(draw, 0.01);
  const std::string all = error_message_of([&] {
    std::vector<std::string> none;
    build_solid(thin, {.max_hollow_hulls = scene::kMaxHulls}, none);
  });
  EXPECT_NE(all.find("more than the tolerance of 20 %, and a solid has at most 256 pieces: raise tolerance"),
            std::string::npos)
      << all;
  const std::string few = error_message_of([&] {
    std::vector<std::string> none;
    build_solid(thin, {.max_hulls = 20, .max_hollow_hulls = 20}, none);
  });
  EXPECT_NE(few.find("more than the tolerance of 20 %: raise pieces = 20 or tolerance"), std::string::npos)
      << few;
}

}  // namespace
}  // namespace smartsurf::mesh
