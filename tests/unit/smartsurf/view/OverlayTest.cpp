#include "smartsurf/view/interaction/Overlay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "smartsurf/view/model/OptionEdit.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

struct OverlayTest : testing::Test {
  OverlayTest() : scene(4, 4), overlay(scene.spec.surface) {
    scene.add_sphere(1.0, 1.0, 6.0, 1.0, {1.0f, 0.0f, 0.0f});
  }
  FrameInput input() const { return {scene.snapshot, scene.spec.objects, channels, contacts}; }
  DrawOptions apply() {
    DrawOptions options;
    overlay.apply(input(), nullptr, options);
    return options;
  }
  TestScene scene;
  Overlay overlay;
  std::vector<float> distance = std::vector<float>(16, 8.0f), mask = std::vector<float>(16, 0.0f);
  std::vector<Channel> channels = {{"proximity", "u", distance, 0.0f, 8.0f},
                                   {"proximity_hit", "", mask, 0.0f, 1.0f}};
  std::vector<ContactMark> contacts;
};

TEST_F(OverlayTest, ColoursCellsByChannel) {
  EXPECT_TRUE(apply().cell_values.empty());
  EXPECT_FALSE(overlay.colour_scale());
  overlay.settings.channel = "proximity";
  overlay.settings.palette = Palette::kFlame;
  const DrawOptions options = apply();
  EXPECT_EQ(options.cell_values.size(), distance.size());
  EXPECT_EQ(options.high, 8.0f);
  EXPECT_EQ(options.palette, Palette::kFlame);
  ASSERT_TRUE(overlay.colour_scale());
  EXPECT_EQ(overlay.colour_scale()->unit, "u");
  overlay.settings.reverse_palette = true;
  EXPECT_EQ(apply().low, 8.0f);
  EXPECT_EQ(apply().high, 0.0f);
}

// A distance sensor reports its range where it sees nothing: that is not a distance.
TEST_F(OverlayTest, CellsThatSeeNothingHaveNoValue) {
  std::mt19937 draw(5);
  for (std::size_t i = 0; i < mask.size(); ++i) {
    mask[i] = draw() % 2 == 0 ? 1.0f : 0.0f;
    distance[i] = mask[i] > 0.5f ? static_cast<float>(draw() % 7) : 8.0f;
  }
  overlay.settings.channel = "proximity";
  const DrawOptions options = apply();
  for (std::size_t i = 0; i < mask.size(); ++i) {
    if (mask[i] > 0.5f)
      EXPECT_EQ(options.cell_values[i], distance[i]);
    else
      EXPECT_TRUE(std::isnan(options.cell_values[i]));
  }
  EXPECT_TRUE(overlay.colour_scale()->has_gaps);
  overlay.settings.channel = "proximity_hit";
  EXPECT_EQ(apply().cell_values.data(), mask.data());
  EXPECT_FALSE(overlay.colour_scale()->has_gaps);
}

TEST_F(OverlayTest, UsesRangeOfValuesIfChannelHasNone) {
  channels[0].low = channels[0].high = 0.0f;
  distance[5] = -3.0f;
  overlay.settings.channel = "proximity";
  EXPECT_EQ(apply().low, -3.0f);
  EXPECT_EQ(apply().high, 8.0f);
  overlay.settings.manual_range = true;
  overlay.settings.low = 1.0f;
  overlay.settings.high = 2.0f;
  EXPECT_EQ(apply().low, 1.0f);
}

// Pressure reaches up to 10⁶, of which a scene shows the first thousandth.
TEST_F(OverlayTest, RoundsTheRangeOfAChannelWithoutLimit) {
  overlay.settings.channel = "proximity";
  channels[0].low = -1e6f;
  channels[0].high = 1e6f;
  std::ranges::fill(distance, 0.0f);
  EXPECT_EQ(apply().high, 1.0f) << "nothing to fit to";
  distance[3] = 130.0f;
  const float high = apply().high;
  EXPECT_GE(high, 130.0f);
  EXPECT_LE(high, 260.0f);
  EXPECT_EQ(apply().low, -high);
  distance[3] = -0.3f * high;
  EXPECT_EQ(apply().high, high) << "a small change changes no colours";
  distance[3] = -0.1f * high;
  EXPECT_LT(apply().high, 0.5f * high);
  distance[3] = 10 * high;
  EXPECT_GE(apply().high, 10 * high);
}

