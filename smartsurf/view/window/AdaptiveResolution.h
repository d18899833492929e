// Chooses the rendering resolution of a window without a graphics card from its frame times, so that large
// scenes stay interactive. Panels and text keep full resolution.
//
// Windows only: pictures, videos and replays to a file never depend on a clock.
#pragma once

namespace smartsurf::view {

class AdaptiveResolution {
 public:
  static constexpr double kFrameBudget_ms =
      28.0;  // a frame; the simulation needs the rest of a 25th of a second
  static constexpr double kMinScale = 0.5;

  // Pixels drawn along each edge, as a share of those shown: 1, 0.75 or 0.5.
  double scale_factor() const { return scale_factor_; }

  // What the frame that was drawn with value() took on the wall clock.
  void record_frame_time(double ms);

 private:
  double scale_factor_ = 1.0;
  double mean_ms_ = 0.0;  // of the frames since the last change
  int frames_ = 0;
};

}  // namespace smartsurf::view
