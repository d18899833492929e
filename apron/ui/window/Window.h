// The program's desktop window.
//
// GLFW requires one thread: create, call and destroy it on the process's main thread. One window per process.
#pragma once

#include <memory>
#include <string>

#include "apron/ui/ViewModel.h"
#include "common/image/Image.h"

namespace apron::ui {

// Where on the screen, in screen coordinates; the right part of it beside another window.
struct WindowPlacement {
  int width = 0, height = 0;  // 0: chosen
  bool has_position = false;
  int x = 0, y = 0;
  bool beside_simulator = false;  // the right part of the work area, the left one being somebody else's
};

class Window {
 public:
  // Whether a window can be opened here.
  static bool display_available();

  // Throws UserError, one line, when there is no display or no OpenGL 3.3.
  Window(const std::string& title, const WindowPlacement& placement);
  ~Window();

  // Takes in what the person did, draws (nothing while minimised) and shows it; does not wait. False once the
  // window was closed.
  bool render_frame(ViewModel& model);
  // Waits for the mouse, a key or the time to pass.
  void wait_events(double seconds);
  // What is shown: draws once more. Empty while minimised.
  common::Image capture(ViewModel& model);
  // As if the person had closed it.
  void close();
  // OpenGL's errors since the last call, 0 for none.
  unsigned take_gl_error();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace apron::ui
