#include "smartsurf/view/window/AdaptiveResolution.h"

#include <gtest/gtest.h>

namespace smartsurf::view {
namespace {

// A scene that costs that much whatever the pixels, and that much more with all of them.
struct Cost {
  double fixed_ms, pixels_ms;
  double at(double scale) const { return fixed_ms + pixels_ms * scale * scale; }
};

double settled(AdaptiveResolution& scale, const Cost& cost) {
  for (int frame = 0; frame < 200; ++frame) scale.took(cost.at(scale.value()));
  return scale.value();
}

TEST(RenderScale, StaysFullWhereFramesAreQuick) {
  AdaptiveResolution scale;
  EXPECT_EQ(settled(scale, {5.0, 15.0}), 1.0);
}

TEST(RenderScale, GivesUpPixelsUntilAFrameFitsAndNoMore) {
  AdaptiveResolution scale;
  EXPECT_EQ(settled(scale, {8.0, 30.0}), 0.75);
  EXPECT_EQ(settled(scale, {8.0, 60.0}), 0.5);
  EXPECT_EQ(settled(scale, {100.0, 500.0}), AdaptiveResolution::kLeast);
}

TEST(RenderScale, ComesBackWhenTheSceneIsLightAgain) {
  AdaptiveResolution scale;
  settled(scale, {8.0, 60.0});
  EXPECT_EQ(settled(scale, {3.0, 8.0}), 1.0);
}

TEST(RenderScale, NeverSwingsToAndFro) {
  for (double fixed = 0.0; fixed < 40.0; fixed += 2.5)
    for (double pixels = 0.0; pixels < 120.0; pixels += 2.5) {
      AdaptiveResolution scale;
      const Cost cost{fixed, pixels};
      settled(scale, cost);
      const double before = scale.value();
      for (int frame = 0; frame < 100; ++frame) {
        scale.took(cost.at(scale.value()));
        ASSERT_EQ(scale.value(), before) << fixed << " and " << pixels;
      }
    }
}

TEST(RenderScale, OneSlowFrameChangesNothing) {
  AdaptiveResolution scale;
  for (int frame = 0; frame < 40; ++frame) scale.took(frame == 17 ? 90.0 : 12.0);
  EXPECT_EQ(scale.value(), 1.0);
}

}  // namespace
}  // namespace smartsurf::view
