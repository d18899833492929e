#include "smartsurf/run/replay/Replay.h"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <thread>

#include "common/process/WindowLibrary.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/display/PlotFile.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/replay/Player.h"
#include "smartsurf/run/replay/RecordedFrames.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

void require_poses(const record::Recording& recording) {
  if (recording.frames() == 0 || !(recording.has_objects() || recording.has_heights()))
    throw scene::InputError(recording.path().string() + ": holds nothing to show");
}

view::Status make_view_status(const record::Recording& recording, const RecordedFrames& frames,
                              const Player& player, double actual_pace) {
  view::Status status;
  status.actual_pace = actual_pace;
  status.mode = "recording";
  status.paused = player.paused();
  status.requested_pace = player.pace();
  status.can_reset = true;
  status.timeline = view::Timeline{recording.frames(),       player.frame(), recording.times().front(),
                                   recording.times().back(), true,           frames.marks()};
  if (!recording.has_heights())
    status.notice = "no pin heights were recorded";
  else if (const auto tick = recording.first_interaction_tick())
    status.notice = fmt::format("user intervened after tick {}", *tick);
  return status;
}

// "" if the file can be opened.
std::string reason_not_to_open(const std::string& file) {
  try {
    if (file.ends_with(".h5"))
      require_poses(record::Recording::open(file));
    else
      Run::load(options_for_opened(file, {}));
    return "";
  } catch (const scene::InputError& error) {
    return error.what();
  }
}

}  // namespace

bool replay_to_media(const record::Recording& recording, const std::vector<Screenshot>& screenshots,
                     std::unique_ptr<common::VideoEncoder> video, const RenderOptions& render_options,
                     const std::atomic<bool>& stop) {
  require_poses(recording);
  for (const Screenshot& screenshot : screenshots)
    if (screenshot.time_s && *screenshot.time_s > recording.times().back() + 1e-9)
      throw scene::InputError(fmt::format("--screenshot {}@{}: the recording ends at {} s", screenshot.file,
                                          *screenshot.time_s, recording.times().back()));
  MediaWriter media(screenshots, std::move(video), render_options, recording.spec());
  Progress progress;
  RecordedFrames frames(recording);
  for (std::size_t frame = 0; frame < recording.frames() && !media.only_final_left(); ++frame) {
    if (stop) return false;
    media.write_due(frames.frame_input(frame));
    progress.update(recording.times()[frame], recording.times().back());
  }
  media.finish(frames.frame_input(recording.frames() - 1));
  progress.finish(recording.times().back());
  return true;
}

std::string replay_in_window(const record::Recording& recording, double pace,
                             const view::ViewSettings& settings, const std::atomic<bool>& stop) {
  require_poses(recording);
  view::OffscreenView::require_available();
  RecordedFrames frames(recording);
  if (!settings.overlay.channel.empty())
    require_channel("--cells", settings.overlay.channel, frames.channels());
  for (const view::Signal& signal : settings.plots)
    if (signal.kind == view::Signal::Kind::kMetric)
      require_metric("--plot", signal.quantity, recording.metric_names());
    else
      require_signal("--plot", signal, recording.spec().surface, frames.channels());
  common::require_window_library();
  if (!view::Window::display_available())
    throw scene::InputError(
        "--window: there is no display here; use --video or --screenshot, or set DISPLAY");
  view::Window window(recording.spec(), "smartsurf: " + recording.path().filename().string());
  window.apply(settings);
  Player player(recording.times(), pace);
  Pacer speed(std::nullopt);
  auto last_time = Clock::now();
  while (!stop) {
    const view::Commands commands = window.render_frame(
        frames.frame_input(player.frame()),
        make_view_status(recording, frames, player, speed.update_real_time_factor(player.position_s())));
    if (commands.quit || commands.display_lost) return "";
    if (commands.reset) return recording.path().string();
    if (!commands.open_file.empty()) {
      if (const std::string refusal = reason_not_to_open(commands.open_file); refusal.empty())
        return commands.open_file;
      else
        window.show_message(refusal);
    }
    if (commands.plot_export)
      window.show_message(write_plot_file(*commands.plot_export, recording.path().string()));
    player.apply(commands);
    if (player.paused() || commands.seek || commands.seek_time_s) speed = Pacer(std::nullopt);
    const auto now = Clock::now();
    player.advance(std::chrono::duration<double>(now - last_time).count());
    last_time = now;
    std::this_thread::sleep_for(5ms);
  }
  return "";
}

}  // namespace smartsurf::run
