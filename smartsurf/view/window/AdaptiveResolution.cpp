#include "smartsurf/view/window/AdaptiveResolution.h"

#include <algorithm>

namespace smartsurf::view {
namespace {

constexpr double kScaleStep = 0.25;
// The first frame at a new scale is ignored: the driver may compile or allocate in it.
constexpr int kFramesPerDecision = 8;
// Upscale if the predicted time stays below this share of the budget. The prediction is pessimistic: it
// scales the whole frame time with the number of pixels.
constexpr double kUpscaleHeadroom = 0.85;

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
