// `smartsurf run`: one experiment from its first tick to its last, with everything around it: the controller,
// the clock, the window, the recordings and the figures about the run.
#pragma once

#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "smartsurf/record/Purity.h"
#include "smartsurf/record/Recorder.h"
#include "smartsurf/run/ControllerProcess.h"
#include "smartsurf/run/Display.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/RunOptions.h"
#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/Stats.h"
#include "smartsurf/run/SurfaceLink.h"

namespace smartsurf::run {

// Exit statuses of the program.
enum ExitStatus { kDone = 0, kFailed = 1, kUserError = 2, kPeerLost = 3 };

// Writes a file in one piece or not at all. Throws scene::InputError that names the flag and the file.
void write_whole_file(const std::string& flag, const std::string& file, const std::string& text);

class Run {
 public:
  // `stop` is raised by SIGINT and SIGTERM. Throws scene::InputError for whatever the user got wrong.
  Run(const RunOptions&, const std::atomic<bool>& stop);
  ~Run();

  // The figures about the run so far, as --stats writes them.
  std::string stats_json() const { return to_json(summary(), times_); }

  // Runs to the end and returns the exit status. Throws scene::InputError for a mistake in the script's
  // events, after everything recorded has been kept.
  int execute();

 private:
  // Why a run ends; the outcome is one line for the recording and the stats.
  struct Ending {
    int exit_status = kDone;
    std::string outcome;
  };

  void open_recordings();
  void begin();
  bool tick();  // false: the run is over, and ending_ says why
  bool receive_actuators();
  bool replace_controller();
  bool child_ended();
  bool fly_on_without_controller(shm_protocol::Status);
  bool advance_physics();
  bool publish();
  void record();
  void obey_script();
  bool hold_pace();  // sleeps or draws until the next tick is due; false: the run is over
  void refresh_display();
  void show_progress(bool last);
  void end(int exit_status, std::string outcome);
  void finish();
  void write_stats() const;
  RunSummary summary() const;
  std::string controller_phrase();
  void say(const std::string&);

  RunOptions options_;
  const std::atomic<bool>& stop_;
  script::Experiment experiment_;
  Simulation simulation_;
  std::unique_ptr<SurfaceLink> link_;  // none with --no-controller
  std::unique_ptr<ControllerProcess> child_;
  std::vector<std::unique_ptr<record::Recorder>> recorders_;
  Display display_;
  Pacer pacer_;
  Controls controls_;
  PhaseTimes times_;
  record::PurityMeter purity_;
  std::optional<std::uint64_t> last_tick_;
  std::optional<Ending> ending_;
  std::chrono::steady_clock::time_point started_{}, next_progress_{};
  double wall_s_ = 0.0;
  bool progress_shown_ = false;
  bool announced_waiting_ = false;
  bool had_controller_ = false;
};

}  // namespace smartsurf::run
