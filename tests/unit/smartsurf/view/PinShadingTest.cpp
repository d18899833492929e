#include "smartsurf/view/model/PinShading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "smartsurf/scene/KindRegistry.h"
#include "smartsurf/view/model/Palette.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

// Mean sky visibility of the pin's corners.
int sky(const PinInstance& pin) {
  return (pin.corner_sky_visibility[0] + pin.corner_sky_visibility[1] + pin.corner_sky_visibility[2] +
          pin.corner_sky_visibility[3]) /
         4;
}

TEST(PinShading, DeeperPinsSeeLessSky) {
  TestScene scene(9, 9);
  PinShading shading(scene.spec.surface);
  const int centre = scene.spec.surface.index(4, 4);
  const int flat = sky(shading.update(scene.snapshot, {}, {}, true, false)[centre]);
  scene.snapshot.height[centre] = 3.0f;
  const int shallow = sky(shading.update(scene.snapshot, {}, {}, true, false)[centre]);
  scene.snapshot.height[centre] = 0.0f;
  const int deep = sky(shading.update(scene.snapshot, {}, {}, true, false)[centre]);
  EXPECT_EQ(flat, 255);
  EXPECT_LT(shallow, flat - 30);
  EXPECT_LT(deep, shallow);
}

TEST(PinShading, OnlyCornersBesideWallAreDarker) {
  TestScene scene(5, 5, 0.0f);
  for (int column = 0; column < 5; ++column)
    scene.snapshot.height[scene.spec.surface.index(1, column)] = 6.0f;
  PinShading shading(scene.spec.surface);
  const PinInstance pin = shading.update(scene.snapshot, {}, {}, true, false)[scene.spec.surface.index(2, 2)];
  EXPECT_EQ(pin.corner_sky_visibility[0], 255);  // south-west
  EXPECT_EQ(pin.corner_sky_visibility[1], 255);
  EXPECT_LT(pin.corner_sky_visibility[2], 200);  // north-west
  EXPECT_LT(pin.corner_sky_visibility[3], 200);
  EXPECT_FLOAT_EQ(pin.neighbour[3], 6.0f);  // north
  EXPECT_FLOAT_EQ(pin.neighbour[2], 0.0f);  // south
}

TEST(PinShading, SphereDarkensOnlyPinsBelowIt) {
  TestScene scene(15, 15);
  PinShading shading(scene.spec.surface);
  scene.add_sphere(7.0, 7.0, 6.0, 2.0, {});
  const auto pins = shading.update(scene.snapshot, scene.spec.objects, {}, true, false);
  EXPECT_LT(sky(pins[scene.spec.surface.index(7, 7)]), 120);
  EXPECT_EQ(sky(pins[scene.spec.surface.index(1, 1)]), 255);
  DrawOptions wires;
  wires.fill_mode = FillMode::kWireframe;
  EXPECT_EQ(sky(shading.update(scene.snapshot, scene.spec.objects, wires, true, false)[7 * 15 + 7]), 255);
}

// Three prisms at turns of 60° are one hexagon, as wide as the top.
TEST(PinShading, HexagonalCellsAreHexagons) {
  TestScene scene(4, 5);
  scene::SurfaceSpec& s = scene.spec.surface;
  s.actuators = {scene::find_actuator_kind("conveyor")->default_spec()};
  for (int row = 0; row < s.rows; ++row)
    for (int column = 0; column < s.columns; ++column)
      s.cell_poses.push_back(scene::hexagonal_pose(s.rows - 1 - row, column, s.pitch));
  ASSERT_TRUE(s.has_hexagonal_tops());
  PinShading shading(s);
  const auto prisms = shading.update(scene.snapshot, {}, {}, true, false);
  ASSERT_EQ(prisms.size(), 3u * 4u * 5u);
  const auto [half_x, half_y] = prism_half_edges(s);
  EXPECT_FLOAT_EQ(half_x, static_cast<float>(s.pin.top_x / 2));
  std::mt19937 random(1);
  std::uniform_real_distribution<float> offset(-0.7f * half_x * 2, 0.7f * half_x * 2);
  for (int i = 0; i < 2000; ++i) {
    const std::size_t cell = random() % 20;
    const float x = offset(random), y = offset(random);
    float farthest = 0;  // along the normals of the hexagon's sides
    for (const float angle : {0.0f, 60.0f, 120.0f}) {
      const float rad = angle * std::numbers::pi_v<float> / 180;
      farthest = std::max(farthest, std::abs(x * std::cos(rad) + y * std::sin(rad)));
    }
    if (std::abs(farthest - half_x) < 1e-4f) continue;
    bool covered = false;
    for (std::size_t k = 3 * cell; k < 3 * cell + 3; ++k) {
      const auto [cosine, sine] = prisms[k].rotation;
      EXPECT_EQ(prisms[k].position, prisms[3 * cell].position);
      covered |= std::abs(cosine * x + sine * y) <= half_x && std::abs(cosine * y - sine * x) <= half_y;
    }
    EXPECT_EQ(covered, farthest < half_x) << x << ", " << y;
  }
}

