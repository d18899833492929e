#include "smartsurf/run/replay/Replay.h"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <optional>
#include <thread>

#include "common/process/WindowLibrary.h"
#include "shm-protocol/hardware/bridge/ControlSocket.h"
#include "smartsurf/run/Pacer.h"
#include "smartsurf/run/Run.h"
#include "smartsurf/run/display/PlotFile.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/replay/Player.h"
#include "smartsurf/run/replay/RecordedFrames.h"
#include "smartsurf/run/replay/Verify.h"
#include "smartsurf/scene/ChannelKind.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "smartsurf/view/window/Window.h"

namespace smartsurf::run {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

void require_times(const record::Recording& recording, const std::vector<Screenshot>& screenshots) {
  const double begin_s = recording.times().front(), end_s = recording.times().back();
  for (const auto& [file, time_s] : screenshots)
    if (time_s && (*time_s < begin_s - 1e-9 || *time_s > end_s + 1e-9))
      throw scene::InputError(fmt::format("--screenshot {}@{}: the recording {}", file, *time_s,
                                          *time_s > end_s ? fmt::format("ends at {:.2f} s", end_s)
                                                          : fmt::format("begins at {:.4f} s", begin_s)));
}

std::optional<double> next_time_s(const record::Recording& recording, std::size_t frame) {
  if (frame + 1 == recording.frames()) return std::nullopt;
  return recording.times()[frame + 1];
}

void require_cell_channel(const record::Recording& recording, const RecordedFrames& frames,
                          const std::string& channel) {
  if (channel.empty()) return;
  std::string hint;
  const scene::ChannelReference reference = scene::parse_channel(channel);
  if (reference.kind == scene::ChannelKind::kRegister)
    hint = fmt::format("the recording has no such register, which run --record-registers {} keeps",
                       reference.name);
  else if (recording.channel_names(record::ChannelGroup::kSensors).empty())
    hint = "the recording has no sensors, which record { sensors = true } keeps";
  require_channel("--cells", channel, frames.channels(), hint);
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
      record::Recording::open(file).require_poses();
    else
      Run::load(options_for_opened(file, {}));
    return "";
  } catch (const scene::InputError& error) {
    return error.what();
  }
}

}  // namespace

bool needs_rerun(const record::Recording& recording, const RenderOptions& options) {
  const std::string& channel = options.view.overlay.channel;
  return !channel.empty() && scene::parse_channel(channel).kind == scene::ChannelKind::kSensor &&
         recording.channel_names(record::ChannelGroup::kSensors).empty();
}

bool rerun_to_media(const record::Recording& recording, const std::vector<Screenshot>& screenshots,
                    std::unique_ptr<common::VideoEncoder> video, const RenderOptions& render_options,
                    const std::filesystem::path& output_folder, const std::atomic<bool>& stop) {
  recording.require_poses();
  require_times(recording, screenshots);
  MediaWriter media(screenshots, std::move(video), render_options, recording.spec());
  Progress progress;
  progress.print_message(recording.path().string() + ": has no sensors: running it again");
  ViewChannels channels;
  std::size_t frame = 0;
  const double until_s = recording.times().back();
  const VerificationResult result = verify(
      recording, 1, {}, output_folder, stop, [&](double time_s) { progress.update(time_s, until_s); },
      [&](const simulation::Simulation& simulation) {
        const view::FrameInput input{simulation.snapshot(), simulation.catalogue(),
                                     channels.update(simulation)};
        if (frame == 0) require_channel("--cells", render_options.view.overlay.channel, input.channels);
        media.write_due(input, next_time_s(recording, frame));
        if (++frame == recording.frames()) media.finish(input);
        return !media.only_final_left();
      });
  if (result.first_different_tick)
    throw scene::InputError(fmt::format("{}: cannot be run again: it differs at tick {}: {}",
                                        recording.path().string(), *result.first_different_tick,
                                        result.difference));
  progress.finish(until_s);
  return !result.interrupted;
}

bool replay_to_media(const record::Recording& recording, const std::vector<Screenshot>& screenshots,
                     std::unique_ptr<common::VideoEncoder> video, const RenderOptions& render_options,
                     const std::atomic<bool>& stop) {
  recording.require_poses();
  require_times(recording, screenshots);
  RecordedFrames frames(recording);
  require_cell_channel(recording, frames, render_options.view.overlay.channel);
  MediaWriter media(screenshots, std::move(video), render_options, recording.spec());
  Progress progress;
  for (std::size_t frame = 0; frame < recording.frames() && !media.only_final_left(); ++frame) {
    if (stop) return false;
    media.write_due(frames.frame_input(frame), next_time_s(recording, frame));
    progress.update(recording.times()[frame], recording.times().back());
  }
  media.finish(frames.frame_input(recording.frames() - 1));
  progress.finish(recording.times().back());
  return true;
}

std::string replay_in_window(const record::Recording& recording, double pace,
                             const view::ViewSettings& settings, const std::atomic<bool>& stop) {
  recording.require_poses();
  view::OffscreenView::require_available();
  RecordedFrames frames(recording);
  require_cell_channel(recording, frames, settings.overlay.channel);
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
    if (commands.stop_bridges) window.show_message(hardware::stop_all_bridges());
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
