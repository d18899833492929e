// Chooses the rendering resolution of a window on a software renderer from its frame times, so that large
// scenes stay interactive. Panels and text keep full resolution.
//
// Off-screen images and videos do not use it: their content never depends on a clock.
#pragma once

namespace smartsurf::view {

class AdaptiveResolution {
 public:
  // Per frame. At 25 frames per second this leaves 12 ms for the simulation.
  static constexpr double kFrameBudget_ms = 28.0;
  static constexpr double kMinScale = 0.5;

  // Rendered over displayed pixels along each edge: 1, 0.75 or 0.5.
  double scale_factor() const { return scale_factor_; }

  // Wall-clock time of a frame drawn at scale_factor(), ms.
  void record_frame_time(double ms);

 private:
  double scale_factor_ = 1.0;
  double mean_ms_ = 0.0;  // of the frames since the last decision
  int frames_ = 0;
};

}  // namespace smartsurf::view
