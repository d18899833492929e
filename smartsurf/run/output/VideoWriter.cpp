#include "smartsurf/run/output/VideoWriter.h"

#include <chrono>
#include <exception>
#include <optional>
#include <utility>

namespace smartsurf::run {

// The input of a picture, with its own copies.
struct VideoWriter::Frame {
  Frame(const view::FrameInput& input, std::shared_ptr<const std::vector<scene::ObjectSpec>> objects,
        const view::Camera& from, const view::DrawOptions& how)
      : snapshot(input.snapshot),
        catalogue(std::move(objects)),
        camera(from),
        options(how),
        cell_values(how.cell_values.begin(), how.cell_values.end()),
        lines(how.lines.begin(), how.lines.end()) {
    options.cell_values = cell_values;
    options.lines = lines;
    if (!how.legend) return;
    legend = *how.legend;
    options.legend = &*legend;
  }

  scene::Snapshot snapshot;
  std::shared_ptr<const std::vector<scene::ObjectSpec>> catalogue;
  view::Camera camera;
  view::DrawOptions options;
  std::vector<float> cell_values;
  std::vector<view::Line> lines;
  std::optional<view::ColourScale> legend;
  std::promise<common::Image> image;
};

VideoWriter::VideoWriter(std::unique_ptr<common::VideoEncoder> encoder, const scene::SceneSpec& scene,
                         view::Detail detail, common::PixelSize size, int threads)
    : encoder_(std::move(encoder)), scene_(scene), detail_(detail), size_(size), most_waiting_(2 * threads) {
  for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { draw_frames(); });
}

VideoWriter::~VideoWriter() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    waiting_.clear();
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void VideoWriter::draw_frames() {
  std::unique_ptr<view::OffscreenView> view;  // belongs to this thread
  while (true) {
    std::unique_ptr<Frame> frame;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return ended_ || !waiting_.empty(); });
      if (waiting_.empty()) return;
      frame = std::move(waiting_.front());
      waiting_.pop_front();
    }
    try {
      if (!view) view = std::make_unique<view::OffscreenView>(scene_, detail_);
      frame->image.set_value(view->render(frame->snapshot, *frame->catalogue, frame->camera, frame->options,
                                          size_.width, size_.height));
    } catch (...) {
      frame->image.set_exception(std::current_exception());
    }
  }
}

void VideoWriter::encode_first() {
  Drawn first = std::move(drawn_.front());
  drawn_.pop_front();
  const common::Image image = first.image.get();
  for (; first.count > 0; --first.count) encoder_->add(image);
}

void VideoWriter::add(const view::FrameInput& frame, const view::Camera& camera,
                      const view::DrawOptions& options, long count) {
  // A catalogue only grows.
  if (!catalogue_ || catalogue_->size() != frame.catalogue.size())
    catalogue_ = std::make_shared<const std::vector<scene::ObjectSpec>>(frame.catalogue);
  auto own = std::make_unique<Frame>(frame, catalogue_, camera, options);
  drawn_.push_back({own->image.get_future(), count});
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(own));
  }
  changed_.notify_one();
  using namespace std::chrono_literals;
  while (!drawn_.empty() &&
         (drawn_.size() > most_waiting_ || drawn_.front().image.wait_for(0s) == std::future_status::ready))
    encode_first();
}

void VideoWriter::finish() {
  while (!drawn_.empty()) encode_first();
  encoder_->finish();
}

}  // namespace smartsurf::run
