// Tests the declarations of objects, including solids created by a factory.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>

#include "tests/unit/smartsurf/script/ScriptFixture.h"

namespace smartsurf::script {
namespace {

// Records all requests. Returns solids of volume 1 without geometry.
class FakeSolidFactory : public scene::SolidFactory {
 public:
  scene::SolidResult load_mesh(const scene::MeshRequest& r) override {
    meshes.push_back(r);
    for (volatile bool spins = r.display_name == "endless.stl"; spins;) {
    }
    return make_result(r.display_name);
  }
  scene::SolidResult make_hull(const scene::MeshRequest& r) override {
    hulls.push_back(r);
    return make_result(r.display_name);
  }
  scene::SolidResult make_hull(std::span<const Eigen::Vector3d> all, const std::string& name) override {
    points.assign(all.begin(), all.end());
    return make_result(name);
  }
  scene::SolidResult make_compound(std::span<const std::vector<Eigen::Vector3d>> parts,
                                   const std::string& name) override {
    compound.assign(parts.begin(), parts.end());
    return make_result(name);
  }

  std::vector<scene::MeshRequest> meshes, hulls;
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<Eigen::Vector3d>> compound;
  std::string error;
  std::vector<std::string> notes;

 private:
  scene::SolidResult make_result(const std::string& name) {
    if (!error.empty()) throw scene::InputError(error);
    auto solid = std::make_shared<scene::Solid>();
    solid->source = name;
    solid->volume = 1.0;
    return {solid, notes};
  }
};

class ObjectsTest : public ScriptTest {
 protected:
  void SetUp() override {
    ScriptTest::SetUp();
    solids = std::make_shared<FakeSolidFactory>();
    options.solid_factory = solids;
    options.report_warning = [this](std::string_view line) { noted.emplace_back(line); };
  }
  std::shared_ptr<FakeSolidFactory> solids;
  std::vector<std::string> noted;
};

TEST_F(ObjectsTest, CapsulesAndCones) {
  const Experiment e = load_on_surface(
      "capsule{radius = 0.5, height = 3, position = {1, 2, 3}, label = 'pill', colour = 'red'}\n"
      "cone{radius = 2, height = 4, position = {4, 5, 6}, mass = 7, fixed = true}");
  const auto& objects = e.scene().objects;
  ASSERT_EQ(objects.size(), 2U);
  EXPECT_EQ(objects[0].shape, scene::ShapeKind::kCapsule);
  EXPECT_EQ(objects[0].radius, 0.5);
  EXPECT_EQ(objects[0].height, 3.0);
  EXPECT_EQ(objects[0].label, "pill");
  EXPECT_EQ(objects[1].shape, scene::ShapeKind::kCone);
  EXPECT_EQ(objects[1].mass, 7.0);
  EXPECT_TRUE(objects[1].fixed);
  EXPECT_EQ(error_of("capsule{radius = 2, height = 3, position = {0, 0, 0}}"),
            "t.lua:1: capsule.height = 3: must be at least twice the radius, 4");
  EXPECT_EQ(error_of("cone{radius = 2, position = {0, 0, 0}}"),
            "t.lua:1: cone: the field 'height' is missing");
  EXPECT_EQ(error_of("cone{radius = 2, size = 2}"),
            "t.lua:1: cone: unknown field 'size'; known: radius, height, position, orientation, velocity, "
            "angular_velocity, mass, com, inertia, friction, fixed, material, colour, label, pole, moment");
}

TEST_F(ObjectsTest, MeshRequestsFileBesideScript) {
  const Experiment e = load_on_surface(
      "mesh{file = 'parts/l.stl', scale = 0.1, position = {1, 2, 3}}\n"
      "mesh{file = 'l.obj', decompose = false, pieces = 8, tolerance = 0.5, position = {1, 2, 3}, label = "
      "'L'}");
  ASSERT_EQ(solids->meshes.size(), 2U);
  EXPECT_EQ(solids->meshes[0].file, std::filesystem::weakly_canonical(folder) / "parts" / "l.stl");
  EXPECT_EQ(solids->meshes[0].display_name, "parts/l.stl");
  EXPECT_EQ(solids->meshes[0].scale, 0.1);
  EXPECT_TRUE(solids->meshes[0].decompose);
  EXPECT_FALSE(solids->meshes[1].decompose);
  EXPECT_EQ(solids->meshes[1].max_hulls, 8);
  EXPECT_EQ(solids->meshes[1].tolerance, 0.5);
  EXPECT_EQ(e.scene().objects[1].shape, scene::ShapeKind::kSolid);
  EXPECT_EQ(e.scene().objects[1].solid->source, "l.obj");
  EXPECT_EQ(e.scene().objects[1].label, "L");
}

using MeshDeathTest = ObjectsTest;

TEST_F(MeshDeathTest, MeshThatTakesTooLongIsNamed) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  options.load_time_s = 0.3;
  options.end_process = [](const std::string& message) {
    std::fprintf(stderr, "%s\n", message.c_str());
    std::_Exit(2);
  };
  EXPECT_EXIT(
      error_of("\nmesh{file = 'endless.stl', position = {1, 2, 3}}"), testing::ExitedWithCode(2),
      "t.lua:2: mesh.file: its convex pieces take longer to find than a script may run: give the mesh fewer");
}

TEST_F(ObjectsTest, FilesHaveUnits) {
  load_on_surface(
      "world{unit = 'cm'}\nmesh{file = 'l.stl', unit = 'mm', position = {1, 2, 3}}\n"
      "mesh{file = 'l.stl', unit = 'in', scale = 2, position = {1, 2, 3}}");
  ASSERT_EQ(solids->meshes.size(), 2U);
  EXPECT_DOUBLE_EQ(solids->meshes[0].scale, 0.1);
  EXPECT_DOUBLE_EQ(solids->meshes[1].scale, 2 * 2.54);
  EXPECT_EQ(error_of("hull{file = 'l.stl', unit = 'mm', position = {1, 2, 3}}"),
            "t.lua:1: hull.unit: the world has no unit; declare it before, as in world{unit = 'mm'}");
  EXPECT_EQ(error_of("hull{points = {}, unit = 'mm', position = {1, 2, 3}}"),
            "t.lua:1: hull.unit: applies only to file; points are in u");
}

TEST_F(ObjectsTest, HullFromPointsOrFile) {
  load_on_surface(
      "hull{points = {{0, 0, 0}, {x = 1, y = 0, z = 0}, {0, 2, 0}, {0, 0, 3}}, position = {1, 2, 3}}");
  ASSERT_EQ(solids->points.size(), 4U);
  EXPECT_EQ(solids->points[1], Eigen::Vector3d(1, 0, 0));
  EXPECT_EQ(solids->points[3], Eigen::Vector3d(0, 0, 3));
  load_on_surface("hull{file = 'a.ply', scale = 2, position = {1, 2, 3}}");
  ASSERT_EQ(solids->hulls.size(), 1U);
  EXPECT_EQ(solids->hulls[0].scale, 2.0);
  EXPECT_EQ(error_of("hull{position = {0, 0, 0}}"),
            "t.lua:1: hull: takes one of points = {{x, y, z}, ...}, parts = {{{x, y, z}, ...}, ...} and file "
            "= 'part.stl'");
  EXPECT_EQ(error_of("hull{points = {{0, 0, 0}, {0, 0/0, 1}}, position = {0, 0, 0}}"),
            "t.lua:1: hull.points[2][2] = nan: must be finite");
  EXPECT_EQ(error_of("hull{points = {{0, 0, 0}, 'here'}, position = {0, 0, 0}}"),
            "t.lua:1: hull.points[2] = 'here': must be three numbers {x, y, z}");
  EXPECT_EQ(error_of("hull{points = 3, position = {0, 0, 0}}"),
            "t.lua:1: hull.points = 3: must be a list of points, {{x, y, z}, ...}");
}

TEST_F(ObjectsTest, HullFromParts) {
  load_on_surface(
      "hull{parts = {{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}}, {{5, 0, 0}}}, position = {1, 2, 3}}");
  ASSERT_EQ(solids->compound.size(), 2U);
  ASSERT_EQ(solids->compound[0].size(), 4U);
  EXPECT_EQ(solids->compound[0][2], Eigen::Vector3d(0, 2, 0));
  ASSERT_EQ(solids->compound[1].size(), 1U);
  EXPECT_EQ(solids->compound[1][0], Eigen::Vector3d(5, 0, 0));
  EXPECT_EQ(error_of("hull{parts = {}, position = {0, 0, 0}}"),
            "t.lua:1: hull.parts: has 0 parts; must be 1 to 256");
  EXPECT_EQ(error_of("hull{parts = {{{0, 0, 0}}, 'here'}, position = {0, 0, 0}}"),
            "t.lua:1: hull.parts[2] = 'here': must be a list of points, {{x, y, z}, ...}");
  EXPECT_EQ(error_of("hull{parts = 3, position = {0, 0, 0}}"),
            "t.lua:1: hull.parts = 3: must be a list of lists of points, {{{x, y, z}, ...}, ...}");
  EXPECT_EQ(error_of("hull{parts = {}, points = {}, position = {0, 0, 0}}"),
            "t.lua:1: hull: takes one of points = {{x, y, z}, ...}, parts = {{{x, y, z}, ...}, ...} and file "
            "= 'part.stl'");
  EXPECT_EQ(error_of("hull{parts = {}, scale = 2, position = {0, 0, 0}}"),
            "t.lua:1: hull.scale: applies only to file; points are in u");
}

TEST_F(ObjectsTest, FileErrorsHaveScriptLocation) {
  solids->error = "'l.stl': the mesh is open";
  EXPECT_EQ(error_of("\nmesh{file = 'l.stl', position = {1, 2, 3}}"),
            "t.lua:2: mesh.file = 'l.stl': the mesh is open");
  EXPECT_EQ(error_of("hull{file = 'l.stl', position = {1, 2, 3}}"),
            "t.lua:1: hull.file = 'l.stl': the mesh is open");
  solids->error = "is flat";
  EXPECT_EQ(error_of("hull{points = {}, position = {1, 2, 3}}"), "t.lua:1: hull.points: is flat");
  EXPECT_EQ(error_of("mesh{position = {1, 2, 3}}"), "t.lua:1: mesh: the field 'file' is missing");
  EXPECT_EQ(error_of("mesh{file = 'l.stl', scale = 0, position = {1, 2, 3}}"),
            "t.lua:1: mesh.scale = 0: must be in [1e-09, 1e+09]");
  EXPECT_EQ(error_of("mesh{file = 'l.stl', pieces = 0, position = {1, 2, 3}}"),
            "t.lua:1: mesh.pieces = 0: must be an integer from 1 to 256");
  options.solid_factory = nullptr;
  EXPECT_EQ(error_of("mesh{file = 'l.stl', position = {1, 2, 3}}"),
            "t.lua:1: hull and mesh are not available to a script loaded this way");
}

TEST_F(ObjectsTest, RejectsFilesOutsideScriptFolder) {
  for (const char* path : {"../l.stl", "/etc/passwd", "a/../../l.stl"})
    EXPECT_EQ(error_of("mesh{file = '" + std::string(path) + "', position = {1, 2, 3}}"),
              "t.lua:1: mesh.file: '" + std::string(path) +
                  "' is outside the script's folder and the output folder; --unsafe allows it");
  EXPECT_TRUE(solids->meshes.empty());
  options.unsafe = true;
  EXPECT_EQ(error_of("surface{} mesh{file = '/etc/l.stl', position = {1, 2, 3}}"), "");
  EXPECT_EQ(solids->meshes.at(0).file, "/etc/l.stl");
}

TEST_F(ObjectsTest, WarningsHaveScriptLocation) {
  solids->notes = {"'l.stl': the mesh was inside out: flipped"};
  load_on_surface("mesh{file = 'l.stl', position = {1, 2, 3}}");
  ASSERT_EQ(noted.size(), 1U);
  EXPECT_TRUE(noted[0].ends_with("t.lua:2: 'l.stl': the mesh was inside out: flipped")) << noted[0];
}

TEST_F(ObjectsTest, SpawnsSolidsAtRunTime) {
  EXPECT_EQ(run_error_of("for i = 1, 3 do hull{points = {{0, 0, i}}, position = {1, 2, 3}} end"), "");
  solids->error = "is flat";
  EXPECT_EQ(run_error_of("hull{points = {{0, 0, 0}}, position = {1, 2, 3}}"),
            "t.lua:2: hull.points: is flat");
}

TEST_F(ObjectsTest, OffTablePolicy) {
  EXPECT_EQ(load("surface{}").scene().world.off_table, scene::OffTablePolicy::kKeep);
  EXPECT_EQ(load("surface{} world{off_table = 'remove'}").scene().world.off_table,
            scene::OffTablePolicy::kRemove);
  EXPECT_EQ(error_of("world{off_table = 'drop'}"),
            "t.lua:1: world.off_table = 'drop': must be 'keep' or 'remove'");
}

TEST_F(ObjectsTest, OnLeaveReceivesObjectTimeAndTick) {
  Experiment e = load_on_surface(
      "for i = 1, 3 do sphere{radius = 1, position = {i, 1, 1}} end\n"
      "on_leave(function(id, t, tick) print(id, t, tick) if id == 1 then object(2):remove() end end)\n"
      "on_leave(function(id) print('once', id) return false end)");
  FakeSimulation simulation(e.scene());
  e.start(simulation);
  const std::vector<scene::ObjectId> first{0}, then{1, 2};
  e.notify_departures(0.5, 30, first);
  e.notify_departures(1.0, 60, then);
  EXPECT_EQ(printed, "0\t0.5\t30\nonce\t0\n1\t1.0\t60\n");
}

}  // namespace
}  // namespace smartsurf::script
