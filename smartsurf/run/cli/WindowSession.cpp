#include "smartsurf/run/cli/WindowSession.h"

#include <memory>
#include <optional>
#include <span>
#include <utility>

#include "common/process/ExitStatus.h"
#include "common/process/StopSignals.h"
#include "smartsurf/run/ConfinedRuns.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/cli/StartCommand.h"
#include "smartsurf/run/replay/Replay.h"

namespace smartsurf::run {
namespace {

// Clears selections that do not apply to another experiment.
RenderOptions without_signals(RenderOptions render) {
  render.view.overlay.channel.clear();
  render.view.plots.clear();
  render.plotted_metrics.clear();
  return render;
}

}  // namespace

int run_session(RunOptions options) {
  const std::unique_ptr<ConfinedRuns> confined = ConfinedRuns::confine(std::span(&options, 1));
  const auto& stop = common::catch_stop_signals();
  script::Experiment experiment = Run::load(options);
  if (options.window) note_recent(options.experiment);
  std::unique_ptr<Display> display;
  while (true) {
    std::string recording;
    {
      Run run(options, stop, std::move(experiment), std::move(display));
      const int status = run.execute();
      recording = run.recording_to_open();
      std::optional<Run::Restart> next = run.take_restart();
      if (!next && recording.empty()) return status;
      if (next) {
        options = std::move(next->options);
        experiment = std::move(next->experiment);
        display = std::move(next->display);
      }
    }
    if (!recording.empty()) return replay_session(recording, 1.0, without_signals(options.render));
  }
}

int replay_session(const std::string& recording, double pace, const RenderOptions& render) {
  const auto& stop = common::catch_stop_signals();
  std::string next;
  {
    const record::Recording opened = record::Recording::open(recording);
    note_recent(recording);
    next = replay_in_window(opened, pace, render.view, stop);
  }
  if (next.empty()) return common::kDone;
  if (next.ends_with(".h5"))
    return replay_session(next, pace, next == recording ? render : without_signals(render));
  RunOptions window;
  window.render = without_signals(render);
  return run_session(options_for_opened(next, window));
}

}  // namespace smartsurf::run
