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
#include "smartsurf/run/ExitStatus.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/Pictures.h"
#include "smartsurf/run/Progress.h"
#include "smartsurf/run/RunOptions.h"
#include "smartsurf/run/Simulation.h"
#include "smartsurf/run/Stats.h"
#include "smartsurf/run/SurfaceLink.h"

namespace smartsurf::run {

class Run {
 public:
  // What a run that the user wants to begin anew hands to the next.
  struct Successor {
    RunOptions options;
    script::Experiment experiment;
    std::unique_ptr<Display> display;
  };

  static script::Experiment load(const RunOptions&);
  // `stop` is raised by SIGINT, SIGTERM and SIGHUP. display: of the run before; none opens one if the options
  // ask for it. Throws scene::InputError for whatever the user got wrong.
  Run(const RunOptions&, const std::atomic<bool>& stop, script::Experiment,
      std::unique_ptr<Display> display = nullptr);
  ~Run();

  // The figures about the run so far, as --stats writes them.
  std::string stats_json() const { return to_json(summary(), times_); }

  // Runs to the end and returns the exit status. Throws scene::InputError for a mistake in the script's
  // events, after everything recorded has been kept.
  int execute();
  // After execute(): how the user wants it anew, if so.
  std::optional<Successor> take_successor();

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
  void obey_hand();
  void begin_anew();
  void linger();  // a window stays open after stop(), to look around
  void go_on_without_display();
  bool hold_pace();  // sleeps or draws until the next tick is due; false: the run is over
  void refresh_display();
  view::Moment moment();
  std::optional<double> last_time_s() const;
  void end(int exit_status, std::string outcome);
  void finish();
  void write_stats() const;
  RunSummary summary() const;
  std::string controller_phrase();
  bool program_is_held();

  RunOptions options_;
  const std::atomic<bool>& stop_;
  script::Experiment experiment_;
  Simulation simulation_;
  std::unique_ptr<SurfaceLink> link_;  // none with --no-controller
  std::unique_ptr<ControllerProcess> child_;
  std::vector<std::unique_ptr<record::Recorder>> recorders_;
  std::unique_ptr<Display> display_;
  Pictures pictures_;
  ViewChannels channels_;
  Progress progress_;
  Pacer pacer_;
  Controls controls_;
  Hand hand_;
  std::optional<std::uint64_t> touched_;  // after this tick
  std::string notice_;
  bool lingers_ = false;
  std::optional<Successor> successor_;
  PhaseTimes times_;
  record::PurityMeter purity_;
  std::optional<std::uint64_t> last_tick_;
  std::optional<Ending> ending_;
  std::chrono::steady_clock::time_point started_{};
  double wall_s_ = 0.0;
  bool announced_waiting_ = false;
  bool had_controller_ = false;
};

}  // namespace smartsurf::run
