// The program's desktop window.
//
// GLFW requires the main thread: create, call and destroy a Window there. One window per process.
#pragma once

#include <memory>
#include <string>

#include "apron/ui/ViewModel.h"
#include "common/image/Image.h"

namespace apron::ui {

// Size and position in screen coordinates.
struct WindowPlacement {
  int width = 0, height = 0;  // 0: default
  bool has_position = false;
  int x = 0, y = 0;
  bool beside_simulator = false;  // use the right part of the work area; the simulator's window has the left
};

class Window {
 public:
  // True if a window can be opened here.
  static bool display_available();

  // Throws common::UserError, one line, if there is no display or no OpenGL 3.3.
  Window(const std::string& title, const WindowPlacement& placement);
  ~Window();

  // Processes input, draws a frame (unless minimised) and presents it, without waiting. False once the window
  // is closed.
  bool render_frame(ViewModel& model);
  // Waits for input or until the time has passed.
  void wait_events(double seconds);
  // Draws a frame and reads it back. Empty while minimised.
  common::Image capture(ViewModel& model);
  // Requests closing, as if by the user.
  void close();
  // An OpenGL error recorded since the last call, or 0.
  unsigned take_gl_error();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apron::ui
