// A camera behind Linux's video capture interface: agrees on a format, streams through the driver's buffers.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apron/run/Camera.h"
#include "apron/run/CameraPicture.h"
#include "apron/run/CaptureDevice.h"

namespace apron::run {

// Asks for 640x480 and takes what it gets. Streams from its construction on; name is for messages.
class CaptureCamera final : public Camera {
 public:
  // Throws MediaError.
  CaptureCamera(std::string name, std::unique_ptr<CaptureDevice> device);
  ~CaptureCamera() override;
  CaptureCamera(const CaptureCamera&) = delete;
  CaptureCamera& operator=(const CaptureCamera&) = delete;

  // Gives up after five seconds without a picture, or a hundred broken ones.
  void read(const vm::Plane& to, const std::atomic<bool>& stop) override;

 private:
  void require_capture();
  void agree_on_format();
  FourCc offered_format();
  void take_buffers();
  void call(unsigned long request, void* argument, const char* doing);
  [[noreturn]] void failed(const char* doing, int error) const;
  void wait_for_buffer(const std::atomic<bool>& stop);
  // The pictures that wait, all given back, the newest whole one kept in frame_; false if there was none.
  bool take_newest();

  std::string name_;
  std::unique_ptr<CaptureDevice> device_;
  PictureFormat format_;
  std::vector<std::span<const std::uint8_t>> buffers_;
  GreyFrame frame_, spare_;
};

}  // namespace apron::run