TEST_F(OverlayTest, IgnoresChannelWithoutValues) {
  overlay.settings.channel = "proximity";
  channels[0].values = {};
  EXPECT_TRUE(apply().cell_values.empty());
  EXPECT_FALSE(overlay.colour_scale());
}

TEST_F(OverlayTest, SensorRaysEndAtDetectedPoint) {
  mask[static_cast<std::size_t>(scene.spec.surface.index(2, 1))] = 1.0f;
  distance[static_cast<std::size_t>(scene.spec.surface.index(2, 1))] = 1.5f;
  overlay.settings.sensor_rays = true;
  const auto lines = apply().lines;
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_EQ(lines[0].from, (std::array<float, 3>{1.0f, 1.0f, 4.0f}));
  EXPECT_EQ(lines[0].to, (std::array<float, 3>{1.0f, 1.0f, 5.5f}));
}

TEST_F(OverlayTest, SensorRaysFollowOriginAndDirectionAndTurnWithTheCell) {
  scene::SurfaceSpec& surface = scene.spec.surface;
  channels[0].origin = {0.5, 0.0, 0.25};
  channels[0].direction = {1.0, 0.0, 0.0};
  const auto cell = static_cast<std::size_t>(surface.index(2, 1));
  mask[cell] = 1.0f;
  distance[cell] = 1.5f;
  const auto ray = [&] {
    overlay = Overlay(surface);
    overlay.settings.sensor_rays = true;
    return apply().lines[0];
  };
  EXPECT_EQ(ray().from, (std::array<float, 3>{1.5f, 1.0f, 4.25f}));
  EXPECT_EQ(ray().to, (std::array<float, 3>{3.0f, 1.0f, 4.25f}));
  surface.cell_poses.assign(16, {2.0, 3.0, std::numbers::pi / 2.0});
  const Line turned = ray();
  const std::array<float, 3> from{2.0f, 3.5f, 4.25f}, to{2.0f, 5.0f, 4.25f};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(turned.from[axis], from[axis], 1e-6f);
    EXPECT_NEAR(turned.to[axis], to[axis], 1e-6f);
  }
}

TEST_F(OverlayTest, ScalesContactForces) {
  contacts = {{{1, 1, 4}, {0, 0, 10}}, {{2, 1, 4}, {0, 5, 0}}};
  EXPECT_TRUE(apply().lines.empty());
  overlay.settings.contact_forces = true;
  const auto lines = apply().lines;
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_FLOAT_EQ(lines[0].to[2] - lines[0].from[2], 3.0f);
  EXPECT_FLOAT_EQ(lines[1].to[1] - lines[1].from[1], 1.5f);
}

TEST_F(OverlayTest, TrailsGrowAgeAndRestart) {
  overlay.settings.trails = true;
  overlay.settings.trail_length_s = 1.0;
  for (int i = 0; i <= 10; ++i) {
    scene.snapshot.time_s = 0.1 * i;
    scene.snapshot.position[0][0] = static_cast<float>(i);
    apply();
  }
  EXPECT_EQ(apply().lines.size(), 10u);
  EXPECT_EQ(apply().lines[9].colour[3], 255) << "the newest segment is not opaque";
  EXPECT_LT(apply().lines[0].colour[3], 40);
  scene.snapshot.time_s = 1.5;
  EXPECT_EQ(apply().lines.size(), 5u) << "segments older than the trail length remain";
  scene.snapshot.time_s = 0.2;
  EXPECT_TRUE(apply().lines.empty()) << "the trails survived a restart";
}

