// `smartsurf run`: one experiment from its first tick to its last, with its controller, pace, window,
// recordings and statistics.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/process/ExitStatus.h"
#include "smartsurf/record/Purity.h"
#include "smartsurf/record/Recorder.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/SurfaceLink.h"
#include "smartsurf/run/cli/RunOptions.h"
#include "smartsurf/run/display/Display.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/output/Stats.h"

namespace smartsurf::run {

class Run {
 public:
  // What a run that the user wants to begin anew hands to the next.
  struct Restart {
    RunOptions options;
    script::Experiment experiment;
    std::unique_ptr<Display> display;
  };

  static script::Experiment load(const RunOptions&);
  // `stop` is raised by SIGINT, SIGTERM and SIGHUP. display: of the run before; none opens one if the options
  // ask for it. Throws scene::InputError for whatever the user got wrong.
  Run(const RunOptions&, const std::atomic<bool>& stop_requested, script::Experiment,
      std::unique_ptr<Display> display = nullptr);
  ~Run();

  // The figures about the run so far, as --stats writes them.
  std::string stats_json() const { return to_json(summary(), phase_times_); }

  // Runs to the end and returns the exit status. Throws scene::InputError for a mistake in the script's
  // events, after everything recorded has been kept.
  int execute();
  // After execute(): how the user wants it anew, if so.
  std::optional<Restart> take_restart();

 private:
  // Why a run ends; the outcome is one line for the recording and the stats.
  struct Ending {
    int exit_status = common::kDone;
    std::string outcome;
  };

  void open_recordings();
  void start();
  bool tick();  // false: the run is over, and ending_ says why
  bool receive_targets();
  bool wait_for_controller();
  bool handle_controller_exit();
  bool continue_without_controller(shm_protocol::Status);
  bool advance_physics();
  bool publish();
  void record_tick();
  void apply_script_requests();
  void apply_user_interaction();
  void prepare_restart();
  void keep_window_open();  // a window stays open after stop(), to look around
  void handle_display_loss();
  bool wait_until_due();  // sleeps or draws until the next tick is due; false: the run is over
  void refresh_display();
  view::FrameInput frame_input();
  std::optional<double> end_time_s() const;
  void set_ending(int exit_status, std::string outcome);
  void finish();
  void write_stats() const;
  RunSummary summary() const;
  std::string describe_controller();
  bool controller_is_paused();

  RunOptions options_;
  const std::atomic<bool>& stop_requested_;
  script::Experiment experiment_;
  Simulation simulation_;
  std::unique_ptr<SurfaceLink> link_;  // none with --no-controller
  std::unique_ptr<ControllerProcess> controller_process_;
  std::vector<std::unique_ptr<record::Recorder>> recorders_;
  std::unique_ptr<Display> display_;
  MediaWriter media_;
  ViewChannels channels_;
  Progress progress_;
  Pacer pacer_;
  DisplayRequests requests_;
  UserInteraction interaction_;
  std::optional<std::uint64_t> first_interaction_tick_;  // after this tick
  std::string notice_;
  bool keep_window_open_ = false;
  std::optional<Restart> restart_;
  PhaseTimes phase_times_;
  record::PurityMeter purity_meter_;
  std::optional<std::uint64_t> end_tick_;
  std::optional<Ending> ending_;
  std::chrono::steady_clock::time_point start_time_{};
  double wall_s_ = 0.0;
  bool announced_waiting_ = false;
  bool had_controller_ = false;
};

}  // namespace smartsurf::run
