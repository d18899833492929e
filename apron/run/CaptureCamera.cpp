#include "apron/run/CaptureCamera.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "apron/run/MediaError.h"
#include "apron/run/MediaFile.h"
#include "apron/run/VideoClip.h"

namespace apron::run {
namespace {

constexpr std::uint32_t kWidth = 640, kHeight = 480, kBuffers = 4;
constexpr int kLookEvery_ms = 50, kLooks = 100;  // at the stop flag; until the camera is given up
constexpr std::uint32_t kMostFormats = 64;       // that a driver is asked for

v4l2_buffer buffer_of_driver(std::uint32_t index = 0) {
  v4l2_buffer buffer{};
  buffer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  buffer.memory = V4L2_MEMORY_MMAP;
  buffer.index = index;
  return buffer;
}

// A video in a camera's place.
class ClipCamera final : public Camera {
 public:
  explicit ClipCamera(const std::string& path) : clip_(path) {}
  void read(const vm::Plane& to, const std::atomic<bool>&) override { fit(clip_.next(), to); }

 private:
  VideoClip clip_;
};

}  // namespace

std::unique_ptr<Camera> open_camera(const std::string& path) {
  if (extension(path) == "y4m") return std::make_unique<ClipCamera>(path);
  return std::make_unique<CaptureCamera>(path, open_capture_device(path));
}

CaptureCamera::CaptureCamera(std::string name, std::unique_ptr<CaptureDevice> device)
    : name_(std::move(name)), device_(std::move(device)) {
  require_capture();
  agree_on_format();
  take_buffers();
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  call(VIDIOC_STREAMON, &type, "start");
}

CaptureCamera::~CaptureCamera() {
  int type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  device_->control(VIDIOC_STREAMOFF, &type);
}

void CaptureCamera::failed(const char* doing, int error) const {
  const vm::HostStatus status = error == EBUSY ? vm::HostStatus::kRefused : vm::HostStatus::kFailed;
  throw MediaError(status, std::string("cannot ") + doing + " the camera '" + name_ +
                               "': " + (error == EBUSY ? "another program uses it" : std::strerror(error)));
}

void CaptureCamera::call(unsigned long request, void* argument, const char* doing) {
  if (const int error = device_->control(request, argument); error != 0) failed(doing, error);
}

void CaptureCamera::require_capture() {
  v4l2_capability can{};
  if (device_->control(VIDIOC_QUERYCAP, &can) != 0) refuse(name_, "is no camera");
  // A card may have several devices; only device_caps speaks of this one.
  const std::uint32_t caps =
      (can.capabilities & V4L2_CAP_DEVICE_CAPS) != 0 ? can.device_caps : can.capabilities;
  if ((caps & V4L2_CAP_VIDEO_CAPTURE) == 0) refuse(name_, "is a video device, but takes no pictures");
  if ((caps & V4L2_CAP_STREAMING) == 0)
    refuse(name_, "is a camera that does not stream, which is not supported");
}

// The most wanted one that the camera offers.
FourCc CaptureCamera::offered_format() {
  const std::span<const FourCc> wanted = readable_formats();
  std::size_t best = wanted.size();
  std::string offers;
  for (std::uint32_t i = 0; i < kMostFormats; ++i) {
    v4l2_fmtdesc offer{};
    offer.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
    offer.index = i;
    if (device_->control(VIDIOC_ENUM_FMT, &offer) != 0) break;
    const auto found = std::find(wanted.begin(), wanted.end(), offer.pixelformat);
    best = std::min(best, static_cast<std::size_t>(found - wanted.begin()));
    offers += (offers.empty() ? "" : ", ") + format_name(offer.pixelformat);
  }
  if (best == wanted.size())
    refuse(name_, "gives pictures in no format that is read: " + (offers.empty() ? "none at all" : offers));
  return wanted[best];
}

void CaptureCamera::agree_on_format() {
  v4l2_format format{};
  format.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  format.fmt.pix.width = kWidth;
  format.fmt.pix.height = kHeight;
  format.fmt.pix.pixelformat = offered_format();
  format.fmt.pix.field = V4L2_FIELD_ANY;
  call(VIDIOC_S_FMT, &format, "set the format of");
  const v4l2_pix_format& got = format.fmt.pix;
  format_ = {got.pixelformat, got.width, got.height, got.bytesperline};
  const std::span<const FourCc> wanted = readable_formats();
  if (std::find(wanted.begin(), wanted.end(), got.pixelformat) == wanted.end())
    refuse(name_, "gives pictures in the format " + format_name(got.pixelformat) + ", which is not read");
}

void CaptureCamera::take_buffers() {
  v4l2_requestbuffers wanted{};
  wanted.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  wanted.memory = V4L2_MEMORY_MMAP;
  wanted.count = kBuffers;
  call(VIDIOC_REQBUFS, &wanted, "get buffers of");
  if (wanted.count == 0) failed("get buffers of", ENOMEM);
  for (std::uint32_t i = 0; i < wanted.count; ++i) {
    v4l2_buffer buffer = buffer_of_driver(i);
    call(VIDIOC_QUERYBUF, &buffer, "get buffers of");
    buffers_.push_back(device_->map(buffer.length, buffer.m.offset));
    if (buffers_.back().empty()) failed("get buffers of", ENOMEM);
    call(VIDIOC_QBUF, &buffer, "give a buffer to");
  }
}

void CaptureCamera::wait_for_buffer(const std::atomic<bool>& stop) {
  if (stop.load(std::memory_order_relaxed)) throw MediaError(vm::HostStatus::kInterrupted, "");
  const int error = device_->wait(kLookEvery_ms);
  if (error != 0 && error != ETIMEDOUT && error != EINTR) failed("read", error);
}

bool CaptureCamera::take_newest() {
  bool whole = false;
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    v4l2_buffer buffer = buffer_of_driver();
    const int error = device_->control(VIDIOC_DQBUF, &buffer);
    if (error == EAGAIN) break;
    if (error != 0 || buffer.index >= buffers_.size()) failed("read", error != 0 ? error : EIO);
    const std::span<const std::uint8_t> all = buffers_[buffer.index];
    const bool good = (buffer.flags & V4L2_BUF_FLAG_ERROR) == 0 && buffer.bytesused <= all.size() &&
                      make_grey(format_, all.first(buffer.bytesused), spare_);
    if (good) std::swap(frame_, spare_);
    whole = whole || good;
    call(VIDIOC_QBUF, &buffer, "give a buffer to");
  }
  return whole;
}

void CaptureCamera::read(const vm::Plane& to, const std::atomic<bool>& stop) {
  for (int looks = 0; !take_newest(); ++looks) {
    if (looks == kLooks)
      throw MediaError(vm::HostStatus::kFailed, "the camera '" + name_ + "' gives no whole picture");
    wait_for_buffer(stop);
  }
  fit(frame_, to);
}

}  // namespace apron::run
