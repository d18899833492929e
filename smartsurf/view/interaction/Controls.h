// Maps mouse and keyboard input to camera movements and commands to the simulator. Independent of the window
// system and OpenGL: events arrive as plain calls.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/interaction/Overlay.h"
#include "smartsurf/view/interaction/Tools.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/OptionEdit.h"
#include "smartsurf/view/model/PlotData.h"

namespace smartsurf::view {

// An event of a run, marked on the timeline.
struct EventMark {
  enum class Kind {
    kScript,          // a callback of at() ran
    kSuccess,         // the experiment reached its goal
    kTouched,         // the user intervened
    kControllerLost,  // the controller exited, detached or died
  };
  Kind kind = Kind::kScript;
  double time_s = 0.0;
  std::string text;
};

// The frames that the user can seek to: those of a recording, or the recent states of a running simulation.
struct Timeline {
  std::size_t frame_count = 0;        // ≥ 1
  std::size_t current_frame = 0;      // the frame on display, < frame_count
  double begin_s = 0.0, end_s = 0.0;  // simulated time of the first and the last frame
  bool is_recording = false;          // false: a running simulation, whose last frame is the current state
  std::span<const EventMark> marks;   // in order of time
};

// A message in the middle of the window: how the run ended, or what it waits for.
struct Banner {
  enum class Tone { kNeutral, kSuccess, kFailure };
  Tone tone = Tone::kNeutral;
  std::string title;
  std::vector<std::string> lines;
  std::string command;  // a shell command to copy, or ""
  std::string program;  // a program that a button starts, or ""
};

// The simulator's state for the status panel, besides the snapshot.
struct Status {
  std::string mode;        // "time-step" or "passive"
  std::string controller;  // name, process id and state of the controlling program, or ""
  bool paused = false;
  bool run_ended = false;                  // nothing follows but a restart; the past can be viewed
  double requested_pace = 1.0;             // simulated seconds per wall-clock second; 0: as fast as possible
  double actual_pace = 0.0;                // measured, same unit
  double physics_ms = 0.0;                 // wall-clock time of one tick's physics
  std::span<const scene::Metric> metrics;  // of the script; NaN: no value yet
  std::optional<Timeline> timeline;
  std::string notice;  // one line, shown while not empty
  std::optional<Banner> banner;
  bool has_contacts = false;         // FrameInput::contacts is filled on request
  bool accepts_interaction = false;  // the simulation accepts pulls, pokes and new objects
  bool accepts_faults = false;       // and faults
  bool can_reset = false;            // the simulation can be restarted
};

// The initial state of a window.
struct ViewSettings {
  CameraView camera;
  FillMode fill_mode = FillMode::kSolid;
  Stage stage = Stage::kLight;
  // Default: kStill for pictures, kVideo for videos, and what the driver draws fast enough in a window.
  std::optional<Detail> detail;
  OverlaySettings overlay;
  std::vector<Signal> plots;
};

// The user's requests since the last frame.
struct Commands {
  bool toggle_pause = false;
  int steps = 0;                      // single ticks while paused; negative: back along the timeline
  std::optional<std::size_t> seek;    // frame of the timeline to show
  std::optional<double> seek_time_s;  // show the first frame at or after this simulated time
  std::optional<double> pace;         // new pace, as Status::requested_pace
  bool quit = false;
  bool display_lost = false;    // the window is gone; no further calls are allowed
  std::string screenshot_path;  // path of the screenshot just written, or ""

  std::optional<Pull> pull;               // active while present
  std::optional<Poke> poke;               // active while present
  std::optional<scene::ObjectSpec> drop;  // one new object
  std::optional<Fault> fault;
  bool reset = false;               // restart the run with these options
  std::vector<NamedValue> options;  // changed options
  std::string open_file;            // an experiment or recording to open instead, or ""
  bool start_program = false;       // the banner's
  bool stop_bridges = false;        // emergency stop of the hardware that runs beside
  std::optional<PlotExport> plot_export;
};

// One pointer event. x, y: image pixels, y down.
struct PointerEvent {
  enum class Kind { kPress, kMove, kRelease };
  enum class Button { kLeft, kOther };
  Kind kind = Kind::kMove;
  Button button = Button::kLeft;  // ignored for kMove
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
  kEntities,
  kPlots,
  kTrails,
  kContactForces,
  kSensorRays,
  kNextChannel,
  kFollow,
  kReset,
  kStopBridges,
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