TEST_F(OverlayTest, ForceScaleIsRoundAndStaysWhileForcesVary) {
  overlay.settings.contact_forces = true;
  const auto scale_of = [&](float force) {
    contacts = {{{1.0f, 1.0f, 5.0f}, {0.0f, 0.0f, force}}};
    apply();
    return overlay.force_scale();
  };
  ASSERT_TRUE(scale_of(3.2f));
  EXPECT_DOUBLE_EQ(overlay.force_scale()->force, 5.0);
  EXPECT_DOUBLE_EQ(overlay.force_scale()->length, 3.0 * scene.spec.surface.pitch);
  EXPECT_DOUBLE_EQ(scale_of(1.1f)->force, 5.0);
  EXPECT_DOUBLE_EQ(scale_of(0.9f)->force, 1.0);
  EXPECT_DOUBLE_EQ(scale_of(70.0f)->force, 100.0);
  contacts.clear();
  apply();
  EXPECT_FALSE(overlay.force_scale());
}

TEST_F(OverlayTest, TrailsFillFromHistory) {
  StoredFrames history;
  scene.spec.objects[0].radius = 0.9;  // hides the last four segments
  for (int i = 0; i < 50; ++i) {
    scene.snapshot.time_s = 0.1 * i;
    scene.snapshot.position[0] = {0.2f * static_cast<float>(i), 1.0f, 6.0f};
    history.frames.push_back(scene.snapshot);
  }
  scene.snapshot = history.frames[40];
  overlay.settings.trails = true;
  overlay.settings.trail_length_s = 1.0;
  const auto shown = [&](const History* stored) {
    DrawOptions options;
    overlay.apply({scene.snapshot, scene.spec.objects, channels, contacts, stored}, nullptr, options);
    return options.lines;
  };
  EXPECT_EQ(shown(nullptr).size(), 0u);
  overlay = Overlay(scene.spec.surface);
  overlay.settings.trails = true;
  overlay.settings.trail_length_s = 1.0;
  ASSERT_EQ(shown(&history).size(), 6u);
  EXPECT_FLOAT_EQ(shown(&history).front().from[0], 6.0f);
  scene.snapshot = history.frames[20];  // back in time
  ASSERT_EQ(shown(&history).size(), 6u);
  EXPECT_FLOAT_EQ(shown(&history).back().to[0], 3.2f);
}

using OptionKind = scene::OptionSpec::Kind;

TEST(OptionEdit, RangesOfWholeNumbersLieInTheDeclaredOnes) {
  OptionEdit edit({.name = "count", .value = "3", .help = "", .kind = OptionKind::kInteger});
  EXPECT_FALSE(edit.integer_range());
  edit.spec.range = {-2.5, 7.9};
  EXPECT_EQ(edit.integer_range(), (std::array<std::int64_t, 2>{-2, 7}));
  edit.spec.range = {-1e300, 1e300};
  EXPECT_EQ(edit.integer_range()->back(), std::int64_t{1} << 62);
}

// Numbers keep all their digits, whether the user changes them or not.
TEST(OptionEdit, ReturnsOnlyChangedOptionsExactly) {
  std::mt19937_64 random(20261129);
  for (int draw = 0; draw < 200; ++draw) {
    const auto before = static_cast<std::int64_t>(random() >> (random() % 64)), after = before + 1;
    const double real = std::ldexp(static_cast<double>(random()), static_cast<int>(random() % 200) - 130);
    std::vector<OptionEdit> edits = make_option_edits(
        {{.name = "seed", .value = std::to_string(before), .help = "", .kind = OptionKind::kInteger},
         {.name = "speed", .value = "0.33333333333333", .help = "", .kind = OptionKind::kReal},
         {.name = "on", .value = "true", .help = "", .kind = OptionKind::kBool},
         {.name = "code", .value = "007", .help = ""}});
    EXPECT_TRUE(changed_options(edits).empty());
    edits[0].integer = after;
    edits[1].real = real;
    edits[2].checked = false;
    edits[3].text = "08";
    const std::vector<NamedValue> values = changed_options(edits);
    ASSERT_EQ(values.size(), 4u);
    EXPECT_EQ(values[0].value, std::to_string(after));
    EXPECT_EQ(std::stod(values[1].value), real);
    EXPECT_EQ(values[2].value, "false");
    EXPECT_EQ(values[3].value, "08");
  }
}

}  // namespace
}  // namespace smartsurf::view
