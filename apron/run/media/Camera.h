// The source of `webcam.*` images: a camera, or a video in its place.
#pragma once

#include <atomic>
#include <memory>
#include <string>

#include "apron/vm/Plane.h"

namespace apron::run {

class Camera {
 public:
  virtual ~Camera() = default;

  // The newest picture, or the next one if there is none that was not read yet, fitted into the plane (see
  // fit()); grey, 0 to 255. Throws MediaError: kInterrupted when the flag is raised meanwhile.
  virtual void read(const vm::Plane& to, const std::atomic<bool>& stop) = 0;
};

// A video for Linux device such as /dev/video0, or a video that ends in .y4m, of which each read takes the
// next frame. Throws MediaError.
std::unique_ptr<Camera> open_camera(const std::string& path);

}  // namespace apron::run
