// The user's display settings, and the lines and colours that they add to the scene. No OpenGL.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "smartsurf/view/interaction/Tools.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/model/Trails.h"

namespace smartsurf::view {

struct OverlaySettings {
  std::string channel;  // whose values colour the cells; "": none
  Palette palette = Palette::kViridis;
  bool reverse_palette = false;  // the palette's ends change places
  bool manual_range = false;     // low … high instead of the channel's range
  float low = 0.0F, high = 1.0F;
  bool trails = false;
  double trail_length_s = 3.0;  // of simulated time
  bool contact_forces = false;
  bool sensor_rays = false;
};

class Overlay {
 public:
  explicit Overlay(const scene::SurfaceSpec& surface) : surface_(surface), trails_(surface.pitch) {}

  OverlaySettings settings;

  // A moment on the way to the next that is drawn, so that trails have no gaps. Cheap when they are off.
  void sample_trails(const FrameInput& input);
  // Fills in the options' colours and lines for this moment; what it points to stays valid until the next
  // call.
  void apply(const FrameInput& input, const Tools* tools, DrawOptions& options);
  // None when no channel is shown, or its values are not there.
  const std::optional<ColourScale>& colour_scale() const { return colour_scale_; }

 private:
  void apply_cell_colours(const FrameInput& input, DrawOptions& options);
  void add_contact_forces(const FrameInput& input);
  void add_sensor_rays(const FrameInput& input);
  void add_selection(const FrameInput& input, const Tools& tools);

  scene::SurfaceSpec surface_;
  Trails trails_;
  std::vector<Line> lines_;
  std::optional<ColourScale> colour_scale_;
};

}  // namespace smartsurf::view
