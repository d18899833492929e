// Writes the screenshots and the video of a run or a replay.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/run/options/RenderOptions.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/run/output/VideoWriter.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::run {

// Starts the encoder of a video. Throws scene::InputError if it cannot be written.
std::unique_ptr<common::VideoEncoder> start_video(const std::string& file, const RenderOptions&);

// On how many threads the frames of a video are drawn: one a core; path tracing itself takes all.
int video_threads(const RenderOptions&);

class MediaWriter {
 public:
  // video: null for none. Throws scene::InputError if pictures cannot be drawn.
  MediaWriter(std::vector<Screenshot>, std::unique_ptr<common::VideoEncoder> video, const RenderOptions&,
              const scene::SceneSpec&, std::optional<int> threads_of_video = {});
  ~MediaWriter();

  // Call for every frame, in order. Writes what is due from the frame's time until the next frame's, or at
  // the frame's time if there is no next one. Throws scene::InputError if the overlay channel does not exist.
  void write_due(const view::FrameInput&, std::optional<double> next_time_s);
  // Writes the remaining screenshots from the last frame and closes the video.
  void finish(const view::FrameInput&);
  // True if there is no video and no screenshot is pending.
  bool only_final_left() const { return pending_screenshots_.empty() && !video_writer_; }

 private:
  // The spans are valid until the next call.
  view::DrawOptions draw_options(const view::FrameInput&);
  // also: points that the picture shows besides the table, where the user gives no pose.
  view::Camera camera(const common::PixelSize&, std::span<const Eigen::Vector3d> also = {}) const;
  void write_screenshot(const view::FrameInput&, const std::string& file);
  void write_video_frames(const view::FrameInput&, double until_s);

  scene::SceneSpec scene_;
  RenderOptions render_options_;
  view::Overlay overlay_;
  std::vector<Screenshot> pending_screenshots_;
  std::unique_ptr<view::OffscreenView> screenshot_view_;
  std::unique_ptr<VideoWriter> video_writer_;
  std::optional<double> video_start_s_;  // the first frame's time
  long video_frames_written_ = 0;
};

}  // namespace smartsurf::run
