// Writes the screenshots and the video of a run or a replay.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/run/options/RenderOptions.h"
#include "smartsurf/run/options/RunOptions.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {
class OffscreenView;
}  // namespace smartsurf::view

namespace smartsurf::run {

class MediaWriter {
 public:
  // Opens the video if video_file is not empty. Throws scene::InputError if it cannot be written.
  MediaWriter(std::vector<Screenshot>, const std::string& video_file, const RenderOptions&,
              const scene::SceneSpec&);
  ~MediaWriter();

  // Call for every frame, in order. Writes what is due at the frame's time. Throws scene::InputError if the
  // overlay channel does not exist.
  void write_due(const view::FrameInput&);
  // Writes the remaining screenshots from the last frame and closes the video.
  void finish(const view::FrameInput&);
  // True if there is no video and no screenshot is pending.
  bool only_final_left() const { return pending_screenshots_.empty() && !video_writer_; }

 private:
  common::Image render(view::OffscreenView&, const view::FrameInput&, const common::PixelSize&);
  void write_screenshot(const view::FrameInput&, const std::string& file);
  void write_video_frames(const view::FrameInput&);

  scene::SceneSpec scene_;
  RenderOptions render_options_;
  view::Overlay overlay_;
  std::vector<Screenshot> pending_screenshots_;
  std::unique_ptr<view::OffscreenView> screenshot_view_, video_view_;
  std::unique_ptr<common::VideoEncoder> video_writer_;
  long video_frames_written_ = 0;
};

}  // namespace smartsurf::run
