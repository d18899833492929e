#include "smartsurf/view/trace/PathTracer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "smartsurf/view/trace/PathSampler.h"
#include "smartsurf/view/trace/Reflection.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

using Vec = Eigen::Vector3f;

constexpr double kPi = std::numbers::pi;

// The same light from everywhere.
StageLight furnace() {
  StageLight light = stage_light(Stage::kLight);
  light.sun = {};
  light.sky = light.bounce = light.floor_paint = {1.0F, 1.0F, 1.0F};
  light.lamps = 0.0F;
  light.grid = 0.0F;
  return light;
}

TracedImage trace(const TestScene& scene, const Camera& camera, const StageLight& light,
                  const TraceSettings& settings, int width, int height) {
  DrawOptions options;
  options.grid = options.axes = false;
  return PathTracer(scene.spec)
      .trace(scene.snapshot, scene.spec.objects, camera, options, light, settings, width, height);
}

Camera camera_at(const TestScene& scene, const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  Camera camera = Camera::fit_to_surface(scene.spec.surface, CameraPreset::kIso, 1.0);
  camera.set_pose({eye, target});
  return camera;
}

// The integral over the hemisphere by the midpoint rule: of all, and of the density.
struct Integrals {
  Vec all = Vec::Zero();
  float density = 0.0F;
};
Integrals integrate(const Reflection& reflection) {
  constexpr int kCosines = 400, kAngles = 400;
  Integrals sum;
  for (int i = 0; i < kCosines; ++i)
    for (int j = 0; j < kAngles; ++j) {
      const double z = (i + 0.5) / kCosines, angle = 2.0 * kPi * (j + 0.5) / kAngles,
                   r = std::sqrt(1.0 - z * z);
      const Reflection::Value value =
          reflection.evaluate(Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z).cast<float>());
      const auto patch = static_cast<float>(2.0 * kPi / (kCosines * kAngles));
      sum.all += patch * value.all;
      sum.density += patch * value.density;
    }
  return sum;
}

TEST(ReflectionTest, IsLambertianWithoutMirror) {
  const Vec albedo(0.2F, 0.5F, 1.0F);
  for (const float z : {0.05F, 0.5F, 1.0F}) {
    const Integrals sums =
        integrate(Reflection(albedo, {1.0F, 0.0F, 0.0F, 0.0F}, {std::sqrt(1.0F - z * z), 0.0F, z}));
    EXPECT_LT((sums.all - albedo).norm(), 1e-4F);
    EXPECT_NEAR(sums.density, 1.0F, 1e-4F);
  }
}

// Whatever the material, no more light leaves than arrives; samples and quadrature agree.
TEST(ReflectionTest, LosesLightAndSamplesWhatItEvaluates) {
  std::mt19937 random(20261123);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  for (int draw = 0; draw < 12; ++draw) {
    const float roughness = 0.3F + 0.7F * share(random), metal = draw % 3 == 0 ? 1.0F : 0.0F;
    const float z = 0.1F + 0.9F * share(random), turn = 6.0F * share(random), r = std::sqrt(1.0F - z * z);
    const Reflection reflection(Vec::Ones(), {roughness, metal, 0.1F * share(random), 0.0F},
                                {r * std::cos(turn), r * std::sin(turn), z});
    const Integrals sums = integrate(reflection);
    EXPECT_LE(sums.all.maxCoeff(), 1.003F) << "roughness " << roughness << ", metal " << metal << ", z " << z;
    EXPECT_LE(sums.density, 1.003F);
    constexpr std::uint32_t kSamples = 1 << 14;
    float sampled = 0.0F;
    for (std::uint32_t i = 0; i < kSamples; ++i) {
      PathSampler sampler(0, 0, i, kSamples, 7);
      const float choice = sampler.next().x();
      const Reflection::Value value = reflection.evaluate(reflection.sample(sampler.next(), choice));
      if (value.density > 0.0F) sampled += value.all.x() / value.density / kSamples;
    }
    EXPECT_NEAR(sampled, sums.all.x(), 0.01F)
        << "roughness " << roughness << ", metal " << metal << ", z " << z;
  }
}

// In a uniform environment a white surface is as bright as the environment, and a glossy one no brighter.
TEST(PathTracerTest, WhiteFurnace) {
  TestScene scene(1, 1);
  const TracedImage plane =
      trace(scene, camera_at(scene, {100, 0, 20}, {100, 12, -2}), furnace(), {.samples = 64}, 24, 16);
  for (std::size_t i = 0; i < plane.radiance.size(); ++i) {
    ASSERT_GT(plane.coverage[i], 0.0F);
    EXPECT_NEAR(plane.radiance[i].x(), 1.0F, 0.002F);
  }
  scene.spec.world.ground = false;
  scene.add_sphere(0, 0, 500, 4, {1.0F, 1.0F, 1.0F});
  const TracedImage sphere =
      trace(scene, camera_at(scene, {0, -20, 508}, {0, 0, 500}), furnace(), {.samples = 256}, 24, 24);
  int seen = 0;
  for (std::size_t i = 0; i < sphere.radiance.size(); ++i) {
    if (sphere.coverage[i] < 1.0F) continue;
    ++seen;
    EXPECT_LE(sphere.radiance[i].maxCoeff(), 1.02F);
    EXPECT_GE(sphere.radiance[i].minCoeff(), 0.75F);
  }
  EXPECT_GT(seen, 50);
}

