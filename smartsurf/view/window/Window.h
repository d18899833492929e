// The simulator's window: the scene, a status panel, and the user's requests.
//
// GLFW requires one thread: create, call and destroy it on the process's main thread. Calls do not wait
// beyond the time of drawing (about 30 ms without a graphics card); the caller chooses the frame rate. One
// window per process.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {

// kLeft: the left part of the screen, beside another program's window on its right.
enum class WindowPlacement { kDefault, kLeft };

class Window {
 public:
  // Whether a window can be opened here. False as well in a build without the view.
  static bool display_available();

  // width, height in screen coordinates (pixels, unless the display is scaled); not used with kLeft.
  // Throws std::runtime_error, one line, when there is no display or no OpenGL 3.3.
  Window(const scene::SceneSpec& spec, const std::string& title, int width = 1280, int height = 720,
         WindowPlacement placement = WindowPlacement::kDefault);
  ~Window();

  // Goes on with another scene: a run that begins anew. The user's view and choices stay as far as they fit.
  void set_scene(const scene::SceneSpec& spec);

  // Takes in what the user did, draws one frame (nothing while the window is minimised) and shows it.
  // A picture or video the user asks for is written into the current folder as NAME-TICK.png or .mp4, NAME
  // the experiment's; if that fails, the panel says so. A display that is gone is told once, in the commands.
  Commands render_frame(const FrameInput& input, const Status& status);

  // What the user asked for, without drawing: to be called between frames that are far apart.
  Commands poll(const Status& status);

  // The scene from the window's camera in the quality of OffscreenView, without the panel.
  common::Image capture_scene(const FrameInput& input, int width, int height);

  // Draws and shows one frame and returns it, panel included; in pixels, which on a scaled display are more
  // than the window's size. Empty while the window is minimised. Leaves the user's wishes for the next
  // frame().
  common::Image capture_frame(const FrameInput& input, const Status& status);

  // Whether the user has done anything since the last frame was drawn.
  bool needs_redraw() const;
  // Whether the user has asked to see contacts: then moments should hold them.
  bool wants_contacts() const;
  // As if the user had pressed that key, or moved the pointer so, in pixels of the framebuffer; taken in by
  // the next frame.
  void perform(UiAction action);
  void add_pointer_event(const PointerEvent& event);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view
