#include "smartsurf/mesh/SolidBuilder.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include "smartsurf/mesh/MassProperties.h"
#include "tests/unit/smartsurf/mesh/TestMeshes.h"

namespace smartsurf::mesh {
namespace {

scene::Solid make(const TriangleMesh& mesh, const SolidOptions& options = {}) {
  std::vector<std::string> notes;
  scene::Solid solid = build_solid(mesh, options, notes);
  for (const auto& note : notes) ADD_FAILURE() << note;
  return solid;
}

void expect_inertia(const scene::Solid& solid, const Eigen::Matrix3d& right, double tolerance) {
  EXPECT_LT((solid.inertia - right).norm(), tolerance * right.norm()) << solid.inertia << "\n\n" << right;
}

// The inertia about the centre of mass, for density 1.
Eigen::Matrix3d box_inertia(const Eigen::Vector3d& size) {
  const Eigen::Vector3d s = size.cwiseAbs2() * size.prod() / 12.0;
  return Eigen::Vector3d(s.y() + s.z(), s.x() + s.z(), s.x() + s.y()).asDiagonal();
}

TEST(MakeSolid, BoxFarFromOriginMatchesClosedForm) {
  const scene::Solid box = make(box_mesh({100, 200, 300}, {101, 202, 303}));
  EXPECT_NEAR(box.volume, 6.0, 1e-12);
  expect_inertia(box, box_inertia({1, 2, 3}), 1e-9);
  EXPECT_LT((box.bounds_min - Eigen::Vector3f(-0.5F, -1.0F, -1.5F)).norm(), 1e-5F);
  EXPECT_LT((box.bounds_max - Eigen::Vector3f(0.5F, 1.0F, 1.5F)).norm(), 1e-5F);
  EXPECT_NEAR(box.bounding_radius, std::sqrt(3.5F), 1e-5);
  EXPECT_EQ(box.hulls.size(), 1U);
}

TEST(MakeSolid, TetrahedronMatchesClosedForm) {
  const scene::Solid t = make(tetrahedron());
  EXPECT_NEAR(t.volume, 1.0 / 6.0, 1e-15);
  // About the corner ∫x² = 1/60, ∫xy = 1/120; the centre of mass is (1, 1, 1)/4.
  Eigen::Matrix3d second = Eigen::Matrix3d::Constant(1.0 / 120.0 - 1.0 / 96.0);
  second.diagonal().setConstant(1.0 / 60.0 - 1.0 / 96.0);
  expect_inertia(t, second.trace() * Eigen::Matrix3d::Identity() - second, 1e-12);
  EXPECT_LT((t.bounds_min - Eigen::Vector3f::Constant(-0.25F)).norm(), 1e-6F);
}

TEST(MakeSolid, RotatedBoxHasRotatedInertia) {
  const Eigen::Matrix3d turn =
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  TriangleMesh mesh = box_mesh({0, 0, 0}, {1, 2, 3});
  for (auto& p : mesh.points) p = turn * p;
  expect_inertia(make(mesh), turn * box_inertia({1, 2, 3}) * turn.transpose(), 1e-9);
}

TEST(MakeSolid, IcospheresConvergeQuadratically) {
  const double sphere = 4.0 / 3.0 * std::numbers::pi;
  double before = 1.0;
  for (const int rounds : {1, 2, 3}) {
    std::vector<std::string> notes;  // the finest mesh exceeds kMaxHullCorners
    const double off = 1.0 - build_solid(icosphere(rounds), {}, notes).volume / sphere;
    if (rounds > 1) {
      EXPECT_NEAR(before / off, 4.0, 0.3);
    }
    before = off;
  }
  EXPECT_LT(before, 0.01);
}

TEST(MakeSolid, TorusMatchesClosedForm) {
  std::vector<std::string> notes;
  const scene::Solid ring = build_solid(torus(3.0, 1.0, 96, 48), {.decompose = false}, notes);
  const double volume = 2.0 * std::numbers::pi * std::numbers::pi * 3.0;
  EXPECT_NEAR(ring.volume / volume, 1.0, 0.004);
  EXPECT_NEAR(ring.inertia(2, 2) / (volume * (9.0 + 0.75)), 1.0, 0.006);
  EXPECT_NEAR(ring.inertia(0, 0) / (volume * (4.5 + 0.625)), 1.0, 0.006);
}

TEST(MakeSolid, ReportsOrRejectsPoorApproximation) {
  std::vector<std::string> notes;
  build_solid(torus(3.0, 1.0, 24, 12), {.decompose = false}, notes);
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_EQ(notes[0],
            "the collision shape, 1 piece, has 56.9 % more volume than the mesh (inertia off by 17.2 %, "
            "centre of mass by 0 % of the radius)");
  const std::string error = error_message_of([] {
    std::vector<std::string> none;
    build_solid(torus(3.0, 1.0, 24, 12), {.max_hulls = 1}, none);
  });
  EXPECT_NE(error.find("more than the tolerance of 20 %: raise pieces = 1 or tolerance"), std::string::npos)
      << error;
  notes.clear();
  EXPECT_EQ(build_solid(torus(3.0, 1.0, 24, 12), {.max_hulls = 1, .tolerance = 0.9}, notes).hulls.size(), 1U);
}

TEST(MakeSolid, RejectsSheetsAndInvalidSizes) {
  const auto refused = [](const TriangleMesh& mesh) { return error_message_of([&] { make(mesh); }); };
  TriangleMesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {}};
  add_quad(sheet, {0, 1, 2, 3});
  add_quad(sheet, {3, 2, 1, 0});
  EXPECT_NE(refused(sheet).find("encloses almost no volume"), std::string::npos) << refused(sheet);
  EXPECT_NE(refused(box_mesh({0, 0, 0}, {1e-4, 1e-4, 1e-4})).find("is 0.0001 u across"), std::string::npos);
  EXPECT_NE(refused(box_mesh({0, 0, 0}, {1e7, 1, 1})).find("set its scale"), std::string::npos);
  EXPECT_NE(refused({{{0, 0, 0}, {1, 1, 1}}, {}}).find("no triangles"), std::string::npos);
}

TEST(MakeSolid, IsDeterministic) {
  const scene::Solid a = make(torus(3.0, 1.0, 20, 10)), b = make(torus(3.0, 1.0, 20, 10));
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.inertia, b.inertia);
  ASSERT_EQ(a.hulls.size(), b.hulls.size());
  for (std::size_t i = 0; i < a.hulls.size(); ++i) {
    EXPECT_EQ(a.hulls[i].vertices, b.hulls[i].vertices);
    EXPECT_EQ(a.hulls[i].face_vertices, b.hulls[i].face_vertices);
  }
}

