// Pictures and videos of the window without a display, by the simulated clock.
#include <filesystem>
#include <memory>

#include "apron/run/StopSignal.h"
#include "apron/run/WindowRun.h"
#include "apron/ui/Film.h"
#include "apron/ui/Offscreen.h"

namespace apron::run {
namespace {

constexpr int kWidth = 1280, kHeight = 800, kFramesPerSecond = 30;

class Photographer {
 public:
  explicit Photographer(Drawn& drawn)
      : drawn_(drawn),
        width_(size(drawn.run.options.geometry.width, kWidth)),
        height_(size(drawn.run.options.geometry.height, kHeight)),
        offscreen_(width_, height_),
        left_(drawn.run.options.screenshots) {
    for (const Screenshot& one : left_) {
      const std::filesystem::path folder = std::filesystem::path(one.file).parent_path();
      if (!folder.empty() && !std::filesystem::is_directory(folder))
        throw ui::PictureError("--screenshot: there is no folder " + folder.string());
    }
    const std::string& video = drawn.run.options.video;
    if (!video.empty()) film_ = std::make_unique<ui::Film>(video, width_, height_, kFramesPerSecond);
  }

  // After a tick: what is due.
  void take() {
    const std::uint64_t ticks = drawn_.session.ticks();
    for (auto one = left_.begin(); one != left_.end();) {
      if (!one->tick || *one->tick > ticks) {
        ++one;
        continue;
      }
      ui::write_png(one->file, still());
      one = left_.erase(one);
    }
    film();
  }
  void take_last() {
    for (const Screenshot& one : left_) ui::write_png(one.file, still());
    if (film_ && frames_ == 0) film_->add(still());
    if (film_) film_->finish();
  }

 private:
  // A film's pictures have even edges.
  static int size(int wanted, int otherwise) { return (wanted > 0 ? wanted : otherwise) / 2 * 2; }

  void look() {
    debugger::Look look;
    drawn_.session.look(drawn_.bench.request(), look);
    drawn_.bench.update(std::move(look));
  }
  ui::Image still() {
    // The first pass finds out which registers are in sight.
    look();
    offscreen_.draw(drawn_.bench);
    look();
    return offscreen_.settle(drawn_.bench);
  }
  void film() {
    const double time_s = drawn_.host.time_s().value_or(0.0);
    if (!film_ || time_s < begin_s_ + static_cast<double>(frames_) / kFramesPerSecond) return;
    if (frames_ == 0) begin_s_ = time_s;
    const ui::Image image = frames_ == 0 ? still() : (look(), offscreen_.draw(drawn_.bench));
    // Control periods longer than a picture's time fill several.
    do film_->add(image);
    while (time_s >= begin_s_ + static_cast<double>(++frames_) / kFramesPerSecond);
  }

  Drawn& drawn_;
  int width_, height_;
  ui::Offscreen offscreen_;
  std::vector<Screenshot> left_;
  std::unique_ptr<ui::Film> film_;
  long frames_ = 0;
  double begin_s_ = 0.0;
};

}  // namespace

void run_for_pictures(Drawn& drawn) {
  drawn.bench.clocked = false;
  Photographer photographer(drawn);
  debugger::Session& session = drawn.session;
  session.run();
  while (session.active() && !stop_flag()) {
    const std::uint64_t before = session.ticks();
    session.advance();
    if (session.ticks() != before) photographer.take();
  }
  photographer.take_last();
}

}  // namespace apron::run
