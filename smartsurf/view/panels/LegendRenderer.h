// The legend of a picture without a window: Dear ImGui drawing into a framebuffer. Private to the view; the
// OpenGL context must be current wherever one is made, used or destroyed.
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
