#include "smartsurf/view/panels/DockLayout.h"

#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/TableBounds.h"

namespace smartsurf::view {
namespace {

bool overlap(const DockRect& a, const DockRect& b) {
  return a.x < b.right() - 0.01f && b.x < a.right() - 0.01f && a.y < b.bottom() - 0.01f &&
         b.y < a.bottom() - 0.01f;
}

struct Draw {
  std::mt19937 random;
  float in(float low, float high) { return std::uniform_real_distribution<float>(low, high)(random); }
  bool coin() { return in(0.0f, 1.0f) < 0.5f; }
  DockContents contents() {
    return {.panels = in(0.0f, 1.0f) < 0.9f,
            .inspector = coin(),
            .plots = coin(),
            .bar_height = in(0.0f, 110.0f),
            .message_height = coin() ? in(30.0f, 220.0f) : 0.0f};
  }
  DockSizes sizes() {
    const auto size = [&] { return coin() ? 0.0f : in(1.0f, 2000.0f); };
    return {size(), size(), size(), size()};
  }
};

TEST(DockLayout, AreasFillTheWindowWithoutOverlap) {
  Draw draw{std::mt19937(11)};
  for (int round = 0; round < 20000; ++round) {
    const float width = draw.in(200.0f, 3000.0f), height = draw.in(150.0f, 2000.0f);
    const DockLayout docks = lay_out_docks(width, height, draw.contents(), draw.sizes(), draw.in(1.0f, 2.0f));
    const DockRect areas[] = {docks.scene, docks.main, docks.inspector,
                              docks.plots, docks.bar,  docks.message};
    float sum = 0.0f;
    for (const DockRect& a : areas) {
      sum += a.width * a.height;
      EXPECT_GE(a.x, -0.01f);
      EXPECT_GE(a.y, -0.01f);
      EXPECT_LE(a.right(), width + 0.01f);
      EXPECT_LE(a.bottom(), height + 0.01f);
      for (const DockRect& b : areas) {
        if (&a == &b || a.empty() || b.empty()) continue;
        ASSERT_FALSE(overlap(a, b)) << round;
      }
    }
    ASSERT_NEAR(sum / (width * height), 1.0f, 1e-3f) << round;
    ASSERT_GE(docks.scene.width, 0.499f * width);
    ASSERT_GE(docks.scene.height, 0.333f * height);
  }
}

// The table's corners, as the presets frame it, lie in the scene and under no panel.
TEST(DockLayout, NoPanelCoversTheTable) {
  Draw draw{std::mt19937(12)};
  for (const auto& [width, height] :
       {std::pair{1366.0f, 768.0f}, {1280.0f, 800.0f}, {1920.0f, 1080.0f}, {573.0f, 740.0f}})
    for (int round = 0; round < 500; ++round) {
      const DockLayout docks = lay_out_docks(width, height, draw.contents(), draw.sizes(), 1.0f);
      scene::SurfaceSpec table;
      table.rows = static_cast<int>(draw.in(1.0f, 200.0f));
      table.columns = static_cast<int>(draw.in(1.0f, 200.0f));
      const auto preset = static_cast<CameraPreset>(round % 3);
      const Camera camera = Camera::fit_to_surface(table, preset, docks.scene.width / docks.scene.height);
      const Eigen::AlignedBox3d box = surface_bounding_box(table);
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3d at = camera.project(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(i)),
                                                  docks.scene.width, docks.scene.height);
        const float x = docks.scene.x + static_cast<float>(at.x()),
                    y = docks.scene.y + static_cast<float>(at.y());
        ASSERT_TRUE(docks.scene.contains(x, y)) << width << 'x' << height << ' ' << round;
        for (const DockRect& panel : {docks.main, docks.inspector, docks.plots, docks.bar, docks.message})
          ASSERT_FALSE(panel.contains(x, y)) << width << 'x' << height << ' ' << round;
      }
    }
}

TEST(DockLayout, DefaultsLeaveMostOfALaptopsScreenToTheScene) {
  const DockLayout docks = lay_out_docks(1366.0f, 768.0f, {.inspector = true, .bar_height = 56.0f}, {}, 1.0f);
  EXPECT_FALSE(docks.tall);
  EXPECT_GT(docks.scene.width, 680.0f);
  EXPECT_GT(docks.scene.height, 700.0f);
  EXPECT_TRUE(lay_out_docks(573.0f, 740.0f, {}, {}, 1.0f).tall) << "beside a program's window";
}

TEST(DockSizes, TextReadsBackAndIgnoresWhatIsWrong) {
  Draw draw{std::mt19937(13)};
  for (int round = 0; round < 100; ++round) {
    const auto whole = [&] { return static_cast<float>(static_cast<int>(draw.in(0.0f, 2000.0f))); };
    const DockSizes sizes{whole(), whole(), whole(), whole()};
    EXPECT_EQ(parse_sizes(format_sizes(sizes)), sizes);
  }
  EXPECT_EQ(parse_sizes("side x\nside -3\nplots 1e9\nplots nan\nwhat 3\n\n"), DockSizes{});
}

}  // namespace
}  // namespace smartsurf::view