TEST(PinShading, PinsAndTurnedCellsAreNoHexagons) {
  TestScene scene(4, 5);
  scene::SurfaceSpec& s = scene.spec.surface;
  EXPECT_FALSE(s.has_hexagonal_tops());
  for (int row = 0; row < s.rows; ++row)
    for (int column = 0; column < s.columns; ++column)
      s.cell_poses.push_back(scene::hexagonal_pose(s.rows - 1 - row, column, s.pitch));
  for (const char* kind : {"pin", "tile", "delta"}) {
    s.actuators = {scene::find_actuator_kind(kind)->default_spec()};
    EXPECT_FALSE(s.has_hexagonal_tops()) << kind;
  }
  s.actuators = {scene::find_actuator_kind("wheels")->default_spec()};
  EXPECT_TRUE(s.has_hexagonal_tops());
  s.cell_poses[7].angle = 0.1;
  EXPECT_FALSE(s.has_hexagonal_tops());
  s.cell_poses[7].angle = 0, s.cell_poses[7].x += 0.01;
  EXPECT_FALSE(s.has_hexagonal_tops());
  EXPECT_EQ(prisms_per_cell(s), 1);
}

TEST(PinShading, IgnoresDistantAndNonFiniteObjects) {
  TestScene scene(5, 5);
  const double nan = std::numeric_limits<double>::quiet_NaN(),
               infinite = std::numeric_limits<double>::infinity();
  scene.add_sphere(1e30, -1e30, 6.0, 2.0, {});
  scene.add_sphere(nan, nan, nan, 2.0, {});
  scene.add_sphere(2.0, 2.0, nan, 2.0, {});
  scene.add_sphere(infinite, 2.0, 0.0, 2.0, {});
  PinShading shading(scene.spec.surface);
  EXPECT_EQ(sky(shading.update(scene.snapshot, scene.spec.objects, {}, true, false)[12]), 255);
  EXPECT_FLOAT_EQ(shading.mean_height_around(scene.snapshot, 1e30f, 0.0f, 1.0f), -2.0f);
}

TEST(PinShading, DrawingOrderStartsAtRequestedCorner) {
  TestScene scene(3, 4);
  for (int i = 0; i < 12; ++i) scene.snapshot.height[i] = static_cast<float>(i) / 4.0f;
  PinShading shading(scene.spec.surface);
  EXPECT_FLOAT_EQ(shading.update(scene.snapshot, {}, {}, true, false)[0].height, 0.0f);          // north-west
  EXPECT_FLOAT_EQ(shading.update(scene.snapshot, {}, {}, false, false)[0].height, 8.0f / 4.0f);  // south-west
  EXPECT_FLOAT_EQ(shading.update(scene.snapshot, {}, {}, false, true)[0].height, 11.0f / 4.0f);  // south-east
  EXPECT_FLOAT_EQ(shading.update(scene.snapshot, {}, {}, true, true)[0].height, 3.0f / 4.0f);    // north-east
}

TEST(PinShading, WallThatFacesTheCameraIsDrawnLower) {
  TestScene scene(3, 3);
  scene.spec.surface.border_height = 6.0;
  for (float& height : scene.snapshot.height) height = 6.0f;
  scene.snapshot.height[4] = 4.0f;
  PinShading shading(scene.spec.surface);
  const auto pins = shading.update(scene.snapshot, {}, {}, true, false, {}, {.south = true});
  EXPECT_FLOAT_EQ(pins[1].height, 6.0f);  // the northern wall
  EXPECT_FLOAT_EQ(pins[4].height, 4.0f);
  EXPECT_FLOAT_EQ(pins[4].neighbour[2], pins[7].height);
  EXPECT_LT(pins[7].height, 4.0f);
}

TEST(PinShading, ChannelColoursPinsButNotBorder) {
  TestScene scene(3, 3);
  scene.spec.surface.border_height = 6.0;
  PinShading shading(scene.spec.surface);
  std::vector<float> values(9, 8.0f);
  values[4] = 2.0f;
  DrawOptions options;
  options.cell_values = values;
  options.low = 2.0f;
  options.high = 8.0f;
  const auto pins = shading.update(scene.snapshot, {}, options, true, false);
  const Rgb low = linear_light(common::palette_color(Palette::kViridis, 0.0f));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(pins[4].colour[c], low[c] * 255.0f, 1.0f);
  EXPECT_NE(pins[0].colour, pins[4].colour);
  const auto border = pins[0].colour;
  EXPECT_EQ(shading.update(scene.snapshot, {}, {}, true, false)[0].colour, border);
}

}  // namespace
}  // namespace smartsurf::view
