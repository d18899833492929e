// A Video4Linux2 camera: negotiates a format and streams through the driver's buffers.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apron/run/media/Camera.h"
#include "apron/run/media/CaptureFormat.h"
#include "apron/run/media/V4l2Device.h"

namespace apron::run {

// Requests 640x480 and accepts the size that the driver chooses. Streams from construction to destruction.
class V4l2Camera final : public Camera {
 public:
  // name is for messages. Throws MediaError.
  V4l2Camera(std::string name, std::unique_ptr<V4l2Device> device);
  ~V4l2Camera() override;
  V4l2Camera(const V4l2Camera&) = delete;
  V4l2Camera& operator=(const V4l2Camera&) = delete;

  // Throws after 100 polls without a valid frame, which takes at most five seconds.
  void read(const vm::Plane& to, const std::atomic<bool>& stop) override;

 private:
  void require_capture_capability();
  void negotiate_format();
  FourCc choose_format();
  void map_buffers();
  void control_or_throw(unsigned long request, void* argument, const char* action);
  [[noreturn]] void throw_error(const char* action, int error) const;
  void wait_for_buffer(const std::atomic<bool>& stop);
  // Dequeues and requeues all filled buffers. Keeps the latest valid frame in frame_; false if there is none.
  bool dequeue_newest();

  std::string name_;
  std::unique_ptr<V4l2Device> device_;
  CaptureFormat format_;
  std::vector<std::span<const std::uint8_t>> buffers_;
  GreyFrame frame_, back_frame_;
};

}  // namespace apron::run