  // Switches to another surface. Display settings stay; tools and the followed object are reset. The camera
  // is kept if the surface has the same size.
  void set_surface(const scene::SurfaceSpec& surface);

  void perform(UiAction action, const Status& status);
  // Handles a pointer event over a width × height image. Control + drag pulls an object and a click selects.
  // Other drags go to the active tool; if it does not take them, the left button orbits, and any other button
  // or Shift pans.
  void handle_pointer(const PointerEvent& event, const FrameInput& input, const Status& status, double width,
                      double height);
  // dx, dy: pointer movement, pixels, y down. height: image height, pixels.
  void orbit_or_pan(PointerDrag kind, double dx, double dy, double height);
  void handle_scroll(double notches);
  // Sets the image's aspect ratio (width / height). If it changes and the camera has not been moved since its
  // preset was applied, the camera is fitted again.
  void resize(double aspect);

  void apply(const ViewSettings& settings);
  void seek(std::size_t frame) { commands_.seek = frame; }
  void seek_time(double time_s) { commands_.seek_time_s = time_s; }
  void open_file(const std::string& file) { commands_.open_file = file; }
  void start_program() { commands_.start_program = true; }
  void export_plot(PlotExport plot) { commands_.plot_export = std::move(plot); }
  // Moves the camera as parse_camera_pose() reads the text; false if it cannot be read.
  bool paste_camera(std::string_view text);
  void reset(std::vector<NamedValue> options);
  void follow(std::optional<scene::ObjectId> object) { followed_ = object; }
  const std::optional<scene::ObjectId>& followed() const { return followed_; }
  // Call before drawing: moves the camera to the followed object, and stops following once it is removed. A
  // preset that has been applied since the last call is fitted to the objects over the table, too.
  // catalogue: index = object id.
  void update_camera(const scene::Snapshot& snapshot, const std::vector<scene::ObjectSpec>& catalogue);

  // Returns the commands since the last call and clears them, except for an active pull or poke.
  Commands take_commands();
  bool take_screenshot_request();
  bool take_video_request();

  const Camera& camera() const { return camera_; }
  bool help_shown() const { return help_; }
  FillMode fill_mode() const { return fill_mode_; }
  bool grid_shown() const { return grid_; }
  bool panels_shown() const { return panels_; }
  bool labels_shown() const { return labels_; }
  bool entities_shown() const { return entities_; }
  bool plots_shown() const { return plots_; }
  // True if the action is a switch that is on.
  bool is_on(UiAction action) const;
  Tools& tools() { return tools_; }
  const Tools& tools() const { return tools_; }
  OverlaySettings& overlay() { return overlay_; }
  const OverlaySettings& overlay() const { return overlay_; }
  // The channels that kNextChannel cycles through.
  void set_channels(std::span<const Channel> channels);

  // The next pace in the sequence 1/16, 1/8, …, 32, as fast as possible (0).
  static double faster_pace(double pace);
  static double slower_pace(double pace);

 private:
  void apply_view(const CameraView& view);
  void fit_camera();
  void perform_view_action(UiAction action);
  void toggle_display_option(UiAction action);
  void select_next_channel();
  Ray pointer_ray(const PointerEvent& event, double width, double height) const;

  scene::SurfaceSpec surface_;
  Camera camera_;
  CameraView view_;
  std::vector<Eigen::Vector3d> fitted_corners_;  // of the objects to which the view is fitted
  bool fits_to_objects_ = true;                  // at the next update_camera()
  double aspect_ = 16.0 / 9.0;
  bool camera_moved_ = false, help_ = false, grid_ = true, screenshot_requested_ = false;
  bool video_requested_ = false, panels_ = true, labels_ = false, entities_ = false, plots_ = false;
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
