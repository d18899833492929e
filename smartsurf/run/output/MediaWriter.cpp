#include "smartsurf/run/output/MediaWriter.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "common/image/Png.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/view/model/TableBounds.h"
#include "smartsurf/view/output/OffscreenView.h"

namespace smartsurf::run {
namespace {

constexpr common::PixelSize kDefaultScreenshotSize{1600, 1000}, kDefaultVideoSize{1280, 720};
constexpr int kVideoFramesPerSecond = 30;
constexpr double kTimeTolerance = 1e-7;  // s
constexpr unsigned kMaxVideoThreads = 16;

// The video format subsamples colours by 2 × 2, so both edges must be even.
common::PixelSize video_size(const RenderOptions& render_options) {
  const common::PixelSize size = render_options.pixel_size.value_or(kDefaultVideoSize);
  if (size.width % 2 != 0 || size.height % 2 != 0)
    throw scene::InputError(
        fmt::format("--picture-size {}x{}: a video needs even numbers", size.width, size.height));
  return size;
}

}  // namespace

std::unique_ptr<common::VideoEncoder> start_video(const std::string& file, const RenderOptions& options) {
  if (file.empty()) return nullptr;
  const common::PixelSize size = video_size(options);
  return std::make_unique<common::VideoEncoder>(file, size.width, size.height, kVideoFramesPerSecond);
}

int video_threads(const RenderOptions& options) {
  if (options.view.detail == view::Detail::kFinal) return 1;
  return static_cast<int>(std::clamp(std::thread::hardware_concurrency(), 1U, kMaxVideoThreads));
}

MediaWriter::MediaWriter(std::vector<Screenshot> screenshots, std::unique_ptr<common::VideoEncoder> video,
                         const RenderOptions& render_options, const scene::SceneSpec& scene,
                         std::optional<int> threads_of_video)
    : scene_(scene),
      render_options_(render_options),
      overlay_(scene.surface),
      pending_screenshots_(std::move(screenshots)) {
  if (!pending_screenshots_.empty() || video)
    view::OffscreenView::require_available(render_options.view.detail.value_or(view::Detail::kStill));
  overlay_.settings = render_options.view.overlay;
  if (video)
    video_writer_ = std::make_unique<VideoWriter>(
        std::move(video), scene_, render_options.view.detail.value_or(view::Detail::kVideo),
        video_size(render_options), threads_of_video.value_or(video_threads(render_options)));
}

MediaWriter::~MediaWriter() = default;

void MediaWriter::write_due(const view::FrameInput& frame, std::optional<double> next_time_s) {
  if (!only_final_left()) overlay_.sample_trails(frame);
  // A picture at a frame's time shows that frame, in spite of rounding.
  const double until_s = next_time_s ? *next_time_s - kTimeTolerance : frame.snapshot.time_s + kTimeTolerance;
  if (video_writer_) write_video_frames(frame, until_s);
  if (pending_screenshots_.empty()) return;
  std::erase_if(pending_screenshots_, [&](const Screenshot& shot) {
    const bool due = shot.time_s && *shot.time_s < until_s;
    if (due) write_screenshot(frame, shot.file);
    return due;
  });
}

void MediaWriter::finish(const view::FrameInput& frame) {
  for (const Screenshot& screenshot : std::exchange(pending_screenshots_, {}))
    write_screenshot(frame, screenshot.file);
  if (!video_writer_) return;
  video_writer_->finish();
  video_writer_.reset();
}

view::DrawOptions MediaWriter::draw_options(const view::FrameInput& frame) {
  const view::ViewSettings& settings = render_options_.view;
  if (!settings.overlay.channel.empty()) require_channel("--cells", settings.overlay.channel, frame.channels);
  view::DrawOptions options;
  options.fill_mode = settings.fill_mode;
  options.stage = settings.stage;
  options.aperture = render_options_.aperture;
  options.samples = render_options_.samples;
  overlay_.apply(frame, nullptr, options);
  if (overlay_.colour_scale()) options.legend = &*overlay_.colour_scale();
  return options;
}

view::Camera MediaWriter::camera(const common::PixelSize& size, std::span<const Eigen::Vector3d> also) const {
  return view::Camera::from_view(scene_.surface, render_options_.view.camera,
                                 static_cast<double>(size.width) / size.height, also);
}

void MediaWriter::write_screenshot(const view::FrameInput& frame, const std::string& file) {
  if (!screenshot_view_)
    screenshot_view_ = std::make_unique<view::OffscreenView>(
        scene_, render_options_.view.detail.value_or(view::Detail::kStill));
  const common::PixelSize size = render_options_.pixel_size.value_or(kDefaultScreenshotSize);
  const auto objects = view::corners_of_objects_over(scene_.surface, frame.snapshot, frame.catalogue);
  common::write_png(file, screenshot_view_->render(frame.snapshot, frame.catalogue, camera(size, objects),
                                                   draw_options(frame), size.width, size.height));
}

// The frame rate refers to simulated time, so that the video plays in real time at any pace of the run.
void MediaWriter::write_video_frames(const view::FrameInput& frame, double until_s) {
  if (!video_start_s_) video_start_s_ = frame.snapshot.time_s;
  // An image is repeated until the next frame.
  const auto due = static_cast<long>(std::ceil((until_s - *video_start_s_) * kVideoFramesPerSecond));
  if (due <= video_frames_written_) return;
  video_writer_->add(frame, camera(video_size(render_options_)), draw_options(frame),
                     due - video_frames_written_);
  video_frames_written_ = due;
}

}  // namespace smartsurf::run
