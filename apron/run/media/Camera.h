// The source of `webcam.*` images: a camera, a video file or pictures.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

class Camera {
 public:
  virtual ~Camera() = default;

  // Reads the latest unread frame, waiting for one if necessary, and resamples it to the plane (see
  // resample_center_crop()); grey, 0 to 255. Throws MediaError, with kInterrupted if stop is raised.
  virtual void read(const vm::Plane& to, const std::atomic<bool>& stop) = 0;
};

// Opens a Video4Linux device such as /dev/video0; a .y4m file; a picture; or a folder, whose pictures follow
// each other by name. Of files, each read() takes the next frame, and after the last the first. Throws
// MediaError.
std::unique_ptr<Camera> open_camera(const std::string& path);

}  // namespace apron::run
