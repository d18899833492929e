#include "smartsurf/view/model/PinShading.h"

#include <gtest/gtest.h>

#include <limits>

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