// The largest difference of two solids as a whole, relative to their size.
double difference(const scene::Solid& a, const scene::Solid& b) {
  const double size = b.bounding_radius;
  double worst =
      std::max({std::abs(a.volume - b.volume) / b.volume, (a.inertia - b.inertia).norm() / b.inertia.norm(),
                (a.centroid - b.centroid).norm() / (size + b.centroid.norm()),
                std::abs(double{a.bounding_radius} - size) / size});
  const auto compare = [&](double x, double y) { worst = std::max(worst, std::abs(x - y) / size); };
  const auto reach = [](const scene::Solid& solid, const Eigen::Vector3f& direction) {
    float hulls = -1e9F, mesh = -1e9F;
    for (const scene::ConvexHull& hull : solid.hulls)
      for (const Eigen::Vector3f& v : hull.vertices) hulls = std::max(hulls, v.dot(direction));
    for (const Eigen::Vector3f& v : solid.vertices) mesh = std::max(mesh, v.dot(direction));
    return std::pair{hulls, mesh};
  };
  std::mt19937 random(2);
  std::normal_distribution<float> normal;
  for (int i = 0; i < 40; ++i) {
    const auto direction = Eigen::Vector3f(normal(random), normal(random), normal(random)).normalized();
    const auto [hulls_a, mesh_a] = reach(a, direction);
    const auto [hulls_b, mesh_b] = reach(b, direction);
    compare(hulls_a, hulls_b), compare(mesh_a, mesh_b);
  }
  for (int i = 0; i < 3; ++i)
    compare(a.bounds_min[i], b.bounds_min[i]), compare(a.bounds_max[i], b.bounds_max[i]);
  return worst;
}

