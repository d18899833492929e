// Renders the legend of an off-screen image with Dear ImGui. Internal to smartsurf/view. The same OpenGL
// context must be current whenever a LegendRenderer is created, used or destroyed.
#pragma once

#include "smartsurf/view/model/DrawOptions.h"

struct ImGuiContext;

namespace smartsurf::view {

class LegendRenderer {
 public:
  // scale: text size, 1 = 14 pixels.
  explicit LegendRenderer(float scale);
  ~LegendRenderer();
  LegendRenderer(const LegendRenderer&) = delete;
  LegendRenderer& operator=(const LegendRenderer&) = delete;

  float scale() const { return scale_; }
  // width, height: of the framebuffer, pixels.
  void draw(const ColourScale& colour_scale, unsigned framebuffer, int width, int height);

 private:
  float scale_;
  ImGuiContext* context_;
};

}  // namespace smartsurf::view
