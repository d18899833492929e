// Renders screenshots and videos without a display, timed by the simulated clock.
#include <fmt/format.h>

#include <filesystem>
#include <memory>

#include "apron/run/ui/UiRunContext.h"
#include "apron/ui/window/OffscreenRenderer.h"
#include "common/error/UserError.h"
#include "common/image/Png.h"
#include "common/process/StopSignals.h"
#include "common/text/Printable.h"
#include "common/video/VideoEncoder.h"

namespace apron::run {
namespace {

constexpr int kViewWidth = 1280, kViewHeight = 800, kFramesPerSecond = 30;

class OffscreenRecorder {
 public:
  explicit OffscreenRecorder(UiRunContext& context)
      : context_(context),
        width_(size_or(kViewWidth, context.run.options.geometry.width)),
        height_(size_or(kViewHeight, context.run.options.geometry.height)),
        offscreen_(width_, height_),
        pending_(context.run.options.screenshots) {
    for (const Screenshot& screenshot : pending_) {
      const std::filesystem::path folder = std::filesystem::path(screenshot.file).parent_path();
      if (!folder.empty() && !std::filesystem::is_directory(folder))
        throw common::UserError("--screenshot: there is no folder " + folder.string());
    }
    const std::string& video = context.run.options.video;
    if (!video.empty())
      encoder_ = std::make_unique<common::VideoEncoder>(video, width_, height_, kFramesPerSecond);
  }

  // Captures the screenshots and video frames that are due; call after each tick.
  void capture_due() {
    const std::uint64_t ticks = context_.session.ticks();
    for (auto one = pending_.begin(); one != pending_.end();) {
      if (!one->tick || *one->tick > ticks) {
        ++one;
        continue;
      }
      common::write_png(one->file, render_still());
      one = pending_.erase(one);
    }
    encode_due_frames();
  }
  void capture_final() {
    for (const Screenshot& screenshot : pending_) {
      common::write_png(screenshot.file, render_still());
      if (screenshot.tick)
        common::print_error_line("apron",
                                 fmt::format("{} shows the end at tick {}: the run did not reach tick {}",
                                             screenshot.file, context_.session.ticks(), *screenshot.tick));
    }
    if (encoder_ && frames_ == 0) encoder_->add(render_still());
    if (encoder_) encoder_->finish();
  }

 private:
  static int size_or(int default_size, int requested) { return requested > 0 ? requested : default_size; }

  void update_model() {
    debugger::DebugSnapshot snapshot;
    context_.session.capture_snapshot(context_.model.snapshot_request(), snapshot);
    context_.model.update(std::move(snapshot));
  }
  common::Image render_still() {
    // The first pass determines which thumbnails are visible, and the second snapshot includes them.
    update_model();
    offscreen_.render(context_.model);
    update_model();
    return offscreen_.render_settled(context_.model);
  }
  void encode_due_frames() {
    const double time_s = context_.host.time_s().value_or(0.0);
    if (!encoder_ || time_s < start_s_ + static_cast<double>(frames_) / kFramesPerSecond) return;
    if (frames_ == 0) start_s_ = time_s;
    const common::Image image =
        frames_ == 0 ? render_still() : (update_model(), offscreen_.render(context_.model));
    // A control period longer than a frame is repeated for several frames.
    do encoder_->add(image);
    while (time_s >= start_s_ + static_cast<double>(++frames_) / kFramesPerSecond);
  }

  UiRunContext& context_;
  int width_, height_;
  ui::OffscreenRenderer offscreen_;
  std::vector<Screenshot> pending_;
  std::unique_ptr<common::VideoEncoder> encoder_;
  long frames_ = 0;
  double start_s_ = 0.0;
};

}  // namespace

void run_offscreen(UiRunContext& context) {
  context.model.speed_shown = false;
  OffscreenRecorder recorder(context);
  debugger::DebugSession& session = context.session;
  session.run();
  while (session.active() && !common::stop_flag()) {
    const std::uint64_t previous_ticks = session.ticks();
    session.advance();
    if (session.ticks() != previous_ticks) recorder.capture_due();
  }
  // A program that was refused, as one that needs a surface and has none, leaves no picture.
  if (session.active() || session.status() != vm::Status::kRefused) recorder.capture_final();
}

}  // namespace apron::run
