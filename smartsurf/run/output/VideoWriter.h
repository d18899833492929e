// Draws the frames of a video on several threads and hands them to the encoder in order. The bytes do not
// depend on the number of threads.
#pragma once

#include <condition_variable>
#include <deque>
#include <future>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "common/image/Image.h"
#include "common/image/PixelSize.h"
#include "common/video/VideoEncoder.h"
#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/DrawOptions.h"
#include "smartsurf/view/model/FrameInput.h"
#include "smartsurf/view/output/OffscreenView.h"

namespace smartsurf::run {

class VideoWriter {
 public:
  // scene must outlive this. threads: at least 1.
  VideoWriter(std::unique_ptr<common::VideoEncoder> encoder, const scene::SceneSpec& scene,
              view::Detail detail, common::PixelSize size, int threads);
  // Without finish(): discards the video.
  ~VideoWriter();
  VideoWriter(const VideoWriter&) = delete;
  VideoWriter& operator=(const VideoWriter&) = delete;

  // A frame that is repeated `count` times. Copies what is borrowed. Waits while many frames are not drawn
  // yet. add() and finish() throw what drawing or encoding throws.
  void add(const view::FrameInput& frame, const view::Camera& camera, const view::DrawOptions& options,
           long count);
  void finish();

 private:
  struct Frame;
  struct Drawn {
    std::future<common::Image> image;
    long count;
  };
  void draw_frames();
  void encode_first();

  std::unique_ptr<common::VideoEncoder> encoder_;
  const scene::SceneSpec& scene_;
  view::Detail detail_;
  common::PixelSize size_;
  std::shared_ptr<const std::vector<scene::ObjectSpec>> catalogue_;  // that frames share
  std::deque<Drawn> drawn_;                                          // in order, most of them not yet
  std::size_t most_waiting_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::unique_ptr<Frame>> waiting_;  // guarded by mutex_
  bool ended_ = false;                          // guarded by mutex_
  std::vector<std::thread> threads_;
};

}  // namespace smartsurf::run
