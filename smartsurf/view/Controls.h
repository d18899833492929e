// What the user does with mouse and keys, turned into camera movements and wishes for the simulator. No window
// and no OpenGL here: events come in as plain calls.
#pragma once

#include <optional>
#include <string>

#include "smartsurf/scene/SceneSpec.h"
#include "smartsurf/view/Camera.h"
#include "smartsurf/view/DrawOptions.h"

namespace smartsurf::view {

// What the simulator tells the user besides the snapshot.
struct Status {
  std::string mode;                // "time-step" or "passive"
  std::string controller;          // who drives the surface: name, process id and state in a few words; or ""
  bool paused = false;
  double requested_pace = 1.0;     // simulated seconds a second of wall-clock; 0: as fast as possible
  double actual_pace = 0.0;        // measured
  double physics_ms = 0.0;         // wall-clock of one tick's physics
  std::optional<double> purity;    // [0, 1], when the experiment has such a measure
};

// What the user asked for since the last frame.
struct Commands {
  bool toggle_pause = false;
  int steps = 0;                // single ticks, to run while paused
  std::optional<double> pace;   // new pace, as Status::requested_pace
  bool quit = false;
  std::string screenshot;       // path of a picture that was just written, or ""
};

enum class Key { kPause, kStep, kFaster, kSlower, kMaxPace, kTop, kIso, kSide, kWireframe, kGrid, kPicture, kHelp, kQuit };
enum class Drag { kOrbit, kPan };

class Controls {
 public:
  explicit Controls(const scene::SurfaceSpec& surface);

  void press(Key key, const Status& status);
  // Pointer movement in pixels, y down, in a picture of that height.
  void drag(Drag kind, double dx, double dy, double height);
  void wheel(double notches);
  // The picture's new shape: a preset that was not touched since is framed anew.
  void resize(double aspect);

  // What was asked since the last call; the pause, step and pace of keys and of the panel's buttons alike.
  Commands take();
  bool take_picture_request();

  const Camera& camera() const { return camera_; }
  bool help_shown() const { return help_; }
  Style style() const { return style_; }
  bool grid_shown() const { return grid_; }

  // The neighbouring pace on the ladder 1/16, 1/8 … 32, as fast as possible (0).
  static double faster(double pace);
  static double slower(double pace);

 private:
  void frame(Preset preset);

  scene::SurfaceSpec surface_;
  Camera camera_;
  Preset preset_ = Preset::kIso;
  double aspect_ = 16.0 / 9.0;
  bool camera_touched_ = false, help_ = false, grid_ = true, picture_ = false;
  Style style_ = Style::kSolid;
  Commands commands_;
};

}  // namespace smartsurf::view
