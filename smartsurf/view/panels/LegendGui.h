// The legend of a picture without a window: Dear ImGui drawing into a framebuffer. Internal to the room; the
// OpenGL context must be current wherever one is made, used or destroyed.
#pragma once

#include "smartsurf/view/model/DrawOptions.h"

struct ImGuiContext;

namespace smartsurf::view {

class LegendGui {
 public:
  explicit LegendGui(float scale);
  ~LegendGui();
  LegendGui(const LegendGui&) = delete;
  LegendGui& operator=(const LegendGui&) = delete;

  float scale() const { return scale_; }
  void draw(const HeatScale& heat, unsigned framebuffer, int width, int height);

 private:
  float scale_;
  ImGuiContext* context_;
};

}  // namespace smartsurf::view
