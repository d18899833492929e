// Maps mouse and keyboard input to camera movements and requests to the simulator. Independent of windows and
// OpenGL: events arrive as plain calls.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/interaction/Tools.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/OptionEdit.h"

namespace smartsurf::view {

// The moments that can be gone to: a recording's frames, or the last states of a run, to look back on.
struct Timeline {
  std::size_t frame_count = 0;        // ≥ 1
  std::size_t current_frame = 0;      // the one that is shown, < frames
  double begin_s = 0.0, end_s = 0.0;  // simulated time of the first and the last
  bool is_recording = false;  // a recording; else a running simulation, whose last frame is where it stands
};

// What the simulator tells the user besides the snapshot.
struct Status {
  std::string mode;        // "time-step" or "passive"
  std::string controller;  // who drives the surface: name, process id and state in a few words; or ""
  bool paused = false;
  double requested_pace = 1.0;   // simulated seconds a second of wall-clock; 0: as fast as possible
  double actual_pace = 0.0;      // measured
  double physics_ms = 0.0;       // wall-clock of one tick's physics
  std::optional<double> purity;  // [0, 1], when the experiment has such a measure
  std::optional<Timeline> timeline;
  std::string notice;                // one line that matters for as long as it is there
  bool has_contacts = false;         // the moments tell contacts
  bool accepts_interaction = false;  // a simulation that takes pulls, pokes and new objects
  bool accepts_faults = false;       // and faults
  bool can_reset = false;            // and may begin anew
};

// What the user asked for since the last frame.
struct Commands {
  bool toggle_pause = false;
  int steps = 0;                    // single ticks while paused; negative: back along the timeline
  std::optional<std::size_t> seek;  // frame of the timeline to show
  std::optional<double> pace;       // new pace, as Status::requested_pace
  bool quit = false;
  bool display_lost = false;    // there is no window any more: do not call it again
  std::string screenshot_path;  // path of a picture that was just written, or ""

  std::optional<Pull> pull;               // for as long as it is there
  std::optional<Poke> poke;               // likewise
  std::optional<scene::ObjectSpec> drop;  // one new object
  std::optional<Fault> fault;
  bool reset = false;  // begin anew, with these options changed:
  std::vector<NamedValue> options;
};

// One movement of the pointer, in pixels of a picture, y down.
struct PointerEvent {
  enum class Kind { kPress, kMove, kRelease };
  enum class Button { kLeft, kOther };
  Kind kind = Kind::kMove;
  Button button = Button::kLeft;  // not for kMove
  double x = 0.0, y = 0.0;
  bool control = false, shift = false;
};

enum class UiAction {
  kPause,
  kStep,
  kStepBack,
  kFaster,
  kSlower,
  kMaxPace,
  kTop,
  kIso,
  kSide,
  kWireframe,
  kGrid,
  kLabels,
  kTrails,
  kContactForces,
  kSensorRays,
  kNextChannel,
  kFollow,
  kReset,
  kPanels,
  kScreenshot,
  kVideo,
  kHelp,
  kEscape,
  kQuit
};
enum class PointerDrag { kOrbit, kPan };

class Controls {
 public:
  explicit Controls(const scene::SurfaceSpec& surface);

  // Another experiment, or the same with another surface; the user's choices stay.
  void set_surface(const scene::SurfaceSpec& surface);

  void perform(UiAction action, const Status& status);
  // The pointer over a picture of that size. Control and a drag pull an object, a click picks, drags of the
  // left button turn and others move the camera, unless a tool takes them.
  void handle_pointer(const PointerEvent& event, const FrameInput& input, const Status& status, double width,
                      double height);
  // Pointer movement in pixels, y down, in a picture of that height.
  void orbit_or_pan(PointerDrag kind, double dx, double dy, double height);
  void handle_scroll(double notches);
  // The picture's shape, and what of its height panels cover: where they change, a preset that was not
  // touched since is framed anew.
  void resize(double aspect, const ViewInsets& insets = {});

  void seek(std::size_t frame) { commands_.seek = frame; }
  void reset(std::vector<NamedValue> options);
  void follow(std::optional<scene::ObjectId> object) { followed_ = object; }
  const std::optional<scene::ObjectId>& followed() const { return followed_; }
  // Before drawing: the camera goes after the followed object, until that is gone.
  void update_camera(const scene::Snapshot& snapshot);

  // What was asked since the last call; the pause, step and pace of keys and of the panel's buttons alike.
  Commands take_commands();
  bool take_screenshot_request();
  bool take_video_request();

  const Camera& camera() const { return camera_; }
  bool help_shown() const { return help_; }
  FillMode fill_mode() const { return fill_mode_; }
  bool grid_shown() const { return grid_; }
  bool panels_shown() const { return panels_; }
  bool labels_shown() const { return labels_; }
  Tools& tools() { return tools_; }
  const Tools& tools() const { return tools_; }
  OverlaySettings& overlay() { return overlay_; }
  const OverlaySettings& overlay() const { return overlay_; }
  // The names that kNextChannel goes through.
  void set_channels(std::span<const Channel> channels);

  // The neighbouring pace on the ladder 1/16, 1/8 … 32, as fast as possible (0).
  static double faster_pace(double pace);
  static double slower_pace(double pace);

 private:
  void apply_preset(CameraPreset preset);
  void perform_view_action(UiAction action);
  void toggle_display_option(UiAction action);
  void select_next_channel();
  Ray pointer_ray(const PointerEvent& event, double width, double height) const;

  scene::SurfaceSpec surface_;
  Camera camera_;
  CameraPreset preset_ = CameraPreset::kIso;
  double aspect_ = 16.0 / 9.0;
  ViewInsets insets_;
  bool camera_moved_ = false, help_ = false, grid_ = true, screenshot_requested_ = false;
  bool video_requested_ = false, panels_ = true, labels_ = false;
  FillMode fill_mode_ = FillMode::kSolid;
  Commands commands_;
  Tools tools_;
  OverlaySettings overlay_;
  std::vector<std::string> channels_;
  std::optional<scene::ObjectId> followed_;
  enum class Gesture { kNone, kOrbit, kPan, kTool };
  Gesture gesture_ = Gesture::kNone;
  double pointer_x_ = 0.0, pointer_y_ = 0.0, drag_distance_ = 0.0;
};

}  // namespace smartsurf::view
