// The source of `webcam.*` images: a camera, a video file or pictures.
#pragma once

#include <atomic>

#include "apron/vm/Plane.h"

namespace apron::run {

class Camera {
 public:
  virtual ~Camera() = default;

  // Reads the latest unread frame, waiting for one if necessary, and resamples it to the plane (see
  // resample_center_crop()); grey, 0 to 255. Throws MediaError, with kInterrupted if stop is raised.
  virtual void read(const vm::Plane& to, const std::atomic<bool>& stop) = 0;
};

}  // namespace apron::run
