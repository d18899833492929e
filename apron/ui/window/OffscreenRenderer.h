// Renders the window's contents off-screen, through EGL into memory.
//
// The same view model and size give the same bytes on the same driver. One thread, one instance at a time,
// and none beside a Window, because Dear ImGui has one context per process.
#pragma once

#include <memory>
#include <string>

#include "apron/ui/ViewModel.h"
#include "common/image/Image.h"

namespace apron::ui {

class OffscreenRenderer {
 public:
  // Pixels; scale: of texts and gaps. Throws UserError when this machine has no OpenGL 3.3, or no picture
  // so large.
  OffscreenRenderer(int width, int height, float scale = 1.0F);
  ~OffscreenRenderer();

  // The mouse, as seen by the next draw(): pixels from the north-west, and the left button.
  void set_mouse(float x, float y, bool down = false, float wheel = 0.0F);
  // A character typed before the next draw().
  void type_character(unsigned character);
  // One pass over the window; what the person asked for is in the workbench.
  common::Image render(ViewModel& model);
  // As long as it takes until everything has found its place: a still picture.
  common::Image render_settled(ViewModel& model);

  // OpenGL's errors since the last call, 0 for none.
  unsigned take_gl_error();
  // Pictures of registers that were sent to OpenGL so far.
  std::uint64_t texture_uploads() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apron::ui
