#include "smartsurf/view/window/AdaptiveResolution.h"

#include <gtest/gtest.h>

namespace smartsurf::view {
namespace {

// Cost model of a scene: a fixed part and a part proportional to the number of pixels.
struct FrameCost {
  double fixed_ms, pixels_ms;
  double at_scale(double scale) const { return fixed_ms + pixels_ms * scale * scale; }
};

double converged_scale(AdaptiveResolution& scale, const FrameCost& cost) {
  for (int frame = 0; frame < 200; ++frame) scale.record_frame_time(cost.at_scale(scale.scale_factor()));
  return scale.scale_factor();
}

TEST(AdaptiveResolution, KeepsFullResolutionForFastFrames) {
  AdaptiveResolution scale;
  EXPECT_EQ(converged_scale(scale, {5.0, 15.0}), 1.0);
}

TEST(AdaptiveResolution, ReducesResolutionUntilFrameFitsBudget) {
  AdaptiveResolution scale;
  EXPECT_EQ(converged_scale(scale, {8.0, 30.0}), 0.75);
  EXPECT_EQ(converged_scale(scale, {8.0, 60.0}), 0.5);
  EXPECT_EQ(converged_scale(scale, {100.0, 500.0}), AdaptiveResolution::kMinScale);
}

TEST(AdaptiveResolution, RecoversWhenSceneBecomesCheap) {
  AdaptiveResolution scale;
  converged_scale(scale, {8.0, 60.0});
  EXPECT_EQ(converged_scale(scale, {3.0, 8.0}), 1.0);
}

TEST(AdaptiveResolution, DoesNotOscillate) {
  for (double fixed = 0.0; fixed < 40.0; fixed += 2.5)
    for (double pixels = 0.0; pixels < 120.0; pixels += 2.5) {
      AdaptiveResolution scale;
      const FrameCost cost{fixed, pixels};
      converged_scale(scale, cost);
      const double before = scale.scale_factor();
      for (int frame = 0; frame < 100; ++frame) {
        scale.record_frame_time(cost.at_scale(scale.scale_factor()));
        ASSERT_EQ(scale.scale_factor(), before) << fixed << " and " << pixels;
      }
    }
}

TEST(AdaptiveResolution, IgnoresSingleSlowFrame) {
  AdaptiveResolution scale;
  for (int frame = 0; frame < 40; ++frame) scale.record_frame_time(frame == 17 ? 90.0 : 12.0);
  EXPECT_EQ(scale.scale_factor(), 1.0);
}

}  // namespace
}  // namespace smartsurf::view
