#include "smartsurf/view/window/AdaptiveResolution.h"

#include <algorithm>

namespace smartsurf::view {
namespace {

constexpr double kStep = 0.25;
constexpr int kFramesToJudge =
    8;  // the first of them, which makes the driver compile or allocate, is left out
constexpr double kRoomToGrow = 0.85;  // of the budget, if all the time went into pixels

double squared(double x) { return x * x; }

}  // namespace

void AdaptiveResolution::took(double ms) {
  if (++frames_ == 1) return;
  mean_ms_ += (ms - mean_ms_) / (frames_ - 1);
  if (frames_ < kFramesToJudge) return;
  const double finer = value_ + kStep;
  if (mean_ms_ > kBudget_ms && value_ > kLeast)
    value_ = std::max(kLeast, value_ - kStep);
  else if (finer <= 1.0 && mean_ms_ * squared(finer / value_) < kRoomToGrow * kBudget_ms)
    value_ = finer;
  frames_ = 0;
  mean_ms_ = 0.0;
}

}  // namespace smartsurf::view
