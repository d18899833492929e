// Renders the window's contents off-screen, through EGL into memory.
//
// The same view model and size produce the same bytes on the same driver. Not thread-safe. At most one
// OffscreenRenderer or Window exists at a time, because Dear ImGui has one context per process.
#pragma once

#include <memory>

#include "apron/ui/ViewModel.h"
#include "common/image/Image.h"

namespace apron::ui {

class OffscreenRenderer {
 public:
  // width, height: pixels; scale: pixels per point, for text and spacing. Throws common::UserError if OpenGL
  // 3.3 is not available or the size is not supported.
  OffscreenRenderer(int width, int height, float scale = 1.0F);
  ~OffscreenRenderer();

  // The mouse state for the next render(): position in pixels from the north-west, left button, wheel.
  void set_mouse(float x, float y, bool down = false, float wheel = 0.0F);
  // A character typed before the next render().
  void type_character(unsigned character);
  // Draws one frame and applies user input to the model.
  common::Image render(ViewModel& model);
  // Draws until the layout has settled and returns the last frame.
  common::Image render_settled(ViewModel& model);

  // An OpenGL error recorded since the last call, or 0.
  unsigned take_gl_error();
  // The number of texture uploads so far.
  std::uint64_t texture_uploads() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apron::ui
