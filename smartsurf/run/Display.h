// The window of a run: draws snapshots, and turns what the user does into Controls.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/run/Hand.h"
#include "smartsurf/run/LookBack.h"
#include "smartsurf/run/RunOptions.h"
#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/ViewChannels.h"
#include "smartsurf/view/Controls.h"

namespace smartsurf::view {
class Window;
}  // namespace smartsurf::view

namespace smartsurf::run {

// What the user of the window asked for; the run obeys.
struct Controls {
  HandWishes hand;
  bool reset = false;  // begin anew, with these options changed:
  std::vector<view::NamedValue> options;
  bool display_lost = false;
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
  bool resettable = false;
  std::string notice;
  bool over = false;  // nothing can be touched any more
};

class Display {
 public:
  // Opens the window if asked to. Throws scene::InputError when there is no display.
  Display(const RunOptions&, const scene::SceneSpec&);
  ~Display();

  bool has_window() const { return window_ != nullptr; }
  // The same window for another run.
  void begin_anew(const scene::SceneSpec&);
  // A state to look back on. Does nothing without a window.
  void remember(const Simulation&);
  // Reads the user's input, and draws a frame if the last is old enough. Does nothing without a window.
  void refresh(const Simulation&, const DisplayStatus&, Controls&);

 private:
  bool frame_due(const Simulation&, std::chrono::steady_clock::time_point now) const;
  void obey(const view::Commands&, Controls&);
  view::Status status_of(const DisplayStatus&, bool paused) const;

  scene::SceneSpec scene_;
  std::unique_ptr<view::Window> window_;
  LookBack past_;
  std::optional<std::size_t> looking_;  // at this state of the past
  ViewChannels channels_;
  std::vector<view::ContactMark> contacts_;
  std::chrono::steady_clock::time_point next_frame_{}, drawn_at_{};
  std::uint64_t drawn_tick_ = 0;
};

}  // namespace smartsurf::run
