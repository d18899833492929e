#include "smartsurf/run/replay/Replay.h"

#include <fmt/format.h>

#include <chrono>
#include <optional>
#include <span>
#include <thread>

#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/run/output/MediaWriter.h"
#include "smartsurf/run/output/Progress.h"
#include "smartsurf/run/replay/Player.h"
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

// Loads the frames of a recording for the view, one at a time.
class RecordedFrameLoader {
 public:
  explicit RecordedFrameLoader(const record::Recording& recording) : recording_(recording) {
    const scene::SurfaceSpec& surface = recording.spec().surface;
    channels_ = {height_channel(surface)};
    add_channels("sensors", sensor_channel);
    add_channels("actuators", actuator_channel);
  }
  // Valid until the next call.
  view::FrameInput frame_input(std::size_t frame) {
    if (loaded_frame_ != frame) load(frame);
    return {snapshot_, recording_.spec().objects, channels_};
  }

 private:
  void add_channels(const char* group,
                    view::Channel (*describe)(const scene::SurfaceSpec&, const std::string&)) {
    for (const std::string& name : recording_.channel_names(group)) {
      channels_.push_back(describe(recording_.spec().surface, name));
      sources_.push_back({group, name});
    }
  }
  // A recording without heights is shown with all pins down; channels of several components are not shown.
  void load(std::size_t frame) {
    loaded_frame_ = frame;
    snapshot_ = recording_.read_snapshot(frame);
    const scene::SurfaceSpec& surface = recording_.spec().surface;
    const auto cells = static_cast<std::size_t>(surface.cell_count());
    if (snapshot_.height.empty()) snapshot_.height.assign(cells, static_cast<float>(surface.pin.min_height));
    channels_[0].values = snapshot_.height;
    values_.resize(sources_.size());
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      values_[i] = recording_.read_channel(sources_[i].group, sources_[i].name, frame);
      channels_[1 + i].values = values_[i].size() == cells ? values_[i] : std::span<const float>{};
    }
  }

  struct Source {
    std::string group, name;
  };
  const record::Recording& recording_;
  std::optional<std::size_t> loaded_frame_;
  scene::Snapshot snapshot_;
  std::vector<view::Channel> channels_;
  std::vector<Source> sources_;  // of channels_[1 …]
  std::vector<std::vector<float>> values_;
};

view::Status make_view_status(const record::Recording& recording, const Player& player) {
  view::Status status;
  status.mode = "recording";
  status.paused = player.paused();
  status.requested_pace = player.pace();
  status.timeline = view::Timeline{recording.frames(), player.frame(), recording.times().front(),
                                   recording.times().back(), true};
  if (!recording.has_heights())
    status.notice = "no pin heights were recorded";
  else if (const auto tick = recording.first_interaction_tick())
    status.notice = fmt::format("user intervened after tick {}", *tick);
  return status;
}

}  // namespace

bool replay_to_media(const record::Recording& recording, const std::vector<Screenshot>& screenshots,
                     const std::string& video_file, const RenderOptions& render_options,
                     const std::atomic<bool>& stop) {
  require_poses(recording);
  for (const Screenshot& screenshot : screenshots)
    if (screenshot.time_s && *screenshot.time_s > recording.times().back() + 1e-9)
      throw scene::InputError(fmt::format("--screenshot {}@{}: the recording ends at {} s", screenshot.file,
                                          *screenshot.time_s, recording.times().back()));
  MediaWriter media(screenshots, video_file, render_options, recording.spec());
  Progress progress;
  RecordedFrameLoader loader(recording);
  for (std::size_t frame = 0; frame < recording.frames() && !media.only_final_left(); ++frame) {
    if (stop) return false;
    media.write_due(loader.frame_input(frame));
    progress.update(recording.times()[frame], recording.times().back());
  }
  media.finish(loader.frame_input(recording.frames() - 1));
  progress.finish(recording.times().back());
  return true;
}

void replay_in_window(const record::Recording& recording, double pace, const std::atomic<bool>& stop) {
  require_poses(recording);
  view::OffscreenView::require_available();
  if (!view::Window::display_available())
    throw scene::InputError(
        "--window: there is no display here; use --video or --screenshot, or set DISPLAY");
  view::Window window(recording.spec(), "smartsurf: " + recording.path().filename().string());
  Player player(recording.times(), pace);
  RecordedFrameLoader loader(recording);
  auto last_time = Clock::now();
  while (!stop) {
    const view::Commands commands =
        window.render_frame(loader.frame_input(player.frame()), make_view_status(recording, player));
    if (commands.quit || commands.display_lost) return;
    player.apply(commands);
    const auto now = Clock::now();
    player.advance(std::chrono::duration<double>(now - last_time).count());
    last_time = now;
    std::this_thread::sleep_for(5ms);
  }
}

}  // namespace smartsurf::run
