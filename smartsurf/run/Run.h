// `smartsurf run`: runs one experiment from its first to its last tick, with controller, pacing, window,
// recordings and statistics.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/process/ExitStatus.h"
#include "smartsurf/record/Recorder.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/FileWatch.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/SurfaceLink.h"
#include "smartsurf/run/display/Display.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/output/Stats.h"
#include "smartsurf/scene/NamedValues.h"
#include "smartsurf/scene/UnlikelyPlacements.h"
#include "smartsurf/simulation/Simulation.h"

namespace smartsurf::run {

class Run {
 public:
  // The values that a run that the user restarts, or replaces by another experiment, passes to the next run.
  struct Restart {
    RunOptions options;
    script::Experiment experiment;
    std::unique_ptr<Display> display;
  };

  static script::Experiment load(const RunOptions&);
  // stop_requested: set by SIGINT, SIGTERM and SIGHUP; must outlive the run. display: that of the previous
  // run, or null to open a new one if the options ask for a window. Throws scene::InputError for invalid
  // input.
  Run(const RunOptions&, const std::atomic<bool>& stop_requested, script::Experiment,
      std::unique_ptr<Display> display = nullptr);
  ~Run();

  // Calls the observer with the state before the first tick and after each tick.
  void observe(std::function<void(const simulation::Simulation&)> observer) {
    observer_ = std::move(observer);
  }

  // The statistics of the run so far, as written by --stats.
  std::string stats_json() const { return to_json(summary(), phase_times_); }

  // Runs to the end and returns the exit status. Throws scene::InputError for an error in the script's event
  // handlers, after the recordings are closed.
  int execute();
  // The values of the script's metric().
  const scene::Metrics& metrics() const { return experiment_.metrics(); }
  // After execute(): the next run if the user asked for a restart.
  std::optional<Restart> take_restart();
  // After execute(): the recording that the user opened instead, or "".
  const std::string& recording_to_open() const { return recording_to_open_; }

 private:
  // Why the run ends. The outcome is one line for the recording and the statistics.
  struct Ending {
    int exit_status = common::kDone;
    std::string outcome;
    std::string title;            // the outcome in the words of the script, or ""
    std::optional<bool> success;  // as the script says
  };

  void open_recordings();
  void start();
  bool tick();  // false: the run is over; ending_ is set
  bool receive_targets();
  bool wait_for_controller();
  bool handle_controller_exit(shm_protocol::Status);
  void check_silence();
  std::string command_to_attach() const;
  void end_without_name();
  bool continue_without_controller(shm_protocol::Status);
  bool advance_physics();
  void warn_of_added_objects(std::size_t first);  // those of the catalogue from there on
  bool publish();
  void record_tick();
  void apply_script_requests();
  void apply_user_interaction();
  RunOptions options_of_restart() const;  // the options of this run, paused and paced as it is
  void prepare_restart();
  void prepare_restart(RunOptions);
  void reload();         // the experiment, which was saved
  void start_program();  // that of waiting_banner()
  void open_file(const std::string& file);
  void mark_events();  // of this tick, and adds it to the window's history
  void mark_controller_lost();
  void keep_window_open();  // shows the result until the user closes the window
  bool controller_has_window() const;
  view::Banner result_banner() const;
  view::Banner waiting_banner() const;
  std::vector<std::string> written_files() const;
  void print_summary();
  void handle_display_loss();
  void require_broker();
  bool wait_until_due();  // draws and sleeps until the next tick is due; false: the run is over
  void refresh_display();
  view::FrameInput frame_input();
  std::optional<double> end_time_s() const;
  // The first ending counts.
  void set_ending(int exit_status, std::string outcome, std::string title = "",
                  std::optional<bool> success = std::nullopt);
  void replace_ending(int exit_status, std::string outcome);
  void finish();
  bool failed_to_start() const;
  void finish_pictures(double end_s);
  void write_stats() const;
  RunSummary summary() const;
  std::string describe_controller();
  bool can_restart() const;
  bool controller_is_paused();

  RunOptions options_;
  const std::atomic<bool>& stop_requested_;
  script::Experiment experiment_;
  simulation::Simulation simulation_;
  std::unique_ptr<SurfaceLink> link_;  // null with --no-controller
  std::unique_ptr<ControllerProcess> controller_process_;
  std::vector<std::unique_ptr<record::Recorder>> recorders_;
  std::unique_ptr<Display> display_;
  MediaWriter media_;
  ViewChannels channels_;
  const scene::PlacementCheck placement_check_;
  Progress progress_;
  Pacer pacer_;
  DisplayRequests requests_;
  FileWatch experiment_file_;
  UserInteraction interaction_;
  std::optional<std::uint64_t> first_interaction_tick_;  // the tick after which the user intervened
  std::string notice_;
  std::chrono::steady_clock::time_point silent_since_{};  // when the controller should have answered
  std::string silence_;                                   // what was reported about it, or ""
  std::chrono::steady_clock::time_point next_broker_check_{};
  bool quit_by_script_ = false;
  std::optional<Restart> restart_;
  std::string recording_to_open_;
  bool interacted_ = false;  // in the latest tick
  std::function<void(const simulation::Simulation&)> observer_;
  PhaseTimes phase_times_;
  std::optional<double> success_s_;  // when success() first said so
  std::optional<std::uint64_t> end_tick_;
  std::optional<Ending> ending_;
  std::chrono::steady_clock::time_point start_time_{};
  std::chrono::steady_clock::duration pictures_time_{};  // since then, for --screenshot and --video
  double wall_s_ = 0.0;                                  // without that
  std::uint64_t frames_drawn_ = 0;                       // until the end of the run
  std::optional<RunSummary> final_summary_;              // with the counters of the link, which closes then
  std::array<bool, scene::PlacementCheck::kKinds> warned_of_{};  // objects that the script adds
  bool announced_waiting_ = false;                               // and still waits
};

}  // namespace smartsurf::run
