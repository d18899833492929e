// The window and the pictures of a run: draws snapshots, and turns what the user does into Controls.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/run/RunOptions.h"
#include "smartsurf/run/Simulation.h"

namespace smartsurf::view {
class Window;
class OffscreenView;
class VideoWriter;
}  // namespace smartsurf::view

namespace smartsurf::run {

// What the user of the window asked for; the run obeys.
struct Controls {
  bool paused = false;
  int single_steps = 0;  // to take although paused
  bool quit = false;
  bool pace_changed = false;
  std::optional<double> pace;
};

// What the window tells besides the scene.
struct DisplayStatus {
  double real_time_factor = 0.0;
  std::optional<double> requested_pace;
  RunMode mode = RunMode::kTimeStep;
  std::string controller;  // one phrase: "apron, process 4711", "waiting for a controller"
  double physics_ms = 0.0;
  std::optional<double> purity;
};

class Display {
 public:
  // Opens the window and begins the video if asked to. Throws scene::InputError when there is no display, or
  // the video cannot be made.
  Display(const RunOptions&, const scene::SceneSpec&);
  ~Display();

  bool has_window() const { return window_ != nullptr; }
  // Reads the user's input, and draws a frame if the last is old enough. Does nothing without a window.
  void refresh(const Simulation&, const DisplayStatus&, Controls&);

  // Writes the screenshots and the video's pictures that are due at this time; at the end all screenshots
  // that are left, and the video's last words.
  void take_pictures(const Simulation&);
  void take_last_pictures(const Simulation&);

 private:
  void write_picture(const Simulation&, const std::string& file);
  void film(const Simulation&);

  scene::SceneSpec scene_;
  std::vector<Screenshot> pending_;
  std::unique_ptr<view::Window> window_;
  std::unique_ptr<view::OffscreenView> pictures_, film_;
  std::unique_ptr<view::VideoWriter> video_;
  long film_frames_ = 0;
  std::chrono::steady_clock::time_point next_frame_{};
};

}  // namespace smartsurf::run
