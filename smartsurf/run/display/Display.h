// The window of a run: draws snapshots and collects the user's requests.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "smartsurf/run/display/RunHistory.h"
#include "smartsurf/run/display/UserInteraction.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/simulation/Simulation.h"
#include "smartsurf/view/interaction/Controls.h"

namespace smartsurf::view {
class Window;
}  // namespace smartsurf::view

namespace smartsurf::run {

// The user's requests, which the run carries out. Flags stay set until the run clears them.
struct DisplayRequests {
  InteractionRequests interaction;
  bool restart = false;  // with changed_options
  std::vector<view::NamedValue> changed_options;
  bool display_lost = false;
  bool paused = false;
  int single_steps = 0;  // ticks to run while paused
  bool quit = false;
  bool pace_changed = false;
  std::optional<double> pace;  // nullopt: as fast as possible
  std::string open_file;       // an experiment or recording to open instead, or ""
  bool start_program = false;  // of the banner
};

// The contents of the window besides the scene.
struct DisplayStatus {
  double real_time_factor = 0.0;
  std::optional<double> requested_pace;
  RunMode mode = RunMode::kTimeStep;
  std::string controller;  // a phrase: "process 4711, running"
  double physics_ms = 0.0;
  std::span<const scene::Metric> metrics;
  bool can_restart = false;
  std::string notice;
  std::optional<view::Banner> banner;
  bool run_ended = false;
};

class Display {
 public:
  // Opens the window if the options ask for one. Throws scene::InputError if there is no display, or the
  // surface lacks what --cells or --plot name.
  Display(const RunOptions&, const simulation::Simulation&);
  ~Display();

  bool has_window() const { return window_ != nullptr; }
  std::uint64_t frames_drawn() const { return frames_drawn_; }  // of this run
  // Reuses the window for another run; makes room if only this one has a controller's window beside it.
  void restart(const RunOptions&, const scene::SceneSpec&);
  // Shows one line in the panel until the next.
  void show_message(const std::string& message);
  // Adds the state of the current tick to the history. metrics: in an order that stays. Does nothing
  // without a window.
  void record_tick(const simulation::Simulation&, std::span<const scene::Metric> metrics);
  // Marks an event on the timeline. Does nothing without a window.
  void mark(view::EventMark mark);
  // Polls the user's input and draws a frame if one is due. Does nothing without a window.
  void refresh(const simulation::Simulation&, const DisplayStatus&, DisplayRequests&);

 private:
  bool frame_due(const simulation::Simulation&, std::chrono::steady_clock::time_point now) const;
  void apply_commands(const view::Commands&, DisplayRequests&);
  view::Status make_view_status(const DisplayStatus&, bool paused) const;

  scene::SceneSpec scene_;
  std::unique_ptr<view::Window> window_;
  bool beside_controller_window_ = false;
  RunHistory history_;
  std::vector<view::EventMark> marks_;        // in order of time
  std::optional<std::size_t> history_index_;  // the snapshot shown; nullopt: the present
  mutable scene::Metrics past_metrics_;       // of that snapshot
  ViewChannels channels_;
  std::vector<view::ContactMark> contacts_;
  std::chrono::steady_clock::time_point next_frame_time_{}, last_draw_time_{};
  std::uint64_t last_drawn_tick_ = 0, frames_drawn_ = 0;
};

}  // namespace smartsurf::run