// The same hulls, bit for bit.
void expect_same_hulls(const scene::Solid& a, const scene::Solid& b) {
  ASSERT_EQ(a.hulls.size(), b.hulls.size());
  for (std::size_t i = 0; i < a.hulls.size(); ++i) {
    const scene::ConvexHull &x = a.hulls[i], &y = b.hulls[i];
    EXPECT_EQ(x.vertices, y.vertices);
    EXPECT_EQ(x.face_vertices, y.face_vertices);
    EXPECT_EQ(x.edges, y.edges);
    EXPECT_EQ(x.bounds_min, y.bounds_min);
    EXPECT_EQ(x.bounds_max, y.bounds_max);
    EXPECT_EQ(x.unique_normals, y.unique_normals);
    EXPECT_EQ(x.unique_edge_directions, y.unique_edge_directions);
    const auto same = [](const scene::ConvexHull::Face& f, const scene::ConvexHull::Face& g) {
      return f.normal == g.normal && f.offset == g.offset && f.first_vertex == g.first_vertex &&
             f.vertex_count == g.vertex_count;
    };
    EXPECT_TRUE(std::ranges::equal(x.faces, y.faces, same));
  }
}

// Builds the solid of an object made larger by the factor.
using Builder = std::function<scene::Solid(double)>;

// Hulls of points about a sphere, compounds of such, boxes and decomposed meshes.
std::vector<Builder> random_builders(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const auto points = [&] {
    std::vector<Eigen::Vector3d> all(12);
    const Eigen::Vector3d centre(normal(random), normal(random), normal(random));
    for (auto& p : all)
      p = centre + Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    return all;
  };
  const auto larger = [](std::vector<Eigen::Vector3d> all, double factor) {
    for (auto& p : all) p *= factor;
    return all;
  };
  const auto of_mesh = [larger](const TriangleMesh& mesh) -> Builder {
    return [=](double factor) {
      std::vector<std::string> notes;
      return build_solid({larger(mesh.points, factor), mesh.triangles}, {}, notes);
    };
  };
  std::vector<Builder> builders{of_mesh(l_mesh()), of_mesh(torus(3.0, 1.0, 8, 6)),
                                of_mesh(box_mesh(Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(1.5, 4, 4)))};
  for (int i = 0; i < 10; ++i) {
    builders.emplace_back(
        [larger, hull = points()](double factor) { return build_hull_solid(larger(hull, factor)); });
    builders.emplace_back([larger, a = points(), b = points()](double factor) {
      return build_compound(std::vector{larger(a, factor), larger(b, factor)});
    });
  }
  return builders;
}

TEST(ScaledSolid, IsTheSolidOfScaledPoints) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> exponent(-6.0, 6.0);
  for (const Builder& build : random_builders(random)) {
    const scene::Solid solid = build(1.0);
    const double factor = std::exp(exponent(random));
    EXPECT_LT(difference(scaled(solid, factor), build(factor)), 1e-5) << factor;
    EXPECT_LT(difference(scaled(scaled(solid, factor), 1.0 / factor), solid), 1e-5) << factor;
    const double exact = std::exp2(std::round(exponent(random)));
    EXPECT_EQ(difference(scaled(solid, exact), build(exact)), 0.0) << exact;
    expect_same_hulls(scaled(solid, exact), build(exact));
  }
}

TEST(HullSolid, CentreOfMassIsOrigin) {
  const std::vector<Eigen::Vector3d> wedge{{10, 0, 0}, {13, 0, 0}, {10, 3, 0}, {10, 0, 2},
                                           {13, 0, 2}, {10, 3, 2}, {11, 1, 1}};
  const scene::Solid solid = build_hull_solid(wedge);
  EXPECT_NEAR(solid.volume, 9.0, 1e-5);
  EXPECT_LT((solid.bounds_min - Eigen::Vector3f(-1, -1, -1)).norm(), 1e-5F);
  EXPECT_LT((solid.bounds_max - Eigen::Vector3f(2, 2, 1)).norm(), 1e-5F);
  ASSERT_EQ(solid.hulls.size(), 1U);
  EXPECT_EQ(solid.hulls[0].vertices.size(), 6U);
  EXPECT_EQ(solid.triangles.size(), 8U);
  MassProperties drawn;
  for (const auto& t : solid.triangles)
    drawn.add(solid.vertices[t[0]].cast<double>(), solid.vertices[t[1]].cast<double>(),
              solid.vertices[t[2]].cast<double>());
  EXPECT_NEAR(drawn.volume(), 9.0, 1e-5);
  expect_inertia(solid, drawn.inertia(drawn.centre()), 1e-9);
}

TEST(HullSolid, RejectsFlatOrTooFewPoints) {
  const std::vector<Eigen::Vector3d> flat{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  EXPECT_EQ(error_message_of([&] { build_hull_solid(flat); }), "is flat: its points enclose no volume");
  EXPECT_EQ(error_message_of([&] { build_hull_solid(std::span(flat).first(3)); }),
            "has 3 points: a hull needs at least four");
}

}  // namespace
}  // namespace smartsurf::mesh
