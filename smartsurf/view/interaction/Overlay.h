// The user's display settings, and the overlay lines and cell colours derived from them. No OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/view/interaction/Tools.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/model/Trails.h"

namespace smartsurf::view {

// Colours of the lines, sRGB and alpha.
inline constexpr std::array<std::uint8_t, 4> kContactColour{200, 30, 20, 255},
    kSensorRayColour{20, 140, 60, 150}, kSelectionColour{255, 190, 0, 255}, kSpringColour{230, 40, 160, 255};

struct OverlaySettings {
  std::string channel;  // the channel that colours the cells; "": none
  Palette palette = Palette::kViridis;
  bool reverse_palette = false;
  bool manual_range = false;  // low … high instead of the channel's range
  float low = 0.0F, high = 1.0F;
  bool trails = false;
  double trail_length_s = 3.0;  // simulated time
  bool contact_forces = false;
  bool sensor_rays = false;
};

// The scale of the arrows of contact forces.
struct ForceScale {
  double force = 1.0;   // mass·u/s², a round number
  double length = 3.0;  // u: the arrow of that force
};

class Overlay {
 public:
  explicit Overlay(const scene::SurfaceSpec& surface) : surface_(surface), trails_(surface.pitch) {}

  OverlaySettings settings;

  // Adds a frame that is not drawn to the trails, so that they have no gaps. No-op while trails are off.
  void sample_trails(const FrameInput& input);
  // Sets the colours and lines of `options` for one frame. The spans are valid until the next call. tools:
  // adds the selection and the spring of a pull; may be null.
  void apply(const FrameInput& input, const Tools* tools, DrawOptions& options);
  // Empty if no channel is shown or it has no values.
  const std::optional<ColourScale>& colour_scale() const { return colour_scale_; }
  // Empty if no contact force is shown. Changes only when the largest force leaves a fifth to the whole of
  // it.
  const std::optional<ForceScale>& force_scale() const { return force_scale_; }

 private:
  void apply_cell_colours(const FrameInput& input, DrawOptions& options);
  void fit_to_values(const Channel& channel, ColourScale& scale);
  void add_contact_forces(const FrameInput& input);
  void add_sensor_rays(const FrameInput& input);
  void add_selection(const FrameInput& input, const Tools& tools);

  scene::SurfaceSpec surface_;
  Trails trails_;
  std::vector<Line> lines_;
  std::vector<float> seen_;  // the values of a distance channel, NaN where nothing is seen
  std::optional<ColourScale> colour_scale_;
  std::string fitted_channel_;  // of fit_to_values()
  float fitted_high_ = 0.0F;    // 0: its values were all 0
  std::optional<ForceScale> force_scale_;
};

}  // namespace smartsurf::view
