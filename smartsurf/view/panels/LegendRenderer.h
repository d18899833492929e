// Renders the legend of an off-screen picture with Dear ImGui. Internal to this module; the OpenGL context
// must be current wherever one is created, used or destroyed.
#pragma once

#include "smartsurf/view/model/DrawOptions.h"

struct ImGuiContext;

namespace smartsurf::view {

class LegendRenderer {
 public:
  explicit LegendRenderer(float scale);
  ~LegendRenderer();
  LegendRenderer(const LegendRenderer&) = delete;
  LegendRenderer& operator=(const LegendRenderer&) = delete;

  float scale() const { return scale_; }
  void draw(const ColourScale& colour_scale, unsigned framebuffer, int width, int height);

 private:
  float scale_;
  ImGuiContext* context_;
};

}  // namespace smartsurf::view
