// The window of a run: draws snapshots and collects the user's requests.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/cli/RunOptions.h"
#include "smartsurf/run/display/SnapshotHistory.h"
#include "smartsurf/run/display/UserInteraction.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::view {
class Window;
}  // namespace smartsurf::view

namespace smartsurf::run {

// What the user of the window asked for; the run obeys.
struct DisplayRequests {
  InteractionRequests interaction;
  bool restart = false;  // begin anew, with these options changed:
  std::vector<view::NamedValue> changed_options;
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
  bool can_restart = false;
  std::string notice;
  bool run_ended = false;  // nothing can be touched any more
};

class Display {
 public:
  // Opens the window if asked to. Throws scene::InputError when there is no display.
  Display(const RunOptions&, const scene::SceneSpec&);
  ~Display();

  bool has_window() const { return window_ != nullptr; }
  // The same window for another run.
  void restart(const scene::SceneSpec&);
  // A state to look back on. Does nothing without a window.
  void record_snapshot(const Simulation&);
  // Reads the user's input, and draws a frame if the last is old enough. Does nothing without a window.
  void refresh(const Simulation&, const DisplayStatus&, DisplayRequests&);

 private:
  bool frame_due(const Simulation&, std::chrono::steady_clock::time_point now) const;
  void apply_commands(const view::Commands&, DisplayRequests&);
  view::Status make_view_status(const DisplayStatus&, bool paused) const;

  scene::SceneSpec scene_;
  std::unique_ptr<view::Window> window_;
  SnapshotHistory history_;
  std::optional<std::size_t> history_index_;  // at this state of the past
  ViewChannels channels_;
  std::vector<view::ContactMark> contacts_;
  std::chrono::steady_clock::time_point next_frame_time_{}, last_draw_time_{};
  std::uint64_t last_drawn_tick_ = 0;
};

}  // namespace smartsurf::run
