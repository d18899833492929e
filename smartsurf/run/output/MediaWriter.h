// Writes the screenshots and the video of a run or a replay. Takes every frame in order.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/image/Image.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/run/cli/RenderOptions.h"
#include "smartsurf/run/cli/RunOptions.h"
#include "smartsurf/view/model/FrameInput.h"

namespace smartsurf::view {
class OffscreenView;
}  // namespace smartsurf::view

namespace smartsurf::run {

class MediaWriter {
 public:
  // Begins the video if there is one. Throws scene::InputError when it cannot be made.
  MediaWriter(std::vector<Screenshot>, const std::string& video_file, const RenderOptions&,
              const scene::SceneSpec&);
  ~MediaWriter();

  // Writes what is due at the moment's time. Throws scene::InputError when the channel that is to colour the
  // cells does not exist.
  void write_due(const view::FrameInput&);
  // At the end: the screenshots that are left, and the video's last words.
  void finish(const view::FrameInput&);
  // Nothing more will be due, however long it goes on, but for the last pictures.
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