TEST(PathTracerTest, GroundLiesUnderATableFarAway) {
  TestScene scene(1, 1);
  scene.spec.surface.cell_poses = {{3000.0, -2000.0, 0.0}};
  const TracedImage plane =
      trace(scene, camera_at(scene, {3020, -2000, 20}, {3020, -1988, -2}), furnace(), {.samples = 1}, 12, 8);
  for (const float covered : plane.coverage) EXPECT_GT(covered, 0.0F);
}

// From beside the table, the middle of the picture lies in the gap between two columns.
TEST(PathTracerTest, OnlyNarrowGapsAreClosed) {
  for (const double pitch : {1.0, 3.0}) {
    TestScene scene(2, 2);
    scene.spec.world.ground = false;
    scene.spec.surface.pitch = pitch;
    const double middle = pitch / 2.0;
    const TracedImage seen = trace(scene, camera_at(scene, {middle, -20, 3}, {middle, 20, 2.9}), furnace(),
                                   {.samples = 16}, 121, 121);
    EXPECT_EQ(seen.coverage[60 * 121 + 60], pitch == 1.0 ? 1.0F : 0.0F) << "pitch " << pitch;
  }
}

// Sunlight on a diffuse plane: albedo times the cosine of the sun's elevation.
TEST(PathTracerTest, SunOnPlane) {
  const TestScene scene(1, 1);
  StageLight light = furnace();
  light.sky = light.bounce = {};
  light.sun = {2.0F, 1.0F, 0.5F};
  light.floor_paint = {0.3F, 0.6F, 0.9F};
  const TracedImage plane =
      trace(scene, camera_at(scene, {100, 0, 20}, {100, 12, -2}), light, {.samples = 64}, 24, 16);
  const auto facing = static_cast<float>(towards_sun().z());
  for (const Vec& radiance : plane.radiance) {
    EXPECT_NEAR(radiance.x(), 0.6F * facing, 0.003F);
    EXPECT_NEAR(radiance.y(), 0.6F * facing, 0.003F);
    EXPECT_NEAR(radiance.z(), 0.45F * facing, 0.003F);
  }
}

TEST(PathTracerTest, ThreadsChangeNothing) {
  TestScene scene(12, 12);
  scene.add_sphere(4, 4, 6, 2, {0.9F, 0.3F, 0.1F});
  scene::ObjectSpec box;
  box.shape = scene::ShapeKind::kBox;
  box.size = {2, 2, 2};
  box.position = {8, 7, 6};
  scene.add(box);
  const Camera camera = Camera::fit_to_surface(scene.spec.surface, CameraPreset::kIso, 1.5);
  const TracedImage one =
      trace(scene, camera, stage_light(Stage::kLight), {.samples = 4, .aperture = 1.0}, 90, 60);
  for (const int threads : {2, 5}) {
    const TracedImage many = trace(scene, camera, stage_light(Stage::kLight),
                                   {.samples = 4, .aperture = 1.0, .threads = threads}, 90, 60);
    EXPECT_EQ(many.coverage, one.coverage);
    EXPECT_TRUE(many.radiance == one.radiance);
  }
}

// A wide lens blurs what is far from its focus, and keeps what is in it.
TEST(PathTracerTest, LensIsFocusedOnTheTarget) {
  TestScene scene(24, 24);
  scene.add_sphere(11.5, 3, 6, 1, {0.9F, 0.1F, 0.1F});
  scene.add_sphere(11.5, 20, 6, 1, {0.9F, 0.1F, 0.1F});
  constexpr int kAcross = 90, kDown = 60;
  const Camera camera = camera_at(scene, {11.5, -25, 20}, {11.5, 3, 6});
  const auto red_share = [&](double aperture, double y) {
    const TracedImage image = trace(scene, camera, stage_light(Stage::kLight),
                                    {.samples = 16, .aperture = aperture}, kAcross, kDown);
    const Eigen::Vector3d at = camera.project({11.5, y, 6}, kAcross, kDown);
    const Vec& c =
        image.radiance[static_cast<std::size_t>(at.y()) * kAcross + static_cast<std::size_t>(at.x())];
    return c.x() / c.sum();
  };
  EXPECT_NEAR(red_share(6.0, 3.0), red_share(0.0, 3.0), 0.05);
  EXPECT_LT(red_share(6.0, 20.0), red_share(0.0, 20.0) - 0.15);
}

}  // namespace
}  // namespace smartsurf::view
