#include "smartsurf/view/window/AdaptiveResolution.h"

#include <algorithm>

namespace smartsurf::view {
namespace {

constexpr double kScaleStep = 0.25;
constexpr int kFramesPerDecision =
    8;  // the first of them, which makes the driver compile or allocate, is left out
constexpr double kUpscaleHeadroom = 0.85;  // of the budget, if all the time went into pixels

double square(double x) { return x * x; }

}  // namespace

void AdaptiveResolution::record_frame_time(double ms) {
  if (++frames_ == 1) return;
  mean_ms_ += (ms - mean_ms_) / (frames_ - 1);
  if (frames_ < kFramesPerDecision) return;
  const double next_scale = scale_factor_ + kScaleStep;
  if (mean_ms_ > kFrameBudget_ms && scale_factor_ > kMinScale)
    scale_factor_ = std::max(kMinScale, scale_factor_ - kScaleStep);
  else if (next_scale <= 1.0 &&
           mean_ms_ * square(next_scale / scale_factor_) < kUpscaleHeadroom * kFrameBudget_ms)
    scale_factor_ = next_scale;
  frames_ = 0;
  mean_ms_ = 0.0;
}

}  // namespace smartsurf::view
