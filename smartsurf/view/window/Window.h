// The simulator's window: draws the scene and the panels, and returns the user's commands.
//
// Main thread only, as GLFW requires; one window per process. Calls block only while drawing (about 30 ms on
// a software renderer). The caller chooses the frame rate.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/scene/Snapshot.h"
#include "smartsurf/view/interaction/Controls.h"
#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/window/WindowPlacement.h"

namespace smartsurf::view {

class Window {
 public:
  // True if a window can be opened. False in a build without the view.
  static bool display_available();

  // width, height: in screen coordinates (pixels, unless the display is scaled); ignored with kLeft.
  // Throws std::runtime_error with a one-line message if there is no display or no OpenGL 3.3.
  Window(const scene::SceneSpec& spec, const std::string& title, int width = 1280, int height = 720,
         WindowPlacement placement = WindowPlacement::kDefault);
  ~Window();

  // Sets the camera, the overlays and the plotted signals.
  void apply(const ViewSettings& settings);
  // Shows one line in the panel, for example the path of a file that was written.
  void show_message(const std::string& message);

  // Switches to another scene, for example when a run is restarted. Display settings stay, and so does the
  // camera if the surface has the same size.
  void set_scene(const scene::SceneSpec& spec, const std::string& title);
  // Moves the window to WindowPlacement::kLeft.
  void move_to_left();

  // Handles input, then draws and shows one frame (none while the window is minimised). A screenshot or video
  // that the user requests is written to the current directory as NAME-TICK.png or .mp4, where NAME is the
  // experiment's; the panel reports a failure. A lost display is reported in Commands::display_lost.
  Commands render_frame(const FrameInput& input, const Status& status);

  // Handles input and returns the commands without drawing. For use between frames that are far apart.
  Commands poll(const Status& status);

  // Renders the scene from the window's camera in the quality of OffscreenView, without the panels.
  common::Image capture_scene(const FrameInput& input, int width, int height);

  // Draws and shows one frame and returns it with its panels, in framebuffer pixels (on a scaled display,
  // more than the window's size). Empty while the window is minimised. Commands stay pending for
  // render_frame().
  common::Image capture_frame(const FrameInput& input, const Status& status);

  // True if there was input since the last frame.
  bool needs_redraw() const;
  // True if the user has enabled contact forces; FrameInput::contacts should then be filled.
  bool wants_contacts() const;
  // Simulate a key action and a pointer event (screen coordinates of the window). Take effect in the next
  // frame.
  void perform(UiAction action);
  void add_pointer_event(const PointerEvent& event);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace smartsurf::view
